#include "isac/explain/hypothesis.hpp"

#include <algorithm>
#include <cmath>
#include <string_view>

#include "isac/explain/shapes.hpp"

namespace isac::explain {
namespace {

using models::EffectInfo;
using models::Hook;
using models::Subsystem;
using std::string_view;

bool jumps_with_direction(int effect, const EffectInfo& info) {
  if (info.hook != Hook::kTorque) return false;
  if (info.state_count > 0) return info.state_count == 1 && !one_of(info.id, {"creep", "pressure_creep"});
  models::JointPoint<double> x;
  x.angle = 0.3;
  x.mean_pressure = x.reference_pressure = 3e5;
  Values q{};
  for (int i = 0; i < info.parameter_count; ++i) q[static_cast<std::size_t>(i)] = info.parameters[i].typical;
  x.velocity = 1e-9;
  const double up = models::effect_torque(effect, q.data(), x);
  x.velocity = -1e-9;
  return std::abs(up - models::effect_torque(effect, q.data(), x)) > 1e-6;
}

/// Which of angle, forces, pressures a reading effect changes, asked of its equation.
struct Touches {
  bool angle = false, force = false, pressure = false;
  bool shifts_force = false;  ///< by as much, whatever the force
};

Touches touches(int effect, const EffectInfo& info) {
  Touches t;
  if (info.hook == Hook::kDelay) {
    t.angle = info.where == Subsystem::kSensor;
    return t;
  }
  if (info.hook == Hook::kOutlier) {
    t.force = true;
    return t;
  }
  Values q{};
  for (int i = 0; i < info.parameter_count; ++i) q[static_cast<std::size_t>(i)] = info.parameters[i].typical;
  models::Readings<double> y{{200, 300}, {3e5, 4e5}, 0.4};
  const models::Readings<double> before = y;
  const double z[2] = {0.1, 0.2};
  models::effect_reading(effect, q.data(), 20.3, z, y);
  t.angle = y.angle != before.angle;
  t.force = y.force[0] != before.force[0] || y.force[1] != before.force[1];
  t.pressure = y.pressure[0] != before.pressure[0] || y.pressure[1] != before.pressure[1];
  models::Readings<double> other{{70, 640}, {3e5, 4e5}, 0.4};
  const models::Readings<double> other_before = other;
  models::effect_reading(effect, q.data(), 20.3, z, other);
  t.shifts_force = t.force && info.state_count == 0;
  for (int i = 0; i < 2; ++i) {
    constexpr double kRounding = 1e-9;  // N
    const double change = y.force[i] - before.force[i], there = other.force[i] - other_before.force[i];
    t.shifts_force = t.shifts_force && std::abs(change - there) < kRounding;
  }
  return t;
}

unsigned chains_of(const Hypothesis& h) {
  const EffectInfo& info = h.info();
  switch (info.hook) {
    case Hook::kTorque:
      return h.seen_by == SeenBy::kForceSensors ? bit(Chain::kTorque) : bit(Chain::kMotion);
    case Hook::kCommand:
    case Hook::kPressureRate:
    case Hook::kOutletPressure:
      return kPressureChains;
    case Hook::kMusclePressure:
      return bit(Chain::kTorque);
    case Hook::kDelay:
      return info.where == Subsystem::kPcu ? kPressureChains : kForceChains;
    case Hook::kReading:
    case Hook::kOutlier:
      return (h.reads_angle || h.reads_force ? kForceChains : 0U) |
             (h.reads_pressure ? bit(Chain::kTorque) | kPressureChains : 0U);
  }
  return 0;
}

Hypothesis make_hypothesis(int effect, const Reach& reach) {
  Hypothesis h;
  h.effect = effect;
  const EffectInfo& info = h.info();
  const bool moves_freely = reach.free_high > reach.free_low;
  h.shapes = string_view(info.id) != "end_stop" ? shapes_of(info, reach)
             : moves_freely                     ? stops(info, reach.free_low, reach.free_high)
                                                : stops(info, reach.angle_low, reach.angle_high);
  for (int i = 0; i < info.parameter_count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    h.lower[k] = info.parameters[i].lower;
    h.upper[k] = info.parameters[i].upper;
    h.free[k] = true;
    h.amplitude[k] = std::isfinite(info.parameters[i].null_value);
  }
  // A friction that falls over the whole range of speeds is another one.
  if (string_view(info.id) == "stribeck_friction")
    h.upper[2] = std::clamp(0.3 * reach.speed, 2 * h.lower[2], h.upper[2]);
  // Beyond the kernel of the motion's rows s − φ̈ is the fourth derivative of the encoder's noise, whose second is in the residual.
  if (string_view(info.id) == "series_elasticity_within") h.upper[1] = 24;
  // What is damped more has no resonance that would tell it from an inertia, or from a lag.
  if (h.id() == "series_elasticity") h.upper[2] = 0.7;
  h.dry = jumps_with_direction(effect, info);
  if (info.hook == Hook::kReading || info.hook == Hook::kDelay || info.hook == Hook::kOutlier) {
    const Touches t = touches(effect, info);
    h.reads_angle = t.angle;
    h.reads_force = t.force;
    h.shifts_force = t.shifts_force;
    h.reads_pressure = t.pressure;
  }
  h.seen_by = info.where == Subsystem::kMuscle ? SeenBy::kForceSensors : SeenBy::kMotionOnly;
  h.chains = chains_of(h);
  return h;
}

unsigned chains_in(const Prepared& data) {
  unsigned chains = 0;
  for (const Row& row : data.rows) chains |= bit(row.chain);
  return chains;
}

}  // namespace

int Hypothesis::parameters() const noexcept {
  // The moment of a slip is not refined, but it was chosen from the data.
  const int chosen = clock == Clock::kDay && string_view(info().id) == "encoder_slip" ? 1 : 0;
  return chosen + static_cast<int>(std::count(free.begin(), free.end(), true));
}

bool has_fitted_states(const Hypothesis& hypothesis) noexcept {
  return hypothesis.info().hook == models::Hook::kTorque && hypothesis.info().state_count == 2 &&
         (hypothesis.chains & bit(Chain::kMotion)) != 0;
}

Values null_values(const Hypothesis& hypothesis, const Values& shape) {
  Values values = shape;
  const EffectInfo& info = hypothesis.info();
  for (int i = 0; i < info.parameter_count; ++i)
    if (!std::isnan(info.parameters[i].null_value))
      values[static_cast<std::size_t>(i)] = info.parameters[i].null_value;
  return values;
}

Library make_library(const Prepared& data, const std::vector<std::string>& excluded) {
  Library library;
  const Reach reach = reach_of(data);
  const unsigned there = chains_in(data);
  const bool seed = data.baseline.terms.empty();
  const auto catalogue = models::effect_catalogue();
  const auto is_excluded = [&](const char* id) {
    return std::find(excluded.begin(), excluded.end(), id) != excluded.end();
  };
  const auto in_baseline = [&](const char* id) {
    if (seed)
      return one_of(id, {"stiffness", "pressure", "cubic_damping", "viscous_damping", "inertia", "offset"});
    return std::any_of(data.baseline.terms.begin(), data.baseline.terms.end(), [&](const std::string& term) {
      return models::find_effect(term) == models::find_effect(id);
    });
  };
  for (int e = 0; e < static_cast<int>(catalogue.size()); ++e) {
    const EffectInfo& info = catalogue[static_cast<unsigned>(e)];
    const string_view id = info.id;
    if (in_baseline(info.id) || is_excluded(info.id) ||
        (info.reported_as != nullptr && is_excluded(info.reported_as)) || info.hook == Hook::kOutlier)
      continue;
    if (one_of(id, {"mains_hum", "periodic_disturbance"}))
      continue;  // found by their spectrum (spectrum.hpp)
    if (!seed) {
      // A sum of terms has no forces, pressures or motion of its own: torques on the output, and the angle's sensor.
      if (info.hook != Hook::kTorque && !touches(e, info).angle) continue;
      if (one_of(id,
                 {"pressure_creep", "offset", "inertia_error", "bearing_friction", "stiffness", "pressure",
                  "backlash", "backlash_of_wheel", "lever_arm_variation", "lever_arm_in_law",
                  "muscle_asymmetry", "pressure_dependent_stiffness", "quadratic_pressure_angle",
                  "nonlinear_pressure_gain", "pressure_dependent_damping", "pressure_dependent_friction"}))
        continue;
      if (id == "torque_offset" && in_baseline("offset")) continue;
      if (id == "encoder_offset" || id == "encoder_gain") continue;  // nothing says where the zero is
    }
    Hypothesis h = make_hypothesis(e, reach);
    if (seed && id == "pressure_gain_error") {  // its gain is the baseline's K_C
      h.free[0] = h.amplitude[0] = false;
      for (Values& shape : h.shapes) shape[0] = 0;
    }
    if (seed && id == "encoder_slip") {
      h.clock = Clock::kDay;
      h.shapes = slips_between(info, data);
      h.free[1] = false;
    }
    // Slower than this it is a drift in proportion to time, and others say that with fewer parameters.
    constexpr double kSlowest = 2;  // of what was recorded
    const auto no_slower = [&](Hypothesis& o, double recorded) {
      if (id == "thermal_drift") o.upper[3] = std::clamp(kSlowest * recorded, 2 * o.lower[3], o.upper[3]);
    };
    no_slower(h, reach.run_seconds);
    if (!seed) {
      h.seen_by = SeenBy::kForceSensors;
      h.chains = bit(Chain::kTorque);
      if (id == "thermal_drift") h.free[1] = false;
    }
    if ((h.chains & there) == 0) {
      library.not_testable.push_back(info.id);
      continue;
    }
    library.hypotheses.push_back(h);
    const auto also = [&](auto change) {
      Hypothesis other = h;
      change(other);
      if ((other.chains & there) != 0) library.hypotheses.push_back(other);
    };
    if (!seed) continue;
    if (one_of(id, {"backlash", "backlash_of_wheel", "end_stop"}))
      also([&](Hypothesis& o) {
        o.seen_by = SeenBy::kForceSensors, o.chains = bit(Chain::kTorque);
        if (id == "end_stop") o.shapes = stops(info, reach.angle_low, reach.angle_high);
      });
    if (one_of(id, {"stribeck_friction", "hysteresis"}))
      also([](Hypothesis& o) { o.seen_by = SeenBy::kMotionOnly, o.chains = bit(Chain::kMotion); });
    if (one_of(id, {"thermal_drift", "force_drift", "encoder_drift"}) &&
        reach.day_seconds > 1.5 * reach.run_seconds)
      also([&](Hypothesis& o) {
        o.clock = Clock::kDay;
        if (id == "thermal_drift") o.upper[3] = info.parameters[3].upper;
        no_slower(o, reach.day_seconds);
      });
  }

  library.tolerances.reserve(8);  // models point at them, and a search may add some
  if (seed) {
    tolerate(library, data, "time_skew", -0.5 * reach.interval, 0.5 * reach.interval);
    tolerate(library, data, "dead_time", -reach.interval, 0);
  }
  return library;
}

void tolerate(Library& library, const Prepared& data, const std::string& id, double low, double high) {
  Hypothesis h = make_hypothesis(models::find_effect(id), reach_of(data));
  h.lower[0] = low;
  h.upper[0] = high;
  h.shapes.resize(1);
  h.shapes[0][0] = 0.5 * (low + high);
  if ((h.chains & chains_in(data)) == 0) return;
  for (Hypothesis& known : library.tolerances)
    if (known.effect == h.effect) {
      known = std::move(h);
      return;
    }
  library.tolerances.push_back(std::move(h));
}

}  // namespace isac::explain
