/// @file
/// Comedi boards of a few lines, linked in place of libcomedi: what the kernel's drivers do to a caller, made on purpose.
///
/// As the kernel does it: a failed instruction ends its list with −1; a write above the converter's range is refused and the old
/// value stays; outputs keep their value when a handle is closed; comedi_to_phys is NaN at both ends unless told otherwise.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "isac/card/comedi_card.hpp"

namespace isac::test {

struct FakeRange {
  double min = 0, max = 10;
  unsigned unit = 0;  ///< UNIT_volt, UNIT_mA
};

struct FakeSubdevice {
  int type = 0;  ///< COMEDI_SUBD_AI …
  int channels = 0;
  std::uint32_t maxdata = 4095;
  std::vector<FakeRange> ranges;
  std::vector<std::uint32_t> value;  ///< set to `channels` zeros by add()
};

struct FakeBoard {
  std::string driver;
  std::vector<FakeSubdevice> subdevices;
  int fail_subdevice = -1, fail_channel = -1;  ///< whose readings fail with `fail_errno`
  int fail_errno = 110;                        ///< ETIMEDOUT
  bool fail_writes = false, empty_slot = false;
  int lists = 0, instructions = 0, configurations = 0, open_handles = 0;
  std::vector<std::uint32_t> last_configuration;
  std::map<unsigned, unsigned> range_read;  ///< of a channel, with its last reading
  [[nodiscard]] bool closed(int subdevice, std::uint32_t code = 0) const {
    for (const std::uint32_t value : subdevices[static_cast<std::size_t>(subdevice)].value)
      if (value != code) return false;
    return true;
  }
};

/// The machine's boards by path; a test adds and removes them.
std::map<std::string, FakeBoard>& boards();
FakeBoard& add_board(const std::string& path, FakeBoard board);

/// The three shapes of data/cards.
FakeBoard controller_board();
FakeBoard labpc_board();
FakeBoard s626_board();
FakeBoard pci1724_board();

/// Time that passes only when somebody waits.
class FakeClock final : public card::ComediClock {
 public:
  [[nodiscard]] std::int64_t now_ns() const noexcept override { return now_; }
  void sleep_until(std::int64_t time_ns) noexcept override {
    if (time_ns > now_) now_ = time_ns;
  }

 private:
  std::int64_t now_ = 0;
};

}  // namespace isac::test
