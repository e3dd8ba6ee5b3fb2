#include "isac/simulate/sensors.hpp"

#include <algorithm>
#include <cmath>

#include "isac/core/units.hpp"

namespace isac::simulate {

namespace {

NoiseLevel level(const SensorConfig& config, double sigma, double hum) noexcept {
  NoiseLevel n;
  if (config.noise == NoiseKind::kNone) return n;
  const double slow = config.noise == NoiseKind::kColoured ? config.slow_share : 0;
  n.white = sigma * std::sqrt(1 - slow);
  n.coloured = sigma * std::sqrt(slow);
  n.time_constant = config.slow_time_constant;
  n.hum = hum;
  n.hum_hz = config.hum_hz;
  return n;
}

double amplifier_lag(const SensorConfig& config) noexcept {
  return config.bandwidth > 0 ? 1 / (2 * kPi * config.bandwidth) : 0;
}

std::uint32_t to_code(double physical, const ChannelTruth& channel) noexcept {
  const double code = std::floor(physical / channel.gain + channel.offset + 0.5);
  return static_cast<std::uint32_t>(std::clamp(code, 0.0, static_cast<double>(Sensors::kMaxCode)));
}

}  // namespace

Sensors::Sensors(const RigConfig& config)
    : wiring_(wiring_of(config)),
      noise_kind_(config.sensors.noise),
      effects_(config),
      force_lag_{FirstOrderLag(amplifier_lag(config.sensors)), FirstOrderLag(amplifier_lag(config.sensors))},
      pressure_lag_(force_lag_),
      force_noise_{SensorNoise(level(config.sensors, config.sensors.force_noise, config.sensors.force_hum),
                               config.seed, Random::kForce1),
                   SensorNoise(level(config.sensors, config.sensors.force_noise, config.sensors.force_hum),
                               config.seed, Random::kForce2)},
      pressure_noise_{SensorNoise(level(config.sensors, config.sensors.pressure_noise, 0), config.seed,
                                  Random::kPressure1),
                      SensorNoise(level(config.sensors, config.sensors.pressure_noise, 0), config.seed,
                                  Random::kPressure2)} {}

void Sensors::track(const PlantState& state) noexcept {
  const double t = state.time;
  for (std::size_t i = 0; i < 2; ++i) {
    const double force = weight_ ? *weight_ : state.force[i];
    const double pressure = supply_ ? *supply_ : state.pressure[i];
    if (!started_) {
      force_lag_[i].reset(t, force);
      pressure_lag_[i].reset(t, pressure);
    }
    amplified_.force[i] = force_lag_[i].update(t, force);
    amplified_.pressure[i] = pressure_lag_[i].update(t, pressure);
  }
  started_ = true;
  amplified_.angle = state.joint.angle;
  if (effects_.any()) effects_.track(t, amplified_, state.joint.velocity);
}

Codes Sensors::convert(const PlantState& state) noexcept {
  Codes codes;
  Readings seen = amplified_;
  seen.angle = state.joint.angle;
  if (effects_.any()) seen = effects_.apply(state.time, seen);
  for (std::size_t i = 0; i < 2; ++i) {
    double force = seen.force[i], pressure = seen.pressure[i];
    if (noise_kind_ != NoiseKind::kNone) {
      force += force_noise_[i].sample(state.time);
      pressure += pressure_noise_[i].sample(state.time);
    }
    codes.input[kForceInput[i]] = to_code(force, wiring_.force[i]);
    codes.input[kPressureInput[i]] = to_code(pressure, wiring_.pressure[i]);
  }
  const double count = std::floor(seen.angle / (2 * kPi) * wiring_.encoder_steps + wiring_.encoder_middle);
  codes.encoder = static_cast<std::uint32_t>(static_cast<std::int64_t>(count)) % kEncoderModulus;
  return codes;
}

}  // namespace isac::simulate
