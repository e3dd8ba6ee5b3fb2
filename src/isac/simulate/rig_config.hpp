/// @file
/// What the simulated testbed is made of: valve units, muscle pair, joint, sensors, clock, hand, and what is hidden in it.
///
/// The defaults are the seed's testbed (sec 3.1, 3.3, 4.1, 4.2, app. E): A = −23450 N/m, B = 174.2 N cm²/kg,
/// C = 0.0026 N m s³, D = 0.14 N m s, r = 0.019 m, I = 0.0085 kg m², p0 = 3 kg/cm², K_C = 1, T_C = 0.17 s.
/// Units: SI throughout. A value; Errors: none here, Rig's constructor checks.
/// Source: docs/derivations/simulated_rig.md.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "isac/core/units.hpp"
#include "isac/simulate/hand.hpp"
#include "isac/simulate/noise.hpp"

namespace isac::simulate {

/// An effect of models/effects.hpp that is in the rig but not in the model that a person fits.
struct HiddenEffect {
  std::string id;                  ///< "coulomb_friction"
  std::vector<double> parameters;  ///< SI; missing ones take the catalogue's typical value
};

/// Current → pressure: T ṗ + p = K u(t − L) + b, T by direction (seed 4.1).
struct ValveUnit {
  double gain = 1;         ///< K_C
  double offset = 0;       ///< b, Pa
  double fill_lag = 0.17;  ///< T_C while the pressure rises, s
  double vent_lag = 0.17;  ///< T_C while it falls, s
  double dead_time = 0;    ///< L, s
};

/// The muscle pair on its chain wheel and the joint it moves (eq 3.10, 4.3).
struct JointConfig {
  double A = -23450;                               ///< N/m
  double B = 174.2 / kPascalPerKgfCm2;             ///< N/Pa
  double C = 0.0026;                               ///< N m s³
  double D = 0.14;                                 ///< N m s
  double wheel_radius = 0.019;                     ///< r, m
  double initial_pressure = 3 * kPascalPerKgfCm2;  ///< p0, Pa
  double inertia = 0.0085;                         ///< I, kg m²
  double pretension = 95;       ///< N in each muscle at p0 and T = 0, in the middle of the force sensors
  double stop_angle = 1.5;      ///< rad, rubber stop of the bar
  double stop_stiffness = 200;  ///< N m/rad
  double stop_damping = 0.5;    ///< N m s
};

enum class NoiseKind : std::uint8_t { kNone, kWhite, kColoured };

struct SensorConfig {
  NoiseKind noise = NoiseKind::kColoured;
  double force_noise = 0.3;                          ///< N, standard deviation, white and slow part together
  double pressure_noise = 0.004 * kPascalPerKgfCm2;  ///< Pa, likewise
  double slow_share = 0.5;                           ///< share of the slow part in the variance
  double slow_time_constant = 0.02;                  ///< s
  double force_hum = 0;                              ///< N, amplitude of the mains hum
  double hum_hz = 60;                                ///< Hz
  double bandwidth = 1000;                           ///< Hz, of the amplifiers; 0: without lag
  double force_range = 200;                          ///< N over 0 … 10 V, zero at 0.5 V
  double pressure_range = 10 * kPascalPerKgfCm2;     ///< Pa over 0 … 10 V
};

/// code = round(physical/gain + offset), gain and offset of this very rig ("miscalibrated": not those of the data sheet).
struct ChannelTruth {
  double gain = 1;    ///< SI per count
  double offset = 0;  ///< count
};

struct Wiring {
  std::array<ChannelTruth, 2> force, pressure, valve;  ///< F1 F2, p1 p2, p1_cmd p2_cmd
  double encoder_steps = 8000;                         ///< per turn
  double encoder_middle = 0;                           ///< count at φ = 0
};

struct TimingConfig {
  bool jitter = false;  ///< the sampling instant comes late, as on a computer that does other things too
  double mean_delay = 25e-6;   ///< s, of an exponential distribution
  double tail_chance = 0.002;  ///< of a delay of up to tail_delay on top
  double tail_delay = 500e-6;  ///< s
  double stamp_noise = 2e-6;   ///< s, the stamp is read this much after the sample (mean of an exponential)
  double drop_chance = 0;      ///< of a wake-up that comes one whole period late
};

struct RigConfig {
  std::array<ValveUnit, 2> valves;
  JointConfig joint;
  SensorConfig sensors;
  TimingConfig timing;
  HandConfig hand;
  std::vector<HiddenEffect> effects;
  std::uint64_t seed = 1;
  bool miscalibrated = false;  ///< gains, zeros and the encoder's middle differ from the data sheet

  std::array<double, 2> pressure{};  ///< Pa, at time 0
  double angle = 0;                  ///< rad, at time 0
  double velocity = 0;               ///< rad/s, at time 0
  double relative_tolerance = 1e-8;  ///< of the integrator
};

/// Codes as the data sheets have them (card/calibration.hpp states the same numbers for people who convert codes back).
[[nodiscard]] Wiring nominal_wiring(const SensorConfig& sensors) noexcept;
/// The wiring of this rig: nominal, or off by what `miscalibrated` draws from the seed (gains to ±3 %, zeros to ±25 counts).
[[nodiscard]] Wiring wiring_of(const RigConfig& config) noexcept;

}  // namespace isac::simulate
