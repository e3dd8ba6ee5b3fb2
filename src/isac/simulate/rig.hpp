/// @file
/// The simulated testbed: plant, sensors and a person, in virtual time.
///
/// Use: advance_to(t); read(); command(codes); ask a person to sweep, hold, let go. Time stands still in between.
/// Units: SI; codes as in card/calibration.hpp. Real time: no heap and no lock after construction, noexcept where marked.
/// Threads: one. Errors: construction throws isac::Error (usage) for impossible numbers or an unknown effect; advance_to
/// returns kDeviceError if the integrator fails. Source: docs/derivations/simulated_rig.md; seed 3.1, app. E.
/// Example: `Rig rig({.seed = 3}); rig.command({2457, 2457}); rig.advance_to(2.0); auto codes = rig.read();`
#pragma once

#include <array>
#include <cstdint>

#include "isac/core/status.hpp"
#include "isac/simulate/hand.hpp"
#include "isac/simulate/plant.hpp"
#include "isac/simulate/rig_config.hpp"
#include "isac/simulate/sensors.hpp"

namespace isac::simulate {

class Rig {
 public:
  static constexpr std::uint32_t kMaxValveCode = 4095;

  explicit Rig(const RigConfig& config = {});
  Rig(const Rig&) = delete;  // the plant points at the hand
  Rig& operator=(const Rig&) = delete;

  Status advance_to(double time) noexcept;
  [[nodiscard]] double time() const noexcept { return plant_.time(); }
  [[nodiscard]] Codes read() noexcept { return sensors_.convert(plant_.state()); }
  Status command(const std::array<std::uint32_t, 2>& codes) noexcept;

  /// To and fro; a middle that is not finite means the angle at which the joint would rest.
  void sweep(Sweep sweep) noexcept;
  void hold(double angle, bool clamp) noexcept;
  void release() noexcept;
  /// What was asked for is reached (a lead-in takes a second or more).
  [[nodiscard]] bool ready() const noexcept { return !held_ || hand_.ready(plant_.time()); }
  Sensors& sensors() noexcept { return sensors_; }

  /// φ at which T = 0 at the pressures now commanded: −B Δp/(A r) without hidden effects.
  [[nodiscard]] double rest_angle() const noexcept;
  [[nodiscard]] PlantState truth() const noexcept { return plant_.state(); }
  [[nodiscard]] const RigConfig& config() const noexcept { return config_; }
  /// Reference pressures that the valve units are told now, Pa.
  [[nodiscard]] const std::array<double, 2>& commanded() const noexcept { return plant_.commanded(); }

 private:
  RigConfig config_;
  Wiring wiring_;
  Plant plant_;
  Sensors sensors_;
  Hand hand_;
  bool held_ = false;
};

}  // namespace isac::simulate
