// What a torque adds to the rows, as columns that are kept: one for each amplitude, for its shape.
#include <algorithm>
#include <array>
#include <cmath>

#include "isac/explain/kinship.hpp"
#include "isac/explain/predict_parts.hpp"

namespace isac::explain {
namespace {

/// The columns that were asked for last, of each run. A search moves amplitudes more often than shapes, and two or three effects at a time; all of
/// these are asked for by each prediction, so the one that was not asked for longest goes first.
template <typename Part>
class LastAsked {
 public:
  template <typename Make>
  std::shared_ptr<const Part> of(std::size_t run, const std::vector<double>& key, Make&& make) {
    if (runs_.size() <= run) runs_.resize(run + 1);
    ++now_;
    One* oldest = &runs_[run][0];
    for (One& one : runs_[run]) {
      if (one.part != nullptr && one.key == key) {
        one.asked = now_;
        return one.part;
      }
      if (one.asked < oldest->asked) oldest = &one;
    }
    *oldest = {.asked = now_, .key = key, .part = make()};
    return oldest->part;
  }

 private:
  struct One {
    std::uint64_t asked = 0;
    std::vector<double> key;
    std::shared_ptr<const Part> part;
  };
  static constexpr std::size_t kKept = 6;
  std::vector<std::array<One, kKept>> runs_;
  std::uint64_t now_ = 0;
};

}  // namespace

bool Predictor::has_columns(const Hypothesis& effect, bool motion) const noexcept {
  return models::is_linear_for_its_shape(effect.info()) && !(motion && has_fitted_states(effect));
}

/// How many samples a torque need not be asked for, between two that the kernel sums. It is a smooth function of signals that passed the
/// kernel, so that the sum over steps of h ≤ 0.7 σ is the integral to exp(−½ (2π σ/h − σ ω)²): 1e-9 at σ ω = 2.5; with what pressures and the
/// encoder's noise have beyond that, to 1e-4 of the torque (explain_columns_test). Rows lie on the grid. Every sample is asked of what jumps,
/// bends in a corner or goes with the acceleration, which is of the encoder's noise at high frequencies.
std::size_t Predictor::thinned(const Hypothesis& effect, double sigma) const noexcept {
  if (effect.dry || effect.info().state_count > 0 ||
      one_of(effect.info().id, {"end_stop", "tension_loss", "inertia", "inertia_error"}))
    return 1;
  constexpr double kLongestStep = 0.7;
  const auto stride = static_cast<std::size_t>(data_->stride);
  std::size_t every = 1;
  for (std::size_t d = 2; d <= stride; ++d)
    if (stride % d == 0 && static_cast<double>(d) <= kLongestStep * sigma) every = d;
  return every;
}

std::shared_ptr<const Predictor::Columns> Predictor::columns_of(const ModelPoint& model, const Active& a,
                                                                std::size_t index, const Inputs& in,
                                                                bool motion) const {
  const Hypothesis& h = *a.hypothesis;
  const auto count = static_cast<std::size_t>(h.info().parameter_count);
  std::vector<double> key = {static_cast<double>(in.identity), static_cast<double>(h.effect),
                             h.clock == Clock::kDay ? 1.0 : 0.0, motion ? 1.0 : 0.0};
  for (std::size_t i = 0; i < count; ++i)
    if (!h.amplitude[i]) key.push_back(a.values[i]);
  thread_local LastAsked<Columns> last;
  return last.of(index, key, [&] {
    auto made = std::make_shared<Columns>();
    for (std::size_t i = 0; i < count; ++i)
      if (h.amplitude[i]) made->amplitudes.push_back(i);
    const PreparedRun& run = data_->runs[index];
    const double sigma = (motion ? left_to_smooth(data_->smoothing) : data_->smoothing.torque) / run.interval;
    const std::size_t every = thinned(h, sigma);
    const std::vector<std::vector<double>> torques = torques_of_amplitudes(model, a, run, in, every);
    const Kernel kernel(sigma / static_cast<double>(every));
    const Chain chain = motion ? Chain::kMotion : Chain::kTorque;
    for (std::size_t i = data_->run_begin[index]; i < data_->run_begin[index + 1]; ++i)
      if (data_->rows[i].chain == chain)
        for (const std::vector<double>& torque : torques)
          made->rows.push_back(kernel(torque, data_->rows[i].sample / every));
    return made;
  });
}

std::vector<Active> Predictor::without_columns(const ModelPoint& model, std::size_t index, const Inputs& in,
                                               bool motion, std::vector<double>& rows) const {
  std::vector<Active> others;
  for (const Active& a : model.effects) {
    if (!enters(*a.hypothesis, motion) || is_null(a)) continue;
    if (!has_columns(*a.hypothesis, motion)) {
      others.push_back(a);
      continue;
    }
    const std::shared_ptr<const Columns> columns = columns_of(model, a, index, in, motion);
    const std::size_t n = columns->amplitudes.size();
    rows.resize(columns->rows.size() / n, 0.0);
    const double* column = columns->rows.data();
    for (double& row : rows)
      for (const std::size_t i : columns->amplitudes) row += a.values[i] * *column++;
  }
  return others;
}

void Predictor::predict_addition(const ModelPoint& model, const Active& effect, Eigen::VectorXd& out) const {
  ModelPoint alone = model;
  alone.effects = {effect};
  for (std::size_t r = 0; r < data_->runs.size(); ++r) {
    const PreparedRun& run = data_->runs[r];
    const std::size_t begin = data_->run_begin[r], end = data_->run_begin[r + 1];
    if (begin == end) continue;
    const std::shared_ptr<const Inputs> in = inputs_of(model, r);
    for (const Chain chain : {Chain::kTorque, Chain::kMotion}) {
      const bool motion = chain == Chain::kMotion;
      if ((effect.hypothesis->chains & bit(chain)) == 0) continue;
      if (motion ? !run.is_free || run.slow_acceleration.empty() : !run.has_torque) continue;
      std::vector<double> rows;
      const std::vector<double> torque =
          torque_of_effects(alone, without_columns(alone, r, *in, motion, rows), run, *in, motion);
      if (torque.empty() && rows.empty()) continue;
      const double sigma =
          (motion ? left_to_smooth(data_->smoothing) : data_->smoothing.torque) / run.interval;
      const double sign = motion ? -1.0 : 1.0;
      const Kernel kernel(sigma);
      const double* row = rows.data();
      for (std::size_t i = begin; i < end; ++i)
        if (data_->rows[i].chain == chain)
          out[static_cast<Eigen::Index>(i)] =
              sign * (rows.empty() ? kernel(torque, data_->rows[i].sample) : *row++);
    }
  }
}

}  // namespace isac::explain
