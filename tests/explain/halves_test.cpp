// Is an effect the same in both halves of what varies?
#include "isac/explain/halves.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "isac/explain/compare.hpp"
#include "prepared_day.hpp"

namespace isac::explain {
namespace {

/// A day by hand at three pressures.
struct Day : test::PreparedDay {
  explicit Day(const test::TiedRig& rig, std::uint32_t first = 1) : PreparedDay(rig, runs(), 4.0, first) {}
  static std::vector<PlannedRun> runs() {
    std::vector<PlannedRun> all = {test::by_hand(16, 0.5, 1.5), test::by_hand(16, 0.4, 2.5),
                                   test::by_hand(16, 0.45, 2.0)};
    all[0].mean_pressure_kgcm2 = 3.5;
    all[1].mean_pressure_kgcm2 = 2.5;
    return all;
  }
  [[nodiscard]] Fit fitted(const char* id) {
    const Hypothesis& h = hypothesis(id);
    const std::vector<Active> effects = {{&h, h.shapes.front()}};
    Fit fit = refit(predictor, baseline, effects, weights);
    // The noise is white, and its density that of what the effect leaves: a zero that wanders would take a constant torque.
    for (const Chain chain : {Chain::kTorque, Chain::kPressure1, Chain::kPressure2})
      weights.colour[static_cast<int>(chain)] = {
          .white = noise_density(data, fit.residual).of[static_cast<int>(chain)]};
    return fit;
  }
  [[nodiscard]] std::vector<Halves> halves(const Fit& fit) const {
    return halves_of(around(predictor, fit, weights), fit.tolerances);
  }
};

const Halves& in(std::string_view where, const std::vector<Halves>& halves) {
  const auto found =
      std::find_if(halves.begin(), halves.end(), [&](const Halves& h) { return h.where == where; });
  if (found == halves.end()) throw std::out_of_range(std::string(where));
  return *found;
}

constexpr const char* kDirection = "in one direction of motion and in the other";
constexpr const char* kPressure = "at low and at high mean pressure";

TEST(Halves, of_a_friction_that_is_the_same_throughout_differ_by_noise_only) {
  constexpr int kDays = 200;
  int beyond = 0, asked = 0;
  double sum = 0;
  for (std::uint32_t day = 0; day < kDays; ++day) {
    Day d({.dry = 0.03}, 1 + 3 * day);
    const std::vector<Halves> halves = d.halves(d.fitted("coulomb_friction"));
    ASSERT_FALSE(halves.empty());
    EXPECT_FALSE(differs_by_half(halves.front())) << halves.front().where << halves.front().sigma;
    for (const Halves& h : halves) {
      beyond += h.sigma > 1.645;
      sum += h.sigma;
      ++asked;
    }
  }
  EXPECT_GE(asked, 8 * kDays);
  EXPECT_NEAR(static_cast<double>(beyond) / asked, 0.05, 0.015);
  EXPECT_NEAR(sum / asked, 0.0, 0.1);
}

TEST(Halves, of_a_friction_beside_a_constant_torque_differ_by_direction) {
  Day day({.dry = 0.03, .offset = 0.006});
  const std::vector<Halves> halves = day.halves(day.fitted("coulomb_friction"));
  const Halves& direction = in(kDirection, halves);
  EXPECT_TRUE(differs_by_half(direction)) << direction.sigma;
  // A friction of 0.036 one way and 0.024 the other: a fifth of itself more than on the whole.
  EXPECT_NEAR(direction.share, 0.2, 0.03);
}

TEST(Halves, of_a_friction_that_goes_with_the_pressure_differ_by_pressure) {
  Day day({.dry = 0.03, .load_exponent = 1});
  const std::vector<Halves> halves = day.halves(day.fitted("coulomb_friction"));
  EXPECT_EQ(halves.front().where, kPressure);
  EXPECT_TRUE(differs_by_half(halves.front())) << halves.front().sigma;
  EXPECT_FALSE(differs_by_half(in(kDirection, halves)));
  const std::vector<Halves> right = day.halves(day.fitted("pressure_dependent_friction"));
  EXPECT_FALSE(differs_by_half(right.front())) << right.front().where << right.front().sigma;
}

TEST(Halves, are_asked_of_no_effect_of_the_valves_nor_of_one_that_does_nothing) {
  Day day({.dry = 0.03});
  const Hypothesis &friction = day.hypothesis("coulomb_friction"), &leak = day.hypothesis("leak");
  const auto with = [&](const Hypothesis& h, const Values& values) {
    Fit fit = day.baseline;
    fit.model.effects.push_back({&h, values});
    return fit;
  };
  EXPECT_TRUE(day.halves(with(friction, null_values(friction, friction.shapes.front()))).empty());
  EXPECT_FALSE(day.halves(with(friction, friction.shapes.front())).empty());
  EXPECT_TRUE(day.halves(with(leak, leak.shapes.front())).empty());
}

}  // namespace
}  // namespace isac::explain
