#include "isac/simulate/sensor_effects.hpp"

#include <algorithm>
#include <cmath>
#include <string_view>

#include "isac/core/error.hpp"
#include "isac/models/effect_hooks.hpp"

namespace isac::simulate {

namespace {

constexpr double kStep = 1e-4;         // s
constexpr double kShortestLag = 1e-4;  // s: the Runge-Kutta method is stable down to step/2.78
constexpr double kLongestSkew = 0.5;   // s, of history

Readings between(const Readings& a, const Readings& b, double share) noexcept {
  Readings y;
  for (std::size_t i = 0; i < 2; ++i) {
    y.force[i] = a.force[i] + share * (b.force[i] - a.force[i]);
    y.pressure[i] = a.pressure[i] + share * (b.pressure[i] - a.pressure[i]);
  }
  y.angle = a.angle + share * (b.angle - a.angle);
  return y;
}

}  // namespace

SensorEffects::SensorEffects(const RigConfig& config) : random_(config.seed, Random::kSpikes) {
  for (const CompiledEffect& effect : compile_effects(config.effects)) {
    if (effect.info->where != models::Subsystem::kSensor) continue;
    switch (effect.info->hook) {
      case models::Hook::kDelay:
        skew_ += models::effect_delay(effect.index, effect.parameters.data());
        break;
      case models::Hook::kOutlier:
        spike_share_ = effect.parameters[0];
        spike_height_ = effect.parameters[1];
        break;
      case models::Hook::kTorque:
        added_force_ +=
            models::effect_torque(effect.index, effect.parameters.data(), models::JointPoint<double>{}) /
            (2 * config.joint.wheel_radius);
        break;
      default:
        effects_.push_back({.effect = effect});
        break;
    }
    if (std::string_view(effect.info->id) == "sensor_lag" && effect.parameters[0] > 0 &&
        effect.parameters[0] < kShortestLag) {
      throw Error(ErrorKind::kUsage, "effect_parameters", "effect 'sensor_lag' needs 0 or at least 1e-4 s.");
    }
  }
  if (std::abs(skew_) > kLongestSkew) {
    throw Error(ErrorKind::kUsage, "effect_parameters", "effect 'time_skew' reaches 0.5 s at most.");
  }
  if (skew_ != 0) past_.resize(kPasts);
}

void SensorEffects::integrate(Stateful& e, const Readings& from, const Readings& to,
                              double duration) noexcept {
  const int steps = std::max(1, static_cast<int>(std::ceil(duration / kStep)));
  const double h = duration / steps;
  const auto n = static_cast<std::size_t>(e.effect.info->state_count);
  using States = std::array<double, models::kMaxEffectStates>;
  const auto rate = [&](double share, const States& z) {
    States dz{};
    models::effect_reading_derivative(e.effect.index, e.effect.parameters.data(), between(from, to, share),
                                      z.data(), dz.data());
    return dz;
  };
  const auto moved = [n](States z, const States& dz, double by) {
    for (std::size_t i = 0; i < n; ++i) z[i] += by * dz[i];
    return z;
  };
  for (int k = 0; k < steps; ++k) {
    const double a = static_cast<double>(k) / steps, b = (k + 0.5) / steps, c = (k + 1.0) / steps;
    const States k1 = rate(a, e.state);
    const States k2 = rate(b, moved(e.state, k1, 0.5 * h));
    const States k3 = rate(b, moved(e.state, k2, 0.5 * h));
    const States k4 = rate(c, moved(e.state, k3, h));
    for (std::size_t i = 0; i < n; ++i) e.state[i] += h / 6 * (k1[i] + 2 * k2[i] + 2 * k3[i] + k4[i]);
  }
}

void SensorEffects::track(double time, const Readings& readings, double velocity) noexcept {
  if (!started_) {
    for (Stateful& e : effects_) {
      models::effect_reading_rest(e.effect.index, e.effect.parameters.data(), readings, e.state.data());
    }
  } else if (time > last_time_) {
    for (Stateful& e : effects_) {
      if (e.effect.info->state_count > 0) integrate(e, last_, readings, time - last_time_);
    }
  }
  if (!past_.empty() && (!started_ || time > last_time_)) {
    newest_ = (newest_ + 1) % kPasts;
    past_[newest_] = {.time = time, .readings = readings, .velocity = velocity};
    pasts_ = std::min(pasts_ + 1, kPasts);
  }
  started_ = true;
  last_ = readings;
  last_time_ = time;
}

Readings SensorEffects::at(double time) const noexcept {
  std::size_t k = newest_, left = pasts_;
  while (left > 1 && past_[k].time > time) {
    k = (k + kPasts - 1) % kPasts;
    --left;
  }
  const Past& a = past_[k];
  if (k == newest_ || time <= a.time) return a.readings;  // before the history began: as it was then
  const Past& b = past_[(k + 1) % kPasts];
  const double h = b.time - a.time, s = (time - a.time) / h;
  Readings y = between(a.readings, b.readings, s);
  // Cubic Hermite: the velocities at both ends are known.
  const double slope = b.readings.angle - a.readings.angle;
  y.angle += s * (1 - s) * ((1 - s) * (h * a.velocity - slope) - s * (h * b.velocity - slope));
  return y;
}

Readings SensorEffects::apply(double time, Readings readings) noexcept {
  if (skew_ > 0) readings.angle = at(time - skew_).angle;
  if (skew_ < 0) {
    const double angle = readings.angle;
    readings = at(time + skew_);
    readings.angle = angle;
  }
  readings.force[0] -= added_force_;
  readings.force[1] += added_force_;
  for (Stateful& e : effects_) {
    const double* q = e.effect.parameters.data();
    models::effect_reading_step(e.effect.index, q, readings, e.state.data());
    models::effect_reading(e.effect.index, q, time, e.state.data(), readings);
  }
  if (spike_share_ > 0 && random_.uniform() < spike_share_) {
    const double sign = random_.uniform() < 0.5 ? -1 : 1;
    readings.force[random_.uniform() < 0.5 ? 0 : 1] += sign * spike_height_;
  }
  return readings;
}

}  // namespace isac::simulate
