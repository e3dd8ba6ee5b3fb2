// Built where libcomedi is missing.
#include "isac/card/comedi_card.hpp"
#include "isac/core/error.hpp"

namespace isac::card {

Opened open_comedi(const SignalTable&, std::unique_ptr<ComediClock>) {
  throw Error(ErrorKind::kStopped, "comedi_not_built",
              "this program was built without libcomedi; install libcomedi-dev and build it again");
}

}  // namespace isac::card
