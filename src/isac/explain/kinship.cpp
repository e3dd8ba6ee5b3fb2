#include "isac/explain/kinship.hpp"

#include <algorithm>
#include <iterator>
#include <string_view>

#include "isac/models/effects.hpp"

namespace isac::explain {
namespace {

using models::EffectInfo;
using std::string_view;

}  // namespace

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
                                              {"thermal_drift", "encoder_offset"},
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

bool is_a_loop_with_an_offset(const std::string& a, const std::string& b) noexcept {
  const auto is_offset = [](const std::string& id) {
    return id == "torque_offset" || id == "encoder_offset" || nests(id, "torque_offset");
  };
  return (a == "hysteresis" && is_offset(b)) || (b == "hysteresis" && is_offset(a));
}

}  // namespace isac::explain
