#include "dataset.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <charconv>
#include <cmath>
#include <fstream>
#include <set>

#include "day_parts.hpp"
#include "label.hpp"

namespace blind {
namespace {

void expect_the_truth(const Dataset& d, double of_lag, double left) {
  // The derivative's rule over five rows leaves (31 · 2 ms)⁴/30 of the velocity in free decays; C leans on the fastest.
  EXPECT_NEAR(d.base.A / d.rig.A, 1.0, 1e-5);
  EXPECT_NEAR(d.base.B / d.rig.B, 1.0, 1e-5);
  EXPECT_NEAR(d.base.C / d.rig.C, 1.0, 5e-3);
  EXPECT_NEAR(d.base.D / d.rig.D, 1.0, 1e-3);
  EXPECT_NEAR(d.base.K_C / d.rig.K_C, 1.0, 1e-6);
  EXPECT_NEAR(d.base.T_C / d.rig.T_C, 1.0, of_lag);
  // What is left is far below any noise.
  EXPECT_LT(strength_of(d.gap, d.noise, d.rig).ratio, left);
}

TEST(Dataset, gives_the_truth_back_when_nothing_is_hidden) {
  for (const std::uint64_t seed : {1u, 2u, 3u}) expect_the_truth(make_dataset({.seed = seed}), 1e-5, 0.06);
}

TEST(Dataset, hides_effects_at_the_strength_that_was_asked_for) {
  struct Asked {
    const char *id, *noise;
    double ratio;
  };
  const Asked asked[] = {{"coulomb_friction", "white", 0.25},  {"sensor_lag", "coloured", 0.75},
                         {"bearing_friction", "quantised", 2}, {"dead_time", "white", 0.25},
                         {"supply_droop", "coloured", 2},      {"force_saturation", "quantised", 0.75}};
  for (const auto& [id, noise, ratio] : asked) {
    const Dataset d = make_dataset({.seed = 31, .ids = {id}, .ratio = ratio, .noise = noise});
    ASSERT_EQ(d.not_testable, "") << id << ratio;
    EXPECT_NEAR(strength_of(d.gap, d.noise, d.rig).ratio / ratio, 1.0, 0.1) << id << " " << noise;
  }
}

TEST(Dataset, says_that_damping_which_the_base_model_has_cannot_be_hidden) {
  for (const char* id : {"viscous_damping", "cubic_damping"})
    EXPECT_EQ(make_dataset({.seed = 4, .ids = {id}, .ratio = 0.25}).not_testable, id);
}

TEST(Dataset, refuses_an_effect_that_does_not_exist) {
  EXPECT_THROW(make_dataset({.ids = {"gremlins"}}), std::invalid_argument);
}

TEST(Dataset, hides_two_effects_each_at_its_own_strength) {
  const Dataset d = make_dataset({.seed = 6, .ids = {"torque_ripple", "leak"}});
  ASSERT_EQ(d.hidings.size(), 2u);
  EXPECT_NEAR(d.hidings[0].ratio, 0.75, 0.04);
  EXPECT_NEAR(d.hidings[1].ratio, 0.75, 0.04);
  EXPECT_NE(d.hidings[0].signal, d.hidings[1].signal);
}

void expect_a_day(const std::vector<RunPlan>& runs, std::size_t count) {
  int rows = 0, heldout = 0;
  double before = -1.0;
  std::set<std::string> fitted, kept;
  for (const RunPlan& run : runs) {
    rows += run.rows();
    heldout += run.heldout;
    (run.heldout ? kept : fitted).insert(run.experiment);
    EXPECT_GT(run.started, before) << "runs of one day, one after another";
    before = run.started + run.rows() * kRowTime;
  }
  EXPECT_EQ(runs.size(), count);
  EXPECT_EQ(heldout, 5);
  EXPECT_NEAR(rows * kRowTime, 600.0, 30.0);
  EXPECT_EQ(fitted, kept);
  EXPECT_EQ(fitted, (std::set<std::string>{"constant-pressure", "constant-angle", "free", "pcu-step"}));
}

TEST(Dataset, has_ten_minutes_in_fifteen_runs_of_every_kind_of_which_five_are_held_out) {
  Random random(8);
  expect_a_day(draw_day(Rig{}, random), 15);
}

TEST(Dataset, has_another_day_by_a_protocol_whose_first_test_comes_again_at_the_end) {
  Random random(8);
  const Rig rig = draw_other_rig(random);
  const std::vector<RunPlan> runs = draw_protocol_day(rig, random);
  expect_a_day(runs, 17);
  EXPECT_EQ(runs.front().hand, runs.back().hand);
  EXPECT_EQ(runs.front().command_1, runs.back().command_1);
  EXPECT_GT(runs.back().started - runs.front().started, 600.0);
  for (const RunPlan& run : runs)
    for (const double angle : run.hand) ASSERT_LE(std::abs(angle), reach(rig, 0.0, rig.p0 + 0.7)) << run.name;
}

TEST(Dataset, gives_the_truth_of_another_joint_back_from_a_day_by_a_protocol) {
  for (const std::uint64_t seed : {1u, 2u}) {
    const Dataset d = make_dataset({.seed = seed, .day = "protocol"});
    EXPECT_NE(d.rig.r, Rig{}.r);
    expect_the_truth(d, 1e-4, 0.12);
  }
}

TEST(Dataset, refuses_a_day_that_does_not_exist) {
  EXPECT_THROW(make_dataset({.day = "sunday"}), std::invalid_argument);
}

class Folder {
 public:
  explicit Folder(const std::string& name)
      : path_(std::filesystem::temp_directory_path() /
              ("blind_dataset_test_" + name + std::to_string(getpid()))) {}
  ~Folder() { std::filesystem::remove_all(path_); }
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

std::string text_of(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

TEST(Dataset, is_the_same_for_the_same_seed_and_another_for_another) {
  std::string texts[3];
  const std::uint64_t seeds[] = {5, 5, 6};
  for (int i = 0; i < 3; ++i) {
    const Folder folder(std::to_string(i));
    const Dataset d = make_dataset({.seed = seeds[i], .ids = {"spikes"}});
    write_dataset(d, folder.path());
    for (const RunPlan& run : d.runs)
      texts[i] += text_of((run.heldout ? folder.path() / "heldout" : folder.path()) / (run.name + ".csv"));
  }
  EXPECT_TRUE(texts[0] == texts[1]);
  EXPECT_FALSE(texts[0] == texts[2]);
}

TEST(Dataset, writes_every_number_rounded_as_the_standard_library_rounds_it) {
  const Folder folder("digits");
  const Dataset d = make_dataset({.seed = 9});
  const std::vector<Signals> noisy = write_dataset(d, folder.path());
  const auto text = [](double x, int digits) {
    char buffer[40];
    return std::string(
        buffer, std::to_chars(buffer, buffer + sizeof buffer, x, std::chars_format::fixed, digits).ptr);
  };
  const RunPlan& run = d.runs.front();
  std::ifstream in((run.heldout ? folder.path() / "heldout" : folder.path()) / (run.name + ".csv"));
  std::string line;
  for (int i = 0; i < 3; ++i) std::getline(in, line);
  std::size_t rows = 0;
  for (; std::getline(in, line); ++rows) {
    const Signals& s = noisy.front();
    const std::string cells = text(s.angle[rows], 8) + "," + text(s.p1[rows], 6) + "," + text(s.p2[rows], 6) +
                              "," + text(run.command_1[rows], 5) + "," + text(run.command_2[rows], 5) + "," +
                              text(s.F1[rows], 4) + "," + text(s.F2[rows], 4);
    ASSERT_EQ(line.substr(line.find(',') + 1), cells) << "row " << rows;
  }
  EXPECT_EQ(rows, noisy.front().angle.size());
}

TEST(Dataset, writes_recordings_that_say_what_was_done_and_when_and_nothing_of_what_is_hidden) {
  const Folder folder("files");
  const Dataset d = make_dataset({.seed = 5, .ids = {"creep"}});
  write_dataset(d, folder.path());
  int files = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder.path())) {
    if (!entry.is_regular_file()) continue;
    ++files;
    const std::string text = text_of(entry.path());
    EXPECT_EQ(text.find("creep"), std::string::npos);
    if (entry.path().extension() != ".csv") continue;
    EXPECT_EQ(text.rfind("# experiment: ", 0), 0u);
    EXPECT_NE(text.find("\n# started: 2003-05-14T"), std::string::npos);
    EXPECT_NE(
        text.find(
            "time [s],angle [rad],p1 [kg/cm2],p2 [kg/cm2],p1_cmd [kg/cm2],p2_cmd [kg/cm2],F1 [N],F2 [N]\n"),
        std::string::npos);
  }
  EXPECT_EQ(files, 16);
}

}  // namespace
}  // namespace blind
