/// @file
/// What the card reads of the testbed: amplifiers, noise, 12-bit conversion, encoder steps.
///
///   code = clamp(round((lag(x) + noise)/gain + offset), 0, 4095);   count = floor(φ · 8000/2π + middle)
///
/// Inputs: ai0 F1, ai2 F2, ai4 p1, ai6 p2 (seed E.1.5), the others open (code 0); enc0 the joint, counted modulo 2^24.
/// For calibration the force sensors can be taken off the rig and loaded with a weight, the pressure sensors connected to
/// the supply (E.3). Units: SI in, codes out. Real time: no heap, no lock, noexcept. Threads: one. Errors: none.
/// Source: seed E.1, E.3; docs/derivations/simulated_rig.md, "Sensors".
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "isac/simulate/lag.hpp"
#include "isac/simulate/noise.hpp"
#include "isac/simulate/plant.hpp"
#include "isac/simulate/rig_config.hpp"
#include "isac/simulate/sensor_effects.hpp"

namespace isac::simulate {

struct Codes {
  std::uint32_t encoder = 0;
  std::array<std::uint32_t, 8> input{};
};

class Sensors {
 public:
  static constexpr std::uint32_t kEncoderModulus = 1u << 24;
  static constexpr std::uint32_t kMaxCode = 4095;
  static constexpr std::array<std::size_t, 2> kForceInput{0, 2}, kPressureInput{4, 6};

  explicit Sensors(const RigConfig& config);

  /// Lets the amplifiers follow the rig; call at every step of the plant.
  void track(const PlantState& state) noexcept;
  /// The codes at the state last tracked, in which only the encoder looks at `state`.
  [[nodiscard]] Codes convert(const PlantState& state) noexcept;

  void hang_weight(std::optional<double> newton) noexcept {
    weight_ = newton;
  }  ///< empty: mounted in the rig
  void connect_supply(std::optional<double> pascal) noexcept { supply_ = pascal; }  ///< empty: at the muscles

 private:
  Wiring wiring_;
  NoiseKind noise_kind_;
  SensorEffects effects_;
  std::array<FirstOrderLag, 2> force_lag_, pressure_lag_;
  Readings amplified_;
  std::array<SensorNoise, 2> force_noise_, pressure_noise_;
  std::optional<double> weight_, supply_;
  bool started_ = false;
};

}  // namespace isac::simulate
