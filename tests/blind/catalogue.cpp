#include "catalogue.hpp"

#include <stdexcept>

namespace blind {
namespace {

constexpr double kTurn = 6.283185307179586;
constexpr double kDay = 1200.0;  // s, about the length of the day

Shape no_shape(Random&) {
  return {};
}
Shape one_side(Random& random) {
  return {{"sign", random.sign()}, {"sensor", 1.0 + random.index(2)}};
}
Shape only_sign(Random& random) {
  return {{"sign", random.sign()}};
}
bool first(const Shape& shape) {
  return shape.at("sensor") < 1.5;
}

#define BLIND_APPLY [](Hidden & h, double a, const Shape& s)
#define BLIND_SIMPLE(field) [](Hidden& h, double a, const Shape&) { h.field = a; }
#define BLIND_SIGNED(field) [](Hidden& h, double a, const Shape& s) { h.field = a * s.at("sign"); }
#define BLIND_SENSOR(field) \
  [](Hidden& h, double a, const Shape& s) { (first(s) ? h.field##_1 : h.field##_2) = a * s.at("sign"); }

std::vector<Effect> muscle_effects() {
  return {
      {"viscous_damping",
       "muscle",
       true,
       {},
       "D",
       "N m s",
       0.05,
       0.15,
       no_shape,
       BLIND_SIMPLE(linear_damping)},
      {"cubic_damping",
       "muscle",
       true,
       {},
       "C",
       "N m s3",
       0.002,
       0.005,
       no_shape,
       BLIND_SIMPLE(cubic_damping)},
      {"torque_offset", "muscle", true, {}, "T0", "N m", 0.02, 1.0, only_sign, BLIND_SIGNED(torque_offset)},
      {"muscle_asymmetry",
       "muscle",
       true,
       {},
       "b",
       "N cm2/kg",
       0.3,
       20.0,
       only_sign,
       BLIND_SIGNED(asymmetry)},
      {"coulomb_friction", "muscle", true, {}, "T_c", "N m", 0.02, 1.0, no_shape, BLIND_SIMPLE(coulomb)},
      {"stribeck_friction", "muscle", true, {}, "T_s", "N m", 0.03, 1.5,
       [](Random& random) {
         return Shape{{"ratio", random.uniform(1.5, 3.0)}, {"v_s", random.log_uniform(0.08, 0.5)}};
       },
       BLIND_APPLY{h.stribeck_slide = a / s.at("ratio");
  h.stribeck_extra = a - h.stribeck_slide;
  h.stribeck_speed = s.at("v_s");
}
}  // namespace
, {"pressure_dependent_friction", "muscle", true, {}, "T_c", "N m", 0.02, 1.0,
   [](Random& random) {
     return Shape{{"n", random.uniform(0.8, 2.0)}};
   },
   BLIND_APPLY{h.loaded = a;
h.loaded_power = s.at("n");
}  // namespace blind
}
, {"hysteresis", "muscle", true, {}, "T_h", "N m", 0.02, 1.5,
   [](Random& random) {
     return Shape{{"phi_s", random.log_uniform(0.02, 0.2)}};
   },
   BLIND_APPLY{h.hysteresis = a;
h.hysteresis_reach = s.at("phi_s");
}
}
, {"creep", "muscle", true, {}, "k1", "N m/rad", 0.1, 5.0,
   [](Random& random) {
     return Shape{{"tau", random.log_uniform(3.0, 60.0)}};
   },
   BLIND_APPLY{h.creep = a;
h.creep_time = s.at("tau");
}
}
, {"thermal_drift", "muscle", true, {}, "share", "1", 0.01, 0.5,
   [](Random& random) {
     return Shape{{"of_B", random.uniform() < 0.5 ? 1.0 : 0.0},
                  {"sign", random.sign()},
                  {"tau", random.uniform(600.0, 3000.0)}};
   },
   BLIND_APPLY{(s.at("of_B") > 0.5 ? h.warm_B : h.warm_A) = a * s.at("sign");
h.warm_time = s.at("tau");
}
}
, {"cubic_stiffness", "muscle", true, {},        "k3",
   "N m/rad3",        0.1,      8.0,  only_sign, BLIND_SIGNED(cubic_stiffness)},
    {"pressure_dependent_stiffness", "muscle", true, {}, "alpha", "1", 0.02, 0.8, only_sign,
     BLIND_SIGNED(mean_stiffness)},
    {"quadratic_pressure_angle", "muscle", true, {}, "a'", "N cm2/(kg m2)", 1e4, 1e7, only_sign,
     BLIND_SIGNED(quadratic)},
    {"tension_loss", "muscle", true, {}, "share", "1", 0.1, 1.0,
     [](Random& random) {
       return Shape{{"phi_s", random.uniform(0.4, 0.75)}};
     },
     BLIND_APPLY{h.slack_share = a;
h.slack_angle = s.at("phi_s");
}
}
, {"lever_arm_variation", "muscle", true, {}, "a", "1/rad2", 0.01, 0.3, only_sign, BLIND_SIGNED(lever)},
    {"torque_ripple", "muscle", true, {}, "a", "N m", 0.02, 0.5,
     [](Random& random) {
       return Shape{{"N", 12.0 + random.index(20)}, {"psi", random.uniform(0.0, kTurn)}};
     },
     BLIND_APPLY{h.ripple = a;
h.ripple_teeth = s.at("N");
h.ripple_phase = s.at("psi");
}
}
, {"asymmetric_hysteresis", "muscle", true, {}, "T_h", "N m", 0.02, 1.5,
   [](Random& random) {
     const double ratio = random.uniform() < 0.5 ? random.uniform(0.45, 0.7) : random.uniform(1.4, 2.2);
     return Shape{{"phi_s", random.log_uniform(0.03, 0.15)},
                  {"ratio", ratio},
                  {"phi_s_ratio", random.log_uniform(0.5, 2.0)}};
   },
   BLIND_APPLY{h.asym_up = a;
h.asym_down = a * s.at("ratio");
h.asym_reach_up = s.at("phi_s");
h.asym_reach_down = s.at("phi_s") * s.at("phi_s_ratio");
}
}
, {"pressure_dependent_damping", "muscle", true, {}, "D1", "N m s/(kg/cm2)", 0.02, 0.5, only_sign,
   BLIND_SIGNED(mean_damping)},
    {"nonlinear_pressure_gain", "muscle", true, {},        "b3",
     "N m/(kg/cm2)3",           0.01,     0.5,  only_sign, BLIND_SIGNED(cubic_pressure)},
    {"threshold_pressure", "muscle", true, {}, "p_th", "kg/cm2", 0.5, 1.2, no_shape, BLIND_SIMPLE(threshold)},
    {"periodic_disturbance", "rig", true, {}, "a", "N m", 0.02, 1.0,
     [](Random& random) {
       return Shape{{"f", random.log_uniform(0.5, 30.0)}, {"psi", random.uniform(0.0, kTurn)}};
     },
     BLIND_APPLY{h.periodic = a;
h.periodic_frequency = s.at("f");
h.periodic_phase = s.at("psi");
}
}
,
}
;
}

std::vector<Effect> joint_effects() {
  return {{"end_stop", "joint", true, {}, "k_e", "N m/rad", 5.0, 800.0,
           [](Random& random) {
             return Shape{{"phi_e", random.uniform(0.3, 0.5)}, {"side", random.index(3) - 1.0}};
           },
           BLIND_APPLY{h.stop_stiffness = a;
  h.stop_angle = s.at("phi_e");
  h.stop_side = static_cast<int>(s.at("side"));
}
}
, {"gravity_imbalance", "joint", true, {}, "m g l", "N m", 0.05, 2.0,
   [](Random& random) {
     return Shape{{"phi0", random.uniform(-0.6, 0.6)}};
   },
   BLIND_APPLY{h.gravity = a;
h.gravity_angle = s.at("phi0");
}
}
, {"bearing_friction", "joint", true, {}, "T_b", "N m", 0.02, 1.0, no_shape, BLIND_SIMPLE(bearing)},
    {"inertia_error", "joint", true, {},       "delta I",
     "kg m2",         0.001,   0.01, no_shape, BLIND_SIMPLE(added_inertia)},
    {"backlash", "joint", true, {}, "half play", "rad", 0.005, 0.06, no_shape, BLIND_SIMPLE(play)},
    {"quadratic_damping",
     "joint",
     true,
     {},
     "c2",
     "N m s2",
     0.01,
     0.3,
     no_shape,
     BLIND_SIMPLE(quadratic_damping)},
    {"series_elasticity", "joint", true, {}, "compliance", "rad/(N m)", 0.005, 0.08,
     [](Random& random) {
       return Shape{{"second_share", random.uniform(0.3, 0.6)}, {"damping", random.uniform(0.03, 0.1)}};
     },
     BLIND_APPLY{h.compliance = a;
h.second_share = s.at("second_share");
h.second_damping = s.at("damping");
}
}
,
}
;
}

std::vector<Effect> valve_effects() {
  return {{"dead_time", "pcu", true, {}, "L", "s", 0.005, 0.06, no_shape, BLIND_SIMPLE(dead_time)},
          {"second_order_lag", "pcu", true, {}, "T_2", "s", 0.005, 0.12, no_shape, BLIND_SIMPLE(second_lag)},
          {"asymmetric_fill_vent",
           "pcu",
           true,
           {},
           "vent/fill - 1",
           "1",
           0.05,
           1.5,
           no_shape,
           BLIND_SIMPLE(vent_ratio)},
          {"flow_limit", "pcu", true, {}, "1/R", "s cm2/kg", 0.08, 0.5, no_shape, BLIND_SIMPLE(slowness)},
          {"valve_deadband", "pcu", true, {}, "delta", "kg/cm2", 0.01, 0.3, no_shape, BLIND_SIMPLE(deadband)},
          {"supply_droop", "pcu", true, {}, "droop", "s cm2/kg", 0.01, 0.2,
           [](Random& random) {
             return Shape{{"tau", random.uniform(0.2, 1.0)}};
           },
           BLIND_APPLY{h.droop = a;
  h.droop_time = s.at("tau");
}
}
, {"volume_coupling", "pcu", true, {},       "kappa",
   "kg/cm2/rad",      0.02,  1.0,  no_shape, [](Hidden& h, double a, const Shape&) { h.pump = a; }},
    {"pressure_gain_error", "pcu", true, {}, "b", "kg/cm2", 0.01, 0.5, only_sign, BLIND_SIGNED(valve_offset)},
    {"leak", "pcu", true, {}, "1/T_leak", "1/s", 0.02, 1.0,
     [](Random& random) {
       return Shape{{"sensor", 1.0 + random.index(2)}};
     },
     BLIND_APPLY{(first(s) ? h.leak_1 : h.leak_2) = a;
}
}
, {"valve_hysteresis", "pcu", true, {}, "half play", "kg/cm2", 0.01, 0.3, no_shape, BLIND_SIMPLE(valve_play)},
    {"crosstalk", "pcu", true, {}, "x", "1", 0.005, 0.15, no_shape, BLIND_SIMPLE(crosstalk)},
}
;
}

std::vector<Effect> sensor_effects() {
  return {{"force_offset", "sensor", true, {}, "b", "N", 1.0, 40.0, one_side, BLIND_SENSOR(force_offset)},
          {"force_gain_error", "sensor", true, {}, "g", "1", 0.01, 0.3, one_side, BLIND_SENSOR(force_gain)},
          {"force_drift",
           "sensor",
           true,
           {},
           "c",
           "N/s",
           1.0 / kDay,
           60.0 / kDay,
           one_side,
           BLIND_SENSOR(force_drift)},
          {"force_saturation",
           "sensor",
           true,
           {},
           "share of 1000 N lost",
           "1",
           0.5,
           0.85,
           no_shape,
           [](Hidden& h, double a, const Shape&) { h.clip = a > 0.0 ? 1000.0 * (1.0 - a) : 0.0; }},
          {"pressure_offset",
           "sensor",
           true,
           {},
           "b",
           "kg/cm2",
           0.01,
           0.5,
           one_side,
           BLIND_SENSOR(pressure_offset)},
          {"encoder_offset",
           "sensor",
           true,
           {},
           "phi0",
           "rad",
           0.003,
           0.3,
           only_sign,
           BLIND_SIGNED(encoder_offset)},
          {"sensor_lag", "sensor", true, {}, "T_f", "s", 0.003, 0.06, no_shape, BLIND_SIMPLE(force_lag)},
          {"time_skew", "sensor", true, {}, "delta", "s", 0.003, 0.06, no_shape, BLIND_SIMPLE(skew)},
          {"encoder_gain", "sensor", true, {}, "g", "1", 0.01, 0.2, only_sign, BLIND_SIGNED(encoder_gain)},
          {"encoder_drift",
           "sensor",
           true,
           {},
           "d",
           "rad/s",
           0.005 / kDay,
           0.3 / kDay,
           only_sign,
           BLIND_SIGNED(encoder_drift)},
          {"encoder_slip", "sensor", true, {}, "step", "rad", 0.005, 0.3,
           [](Random& random) {
             return Shape{{"sign", random.sign()}, {"t", random.uniform(0.25, 0.7) * kDay}};
           },
           BLIND_APPLY{h.slip = a * s.at("sign");
  h.slip_time = s.at("t");
}
}
, {"encoder_play", "sensor", true, {}, "half play", "rad", 0.005, 0.06, no_shape, BLIND_SIMPLE(encoder_play)},
    {"pressure_sensor_gain", "sensor", true, {}, "g", "1", 0.005, 0.2, one_side, BLIND_SENSOR(pressure_gain)},
    {"spikes", "sensor", true, {}, "height", "N", 5.0, 300.0,
     [](Random& random) {
       return Shape{{"share", random.log_uniform(5e-4, 4e-3)}};
     },
     BLIND_APPLY{h.spikes = a;
h.spike_share = s.at("share");
}
}
, {"mains_hum", "sensor", true, {}, "a", "N", 0.5, 20.0,
   [](Random& random) {
     return Shape{{"f", random.uniform() < 0.5 ? 50.0 : 60.0},
                  {"psi1", random.uniform(0.0, kTurn)},
                  {"psi2", random.uniform(0.0, kTurn)}};
   },
   BLIND_APPLY{h.hum = a;
h.hum_frequency = s.at("f");
h.hum_phase_1 = s.at("psi1");
h.hum_phase_2 = s.at("psi2");
}
}
,
}
;
}

using Names = std::vector<std::string>;

std::vector<Effect> unknown_effects() {
  return {{"angle_friction", "muscle", false, Names{"velocity", "angle"}, "T_c", "N m/rad", 0.05, 2.0,
           no_shape, BLIND_SIMPLE(angle_friction)},
          {"root_damping", "muscle", false, Names{"velocity"}, "d", "N m (s/rad)^0.5", 0.05, 1.0, no_shape,
           BLIND_SIMPLE(root_damping)},
          {"odd_pressure_angle", "muscle", false, Names{"delta_pressure", "angle"}, "g", "N cm2/(kg rad2)",
           5.0, 300.0, only_sign, BLIND_SIGNED(odd_pressure_angle)},
          {"angle_damping", "muscle", false, Names{"velocity", "angle"}, "d", "N m s/rad2", 0.05, 2.0,
           no_shape, BLIND_SIMPLE(angle_damping)},
          {"rate_dependent_hysteresis", "muscle", false, Names{"velocity"}, "k", "N m/rad", 0.1, 5.0,
           [](Random& random) {
             return Shape{{"tau", random.log_uniform(0.1, 0.8)}};
           },
           BLIND_APPLY{h.maxwell = a;
  h.maxwell_time = s.at("tau");
}
}
, {"heat_friction", "muscle", false, Names{"velocity", "time"}, "T", "N m s/rad", 0.05, 1.0,
   [](Random& random) {
     return Shape{{"tau", random.log_uniform(4.0, 20.0)}};
   },
   BLIND_APPLY{h.heat_friction = a;
h.heat_time = s.at("tau");
}
}
, {"intermittent_stick", "muscle", false, Names{"velocity", "time"}, "T", "N m", 0.1, 2.0,
   [](Random& random) {
     return Shape{{"share", random.uniform(0.05, 0.2)}, {"window", random.uniform(0.3, 1.0)}};
   },
   BLIND_APPLY{h.sticking = a;
h.sticking_share = s.at("share");
h.sticking_window = s.at("window");
}
}
, {"bent_muscle_gain", "muscle", false, Names{"p2"}, "share", "1", 0.1, 2.0,
   [](Random& random) {
     return Shape{{"p", random.uniform(3.4, 4.2)}};
   },
   BLIND_APPLY{h.bent_gain = a;
h.bent_pressure = s.at("p");
}
}
, {"wear_jump", "muscle", false, Names{"angle", "time"}, "share", "1", 0.02, 0.5,
   [](Random& random) {
     return Shape{{"t", random.uniform(0.3, 0.65) * kDay}};
   },
   BLIND_APPLY{h.wear = a;
h.wear_time = s.at("t");
}
}
, {"valve_limit_cycle", "pcu", false, Names{"time"}, "a", "kg/cm2", 0.01, 0.3,
   [](Random& random) {
     return Shape{{"f", random.uniform(1.0, 4.0)}, {"psi", random.uniform(0.0, kTurn)}};
   },
   BLIND_APPLY{h.hunting = a;
h.hunting_frequency = s.at("f");
h.hunting_phase = s.at("psi");
}
}
, {"stiffness_step", "muscle", false, Names{"angle"}, "k", "N m/rad", 0.5, 15.0,
   [](Random& random) {
     const double from = random.uniform(-0.4, 0.2);
     return Shape{{"from", from}, {"to", from + random.uniform(0.15, 0.35)}};
   },
   BLIND_APPLY{h.step_stiffness = a;
h.step_from = s.at("from");
h.step_to = s.at("to");
}
}
,
}
;
}

}  // namespace

const std::vector<Effect>& effects() {
  static const std::vector<Effect> all = [] {
    std::vector<Effect> list;
    for (const auto& part :
         {muscle_effects(), joint_effects(), valve_effects(), sensor_effects(), unknown_effects()})
      list.insert(list.end(), part.begin(), part.end());
    return list;
  }();
  return all;
}

const Effect& effect(const std::string& id) {
  for (const Effect& one : effects())
    if (one.id == id) return one;
  throw std::invalid_argument("no effect is called '" + id + "'; blind_generate --list names them");
}

}  // namespace blind
