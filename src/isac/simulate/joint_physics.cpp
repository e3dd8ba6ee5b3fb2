#include "isac/simulate/joint_physics.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "isac/core/error.hpp"
#include "isac/models/effect_hooks.hpp"
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

  add_effects(config.effects);
  require(inertia_ > 0, "an inertia above zero");
  find_dry_friction();
}

void JointPhysics::add_effects(const std::vector<HiddenEffect>& effects) {
  std::size_t state = kFirstEffectState;
  for (const CompiledEffect& effect : compile_effects(effects)) {
    using models::Hook;
    if (effect.info->where == models::Subsystem::kSensor) continue;  // sensor_effects.hpp
    const double* q = effect.parameters.data();
    if (effect.info->hook == Hook::kDelay) {
      for (auto& valve : valves_) valve.dead_time += models::effect_delay(effect.index, q);
      continue;
    }
    (effect.info->hook == Hook::kTorque ? torque_effects_ : valve_effects_)
        .push_back({.effect = effect, .state = state});
    state += static_cast<std::size_t>(effect.info->state_count);
    require(state <= kPlantStates, "at most eight states in its hidden effects");
    // Inertial effects, −ΔI φ̈, go to the other side of eq 4.3.
    models::JointPoint<double> at_rest, accelerated;
    at_rest.reference_pressure = accelerated.reference_pressure = joint_.initial_pressure;
    accelerated.acceleration = 1;
    const std::array<double, models::kMaxEffectStates> none{};
    inertia_ -= models::effect_torque(effect.index, q, accelerated, none.data()) -
                models::effect_torque(effect.index, q, at_rest, none.data());
  }
}

std::array<double, 2> JointPhysics::pressures(const std::array<double, kPlantStates>& x) const noexcept {
  std::array<double, 2> p = {x[0] * kPascal, x[1] * kPascal};
  for (const PlacedEffect& e : valve_effects_) {
    models::effect_outlet_pressure(e.effect.index, e.effect.parameters.data(), p.data());
  }
  return p;
}

models::JointPoint<double> JointPhysics::point_of(const StatePoint& point) const noexcept {
  std::array<double, 2> p = pressures(point.x);
  for (const PlacedEffect& e : valve_effects_) {
    models::effect_muscle_pressure(e.effect.index, e.effect.parameters.data(), p.data());
  }
  return {.delta_pressure = 0.5 * (p[1] - p[0]),
          .mean_pressure = 0.5 * (p[0] + p[1]),
          .angle = point.x[kPhi],
          .velocity = point.omega,
          .acceleration = 0,
          .time = point.time,
          .wheel_radius = joint_.wheel_radius,
          .reference_pressure = joint_.initial_pressure,
          .stiffness = joint_.A,
          .pressure_gain = joint_.B,
          .cubic_damping = joint_.C,
          .damping = joint_.D};
}

Torques JointPhysics::torques(const StatePoint& point) const noexcept {
  const models::JointPoint<double> p = point_of(point);
  Torques t;
  t.muscle = models::joint_torque<double>({.A = joint_.A, .B = joint_.B, .C = joint_.C, .D = joint_.D},
                                          p.wheel_radius, p.angle, p.delta_pressure, p.velocity);
  for (const PlacedEffect& e : torque_effects_) {
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

std::array<double, 2> JointPhysics::targets(const double* command) const noexcept {
  std::array<double, 2> target{};
  for (std::size_t i = 0; i < 2; ++i) {  // a muscle is never below the pressure of the room
    target[i] = std::max(0.0, valves_[i].gain * command[i] + valves_[i].offset);
  }
  return target;
}

/// Runs the command through all valve effects; `visit(e, z)` sees each with `valve.command` as it stands before it.
template <typename Visit>
void JointPhysics::chain_commands(const std::array<double, kPlantStates>& x, double velocity,
                                  const std::array<double, 2>& reference, models::ValvePoint<double>& valve,
                                  double* command, Visit visit) const noexcept {
  valve.velocity = velocity;
  valve.lag = valves_[0].fill_lag;
  for (std::size_t i = 0; i < 2; ++i) {
    valve.pressure[i] = x[i] * kPascal;
    command[i] = reference[i];
  }
  for (const PlacedEffect& e : valve_effects_) {
    for (std::size_t i = 0; i < 2; ++i) valve.command[i] = command[i];
    std::array<double, models::kMaxEffectStates> z{};
    const auto n = static_cast<std::size_t>(e.effect.info->state_count);
    for (std::size_t k = 0; k < n; ++k) z[k] = x[e.state + k] * kPascal;
    visit(e, z);
    models::effect_command(e.effect.index, e.effect.parameters.data(), valve, z.data(), command);
  }
}

void JointPhysics::valve_rates(const StatePoint& point, const std::array<double, 2>& reference,
                               std::array<double, kPlantStates>& dxdt) const noexcept {
  models::ValvePoint<double> valve;
  double u[2], v[2];
  chain_commands(point.x, point.omega, reference, valve, u, [](const PlacedEffect&, const auto&) {});
  const std::array<double, 2> target = targets(u);
  for (std::size_t i = 0; i < 2; ++i) {  // T ṗ + p = K u + b (eq 4.1)
    const double p = point.x[i] * kPascal;
    const double lag = target[i] > p ? valves_[i].fill_lag : valves_[i].vent_lag;
    v[i] = models::valve_rate<double>({.gain = 1, .lag = lag}, p, target[i]);
  }
  for (const PlacedEffect& e : valve_effects_) {
    models::effect_pressure_rate(e.effect.index, e.effect.parameters.data(), valve,
                                 static_cast<const double*>(nullptr), v);
  }
  for (std::size_t i = 0; i < 2; ++i) {
    dxdt[i] = (point.x[i] <= 0 ? std::max(0.0, v[i]) : v[i]) / kPascal;
  }
  if (valve_effects_.empty()) return;
  double again[2];  // the chain once more, for each effect's own view of the command
  chain_commands(point.x, point.omega, reference, valve, again, [&](const PlacedEffect& e, const auto& z) {
    std::array<double, models::kMaxEffectStates> dz{};
    models::effect_valve_derivative(e.effect.index, e.effect.parameters.data(), valve, u, v, z.data(),
                                    dz.data());
    const auto n = static_cast<std::size_t>(e.effect.info->state_count);
    for (std::size_t k = 0; k < n; ++k) dxdt[e.state + k] = dz[k] / kPascal;
  });
}

void JointPhysics::step_valves(const std::array<double, 2>& reference,
                               std::array<double, kPlantStates>& x) const noexcept {
  if (valve_effects_.empty()) return;
  models::ValvePoint<double> valve;
  double u[2];
  chain_commands(x, x[kOmega], reference, valve, u, [&](const PlacedEffect& e, auto& z) {
    models::effect_valve_step(e.effect.index, e.effect.parameters.data(), valve, z.data());
    const auto n = static_cast<std::size_t>(e.effect.info->state_count);
    for (std::size_t k = 0; k < n; ++k) x[e.state + k] = z[k] / kPascal;
  });
}

void JointPhysics::rates(const StatePoint& point, const std::array<double, 2>& reference,
                         std::array<double, kPlantStates>& dxdt) const noexcept {
  dxdt.fill(0);
  valve_rates(point, reference, dxdt);
  if (torque_effects_.empty()) return;
  const models::JointPoint<double> p = point_of(point);
  for (const PlacedEffect& e : torque_effects_) {
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
  for (const PlacedEffect& e : torque_effects_) {
    models::effect_rest(e.effect.index, e.effect.parameters.data(), p, x.data() + e.state);
  }
  models::ValvePoint<double> valve;
  double u[2];
  chain_commands(x, config.velocity, config.pressure, valve, u, [&](const PlacedEffect& e, auto& z) {
    models::effect_valve_rest(e.effect.index, e.effect.parameters.data(), valve, z.data());
    const auto n = static_cast<std::size_t>(e.effect.info->state_count);
    for (std::size_t k = 0; k < n; ++k) x[e.state + k] = z[k] / kPascal;
  });
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
