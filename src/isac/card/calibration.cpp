#include "isac/card/calibration.hpp"

#include "isac/core/units.hpp"
#include "isac/simulate/rig_config.hpp"

namespace isac::card {

std::vector<record::RigChannel> default_calibration(double force_range) {
  simulate::SensorConfig sensors;
  sensors.force_range = force_range;
  const simulate::Wiring wiring = simulate::nominal_wiring(sensors);
  const auto channel = [](const char* signal, const char* name, const simulate::ChannelTruth& truth) {
    return record::RigChannel{.signal = signal, .channel = name, .offset = truth.offset, .gain = truth.gain};
  };
  return {{.signal = "angle",
           .channel = "enc0",
           .offset = wiring.encoder_middle,
           .gain = 2 * kPi / wiring.encoder_steps},
          channel("F1", "ai0", wiring.force[0]),
          channel("F2", "ai2", wiring.force[1]),
          channel("p1", "ai4", wiring.pressure[0]),
          channel("p2", "ai6", wiring.pressure[1]),
          channel("p1_cmd", "ao0", wiring.valve[0]),
          channel("p2_cmd", "ao1", wiring.valve[1])};
}

std::vector<record::RigChannel> default_calibration() {
  return default_calibration(simulate::SensorConfig{}.force_range);
}

}  // namespace isac::card
