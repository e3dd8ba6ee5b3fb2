/// @file
/// Effects of the sensors: what changes between the rig and the numbers in a recording.
///
/// `reading(q, t, z, y)` changes what is read, y, in place at time t (s since the start); with states z there is
/// `derivative(q, y, z, dz)` (continuous) or `step(q, y, z)` (once per sample); `delay(q)` in seconds.
/// Spikes are random: who simulates draws them. Units: SI. Real time: no heap, no lock, noexcept. Errors: none; NaN
/// goes through. Source: seed E; docs/derivations/effects.md.
#pragma once

#include <cmath>

#include "isac/models/effect_types.hpp"
#include "isac/models/scalar.hpp"

namespace isac::models::effect {

struct ForceOffset {
  static constexpr EffectInfo kInfo{
      .id = "force_offset",
      .term = "force sensor zero",
      .where = Subsystem::kSensor,
      .equation = "F_i + b_i",
      .parameter_count = 2,
      .parameters = {{"b1", "N", 1, -100, 100, 2}, {"b2", "N", 1, -100, 100, 2}},
      .state_count = 0,
      .torque_term = false,
      .linear = true,
      .confused_with = "torque_offset, offset",
      .told_apart_by = "an unloaded reading",
      .hook = Hook::kReading};
  template <class S>
  static void reading(const S* q, const S&, const S*, Readings<S>& y) noexcept {
    for (int i = 0; i < 2; ++i) y.force[i] = y.force[i] + q[i];
  }
};

struct ForceGainError {
  static constexpr EffectInfo kInfo{
      .id = "force_gain_error",
      .term = "force sensor gain",
      .where = Subsystem::kSensor,
      .equation = "(1 + g_i) F_i",
      .parameter_count = 2,
      .parameters = {{"g1", "-", 1, -0.5, 0.5, 0.03}, {"g2", "-", 1, -0.5, 0.5, 0.03}},
      .state_count = 0,
      .torque_term = false,
      .linear = true,
      .confused_with = "pressure, muscle_asymmetry",
      .told_apart_by = "a known weight; the wheel's radius",
      .hook = Hook::kReading};
  template <class S>
  static void reading(const S* q, const S&, const S*, Readings<S>& y) noexcept {
    for (int i = 0; i < 2; ++i) y.force[i] = (S(1.0) + q[i]) * y.force[i];
  }
};

struct ForceDrift {
  static constexpr EffectInfo kInfo{
      .id = "force_drift",
      .term = "force sensor zero drifts",
      .where = Subsystem::kSensor,
      .equation = "F_i + c_i t",
      .parameter_count = 2,
      .parameters = {{"c1", "N/s", 1, -1, 1, 0.005}, {"c2", "N/s", 1, -1, 1, 0.005}},
      .state_count = 0,
      .torque_term = false,
      .linear = true,
      .confused_with = "thermal_drift, creep",
      .told_apart_by = "proportional to nothing but time",
      .hook = Hook::kReading};
  template <class S>
  static void reading(const S* q, const S& t, const S*, Readings<S>& y) noexcept {
    for (int i = 0; i < 2; ++i) y.force[i] = y.force[i] + q[i] * t;
  }
};

struct ForceSaturation {
  static constexpr EffectInfo kInfo{.id = "force_saturation",
                                    .term = "force reading clipped",
                                    .where = Subsystem::kSensor,
                                    .equation = "min(F_i, F_max)",
                                    .parameter_count = 1,
                                    .parameters = {{"F_max", "N", 1, 1, 1e5, 150, kUnlimited}},
                                    .state_count = 0,
                                    .torque_term = false,
                                    .linear = false,
                                    .confused_with = "tension_loss, end_stop",
                                    .told_apart_by = "one reading stands still at its largest value",
                                    .hook = Hook::kReading};
  template <class S>
  static void reading(const S* q, const S&, const S*, Readings<S>& y) noexcept {
    for (int i = 0; i < 2; ++i)
      if (y.force[i] > q[0]) y.force[i] = q[0];
  }
};

/// Slow amplifier or averaging on the forces; at T_f = 0 (or below) they pass.
struct SensorLag {
  static constexpr EffectInfo kInfo{.id = "sensor_lag",
                                    .term = "slow amplifier, averaging",
                                    .where = Subsystem::kSensor,
                                    .equation = "F_i -> z_i, T_f z_i' = F_i - z_i",
                                    .parameter_count = 1,
                                    .parameters = {{"T_f", "s", 1, 0, 0.5, 0.01}},
                                    .state_count = 2,
                                    .torque_term = false,
                                    .linear = false,
                                    .confused_with = "viscous_damping, time_skew, dead_time",
                                    .told_apart_by = "acts on forces only, also when clamped",
                                    .hook = Hook::kReading};
  template <class S>
  static void reading(const S* q, const S&, const S* z, Readings<S>& y) noexcept {
    if (!(q[0] > S(0.0))) return;
    for (int i = 0; i < 2; ++i) y.force[i] = z[i];
  }
  template <class S>
  static void derivative(const S* q, const Readings<S>& y, const S* z, S* dz) noexcept {
    for (int i = 0; i < 2; ++i) dz[i] = q[0] > S(0.0) ? S((y.force[i] - z[i]) / q[0]) : S(0.0);
  }
  template <class S>
  static void rest(const S*, const Readings<S>& y, S* z) noexcept {
    for (int i = 0; i < 2; ++i) z[i] = y.force[i];
  }
};

struct PressureOffset {
  static constexpr EffectInfo kInfo{.id = "pressure_offset",
                                    .term = "pressure sensor zero",
                                    .where = Subsystem::kSensor,
                                    .equation = "p_i + b_i",
                                    .parameter_count = 2,
                                    .parameters = {{"b1", "kg/cm2", kPascalPerKgfCm2, -kPascalPerKgfCm2,
                                                    kPascalPerKgfCm2, 0.03 * kPascalPerKgfCm2},
                                                   {"b2", "kg/cm2", kPascalPerKgfCm2, -kPascalPerKgfCm2,
                                                    kPascalPerKgfCm2, 0.03 * kPascalPerKgfCm2}},
                                    .state_count = 0,
                                    .torque_term = false,
                                    .linear = true,
                                    .confused_with = "pressure_gain_error, torque_offset",
                                    .told_apart_by = "both muscles vented: the true pressure is 0",
                                    .hook = Hook::kReading};
  template <class S>
  static void reading(const S* q, const S&, const S*, Readings<S>& y) noexcept {
    for (int i = 0; i < 2; ++i) y.pressure[i] = y.pressure[i] + q[i];
  }
};

struct PressureSensorGain {
  static constexpr EffectInfo kInfo{
      .id = "pressure_sensor_gain",
      .term = "pressure sensor gain",
      .where = Subsystem::kSensor,
      .equation = "(1 + g_i) p_i",
      .parameter_count = 2,
      .parameters = {{"g1", "-", 1, -0.5, 0.5, 0.03}, {"g2", "-", 1, -0.5, 0.5, 0.03}},
      .state_count = 0,
      .torque_term = false,
      .linear = true,
      .confused_with = "pressure_gain_error, pressure",
      .told_apart_by = "torque agrees with the measured pressure or not",
      .hook = Hook::kReading};
  template <class S>
  static void reading(const S* q, const S&, const S*, Readings<S>& y) noexcept {
    for (int i = 0; i < 2; ++i) y.pressure[i] = (S(1.0) + q[i]) * y.pressure[i];
  }
};

struct EncoderOffset {
  static constexpr EffectInfo kInfo{.id = "encoder_offset",
                                    .term = "middle position off",
                                    .where = Subsystem::kSensor,
                                    .equation = "phi + phi0",
                                    .parameter_count = 1,
                                    .parameters = {{"phi0", "rad", 1, -0.5, 0.5, 0.02}},
                                    .state_count = 0,
                                    .torque_term = false,
                                    .linear = true,
                                    .confused_with = "torque_offset, gravity_imbalance",
                                    .told_apart_by = "scales with the stiffness",
                                    .hook = Hook::kReading};
  template <class S>
  static void reading(const S* q, const S&, const S*, Readings<S>& y) noexcept {
    y.angle = y.angle + q[0];
  }
};

struct EncoderGain {
  static constexpr EffectInfo kInfo{.id = "encoder_gain",
                                    .term = "encoder gain",
                                    .where = Subsystem::kSensor,
                                    .equation = "(1 + g) phi",
                                    .parameter_count = 1,
                                    .parameters = {{"g", "-", 1, -0.5, 0.5, 0.02}},
                                    .state_count = 0,
                                    .torque_term = false,
                                    .linear = true,
                                    .confused_with = "stiffness, lever_arm_variation",
                                    .told_apart_by = "a known angle; the fit of A absorbs it",
                                    .hook = Hook::kReading};
  template <class S>
  static void reading(const S* q, const S&, const S*, Readings<S>& y) noexcept {
    y.angle = (S(1.0) + q[0]) * y.angle;
  }
};

struct EncoderDrift {
  static constexpr EffectInfo kInfo{.id = "encoder_drift",
                                    .term = "encoder drift",
                                    .where = Subsystem::kSensor,
                                    .equation = "phi + d t",
                                    .parameter_count = 1,
                                    .parameters = {{"d", "rad/s", 1, -0.1, 0.1, 1e-4}},
                                    .state_count = 0,
                                    .torque_term = false,
                                    .linear = true,
                                    .confused_with = "creep, thermal_drift",
                                    .told_apart_by = "stays after the return to the start",
                                    .hook = Hook::kReading};
  template <class S>
  static void reading(const S* q, const S& t, const S*, Readings<S>& y) noexcept {
    y.angle = y.angle + q[0] * t;
  }
};

struct EncoderSlip {
  static constexpr EffectInfo kInfo{
      .id = "encoder_slip",
      .term = "encoder slips once",
      .where = Subsystem::kSensor,
      .equation = "phi + s for t >= t_s",
      .parameter_count = 2,
      .parameters = {{"s", "rad", 1, -1, 1, 0.01}, {"t_s", "s", 1, 0, 1e6, 10, kAnyValue}},
      .state_count = 0,
      .torque_term = false,
      .linear = false,
      .confused_with = "encoder_offset, spikes",
      .told_apart_by = "one jump that stays",
      .hook = Hook::kReading};
  template <class S>
  static void reading(const S* q, const S& t, const S*, Readings<S>& y) noexcept {
    if (t >= q[1]) y.angle = y.angle + q[0];
  }
};

struct EncoderPlay {
  static constexpr EffectInfo kInfo{.id = "encoder_play",
                                    .term = "play of the encoder's coupling",
                                    .where = Subsystem::kSensor,
                                    .equation = "phi -> z, z follows phi with play b",
                                    .parameter_count = 1,
                                    .parameters = {{"b", "rad", 1, 0, 0.2, 0.003}},
                                    .state_count = 1,
                                    .torque_term = false,
                                    .linear = false,
                                    .confused_with = "backlash, coulomb_friction",
                                    .told_apart_by = "the loop has its width in angle, also without load",
                                    .hook = Hook::kReading};
  template <class S>
  static void reading(const S* q, const S&, const S* z, Readings<S>& y) noexcept {
    y.angle = clamp<S>(z[0], y.angle - q[0], y.angle + q[0]);
  }
  template <class S>
  static void step(const S* q, const Readings<S>& y, S* z) noexcept {
    z[0] = clamp<S>(z[0], y.angle - q[0], y.angle + q[0]);
  }
  template <class S>
  static void rest(const S*, const Readings<S>& y, S* z) noexcept {
    z[0] = y.angle;
  }
};

struct TimeSkew {
  static constexpr EffectInfo kInfo{.id = "time_skew",
                                    .term = "signals recorded at different times",
                                    .where = Subsystem::kSensor,
                                    .equation = "phi(t - d)",
                                    .parameter_count = 1,
                                    .parameters = {{"d", "s", 1, -0.1, 0.1, 0.004}},
                                    .state_count = 0,
                                    .torque_term = false,
                                    .linear = false,
                                    .confused_with = "viscous_damping, sensor_lag, backlash",
                                    .told_apart_by = "the angle's phase, not the force's",
                                    .hook = Hook::kDelay};
  template <class S>
  static S delay(const S* q) noexcept {
    return q[0];
  }
};

struct Spikes {
  static constexpr EffectInfo kInfo{
      .id = "spikes",
      .term = "outliers",
      .where = Subsystem::kSensor,
      .equation = "F_i +- h in a share s of the samples",
      .parameter_count = 2,
      .parameters = {{"s", "-", 1, 0, 0.5, 0.01}, {"h", "N", 1, 0, 1e3, 60, kAnyValue}},
      .state_count = 0,
      .torque_term = false,
      .linear = false,
      .confused_with = "encoder_slip, mains_hum",
      .told_apart_by = "single samples",
      .hook = Hook::kOutlier};
};

/// Half of it on either bridge with opposite signs: what they pick up alike cancels in the torque.
struct MainsHum {
  static constexpr EffectInfo kInfo{.id = "mains_hum",
                                    .term = "mains hum, 50 or 60 Hz",
                                    .where = Subsystem::kSensor,
                                    .equation = "F2 - F1 + s sin(2 pi f t) + c cos(2 pi f t)",
                                    .parameter_count = 3,
                                    .parameters = {{"s", "N", 1, -100, 100, 0.5},
                                                   {"c", "N", 1, -100, 100, 0.5},
                                                   {"f", "Hz", 1, 45, 65, 50, kAnyValue}},
                                    .state_count = 0,
                                    .torque_term = false,
                                    .linear = false,
                                    .confused_with = "periodic_disturbance",
                                    .told_apart_by = "its frequency, and there at rest",
                                    .hook = Hook::kReading};
  template <class S>
  static void reading(const S* q, const S& t, const S*, Readings<S>& y) noexcept {
    using std::cos;
    using std::sin;
    const S turn = S(2.0 * kPi) * q[2] * t;
    const S half = (q[0] * sin(turn) + q[1] * cos(turn)) / S(2.0);
    y.force[0] = y.force[0] - half;
    y.force[1] = y.force[1] + half;
  }
};

using SensorEffects = EffectList<ForceOffset, ForceGainError, ForceDrift, ForceSaturation, SensorLag,
                                 PressureOffset, PressureSensorGain, EncoderOffset, EncoderGain, EncoderDrift,
                                 EncoderSlip, EncoderPlay, TimeSkew, Spikes, MainsHum>;

}  // namespace isac::models::effect
