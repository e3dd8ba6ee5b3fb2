/// @file
/// The right-hand side of the testbed's differential equations; plant.hpp integrates it.
///
/// State: p1, p2 in kgf/cm², φ, φ̇, then the states of the hidden effects (those of the valve unit in kgf/cm² too).
/// Units: SI but for the pressures of the state. Real time: no heap after construction, noexcept.
/// Errors: construction throws isac::Error (usage). Source: docs/derivations/simulated_rig.md.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "isac/models/effects.hpp"
#include "isac/simulate/hidden_effects.hpp"
#include "isac/simulate/rig_config.hpp"

namespace isac::simulate {

inline constexpr std::size_t kPhi = 2, kOmega = 3, kFirstEffectState = 4, kEffectStates = 8;
inline constexpr std::size_t kPlantStates = kFirstEffectState + kEffectStates;
inline constexpr double kBarelyMoving =
    1e-9;  ///< rad/s: the side of zero on which a joint at rest would move

/// Where the torques are asked for. `omega` is the speed that friction sees, which may be one-sided.
struct StatePoint {
  double time;
  const std::array<double, kPlantStates>& x;
  double omega;
  int touch;  ///< −1, 0, +1: the stop that the bar leans on
  bool held;
};

struct Torques {
  double muscle = 0;  ///< N m, through the force sensors
  double joint = 0;   ///< N m, outside them: friction of bearings, stops
};

/// A hidden effect and where its states begin.
struct PlacedEffect {
  CompiledEffect effect;
  std::size_t state = 0;
};

class JointPhysics {
 public:
  explicit JointPhysics(const RigConfig& config);

  [[nodiscard]] std::array<double, kPlantStates> initial_state(const RigConfig& config) const noexcept;
  [[nodiscard]] Torques torques(const StatePoint& point) const noexcept;
  /// ṗ and the rates of the effects' states; φ̇ and φ̈ are the caller's. `reference`: Pa, as it arrives behind the dead time.
  void rates(const StatePoint& point, const std::array<double, 2>& reference,
             std::array<double, kPlantStates>& dxdt) const noexcept;
  /// Pressures in the muscles, Pa, which sensors read: what effects between the valve units make of the units' own.
  [[nodiscard]] std::array<double, 2> pressures(const std::array<double, kPlantStates>& x) const noexcept;
  [[nodiscard]] std::array<double, 2> forces(double torque,
                                             const std::array<double, 2>& pressure) const noexcept;

  /// A new reference has arrived: effects with a memory of commands take a step.
  void step_valves(const std::array<double, 2>& reference,
                   std::array<double, kPlantStates>& x) const noexcept;

  [[nodiscard]] int touching(double angle) const noexcept;
  /// I and what hidden effects add to it.
  [[nodiscard]] double inertia() const noexcept { return inertia_; }
  [[nodiscard]] double dead_time(std::size_t valve) const noexcept { return valves_[valve].dead_time; }
  /// The torque jumps where the speed changes its sign.
  [[nodiscard]] bool dry_friction() const noexcept { return dry_friction_; }

 private:
  [[nodiscard]] models::JointPoint<double> point_of(const StatePoint& point) const noexcept;
  [[nodiscard]] std::array<double, 2> targets(const double* command) const noexcept;
  void add_effects(const std::vector<HiddenEffect>& effects);
  void valve_rates(const StatePoint& point, const std::array<double, 2>& reference,
                   std::array<double, kPlantStates>& dxdt) const noexcept;
  template <typename Visit>
  void chain_commands(const std::array<double, kPlantStates>& x, double velocity,
                      const std::array<double, 2>& reference, models::ValvePoint<double>& valve,
                      double* command, Visit visit) const noexcept;
  void find_dry_friction() noexcept;

  JointConfig joint_;
  std::array<ValveUnit, 2> valves_;
  std::vector<PlacedEffect> torque_effects_, valve_effects_;
  double inertia_ = 0;
  bool dry_friction_ = false;
};

}  // namespace isac::simulate
