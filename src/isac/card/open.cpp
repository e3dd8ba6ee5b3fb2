#include <array>
#include <memory>
#include <string>
#include <string_view>

#include "isac/card/card.hpp"
#include "isac/card/comedi_card.hpp"
#include "isac/card/replay_card.hpp"
#include "isac/card/sim_arm.hpp"
#include "isac/card/sim_card.hpp"
#include "isac/card/sim_options.hpp"
#include "isac/core/error.hpp"

namespace isac::card {

namespace {

/// A back end: its word before the colon, one line of help, and how the rest of the name opens it.
struct BackEnd {
  const char* scheme;
  const char* help;
  Opened (*open)(std::string_view rest);
};

constexpr std::array kBackEnds{
    BackEnd{"sim", "sim:OPTION=VALUE,...  the simulated testbed, in virtual time",
            [](std::string_view rest) {
              if (names_an_arm(rest)) return open_sim_arm(rest);
              return open_sim(std::make_shared<simulate::Rig>(parse_sim(rest)));
            }},
    BackEnd{"replay", "replay:FILE  a recording, row by row; writes are held against the recorded ones",
            [](std::string_view rest) {
              if (rest.empty()) {
                throw Error(ErrorKind::kUsage, "card_name",
                            "replay: needs a file behind it, like replay:run.csv.");
              }
              return open_replay(rest);
            }},
    BackEnd{"comedi", "comedi:TABLE.toml  hardware through Comedi, by a table of signals (data/cards)",
            [](std::string_view rest) {
              if (rest.empty() || rest.starts_with("/dev/")) {
                throw Error(ErrorKind::kUsage, "card_name",
                            "comedi: needs a table of signals behind it, which names the devices, like "
                            "comedi:data/cards/testbed.toml.");
              }
              return open_comedi(read_signal_table(std::string(rest)));
            }},
};

}  // namespace

Opened open(std::string_view name) {
  const auto colon = name.find(':');
  const std::string_view scheme = name.substr(0, colon);
  if (colon != std::string_view::npos) {
    for (const auto& back_end : kBackEnds) {
      if (scheme == back_end.scheme) return back_end.open(name.substr(colon + 1));
    }
  }
  std::string known;
  for (const auto& back_end : kBackEnds)
    known += (known.empty() ? "" : ", ") + std::string(back_end.scheme) + ":";
  throw Error(ErrorKind::kUsage, "card_name",
              "there is no card '" + std::string(name) + "'; a name begins with one of " + known + ".");
}

std::string open_help() {
  std::string help;
  for (const auto& back_end : kBackEnds) help += std::string(back_end.help) + "\n";
  return help + "Options of sim:\n" + sim_help() + "Options of sim:arm=FILE,... (the simulated arm)\n" +
         sim_arm_help();
}

}  // namespace isac::card
