/// @file
/// The physics of the testbed in time: two valve units, a muscle pair, a joint that is free or held by a hand.
///
///   T_i ṗ_i = K_i u_i(t − L_i) + b_i − p_i                      valve units (eq 4.1), i = 1, 2
///   T = A r² φ + B r Δp − C φ̇³ − D φ̇ + Σ hidden muscle terms     (eq 3.10), Δp = (p2 − p1)/2
///   F1,2 = F_c ∓ T/(2r),  F_c = max(0, F_0 + B/2 (p_mean − p0))  so that T = (F2 − F1) r
///   I φ̈ = T + Σ hidden joint terms + stops                      free;  φ(t) prescribed when held
///
/// Integrated by Dormand and Prince's 5(4) pair with error control and dense output (Boost.Odeint), 10 ms at most. No step
/// is used across a command's edge, a change of the sign of φ̇ under dry friction, or the touch of a stop: each is located
/// on the dense output and the integration starts anew there. Dry friction follows Filippov: at φ̇ = 0 the joint sticks
/// while the torque just above zero speed pushes down and the torque just below pushes up.
/// Units: SI. Real time: no heap and no lock after construction, noexcept; cost by error control. Threads: one.
/// Errors: construction throws isac::Error (usage) for an unknown effect or impossible numbers; step_to returns
/// kDeviceError if the integrator cannot meet its tolerance.
/// Source: docs/derivations/simulated_rig.md. Example: `while (plant.time() < t) plant.step_to(t);`
#pragma once

#include <array>
#include <memory>

#include "isac/core/status.hpp"
#include "isac/simulate/hand.hpp"
#include "isac/simulate/rig_config.hpp"

namespace isac::simulate {

struct PlantState {
  double time = 0;                   ///< s
  std::array<double, 2> pressure{};  ///< Pa, in the muscles
  Motion joint;
  double torque = 0;              ///< N m, of the muscle pair: what the force sensors see
  double driving_torque = 0;      ///< N m, all that accelerates the free joint
  std::array<double, 2> force{};  ///< N, F1 and F2
};

class Plant {
 public:
  explicit Plant(const RigConfig& config);
  ~Plant();
  Plant(Plant&&) noexcept;
  Plant& operator=(Plant&&) noexcept;

  /// Reference pressures of the valve units from now on, Pa; they answer after their dead time. Never refused: of more
  /// than 4096 changes on their way through one tube the newest is replaced.
  void command(const std::array<double, 2>& pressure) noexcept;
  [[nodiscard]] const std::array<double, 2>& commanded() const noexcept;

  /// The hand takes the joint; it must outlive the hold. nullptr lets go.
  void hold(Hand* hand) noexcept;

  /// Moves on to `limit`, or to the end of the integrator's step or to an event, whichever is first.
  Status step_to(double limit) noexcept;
  [[nodiscard]] double time() const noexcept;
  [[nodiscard]] PlantState state() const noexcept;
  /// True while dry friction holds the free joint.
  [[nodiscard]] bool stuck() const noexcept;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace isac::simulate
