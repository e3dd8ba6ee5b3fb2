#include "isac/runtime/joint_wiring.hpp"

#include <algorithm>
#include <charconv>
#include <string>
#include <string_view>
#include <vector>

#include "isac/card/calibration.hpp"
#include "isac/core/error.hpp"
#include "isac/core/units.hpp"

namespace isac::runtime {
namespace {

constexpr std::uint32_t kTestbedMaxCode = 4095;

/// The number behind `prefix` in a channel's name ("ai4" → 4), or −1.
int channel_number(std::string_view channel, std::string_view prefix, int channels) {
  if (!channel.starts_with(prefix)) return -1;
  int number = -1;
  const char* end = channel.data() + channel.size();
  const auto [rest, error] = std::from_chars(channel.data() + prefix.size(), end, number);
  return error == std::errc() && rest == end && number >= 0 && number < channels ? number : -1;
}

class Wirer {
 public:
  Wirer(const record::Rig& rig, const card::Shape& shape)
      : shape_(shape),
        own_(!rig.calibration.empty()),
        channels_(own_ ? rig.calibration : card::default_calibration()) {}

  /// The calibrated line of `signal`, or one that is not wired.
  [[nodiscard]] CodeLine line(const std::string& signal, std::string_view prefix, int count) const {
    const auto found = std::find_if(channels_.begin(), channels_.end(),
                                    [&](const record::RigChannel& one) { return one.signal == signal; });
    if (found == channels_.end()) return {};
    const CodeLine line{.channel = channel_number(found->channel, prefix, count),
                        .offset = found->offset,
                        .gain = found->gain};
    // The testbed's calibration is a default: a card without one of its sensors simply has no such sensor.
    if (!own_ && line.channel < 0 && prefix == "ai") return {};
    if (line.channel < 0 || !std::isfinite(line.gain) || line.gain == 0.0) {
      throw Error(ErrorKind::kBadInput, "calibration_channel",
                  "the rig file puts " + signal + " on channel '" + found->channel +
                      "', which the card does not have or whose gain is no number; it has " +
                      std::to_string(count) + " channels of the kind '" + std::string(prefix) + "'");
    }
    return line;
  }
  [[nodiscard]] CodeLine input(const std::string& signal) const { return line(signal, "ai", shape_.inputs); }
  [[nodiscard]] CodeLine valve(const std::string& signal, int otherwise) const {
    CodeLine found = line(signal, "ao", shape_.outputs);
    if (found.wired()) return found;
    if (otherwise < 0 || otherwise >= shape_.outputs) {
      throw Error(ErrorKind::kBadInput, "calibration_missing",
                  "no output is calibrated for " + signal + "; add a [[calibration]] entry with signal = \"" +
                      signal + "\"");
    }
    // 0 … max → 4 … 20 mA → 0 … 5 kg/cm² (seed C.4), whatever the converter's width
    found.channel = otherwise;
    found.gain = 5.0 * kPascalPerKgfCm2 / static_cast<double>(shape_.output_max_code);
    return found;
  }

 private:
  card::Shape shape_;
  bool own_;
  std::vector<record::RigChannel> channels_;
};

}  // namespace

JointWiring wire_joints(const record::Rig& rig, const card::Shape& shape, int joints) {
  if (joints < 1 || joints > kMaxJoints) {
    throw Error(ErrorKind::kBadInput, "joints",
                "the parameters are of " + std::to_string(joints) + " joints; a card drives 1 to 6");
  }
  if (rig.calibration.empty() &&
      (shape.output_max_code != kTestbedMaxCode ||
       (shape.inputs > 0 && shape.input_max_code != kTestbedMaxCode)) &&
      joints == 1) {
    throw Error(
        ErrorKind::kBadInput, "calibration_missing",
        "the card's codes end at " + std::to_string(shape.output_max_code) +
            " and the testbed's calibration is for 4095; add [[calibration]] entries to the rig file");
  }
  const Wirer wirer(rig, shape);
  JointWiring wiring{.joints = joints, .shape = shape, .joint = {}};
  for (int k = 0; k < joints; ++k) {
    JointLines& lines = wiring.joint[static_cast<std::size_t>(k)];
    const bool one = joints == 1;
    const std::string number = std::to_string(k + 1);
    const auto name = [&](const char* signal, const char* join) {
      return one ? std::string(signal) : signal + std::string(join) + number;
    };
    lines.encoder = k;
    lines.radian_per_count = 2.0 * kPi / rig.encoder.steps_per_turn;
    lines.middle = rig.encoder.middle_count;
    // The testbed's own angle channel says no more than [encoder], which the rig file may set.
    const bool calibrated = !rig.calibration.empty();
    if (const CodeLine angle =
            calibrated ? wirer.line(one ? "angle" : "phi" + number, "enc", shape.encoders) : CodeLine{};
        angle.wired()) {
      lines.encoder = angle.channel;
      lines.radian_per_count = angle.gain;
      lines.middle = angle.offset;
    }
    if (lines.encoder >= shape.encoders) {
      throw Error(ErrorKind::kStopped, "card_without_encoder",
                  "the card has " + std::to_string(shape.encoders) + " encoders and joint " + number +
                      " needs one; choose another card or parameters of fewer joints");
    }
    lines.valve_1 = wirer.valve(name("p1_cmd", ""), one && calibrated ? -1 : 2 * k);
    lines.valve_2 = wirer.valve(name("p2_cmd", ""), one && calibrated ? -1 : 2 * k + 1);
    lines.p1 = wirer.input(name("p1", "_"));
    lines.p2 = wirer.input(name("p2", "_"));
    lines.F1 = wirer.input(name("F1", "_"));
    lines.F2 = wirer.input(name("F2", "_"));
  }
  return wiring;
}

}  // namespace isac::runtime
