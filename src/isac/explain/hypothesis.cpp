#include "isac/explain/hypothesis.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string_view>

#include "isac/core/units.hpp"

namespace isac::explain {
namespace {

using models::EffectInfo;
using models::Hook;
using models::Subsystem;
using std::string_view;

/// How far the data reaches: what shapes are worth a start.
struct Reach {
  double angle_low = 0, angle_high = 0, free_low = 0, free_high = 0, speed = 0, pressure_high = 0,
         command_high = 0, rate = 0, force = 0, run_seconds = 0, day_seconds = 0, interval = 0.002;
  std::vector<double> pressure_lows;  ///< of each muscle in each run, lowest first
};

Reach reach_of(const Prepared& data) {
  Reach reach;
  std::vector<double> rates;
  for (const PreparedRun& run : data.runs) {
    if (run.interval > 0) reach.interval = run.interval;
    for (const double v : run.angle) {
      reach.angle_low = std::min(reach.angle_low, v);
      reach.angle_high = std::max(reach.angle_high, v);
      if (!run.is_free) continue;
      reach.free_low = std::min(reach.free_low, v);
      reach.free_high = std::max(reach.free_high, v);
    }
    for (const double w : run.velocity) reach.speed = std::max(reach.speed, std::abs(w));
    for (const auto& p : run.pressure) {
      if (!p.empty()) reach.pressure_lows.push_back(*std::min_element(p.begin(), p.end()));
      for (std::size_t k = 0; k < p.size(); ++k) {
        reach.pressure_high = std::max(reach.pressure_high, p[k]);
        if (k >= 5) reach.rate = std::max(reach.rate, std::abs(p[k] - p[k - 5]) / (5 * run.interval));
      }
    }
    for (const auto& u : run.command)
      for (const double v : u) reach.command_high = std::max(reach.command_high, v);
    for (const auto& f : run.force)
      for (const double v : f) reach.force = std::max(reach.force, v);
    if (!run.time.empty()) {
      reach.run_seconds = std::max(reach.run_seconds, run.time.back());
      reach.day_seconds = std::max(reach.day_seconds, run.day_offset + run.time.back());
    }
  }
  std::sort(reach.pressure_lows.begin(), reach.pressure_lows.end());
  return reach;
}

bool one_of(string_view id, std::initializer_list<string_view> ids) {
  return std::find(ids.begin(), ids.end(), id) != ids.end();
}

/// Grids of the shape parameters; `at` counts the parameter within its effect.
std::vector<double> grid_of(string_view id, int at, const Reach& r) {
  const double bar = kPascalPerKgfCm2;
  if (id == "stribeck_friction" && at == 2) return {0.03, 0.1, 0.3};
  if (id == "pressure_dependent_friction" && at == 1) return {1.0};
  if (one_of(id, {"hysteresis", "maxwell_slip"}) && at == 1) return {0.01, 0.04, 0.15};
  if (id == "pressure_creep" && at == 1) return {2, 10, 50};
  if (id == "valve_stiction" && at == 0) return {0.01 * bar, 0.05 * bar};
  if (id == "asymmetric_hysteresis" && at >= 2) return {0.04};
  if (id == "creep" && at == 1) return {1, 4, 15, 60, 250};
  if (id == "thermal_drift" && at == 3) return {30, 150, 600, 3000};
  if (id == "series_elasticity" && at == 1) return {5, 7, 10, 14, 20, 28, 40};
  // What rings is found within its width only, 2 d f.
  if (id == "series_elasticity_within" && at == 1) return {6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16.5};
  if (one_of(id, {"series_elasticity", "series_elasticity_within"}) && at == 2) return {0.05};
  if (one_of(id, {"backlash", "backlash_of_wheel"}) && at == 0) return {0.003, 0.015};
  if (id == "encoder_play" && at == 0) return {0.001, 0.004};
  if (id == "tension_loss" && at == 1) {
    const double far = std::max(r.angle_high, -r.angle_low);
    return {0.4 * far, 0.65 * far, 0.85 * far};
  }
  if (id == "torque_ripple" && at == 2) {
    std::vector<double> grid;
    const double step = 0.6 * kPi / std::max(0.1, r.angle_high - r.angle_low);
    for (double n = 8.5; n < 70; n += step) grid.push_back(n);
    return grid;
  }
  if (id == "flow_limit" && at == 0) return {0.35 * r.rate, 0.6 * r.rate, 0.85 * r.rate};
  if (id == "force_saturation" && at == 0) return {0.75 * r.force, 0.88 * r.force, 0.97 * r.force};
  if (id == "supply_droop" && at == 0)
    return {0.75 * r.command_high, 0.9 * r.command_high, 1.05 * r.command_high};
  if (id == "supply_droop" && at == 1) return {0.0, 0.3};
  if (id == "supply_droop" && at == 2) return {1.0};
  if (id == "supply_sag" && at == 1) return {0.25, 0.8};
  if (id == "threshold_pressure" && at == 0) {
    // Nothing is seen of it where no pressure falls below: starts just above what the muscles fell to, run by run.
    constexpr std::size_t kStarts = 5;
    std::vector<double> grid;
    for (const double low : r.pressure_lows)
      if (const double start = 1.3 * std::max(0.1 * bar, low);
          grid.empty() || (start > 1.3 * grid.back() && grid.size() < kStarts))
        grid.push_back(start);
    if (grid.empty()) return {};
    grid.push_back(0.4 * grid.front());
    return grid;
  }
  if (id == "dead_time" && at == 0) return {0.006, 0.02};
  if (id == "second_order_lag" && at == 0) return {0.006, 0.03};
  // A response at a long lag holds the curvature of the prediction's noise, which the residual holds too.
  if (id == "sensor_lag" && at == 0) return {0.0005};
  if (id == "valve_deadband" && at == 0) return {0.01 * bar, 0.05 * bar};
  if (id == "valve_hysteresis" && at == 0) return {0.01 * bar, 0.05 * bar};
  if (id == "asymmetric_fill_vent" && at == 0) return {0.9, 1.15};
  return {};
}

std::vector<Values> shapes_of(const EffectInfo& info, const Reach& reach) {
  std::vector<Values> shapes(1);
  for (int i = 0; i < info.parameter_count; ++i) {
    const auto& parameter = info.parameters[i];
    std::vector<double> grid = grid_of(info.id, i, reach);
    if (grid.empty()) grid = {parameter.typical};
    std::vector<Values> more;
    for (const Values& shape : shapes)
      for (const double value : grid) {
        Values next = shape;
        next[static_cast<std::size_t>(i)] = std::clamp(value, parameter.lower, parameter.upper);
        more.push_back(next);
      }
    shapes = std::move(more);
  }
  return shapes;
}

/// Stops on one side or on both, within what the joint reached.
std::vector<Values> stops(const EffectInfo& info, double low, double high) {
  std::vector<Values> shapes;
  const auto add = [&](double upper, double lower) {
    shapes.push_back({info.parameters[0].typical, upper, lower});
  };
  for (const double share : {0.35, 0.55, 0.75, 0.93}) {
    if (high > 0.05) add(share * high, -3.0);
    if (low < -0.05) add(3.0, share * low);
    if (share > 0.5) add(share * high, share * low);
  }
  if (shapes.empty()) add(0.05, -0.05);
  return shapes;
}

/// A wheel slips while hands are on the rig: between two runs. (Within one, `place_slip` finds the moment.)
std::vector<Values> slips_between(const EffectInfo& info, const Prepared& data) {
  std::vector<double> starts;
  for (const PreparedRun& run : data.runs) starts.push_back(run.day_offset);
  std::sort(starts.begin(), starts.end());
  starts.erase(std::unique(starts.begin(), starts.end()), starts.end());
  std::vector<Values> shapes;
  for (std::size_t i = 1; i < starts.size(); ++i)
    shapes.push_back({info.parameters[0].typical, starts[i] - 0.5});
  if (shapes.empty()) shapes.push_back({info.parameters[0].typical, 10.0});
  return shapes;
}

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
  if (string_view(info.id) == "series_elasticity_within") h.upper[1] = 18;
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

const char* family_of(int effect) noexcept {
  const auto catalogue = models::effect_catalogue();
  if (effect < 0 || effect >= static_cast<int>(catalogue.size())) return "";
  const EffectInfo& info = catalogue[static_cast<unsigned>(effect)];
  const string_view id = info.reported_as != nullptr ? info.reported_as : info.id;
  if (one_of(id, {"coulomb_friction", "stribeck_friction", "pressure_dependent_friction", "hysteresis",
                  "asymmetric_hysteresis", "bearing_friction", "backlash", "encoder_play"}))
    return "rate-independent dissipation";
  if (one_of(id, {"viscous_damping", "cubic_damping", "quadratic_damping", "pressure_dependent_damping"}))
    return "viscous damping";
  if (one_of(id,
             {"cubic_stiffness", "pressure_dependent_stiffness", "quadratic_pressure_angle", "tension_loss",
              "end_stop", "lever_arm_variation", "torque_ripple", "nonlinear_pressure_gain"}))
    return "elasticity and geometry";
  if (one_of(id, {"threshold_pressure"})) return "muscle at low pressure";
  if (one_of(id, {"dead_time", "second_order_lag", "sensor_lag", "time_skew", "series_elasticity"}))
    return "delay and lag";
  if (one_of(id,
             {"asymmetric_fill_vent", "flow_limit", "valve_deadband", "valve_hysteresis", "supply_droop"}))
    return "nonlinear valve";
  if (one_of(id, {"creep", "thermal_drift", "force_drift", "encoder_drift"})) return "slow change";
  if (one_of(id,
             {"torque_offset", "muscle_asymmetry", "force_offset", "encoder_offset", "pressure_offset",
              "pressure_gain_error", "pressure_sensor_gain", "force_gain_error", "encoder_gain", "offset"}))
    return "calibration";
  return "something else that moves";
}

bool nests(const std::string& general, const std::string& simple) noexcept {
  static constexpr const char* kPairs[][2] = {{"stribeck_friction", "coulomb_friction"},
                                              {"pressure_dependent_friction", "coulomb_friction"},
                                              {"hysteresis", "coulomb_friction"},
                                              {"asymmetric_hysteresis", "hysteresis"},
                                              {"asymmetric_hysteresis", "coulomb_friction"},
                                              {"asymmetric_hysteresis", "bearing_friction"},
                                              {"asymmetric_hysteresis", "torque_offset"},
                                              {"encoder_slip", "encoder_offset"},
                                              {"encoder_slip", "torque_offset"},
                                              {"encoder_drift", "encoder_offset"},
                                              {"thermal_drift", "torque_offset"},
                                              {"thermal_drift", "encoder_drift"},
                                              {"thermal_drift", "force_drift"},
                                              {"gravity_imbalance", "torque_offset"},
                                              {"force_offset", "torque_offset"},
                                              {"pressure_offset", "torque_offset"},
                                              {"force_gain_error", "force_offset"},
                                              {"force_gain_error", "torque_offset"},
                                              {"lever_arm_variation", "quadratic_pressure_angle"},
                                              {"stribeck_friction", "bearing_friction"},
                                              {"hysteresis", "bearing_friction"},
                                              {"supply_droop", "pressure_gain_error"},
                                              {"pressure_offset", "pressure_gain_error"},
                                              {"series_elasticity", "inertia_error"},
                                              {"end_stop", "tension_loss"}};
  return std::any_of(std::begin(kPairs), std::end(kPairs),
                     [&](const auto& pair) { return general == pair[0] && simple == pair[1]; });
}

}  // namespace isac::explain
