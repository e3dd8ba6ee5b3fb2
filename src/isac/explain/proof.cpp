#include "isac/explain/proof.hpp"

#include <algorithm>
#include <cmath>

#include "isac/core/error.hpp"
#include "isac/core/units.hpp"
#include "isac/explain/labels.hpp"
#include "isac/explain/unknown.hpp"

namespace isac::explain {
namespace {

constexpr double kSkipStart = 0.4;  // s in which a simulated pressure still feels its start

const std::vector<double>& predicted(const Predictor::FullRate& rate, Chain chain) {
  switch (chain) {
    case Chain::kTorque:
      return rate.torque;
    case Chain::kMotion:
      return rate.motion;
    case Chain::kPressure1:
      return rate.pressure[0];
    case Chain::kPressure2:
      return rate.pressure[1];
  }
  return rate.torque;
}

/// What the prediction of a chain is to be held against, at the recording's rate.
const std::vector<double>& read_signal(const PreparedRun& run, Chain chain) {
  switch (chain) {
    case Chain::kTorque:
      return run.torque;
    case Chain::kMotion:  // φ̈ is low-passed; so must be what it is held against
      return run.slow_torque;
    case Chain::kPressure1:
      return run.raw_pressure[0];
    case Chain::kPressure2:
      return run.raw_pressure[1];
  }
  return run.torque;
}

}  // namespace

namespace {

bool has_rows(const Prepared& data, std::size_t run, Chain chain) {
  for (std::size_t i = data.run_begin[run]; i < data.run_begin[run + 1]; ++i)
    if (data.rows[i].chain == chain) return true;
  return false;
}

}  // namespace

double Sums::rms() const {
  return samples > 0 ? std::sqrt(squares / static_cast<double>(samples)) : kNotKnown;
}
double Sums::signal_rms() const {
  return samples > 0 ? std::sqrt(signal_squares / static_cast<double>(samples)) : kNotKnown;
}

double weighted_rms(const Prepared& data, const Weights& weights, const Eigen::VectorXd& rows, Chain chain) {
  double squares = 0, count = 0;
  for (std::size_t i = 0; i < data.rows.size(); ++i) {
    if (data.rows[i].chain != chain) continue;
    squares += rows[static_cast<Eigen::Index>(i)] * rows[static_cast<Eigen::Index>(i)];
    ++count;
  }
  return count > 0 ? weights.sigma[static_cast<int>(chain)] * std::sqrt(squares / count) : kNotKnown;
}

Sums raw_residual(const Predictor& predictor, const ModelPoint& model, Chain chain) {
  Sums sums;
  for (std::size_t r = 0; r < predictor.data().runs.size(); ++r) {
    const PreparedRun& run = predictor.data().runs[r];
    if (!has_rows(predictor.data(), r, chain)) continue;
    const Predictor::FullRate rate = predictor.full_rate(model, r);
    const std::vector<double>& y = predicted(rate, chain);
    const std::vector<double>& measured = read_signal(run, chain);
    if (y.empty()) continue;
    for (std::size_t k = 0; k < y.size(); ++k) {
      if ((chain == Chain::kTorque || chain == Chain::kMotion ? run.loaded : run.usable)[k] == 0 ||
          run.time[k] < kSkipStart || !std::isfinite(y[k]) ||
          (chain == Chain::kMotion && run.dry_velocity[k] == 0))  // at rest any friction balances it
        continue;
      sums.squares += (measured[k] - y[k]) * (measured[k] - y[k]);
      sums.signal_squares += measured[k] * measured[k];
      ++sums.samples;
    }
  }
  return sums;
}

std::vector<RunTrace> traces_of(const Predictor& predictor, const ModelPoint& before, const ModelPoint& after,
                                Chain chain, bool heldout, std::size_t most_points) {
  std::vector<RunTrace> traces;
  const Label label = label_of(predictor.data(), chain);
  for (std::size_t r = 0; r < predictor.data().runs.size(); ++r) {
    const PreparedRun& run = predictor.data().runs[r];
    if (!has_rows(predictor.data(), r, chain)) continue;
    const Predictor::FullRate old_rate = predictor.full_rate(before, r),
                              new_rate = predictor.full_rate(after, r);
    const std::vector<double>&y0 = predicted(old_rate, chain), &y1 = predicted(new_rate, chain);
    if (y0.empty()) continue;
    RunTrace t;
    t.run = run.name;
    t.signal = label.signal;
    t.unit = label.unit;
    t.heldout = heldout;
    const std::vector<double>& measured = chain == Chain::kTorque      ? run.smooth_torque
                                          : chain == Chain::kMotion    ? run.slow_torque
                                          : chain == Chain::kPressure1 ? run.smooth_pressure[0]
                                                                       : run.smooth_pressure[1];
    const std::size_t step = std::max<std::size_t>(1, (y0.size() + most_points - 1) / most_points);
    for (std::size_t k = 0; k < y0.size(); k += step) {
      if (run.usable[k] == 0) continue;
      t.time.push_back(run.time[k]);
      t.measured.push_back(measured[k] * label.scale);
      t.before.push_back(y0[k] * label.scale);
      t.after.push_back(y1[k] * label.scale);
      if (!run.angle.empty()) {
        t.angle.push_back(run.angle[k]);
        t.velocity.push_back(run.velocity[k]);
      }
      if (run.has_pressure) {
        t.delta_pressure.push_back(0.5 * (run.pressure[1][k] - run.pressure[0][k]) / kPascalPerKgfCm2);
        t.mean_pressure.push_back(0.5 * (run.pressure[1][k] + run.pressure[0][k]) / kPascalPerKgfCm2);
      }
    }
    traces.push_back(std::move(t));
  }
  return traces;
}

Proof::Proof(const HeldOut& heldout, const Prepared& fitted, const QuietPressure& quiet) {
  if (heldout.size() == 0) return;
  try {
    data_.emplace(prepare(heldout.runs_, fitted.rig, fitted.baseline, std::max(1.0, fitted.block_seconds),
                          fitted.first_start));
  } catch (const Error&) {
    return;  // nothing in them can be compared
  }
  if (fitted.with_free_torque && can_add_torque_of_free_runs(*data_)) add_torque_of_free_runs(*data_);
  quiet.apply(*data_);
  predictor_.emplace(*data_);
  for (std::size_t r = 0; r + 1 < data_->run_begin.size(); ++r)
    count_ += data_->run_begin[r] < data_->run_begin[r + 1] ? 1U : 0U;
}

ModelPoint Proof::moved_here(const ModelPoint& model) const {
  ModelPoint here = model;
  here.base.resize(predictor_->base().size());
  here.rest
      .clear();  // where within a step of the encoder other runs stood; here the middle of the step is all one knows
  return here;
}

std::vector<Proof::Span> Proof::spans() const {
  std::vector<Span> spans;
  if (!data_) return spans;
  for (std::size_t r = 0; r + 1 < data_->run_begin.size(); ++r) {
    const PreparedRun& run = data_->runs[r];
    if (data_->run_begin[r] < data_->run_begin[r + 1])
      spans.push_back({run.day_offset, run.day_offset + run.time.back()});
  }
  return spans;
}

Sums Proof::residual(const ModelPoint& model, Chain chain) const {
  return predictor_ ? raw_residual(*predictor_, moved_here(model), chain) : Sums{};
}

Eigen::VectorXd Proof::weighted_residual(const ModelPoint& model, const Weights& weights) const {
  Eigen::VectorXd rows = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(predictor_->rows()));
  predictor_->predict(moved_here(model), kAllChains, rows);
  rows -= predictor_->measured();
  weigh(*data_, weights, rows);
  for (double& r : rows)
    if (!std::isfinite(r)) r = 0;
  return rows;
}

Proof::Freed Proof::freed(const ModelPoint& first, const ModelPoint& second, const Weights& weights,
                          Chain chain) const {
  if (!predictor_) return {};
  const Eigen::VectorXd a = weighted_residual(first, weights), b = weighted_residual(second, weights);
  return {compare(*data_, a, b, 0, noise_density(*data_, a)), weighted_rms(*data_, weights, a, chain),
          weighted_rms(*data_, weights, b, chain)};
}

std::string Proof::signal_that_tells(const ModelPoint& model, const Weights& weights, Chain chain) const {
  if (!predictor_) return "";
  Around place;  // nothing is refitted here
  place.predictor = &*predictor_;
  place.weights = &weights;
  place.residual = weighted_residual(model, weights);
  place.basis.resize(place.residual.size(), 0);
  return explain::signal_that_tells(place, chain);
}

Proof::Screened Proof::screened(const Fit& fit, const Weights& weights, const Library& library,
                                const ScreenOptions& options) const {
  if (!predictor_) return {};
  const Fit here =
      beside_other_runs(*predictor_, fit, moved_here(fit.model), weighted_residual(fit.model, weights));
  return {&*data_, screen(around(*predictor_, here, weights), library, options)};
}

std::vector<Series> Proof::series(const ModelPoint& model, Chain chain) const {
  if (!predictor_) return {};
  return residual_series(*predictor_, moved_here(model), chain);
}

std::vector<RunTrace> Proof::traces(const ModelPoint& before, const ModelPoint& after, Chain chain,
                                    std::size_t most_points) const {
  if (!predictor_) return {};
  return traces_of(*predictor_, moved_here(before), moved_here(after), chain, true, most_points);
}

}  // namespace isac::explain
