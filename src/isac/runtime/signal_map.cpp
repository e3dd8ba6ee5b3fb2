#include "isac/runtime/signal_map.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "isac/card/calibration.hpp"
#include "isac/core/error.hpp"
#include "isac/core/units.hpp"

namespace isac::runtime {
namespace {

/// The number behind `prefix` in a channel's name ("ai4" → 4), or −1.
int channel_number(const std::string& channel, const std::string& prefix, int channels) {
  if (channel.rfind(prefix, 0) != 0 || channel.size() == prefix.size()) return -1;
  char* end = nullptr;
  const long number = std::strtol(channel.c_str() + prefix.size(), &end, 10);
  return *end == '\0' && number >= 0 && number < channels ? static_cast<int>(number) : -1;
}

}  // namespace

SignalMap::SignalMap(const record::Rig& rig, const card::Shape& shape)
    : shape_(shape),
      radian_per_count_(2.0 * kPi / rig.encoder.steps_per_turn),
      middle_(rig.encoder.middle_count) {
  if (shape.encoders < 1) {
    throw Error(ErrorKind::kStopped, "card_without_encoder", "the card has no encoder; choose another card");
  }
  for (const record::RigChannel& channel : rig.calibration) {
    if (channel.signal != "angle") continue;
    const int number = channel_number(channel.channel, "enc", shape.encoders);
    if (number < 0 || !std::isfinite(channel.gain) || channel.gain == 0.0) {
      throw Error(ErrorKind::kBadInput, "calibration_channel",
                  "the rig file puts angle on channel '" + channel.channel +
                      "', which the card does not have or whose gain is no number; it has enc0 to enc" +
                      std::to_string(shape.encoders - 1));
    }
    encoder_ = static_cast<std::size_t>(number);
    radian_per_count_ = channel.gain;
    middle_ = channel.offset;
  }
  const std::vector<record::RigChannel> channels =
      rig.calibration.empty() ? card::default_calibration() : rig.calibration;
  struct Wanted {
    const char* signal;
    Line* line;
    bool output;
  };
  for (const Wanted& wanted : {Wanted{"p1", &p1_, false},
                               {"p2", &p2_, false},
                               {"F1", &F1_, false},
                               {"F2", &F2_, false},
                               {"p1_cmd", &p1_cmd_, true},
                               {"p2_cmd", &p2_cmd_, true}}) {
    const auto found = std::find_if(channels.begin(), channels.end(), [&](const record::RigChannel& channel) {
      return channel.signal == wanted.signal;
    });
    if (found == channels.end()) {
      throw Error(ErrorKind::kBadInput, "calibration_missing",
                  std::string("the rig file calibrates no channel for ") + wanted.signal +
                      "; add a [[calibration]] entry with signal = \"" + wanted.signal + "\"");
    }
    wanted.line->channel = channel_number(found->channel, wanted.output ? "ao" : "ai",
                                          wanted.output ? shape.outputs : shape.inputs);
    wanted.line->offset = found->offset;
    wanted.line->gain = found->gain;
    if (wanted.line->channel < 0 || !std::isfinite(found->gain) || found->gain == 0.0) {
      throw Error(ErrorKind::kBadInput, "calibration_channel",
                  std::string("the rig file puts ") + wanted.signal + " on channel '" + found->channel +
                      "', which the card does not have or whose gain is no number; it has " +
                      (wanted.output ? "ao0 to ao" + std::to_string(shape.outputs - 1)
                                     : "ai0 to ai" + std::to_string(shape.inputs - 1)));
    }
    if (wanted.output) continue;
    const double at_zero = value(*wanted.line, 0), at_top = value(*wanted.line, shape.input_max_code);
    ranges_.push_back(
        {wanted.signal, std::min(at_zero, at_top), std::max(at_zero, at_top), std::abs(found->gain)});
  }
}

Physical SignalMap::to_physical(const card::Sample& sample) noexcept {
  // Counters wrap at the modulus; half of it is farther than any joint turns between two samples.
  const auto modulus = static_cast<std::int64_t>(shape_.encoder_modulus);
  const std::uint32_t count = sample.encoder[encoder_];
  if (!has_count_) {
    position_ = count;
    const double from_middle = static_cast<double>(position_) - middle_,
                 half = 0.5 * static_cast<double>(modulus);
    if (from_middle > half) position_ -= modulus;
    if (from_middle < -half) position_ += modulus;
    has_count_ = true;
  } else {
    std::int64_t moved = static_cast<std::int64_t>(count) - static_cast<std::int64_t>(last_count_);
    if (moved > modulus / 2) moved -= modulus;
    if (moved < -modulus / 2) moved += modulus;
    position_ += moved;
  }
  last_count_ = count;
  const auto input = [&sample](const Line& line) noexcept {
    return value(line, sample.input[static_cast<std::size_t>(line.channel)]);
  };
  return {.angle = (static_cast<double>(position_) - middle_) * radian_per_count_,
          .p1 = input(p1_),
          .p2 = input(p2_),
          .F1 = input(F1_),
          .F2 = input(F2_)};
}

std::uint32_t SignalMap::clamped(double code) const noexcept {
  const double wanted = std::round(code);
  if (!(wanted > 0.0)) return 0;  // NaN too
  return static_cast<std::uint32_t>(std::min(wanted, static_cast<double>(shape_.output_max_code)));
}

card::Command SignalMap::to_command(const series::Pressures& pressures) const noexcept {
  return to_command_of_codes({.p1 = pressures.p1 / p1_cmd_.gain + p1_cmd_.offset,
                              .p2 = pressures.p2 / p2_cmd_.gain + p2_cmd_.offset});
}

card::Command SignalMap::to_command_of_codes(const series::Pressures& codes) const noexcept {
  card::Command command;
  command.output[static_cast<std::size_t>(p1_cmd_.channel)] = clamped(codes.p1);
  command.output[static_cast<std::size_t>(p2_cmd_.channel)] = clamped(codes.p2);
  return command;
}

series::Pressures SignalMap::commanded(const card::Command& command) const noexcept {
  return {.p1 = value(p1_cmd_, command.output[static_cast<std::size_t>(p1_cmd_.channel)]),
          .p2 = value(p2_cmd_, command.output[static_cast<std::size_t>(p2_cmd_.channel)])};
}

}  // namespace isac::runtime
