// What is said of a parameter that the rows cannot tell, and that it takes nothing from the others.
#include "isac/explain/uncertainty.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "isac/explain/explain.hpp"
#include "isac/explain/fit.hpp"
#include "prepared_day.hpp"

namespace isac::explain {
namespace {

struct Day : test::PreparedDay {
  Day(const test::TiedRig& rig, std::uint32_t first)
      : PreparedDay(
            rig,
            {test::clamped(20, 0.1, 1.2, 6), test::by_hand(20, 0.5, 1.5), test::free_in_steps(16, 4, 0.8)},
            2.0, first) {}
  [[nodiscard]] Uncertain beside(const Hypothesis& h, const Values& start, Values* found = nullptr) const {
    const Fit fit = refit(predictor, baseline, {{&h, start}}, weights, 12);
    if (found != nullptr) *found = fit.model.effects.back().values;
    return uncertainties(predictor, fit, weights);
  }
};

double error_of(const std::vector<Estimated>& parameters, const std::string& name) {
  for (const Estimated& e : parameters)
    if (e.name == name) return e.std_error;
  return kNotKnown;
}

// A torque of any size within A r² half a step is how the encoder may be read: T_0 has that error too, of a value alike anywhere.
TEST(Uncertainty, of_a_torque_contains_how_the_encoder_is_read_within_its_step) {
  Day day(test::TiedRig{.offset = 0.02}, 100);
  const double half = 0.5 * day.data.rig.angle_step, r = day.data.rig.wheel_radius;
  tolerate(day.library, day.data, "encoder_offset", 0, 0);
  const Fit stem = fit_baseline(day.predictor, day.library.tolerances, day.weights);
  const Fit fit = refit(day.predictor, stem, {{&day.hypothesis("torque_offset"), {0.02}}}, day.weights, 12);
  const double noise = uncertainties(day.predictor, fit, day.weights).effects[0][0].std_error;
  tolerate(day.library, day.data, "encoder_offset", -half, half);
  const Uncertain within = uncertainties(day.predictor, fit, day.weights);
  const double reading = std::abs(fit.model.base[0]) * r * r * half / std::sqrt(3.0);
  EXPECT_GT(reading, 3 * noise);
  EXPECT_NEAR(within.effects[0][0].std_error, std::hypot(noise, reading), 0.05 * reading);
}

// An encoder that is read at the lower end of its steps stands half of one off: no effect, and the answer says what it took it for.
TEST(HowTheRecorderCounts, is_told_and_not_named) {
  test::TiedRig rig;
  rig.offset = 0.5 * rig.facts().angle_step * -rig.A * rig.radius * rig.radius;  // as good as half a step
  const Explanation e =
      explain(test::record_all(rig, {test::clamped(20, 0.1, 1.2, 6), test::by_hand(20, 0.5, 1.5),
                                     test::by_hand(20, 0.4, 2.5), test::free_in_steps(16, 4, 0.8)}),
              {}, {.rig = rig.facts(), .traces = false, .next_experiment = false});
  EXPECT_EQ(e.verdict, Verdict::kNone) << e.summary;
  EXPECT_TRUE(std::any_of(e.trials.begin(), e.trials.end(), [](const TrialNote& note) {
    return note.id == "encoder_offset" && note.sentence.find("how the recorder counts") != std::string::npos;
  }));
}

TEST(Uncertainty, of_a_leak_is_as_if_the_muscle_that_would_rather_gain_air_were_not_asked) {
  test::TiedRig rig;
  rig.leak[1] = 0.012;
  Values found{};
  for (std::uint32_t first = 100; first < 130; first += 10) {
    const Day day(rig, first);
    const Hypothesis& both = day.hypothesis("leak_per_muscle");
    const Uncertain with = day.beside(both, {0.001, 0.01}, &found);
    if (found[0] != 0) continue;  // the noise let it leak a little
    Hypothesis one = both;
    one.free[0] = false;
    const Uncertain without = day.beside(one, {0.0, 0.01});
    EXPECT_EQ(with.effects[0][0].value, 0);
    EXPECT_TRUE(std::isnan(with.effects[0][0].std_error) && std::isnan(with.effects[0][0].ci_low));
    EXPECT_EQ(with.effects[0][0].reason, "at the end of its range");
    EXPECT_EQ(with.effects[0][1].reason, "");
    EXPECT_NEAR(with.effects[0][1].std_error / without.effects[0][1].std_error, 1, 0.02);
    for (const char* name : {"K_C", "T_C"})
      EXPECT_NEAR(error_of(with.base, name) / error_of(without.base, name), 1, 0.02) << name;
    return;
  }
  FAIL() << "on no day did the tight muscle stand at its bound";
}

TEST(Uncertainty, of_a_stop_that_no_run_reached_is_told_as_such_and_its_place_is_kept) {
  const Day day(test::TiedRig{}, 100);
  const Uncertain u = day.beside(day.hypothesis("end_stop"), {1.0, 2.5, -0.3});
  EXPECT_EQ(u.effects[0][1].name, "phi_high");
  EXPECT_EQ(u.effects[0][1].value, 2.5);
  EXPECT_TRUE(std::isnan(u.effects[0][1].std_error));
  EXPECT_EQ(u.effects[0][1].reason, "these runs do not tell it");
}

TEST(Uncertainty, of_two_zeros_of_which_only_the_difference_shows_leaves_the_others_theirs) {
  const Day day(test::TiedRig{.offset = 0.006}, 100);
  const Hypothesis& both = day.hypothesis("force_offset");
  Hypothesis one = both;
  one.free[1] = false;
  const Uncertain u = day.beside(both, {0.1, -0.2}), alone = day.beside(one, {0.1, 0.0});
  for (const Estimated& e : u.effects[0]) {
    EXPECT_TRUE(std::isnan(e.std_error));
    EXPECT_EQ(e.reason.rfind("only b1 − b2 = ", 0), 0U) << e.reason;
  }
  EXPECT_NEAR(u.effects[0][0].value - u.effects[0][1].value, alone.effects[0][0].value, 0.02);
  for (const char* name : {"A", "B", "C", "D"})
    EXPECT_NEAR(error_of(u.base, name) / error_of(alone.base, name), 1, 0.02) << name;
}

}  // namespace
}  // namespace isac::explain
