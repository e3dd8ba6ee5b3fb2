/// @file
/// The whole arm in time: six coupled joints, twelve muscles with their valve units, friction, slack, and a load in the hand.
///
///   T ṗ + p = K u(t − L) + b                                        each muscle's valve unit                seed 4.1
///   T_i = A r² φ_i + B r Δp_i − C φ̇_i³ − D φ̇_i − F_i z_i             pair of muscles, with Dahl friction      seed 3.10
///   (Kᵀ M(θ) K + diag I) φ̈ = T + Kᵀ (τ_g(θ) − h(θ, θ̇) + Jᵀ f)       θ = K φ (+ middle, in the chain)         seed 4.39 to 4.50
///   h = Σ m J_mᵀ J̇_m θ̇                                              Coriolis and centrifugal torques
///   a hose that pulls on a joint adds  pull − pull_stiffness φ_i  to the right side
///   with slack: I φ̈_w = T(φ_w) − T_c, and T_c = k dz(φ_w − φ, ± play) + d (φ̇_w − φ̇) while in touch instead of T
///
/// Point masses alone leave M singular: turning about the line from wrist to hand moves none of them. I is the joint's own
/// inertia (wheel, chain, links about themselves). The valves are solved exactly over each step, the rest by the classical Runge-
/// Kutta method at a fixed step. Nothing stops a joint but its muscles. docs/derivations/arm_simulation.md.
///
/// Shapes: six joints; arrays by actuator angle φ, as the controller sees them. Units: SI; gauge pressures. Threads: one.
/// Real time: no heap after construction. Errors: the constructor throws isac::Error for values that are no arm; run() returns
/// kDeviceError when a state is no longer finite. Example: tests/simulate/arm_plant_test.cpp.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "isac/core/status.hpp"
#include "isac/models/arm/coupling.hpp"
#include "isac/models/joint_torque.hpp"
#include "isac/simulate/rig_config.hpp"

namespace isac::simulate {

inline constexpr std::size_t kArmJoints = 6;
using ArmVector = models::JointVector<double, 6>;
using ArmPressures = std::array<models::PressurePair<double>, kArmJoints>;

struct ArmJointConfig {
  models::JointCoefficients<double> muscle;
  double wheel_radius = 0;       ///< r, m
  double inertia = 0.002;        ///< I, kg m², what turns with the wheel besides the arm's masses
  double friction = 0;           ///< F, N m, Dahl (models/effects_memory.hpp, `hysteresis`)
  double friction_angle = 2e-3;  ///< rad, turn within which the friction comes up
  double play = 0;               ///< rad, half of the slack between wheel and joint; 0: rigid
  double pull = 0;            ///< N m, on the joint, of something that is no part of the arm: a hose, a cable
  double pull_stiffness = 0;  ///< N m/rad, of the same: its torque is pull − pull_stiffness φ
  std::array<ValveUnit, 2> valve{};  ///< of muscle 1 and 2
};

struct ArmPlantConfig {
  models::Chain<double, 6> chain;  ///< true lengths and masses; theta_offset holds θ at φ = 0
  models::Coupling<double, 6> coupling = models::soft_arm_coupling<double>();
  std::array<ArmJointConfig, kArmJoints> joints;
  double load = 0;               ///< kg at the tool centre point
  double touch_stiffness = 2e4;  ///< N m/rad, of wheel on joint at the end of the slack
  double touch_damping = 5;      ///< N m s
  double step = 1e-4;            ///< s
};

/// Mechanical energy, J: of motion, of height (and of what pulls), of the muscles (at the present Δp, as springs) and of the touching slack.
struct ArmEnergy {
  double kinetic = 0, height = 0, muscles = 0, touch = 0;
  [[nodiscard]] double sum() const noexcept { return kinetic + height + muscles + touch; }
};

class ArmPlant {
 public:
  explicit ArmPlant(const ArmPlantConfig& config);

  /// At rest at these angles with `mean` in all muscles and the Δp that carries gravity (not limited here).
  void rest_at(const ArmVector& angle, double mean_pressure) noexcept;
  /// As it is, with these speeds.
  void set_velocity(const ArmVector& velocity) noexcept;

  /// Reference pressures from now on, Pa; they reach the valves after their dead times.
  void command(const ArmPressures& pressure) noexcept { commanded_ = pressure; }
  [[nodiscard]] const ArmPressures& commanded() const noexcept { return commanded_; }
  /// Holds all joints where they are while valves go on; false lets go, from rest.
  void hold(bool held) noexcept;
  /// A force on the tool centre point, N, in the base frame, from now on.
  void push(const models::Vec3<double>& force) noexcept { push_ = force; }

  /// Moves on by `seconds`, rounded to whole steps.
  [[nodiscard]] Status run(double seconds) noexcept;

  [[nodiscard]] double time() const noexcept { return static_cast<double>(steps_) * config_.step; }
  [[nodiscard]] const ArmVector& angle() const noexcept { return x_.angle; }
  [[nodiscard]] const ArmVector& velocity() const noexcept { return x_.velocity; }
  [[nodiscard]] const ArmPressures& pressure() const noexcept { return pressure_; }
  [[nodiscard]] ArmVector muscle_torque() const noexcept;  ///< N m, of each pair, friction included
  [[nodiscard]] models::Vec3<double> tool() const noexcept;
  [[nodiscard]] ArmEnergy energy() const noexcept;
  [[nodiscard]] const ArmPlantConfig& config() const noexcept { return config_; }

 private:
  struct State {
    ArmVector angle{}, velocity{}, friction{}, wheel_angle{}, wheel_velocity{};
  };
  struct Tube {  ///< a command on its way, one entry per step
    std::vector<double> delayed;
    std::size_t next = 0;
  };

  void advance_valves(ArmVector& before, ArmVector& middle, ArmVector& after) noexcept;
  [[nodiscard]] State rate(const State& x, const ArmVector& delta_pressure) const noexcept;
  [[nodiscard]] double torque_of(std::size_t joint, const State& x, double delta_pressure) const noexcept;
  [[nodiscard]] double touch_torque(std::size_t joint, const State& x) const noexcept;
  [[nodiscard]] ArmVector delta_pressure() const noexcept;

  ArmPlantConfig config_;  ///< with the load among the chain's masses
  State x_;
  ArmPressures pressure_{}, commanded_{};
  std::array<std::array<Tube, 2>, kArmJoints> tubes_;
  models::Vec3<double> push_{};
  long long steps_ = 0;
  bool held_ = false;
};

}  // namespace isac::simulate
