#include <cmath>

#include "isac/simulate/random.hpp"
#include "isac/simulate/rig_config.hpp"

namespace isac::simulate {

Wiring nominal_wiring(const SensorConfig& sensors) noexcept {
  constexpr double kInputCodes = 4096;  // 12 bit over 0 … 10 V
  constexpr double kHalfVolt = 205;     // nearest code to 0.5 V
  constexpr double kTenthVolt = 41;     // the amplifiers reach down to 0.1 V only (table E.4)
  constexpr double kValveRange = 5 * kPascalPerKgfCm2 / 4095;
  Wiring w;
  w.force.fill({.gain = sensors.force_range / kInputCodes, .offset = kHalfVolt});
  w.pressure.fill({.gain = sensors.pressure_range / kInputCodes, .offset = kTenthVolt});
  w.valve.fill({.gain = kValveRange, .offset = 0});
  return w;
}

Wiring wiring_of(const RigConfig& config) noexcept {
  Wiring w = nominal_wiring(config.sensors);
  if (!config.miscalibrated) return w;
  Random random(config.seed, Random::kCalibration);
  for (auto* pair : {&w.force, &w.pressure, &w.valve}) {
    for (auto& channel : *pair) channel.gain *= random.uniform(0.97, 1.03);
  }
  for (auto& channel : w.force) channel.offset += std::round(random.uniform(-25, 25));
  for (auto& channel : w.pressure) channel.offset += std::round(random.uniform(-25, 25));
  for (auto& channel : w.valve) channel.offset += std::round(random.uniform(-10, 10));
  w.encoder_middle = std::round(random.uniform(-400, 400));
  return w;
}

}  // namespace isac::simulate
