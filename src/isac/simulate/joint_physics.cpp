#include "isac/simulate/joint_physics.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "isac/core/error.hpp"
#include "isac/models/joint_torque.hpp"
#include "isac/models/valve_unit.hpp"

namespace isac::simulate {

namespace {

constexpr double kPascal = kPascalPerKgfCm2;

void require(bool holds, const char* what) {
  if (!holds)
    throw Error(ErrorKind::kUsage, "rig_impossible", std::string("the simulated rig needs ") + what + ".");
}

}  // namespace

JointPhysics::JointPhysics(const RigConfig& config)
    : joint_(config.joint), valves_(config.valves), inertia_(config.joint.inertia) {
  require(joint_.wheel_radius > 0, "a wheel radius above zero");
  require(joint_.initial_pressure > 0, "an initial pressure above zero");
  require(joint_.stop_angle > 0 && joint_.stop_stiffness >= 0 && joint_.stop_damping >= 0,
          "stops with an angle above zero, a stiffness and a damping not below zero");
  for (const auto& valve : valves_) {
    require(valve.fill_lag > 0 && valve.vent_lag > 0, "time constants of the valve units above zero");
    require(valve.dead_time >= 0 && valve.dead_time < 10, "a dead time from 0 to 10 s");
  }
  require(config.relative_tolerance >= 1e-13 && config.relative_tolerance <= 1e-3,
          "a tolerance from 1e-13 to 1e-3");

  std::size_t state = kFirstEffectState;
  for (const CompiledEffect& effect : compile_effects(config.effects)) {
    if (effect.info->hook != models::Hook::kTorque) continue;
    torque_effects_.push_back({.effect = effect, .state = state});
    state += static_cast<std::size_t>(effect.info->state_count);
    require(state <= kPlantStates, "at most eight states in its hidden effects");
    // Inertial effects, −ΔI φ̈, go to the other side of eq 4.3.
    models::JointPoint<double> at_rest, accelerated;
    at_rest.reference_pressure = accelerated.reference_pressure = joint_.initial_pressure;
    accelerated.acceleration = 1;
    const std::array<double, models::kMaxEffectStates> none{};
    inertia_ -= models::effect_torque(effect.index, effect.parameters.data(), accelerated, none.data()) -
                models::effect_torque(effect.index, effect.parameters.data(), at_rest, none.data());
  }
  require(inertia_ > 0, "an inertia above zero");
  find_dry_friction();
}

models::JointPoint<double> JointPhysics::point_of(const StatePoint& point) const noexcept {
  const double p1 = point.x[0] * kPascal, p2 = point.x[1] * kPascal;
  return {.delta_pressure = 0.5 * (p2 - p1),
          .mean_pressure = 0.5 * (p1 + p2),
          .angle = point.x[kPhi],
          .velocity = point.omega,
          .acceleration = 0,
          .time = point.time,
          .wheel_radius = joint_.wheel_radius,
          .reference_pressure = joint_.initial_pressure,
          .stiffness = joint_.A,
          .pressure_gain = joint_.B};
}

Torques JointPhysics::torques(const StatePoint& point) const noexcept {
  const models::JointPoint<double> p = point_of(point);
  Torques t;
  t.muscle = models::joint_torque<double>({.A = joint_.A, .B = joint_.B, .C = joint_.C, .D = joint_.D},
                                          p.wheel_radius, p.angle, p.delta_pressure, p.velocity);
  for (const TorqueEffect& e : torque_effects_) {
    const double torque =
        models::effect_torque(e.effect.index, e.effect.parameters.data(), p, point.x.data() + e.state);
    (e.effect.info->where == models::Subsystem::kMuscle ? t.muscle : t.joint) += torque;
  }
  if (!point.held && point.touch != 0) {  // rubber pushes, it never pulls
    const double side = point.touch;
    const double depth = side * point.x[kPhi] - joint_.stop_angle;
    t.joint -=
        side * std::max(0.0, joint_.stop_stiffness * depth + joint_.stop_damping * side * point.x[kOmega]);
  }
  return t;
}

void JointPhysics::rates(const StatePoint& point, const std::array<double, 2>& reference,
                         std::array<double, kPlantStates>& dxdt) const noexcept {
  dxdt.fill(0);
  for (std::size_t i = 0; i < 2; ++i) {
    // T ṗ + p = K u + b (eq 4.1); a muscle is never below the pressure of the room.
    const double target = std::max(0.0, (valves_[i].gain * reference[i] + valves_[i].offset) / kPascal);
    const double lag = target > point.x[i] ? valves_[i].fill_lag : valves_[i].vent_lag;
    dxdt[i] = models::valve_rate<double>({.gain = 1, .lag = lag}, point.x[i], target);
  }
  if (torque_effects_.empty()) return;
  const models::JointPoint<double> p = point_of(point);
  for (const TorqueEffect& e : torque_effects_) {
    models::effect_derivative(e.effect.index, e.effect.parameters.data(), p, point.x.data() + e.state,
                              dxdt.data() + e.state);
  }
}

std::array<double, kPlantStates> JointPhysics::initial_state(const RigConfig& config) const noexcept {
  std::array<double, kPlantStates> x{};
  x[0] = config.pressure[0] / kPascal;
  x[1] = config.pressure[1] / kPascal;
  x[kPhi] = config.angle;
  x[kOmega] = config.velocity;
  const models::JointPoint<double> p =
      point_of({.time = 0, .x = x, .omega = config.velocity, .touch = 0, .held = false});
  for (const TorqueEffect& e : torque_effects_) {
    models::effect_rest(e.effect.index, e.effect.parameters.data(), p, x.data() + e.state);
  }
  return x;
}

void JointPhysics::find_dry_friction() noexcept {
  std::array<double, kPlantStates> x{};
  x[0] = x[1] = joint_.initial_pressure / kPascal;
  x[kPhi] = 0.1;
  StatePoint point{.time = 0, .x = x, .omega = kBarelyMoving, .touch = 0, .held = false};
  const Torques above = torques(point);
  point.omega = -kBarelyMoving;
  const Torques below = torques(point);
  // Smooth damping differs by about 1e-9 N m here; the smallest dry friction worth a name is a million times that.
  dry_friction_ = below.muscle + below.joint - above.muscle - above.joint > 1e-6;
}

std::array<double, 2> JointPhysics::forces(double torque,
                                           const std::array<double, 2>& pressure) const noexcept {
  // One muscle of the pair gives B/2 per unit of pressure (eq 3.4: B = 2 D0² (a − b)); no muscle pushes.
  const double mean = 0.5 * (pressure[0] + pressure[1]);
  const double common = std::max(0.0, joint_.pretension + 0.5 * joint_.B * (mean - joint_.initial_pressure));
  const double half = torque / (2 * joint_.wheel_radius);
  return {common - half, common + half};
}

int JointPhysics::touching(double angle) const noexcept {
  if (angle > joint_.stop_angle) return 1;
  return angle < -joint_.stop_angle ? -1 : 0;
}

}  // namespace isac::simulate
