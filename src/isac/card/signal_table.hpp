/// @file
/// Which signal of the card hangs on which Comedi channel: a table of rows (`isac.data/1`), one per wire.
///
///   signal     enc0 … enc5, ai0 … ai7, ao0 … ao11; each kind without gaps from 0; heartbeat, on a digital output
///   device     "/dev/comedi0"; signals may be spread over several devices
///   driver     the driver that must be behind it ("s626"); checked where given
///   subdevice, channel   as the driver counts them
///   range      "0..10 V", "4..20 mA": looked up among the driver's ranges by its ends, so that nothing depends on an index;
///              not for encoders and the heartbeat
///   reference  ground (default), common, differential, other
///   vented     for ao: the driver's code at which the valve is closed, 0 where not given; code 0 of the card is that code
///   setup      for enc: "preload" (s626) or "quadrature x4" (NI) is sent before the first reading; else nothing
/// The widths of converters and counters come from the driver, never from the table.
///
/// Units: none; codes are the driver's. Real time: start-up. Threads: pure. Errors: isac::Error (bad input) with the file,
/// the row, what was found and what would do. Source: seed C.4, C.5, E.1.4; data/cards. Example: `read_signal_table(path)`.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace isac::card {

struct SignalLine {
  enum class Kind { kEncoder, kInput, kOutput, kHeartbeat } kind = Kind::kInput;
  int index = 0;
  std::string signal;  ///< "ai3"
  std::string device, driver;
  unsigned subdevice = 0, channel = 0;
  double range_low = 0, range_high = 0;
  enum class Unit { kNone, kVolt, kMilliampere } unit = Unit::kNone;
  enum class Reference { kGround, kCommon, kDifferential, kOther } reference = Reference::kGround;
  std::uint32_t vented = 0;
  enum class Setup { kNone, kPreload, kQuadratureX4 } setup = Setup::kNone;
  std::string range_text;
};

struct SignalTable {
  std::string file, title;
  std::vector<SignalLine> lines;  ///< encoders, inputs, outputs, each in order, then the heartbeat
  [[nodiscard]] int count(SignalLine::Kind kind) const noexcept;
};

[[nodiscard]] SignalTable read_signal_table(const std::filesystem::path& path);
[[nodiscard]] SignalTable parse_signal_table(const std::string& text, const std::string& file);

}  // namespace isac::card
