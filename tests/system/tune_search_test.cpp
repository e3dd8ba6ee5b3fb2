// isac-tune's default, the search, on the simulated rig: half a minute of one core.
#include "tune_folder.hpp"

namespace isac {
namespace {

using TuneSearch = test::TuneFolder;

TEST_F(TuneSearch, relay_and_search_end_in_gains_that_hold_their_limits_and_track_better_than_before) {
  const test::Run run = tune({"--method", "relay", "--card", "sim:seed=4", "-o", folder_ / "params.toml",
                              "--json", folder_ / "answer.json", "--draws", "60"});
  ASSERT_EQ(run.exit_code, 0) << run.out << run.err;
  const auto a = answer();
  EXPECT_EQ(a["verdict"], "tuned");
  EXPECT_GE(a["figures"]["within_limits_share"].get<double>(), 0.95);
  const double least = 0.1 * a["gains"]["K_P_position"]["value"].get<double>();  // --least-integral
  EXPECT_GE(a["gains"]["K_I_position"]["value"].get<double>(), least);
  const auto& before = a["candidates"][0];
  ASSERT_EQ(before["name"], "before");
  EXPECT_LT(a["figures"]["tracking_rms"]["value"].get<double>(),
            0.5 * before["figures"]["tracking_rms"]["value"].get<double>());  // 49 against 145 mrad
}

}  // namespace
}  // namespace isac
