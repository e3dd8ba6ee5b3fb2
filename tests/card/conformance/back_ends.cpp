#include "back_ends.hpp"

#include <cmath>
#include <memory>
#include <ostream>

#ifdef ISAC_HAVE_COMEDI
#include "../comedi_fake.hpp"
#endif
#include "isac/card/calibration.hpp"
#include "isac/card/replay_card.hpp"
#include "isac/card/sim_arm.hpp"
#include "isac/card/sim_card.hpp"
#include "isac/card/sim_options.hpp"

namespace isac::test {

namespace {

UnderTest open_simulated(const std::string& options) {
  auto rig = std::make_shared<simulate::Rig>(card::parse_sim(options));
  const auto vented = [rig] { return rig->commanded() == std::array<double, 2>{}; };
  return {.opened = card::open_sim(rig), .vented = vented};
}

series::Recording recording(bool raw) {
  series::Recording r;
  r.source = "made by the test";
  series::Column time{"time", "s", {}}, first{"", "", {}}, second{"", "", {}}, out{"", "", {}};
  if (raw) {
    first = {"enc0", "count", {}}, second = {"ai2", "count", {}}, out = {"ao1", "count", {}};
  } else {
    first = {"angle", "rad", {}}, second = {"F2", "N", {}}, out = {"p2_cmd", "Pa", {}};
  }
  for (int k = 0; k < 3000; ++k) {
    time.values.push_back(0.002 * k);
    first.values.push_back(raw ? 500 * std::sin(0.01 * k) : 0.4 * std::sin(0.01 * k));
    second.values.push_back(raw ? 2000 + k % 100 : 95 + k % 50);
    out.values.push_back(raw ? 100 + k % 10 : 2e5);
  }
  r.columns = {time, first, second, out};
  return r;
}

UnderTest open_replayed(bool raw) {
  auto card = std::make_unique<card::ReplayCard>(recording(raw));
  UnderTest test;
  test.vented = [report = card->report()] { return report->vents > 0; };
  test.opened.card = std::move(card);
  return test;
}

#ifdef ISAC_HAVE_COMEDI
/// A table of data/cards on fake boards; the valves are looked at behind the card's back.
UnderTest open_fake_comedi(const std::string& name, const FakeBoard& first, const FakeBoard& second,
                           const char* valves, int subdevice) {
  boards().clear();
  add_board("/dev/comedi0", first);
  add_board("/dev/comedi1", second);
  UnderTest test;
  test.opened = card::open_comedi(
      card::read_signal_table(std::string(ISAC_SOURCE_DIR) + "/data/cards/" + name + ".toml"),
      std::make_unique<FakeClock>());
  test.vented = [valves, subdevice] { return boards().at(valves).closed(subdevice); };
  return test;
}
#endif

}  // namespace

std::ostream& operator<<(std::ostream& out, const BackEnd& back_end) {
  return out << back_end.name;
}

std::vector<BackEnd> back_ends() {
  return {
      {"sim", false, [] { return open_simulated(""); }},
      {"sim_without_jitter", false, [] { return open_simulated("jitter=off,noise=none"); }},
      {"sim_with_tubes_friction_and_drops", false,
       [] {
         return open_simulated(
             "dead_time=0.03,effect=coulomb_friction:0.3,effect=hysteresis,drop=0.05,miscalibrated");
       }},
      {"sim_arm", false,
       [] {
         const card::SimArmConfig config =
             card::parse_sim_arm("arm=" + std::string(ISAC_SOURCE_DIR) + "/data/arms/right_soft_arm.toml");
         auto plant = std::make_shared<simulate::ArmPlant>(config.plant);
         UnderTest test;
         test.vented = [plant] {
           for (const auto& muscles : plant->commanded())
             if (muscles.muscle_1 != 0 || muscles.muscle_2 != 0) return false;
           return true;
         };
         test.opened.card = std::make_unique<card::SimArmCard>(plant, config.encoder_zero);
         return test;
       }},
      {"replay_of_codes", true, [] { return open_replayed(true); }},
      {"replay_of_physical_columns", true, [] { return open_replayed(false); }},
#ifdef ISAC_HAVE_COMEDI
      {"comedi_testbed", false,
       [] { return open_fake_comedi("testbed", controller_board(), labpc_board(), "/dev/comedi0", 1); }},
      {"comedi_soft_arm", false,
       [] { return open_fake_comedi("soft_arm", controller_board(), labpc_board(), "/dev/comedi0", 1); }},
      {"comedi_s626_and_pci1724", false,
       [] { return open_fake_comedi("s626_pci1724", s626_board(), pci1724_board(), "/dev/comedi1", 0); }},
#endif
  };
}

}  // namespace isac::test
