#include "isac/explain/predict.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <string_view>

#include "isac/explain/filters.hpp"
#include "isac/explain/predict_parts.hpp"
#include "isac/explain/workers.hpp"

namespace isac::explain {

using models::Hook;

Predictor::Predictor(const Prepared& data, int threads) : data_(&data), threads_(threads) {
  static std::atomic<std::uint64_t> made{0};
  identity_ = ++made;
  const bool seed = data.baseline.terms.empty();
  const std::vector<std::string> names =
      seed ? std::vector<std::string>{"A", "B", "C", "D"} : data.baseline.terms;
  for (const std::string& name : names) {
    const int e = models::find_effect(name);
    const models::EffectInfo& info = models::effect_catalogue()[static_cast<unsigned>(e)];
    const auto& p = info.parameters[0];
    terms_.push_back(e);
    term_sign_.push_back(data.baseline.driven && !info.added_to_output ? -1.0 : 1.0);
    if (std::string_view(info.id) == "stiffness") stiffness_ = static_cast<int>(base_.size());
    if (std::string_view(info.id) == "cubic_damping") cubic_damping_ = static_cast<int>(base_.size());
    if (std::string_view(info.id) == "viscous_damping") damping_ = static_cast<int>(base_.size());
    if (std::string_view(info.id) == "pressure") pressure_gain_ = static_cast<int>(base_.size());
    base_.push_back({.name = seed ? name : p.name,
                     .unit = p.unit,
                     .si_per_unit = p.si_per_unit,
                     .start = p.typical,
                     .lower = seed ? -1e9 : p.lower,
                     .upper = seed ? 1e9 : p.upper,
                     .chains = bit(Chain::kTorque)});
    if (!seed) base_.back().lower = std::min(base_.back().lower, -1e9);
  }
  if (data.has(Chain::kPressure1) || data.has(Chain::kPressure2)) {
    const auto valve = [&](const char* name, const char* unit, double start, double lower) {
      base_.push_back({.name = name,
                       .unit = unit,
                       .si_per_unit = 1,
                       .start = start,
                       .lower = lower,
                       .upper = 3,
                       .chains = kPressureChains});
      return static_cast<int>(base_.size()) - 1;
    };
    gain_ = valve("K_C", "-", 1, 0.3);
    lag_ = valve("T_C", "s", 0.17, 0.005);
  }
  for (std::size_t r = 0; r < data.runs.size(); ++r) {
    const auto& angle = data.runs[r].raw_angle;
    if (angle.empty() || !data.runs[r].has_torque || stiffness_ < 0 || !std::isfinite(data.rig.angle_step))
      continue;
    const auto [low, high] = std::minmax_element(angle.begin(), angle.end());
    if (*high - *low <= 2.01 * data.rig.angle_step) resting_.push_back(r);
  }
  measured_.resize(static_cast<Eigen::Index>(rows()));
  for (std::size_t i = 0; i < rows(); ++i) {
    const Row& row = data.rows[i];
    const PreparedRun& run = data.runs[row.run];
    const std::size_t k = row.sample;
    measured_[static_cast<Eigen::Index>(i)] =
        row.chain == Chain::kTorque   ? run.smooth_torque[k]
        : row.chain == Chain::kMotion ? run.slow_torque[k]
                                      : run.smooth_pressure[row.chain == Chain::kPressure1 ? 0 : 1][k];
  }
}

namespace {

/// Changes by pressure sensors on a predicted pressure.
void read_pressures(const ModelPoint& model, std::vector<double> (&p)[2]) {
  for (const Active& a : model.effects) {
    if (!a.hypothesis->reads_pressure || is_null(a)) continue;
    const PressureReading made(a);
    for (int i = 0; i < 2; ++i)
      for (double& pressure : p[i]) pressure = made.constant[i] + made.slope[i] * pressure;
  }
}

bool reads_force(const ModelPoint& model) {
  return std::any_of(model.effects.begin(), model.effects.end(),
                     [](const Active& a) { return a.hypothesis->reads_force && !is_null(a); });
}

/// Are all such readings a function of the force at that sample, which passes no kernel?
bool reads_force_by_sample(const ModelPoint& model) {
  return std::all_of(model.effects.begin(), model.effects.end(), [](const Active& a) {
    const Hypothesis& h = *a.hypothesis;
    return !h.reads_force || is_null(a) || (h.info().state_count == 0 && h.amplitude[0]);
  });
}

}  // namespace

bool clips_force(const ModelPoint& model) noexcept {
  return std::any_of(model.effects.begin(), model.effects.end(), [](const Active& a) {
    return a.hypothesis->reads_force && !a.hypothesis->amplitude[0] && !is_null(a);
  });
}

void Predictor::predict_run(const ModelPoint& model, std::size_t index, unsigned chains,
                            Eigen::VectorXd& out) const {
  const PreparedRun& run = data_->runs[index];
  const std::size_t begin = data_->run_begin[index], end = data_->run_begin[index + 1];
  if (begin == end) return;
  const std::shared_ptr<const Inputs> kept = inputs_of(model, index);
  const Inputs& in = *kept;
  const auto for_rows = [&](Chain chain, auto&& value) {
    for (std::size_t i = begin; i < end; ++i)
      if (data_->rows[i].chain == chain) out[static_cast<Eigen::Index>(i)] = value(data_->rows[i].sample);
  };
  if ((chains & bit(Chain::kTorque)) != 0 && run.has_torque) {
    const bool row_by_row = reads_force(model) && reads_force_by_sample(model);
    const bool by_sample = reads_force(model) && !row_by_row;
    std::vector<double> rows, smooth;
    std::vector<double> extra = torque_of_effects(
        model, by_sample ? model.effects : without_columns(model, index, in, false, rows), run, in, false);
    if (by_sample) {
      // A torque of low-passed signals is low-passed already: a gain or a lag must not smooth its noise once more, or it would gain by that. (An
      // inertia of 6 % too much was called a force sensor's gain.) Effects' torques and clipped readings jump, and pass the kernel after that.
      if (!extra.empty()) extra = low_pass(extra, data_->smoothing.torque / run.interval);
      smooth = std::move(extra);
      smooth.resize(run.time.size());
      std::vector<double> torque = smooth, change(smooth.size(), 0.0);
      add_base_torque(model, in, torque);
      read_forces(model, run, Reading::kSmooth, torque, change);
      for (std::size_t k = 0; k < change.size(); ++k) {
        smooth[k] += change[k];
        torque[k] += change[k];
      }
      extra.clear();
      if (clips_force(model)) {
        extra.assign(torque.size(), 0.0);
        read_forces(model, run, Reading::kClipped, torque, extra);
      }
    }
    const double* column = in.columns.data();
    const double resting = model.rest.empty() ? 0.0 : model.rest[index] * stiffness(model);
    const auto base = [&] {
      double sum = resting;
      for (std::size_t j = 0; j < terms_.size(); ++j) sum += model.base[j] * *column++;
      return sum;
    };
    const Kernel kernel(data_->smoothing.torque / run.interval);
    const double* row = rows.data();
    for_rows(Chain::kTorque, [&](std::size_t k) {
      const double torque = base() + (rows.empty() ? 0.0 : *row++) + (smooth.empty() ? 0.0 : smooth[k]) +
                            (extra.empty() ? 0.0 : kernel(extra, k));
      return row_by_row ? torque + change_at(model, run, k, torque) : torque;
    });
  }
  if ((chains & bit(Chain::kMotion)) != 0 && run.is_free && !run.slow_acceleration.empty()) {
    std::vector<double> rows;
    std::vector<double> extra = torque_of_effects(
        model, reads_force(model) ? model.effects : without_columns(model, index, in, true, rows), run, in,
        true);
    for (double& v : extra) v = -v;
    const double inertia = data_->rig.inertia;
    if (reads_force(model)) {
      std::vector<double> torque(run.time.size());
      for (std::size_t k = 0; k < torque.size(); ++k)
        torque[k] = inertia * (*in.acceleration)[k] + (extra.empty() ? 0.0 : extra[k]);
      std::vector<double> change(torque.size(), 0.0);
      read_forces(model, run, Reading::kSmooth, torque, change);
      read_forces(model, run, Reading::kClipped, torque, change);
      if (extra.empty()) {
        extra = std::move(change);
      } else {
        for (std::size_t k = 0; k < change.size(); ++k) extra[k] += change[k];
      }
    }
    const Kernel kernel(left_to_smooth(data_->smoothing) / run.interval);
    const double* row = rows.data();
    for_rows(Chain::kMotion, [&](std::size_t k) {
      return inertia * (*in.slow_acceleration)[k] - (rows.empty() ? 0.0 : *row++) +
             (extra.empty() ? 0.0 : kernel(extra, k));
    });
  }
  if ((chains & kPressureChains) != 0 && run.has_command && gain_ >= 0) {
    std::vector<double> p[2];
    pressures_of(model, run, in, p);
    read_pressures(model, p);
    const Kernel kernel(data_->smoothing.torque / run.interval);
    for_rows(Chain::kPressure1, [&](std::size_t k) { return kernel(p[0], k); });
    for_rows(Chain::kPressure2, [&](std::size_t k) { return kernel(p[1], k); });
  }
}

bool Predictor::adds_up(const ModelPoint& model, const Hypothesis& effect) const noexcept {
  return effect.info().hook == Hook::kTorque &&
         std::none_of(model.effects.begin(), model.effects.end(), [](const Active& a) {
           return a.hypothesis->reads_force && !a.hypothesis->shifts_force && !is_null(a);
         });
}

double Predictor::stiffness(const ModelPoint& model) const noexcept {
  if (stiffness_ < 0) return 0;
  const double r = data_->rig.wheel_radius;
  return model.base[static_cast<std::size_t>(stiffness_)] * r * r;
}

double Predictor::pressure_gain(const ModelPoint& model) const noexcept {
  return pressure_gain_ < 0 ? 0.0
                            : model.base[static_cast<std::size_t>(pressure_gain_)] * data_->rig.wheel_radius;
}

double Predictor::valve_gain(const ModelPoint& model) const noexcept {
  return gain_ < 0 ? 0.0 : model.base[static_cast<std::size_t>(gain_)];
}

double Predictor::valve_lag(const ModelPoint& model) const noexcept {
  return lag_ < 0 ? 0.0 : model.base[static_cast<std::size_t>(lag_)];
}

void Predictor::predict(const ModelPoint& model, unsigned chains, Eigen::VectorXd& out) const {
  share_work(threads_, data_->runs.size(), [&](std::size_t r) { predict_run(model, r, chains, out); });
}

Predictor::FullRate Predictor::full_rate(const ModelPoint& model, std::size_t index) const {
  const PreparedRun& run = data_->runs[index];
  FullRate rate;
  const std::shared_ptr<const Inputs> kept = inputs_of(model, index);
  const Inputs& in = *kept;
  const bool reads = reads_force(model);
  if (run.has_torque && (run.has_pressure || !data_->baseline.terms.empty())) {
    const std::vector<double> extra = torque_of_effects(model, model.effects, run, in, false);
    rate.torque.assign(run.time.size(),
                       index < model.rest.size() ? model.rest[index] * stiffness(model) : 0.0);
    add_base_torque(model, in, rate.torque);
    for (std::size_t k = 0; k < extra.size(); ++k) rate.torque[k] += extra[k];
    if (reads) {
      std::vector<double> change(rate.torque.size(), 0.0);
      read_forces(model, run, Reading::kSmooth, rate.torque, change);
      read_forces(model, run, Reading::kClipped, rate.torque, change);
      for (std::size_t k = 0; k < change.size(); ++k) rate.torque[k] += change[k];
    }
  }
  if (run.is_free && !run.slow_acceleration.empty() && std::isfinite(data_->rig.inertia)) {
    std::vector<double> extra = torque_of_effects(model, model.effects, run, in, true);
    if (!extra.empty())  // as φ̈ is, and what both are held against
      extra = low_pass(extra, left_to_smooth(data_->smoothing) / run.interval);
    rate.motion.resize(run.time.size());
    for (std::size_t k = 0; k < rate.motion.size(); ++k)
      rate.motion[k] = data_->rig.inertia * (*in.slow_acceleration)[k] - (extra.empty() ? 0.0 : extra[k]);
    if (reads) {
      std::vector<double> change(rate.motion.size(), 0.0);
      read_forces(model, run, Reading::kSmooth, rate.motion, change);
      read_forces(model, run, Reading::kClipped, rate.motion, change);
      for (std::size_t k = 0; k < change.size(); ++k) rate.motion[k] += change[k];
    }
  }
  if (run.has_command && gain_ >= 0) {
    pressures_of(model, run, in, rate.pressure);
    read_pressures(model, rate.pressure);
  }
  return rate;
}

}  // namespace isac::explain
