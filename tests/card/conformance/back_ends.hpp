// The back ends that the conformance suite runs over; a new one adds a row in back_ends.cpp.
#pragma once

#include <functional>
#include <iosfwd>
#include <string>
#include <vector>

#include "isac/card/card.hpp"

namespace isac::test {

struct UnderTest {
  card::Opened opened;
  /// Seen from the rig's side of the card, also when the card is gone: the valves were closed and are (simulated rig), or
  /// a vent has reached the card (replay, which has no valves).
  std::function<bool()> vented;
};

struct BackEnd {
  std::string name;
  bool ends = false;  ///< runs out of data
  std::function<UnderTest()> open;
};

std::ostream& operator<<(std::ostream& out, const BackEnd& back_end);

[[nodiscard]] std::vector<BackEnd> back_ends();

}  // namespace isac::test
