// Steps of a valve unit alone, made from closed forms: what is named, what is left as a set, what is left alone.
#include "isac/explain/step_records.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>

#include "isac/core/error.hpp"
#include "isac/core/units.hpp"

namespace isac::explain {
namespace {

/// A fill of 3 kg/cm² at 200 Hz; `curve` goes from 0 to 1 and is given the seconds since the step at 0.3 s.
series::Recording fill(const std::function<double(double)>& curve, double noise, std::uint32_t seed,
                       double duration = 3) {
  std::mt19937 random(seed);
  std::normal_distribution<double> gauss;
  series::Recording out;
  out.source = "fill.csv";
  for (const char* name : {"time", "p1"}) out.columns.push_back({name, name[0] == 't' ? "s" : "Pa", {}});
  for (int k = 0; k < static_cast<int>(200 * duration); ++k) {
    const double t = k / 200.0;
    out.columns[0].values.push_back(t);
    out.columns[1].values.push_back(3 * kPascalPerKgfCm2 * (t > 0.3 ? curve(t - 0.3) : 0.0) +
                                    noise * kPascalPerKgfCm2 * gauss(random));
  }
  return out;
}

double lag(double t) {
  return 1 - std::exp(-t / 0.2);
}
double two_lags(double t) {
  return 1 - (0.2 * std::exp(-t / 0.2) - 0.1 * std::exp(-t / 0.1)) / 0.1;
}
/// 3.6 kg/cm² in a second until what is left would flow slower by itself.
double limited(double t) {
  constexpr double kRate = 3.6 / 3, kLag = 0.2, kEnd = (1 - kRate * kLag) / kRate;
  return t < kEnd ? kRate * t : 1 - kRate * kLag * std::exp(-(t - kEnd) / kLag);
}

Explanation said_of(const std::function<double(double)>& curve, std::uint32_t seed) {
  return explain_steps(std::vector<series::Recording>{fill(curve, 0.005, seed)});
}

TEST(StepRecords, are_pressures_without_a_joint) {
  series::Recording run = fill(lag, 0.005, 1);
  EXPECT_TRUE(only_pressures(std::vector<series::Recording>{run}));
  run.columns.push_back({"angle", "rad", run.columns[0].values});
  EXPECT_FALSE(only_pressures(std::vector<series::Recording>{run}));
  EXPECT_FALSE(only_pressures({}));
}

TEST(StepRecords, of_a_lag_alone_have_nothing_missing) {
  for (std::uint32_t seed = 1; seed <= 20; ++seed) {
    const Explanation e = said_of(lag, seed);
    EXPECT_EQ(e.verdict, Verdict::kNone) << seed << ": " << e.summary;
    EXPECT_TRUE(e.effects.empty());
  }
}

TEST(StepRecords, of_a_second_lag_name_it) {
  for (std::uint32_t seed = 1; seed <= 10; ++seed) {
    const Explanation e = said_of(two_lags, seed);
    ASSERT_EQ(e.effects.size(), 1U) << seed << ": " << e.summary;
    EXPECT_EQ(e.effects.front().id, "second_order_lag");
    // Two lags of 0.2 and 0.1 s trade against each other in the rise's middle; 15 % is what this noise leaves open.
    EXPECT_NEAR(e.effects.front().parameters.front().value, 0.1, 0.015) << seed;
    EXPECT_LT(e.gap.after, 0.006) << "the noise is left";
  }
}

TEST(StepRecords, of_a_limited_flow_name_its_rate) {
  for (std::uint32_t seed = 1; seed <= 10; ++seed) {
    const Explanation e = said_of(limited, seed);
    ASSERT_EQ(e.effects.size(), 1U) << seed << ": " << e.summary;
    EXPECT_EQ(e.effects.front().id, "flow_limit");
    EXPECT_EQ(e.effects.front().parameters.front().unit, "kg/(cm2 s)");
    EXPECT_NEAR(e.effects.front().parameters.front().value, 3.6, 0.05) << seed;
    EXPECT_EQ(e.verdict, Verdict::kNamed);
    EXPECT_TRUE(e.alternatives.empty());
  }
}

TEST(StepRecords, of_two_rates_are_called_unknown) {
  const Explanation e =
      said_of([](double t) { return 1 - 0.5 * std::exp(-t / 0.05) - 0.5 * std::exp(-t / 0.6); }, 1);
  EXPECT_EQ(e.verdict, Verdict::kUnknown) << e.summary;
  EXPECT_TRUE(e.effects.empty());
  ASSERT_TRUE(e.unknown.has_value());
  EXPECT_EQ(e.unknown->subsystem, "pcu");
}

TEST(StepRecords, that_swing_at_rest_say_so) {
  const Explanation e = said_of([](double t) { return lag(t) + (t > 0 ? 0.08 * std::sin(60 * t) : 0.0); }, 1);
  EXPECT_TRUE(e.effects.empty()) << e.summary;
  EXPECT_TRUE(std::any_of(e.warnings.begin(), e.warnings.end(),
                          [](const Warning& w) { return w.code == "swings_at_rest"; }));
}

TEST(StepRecords, without_a_step_are_refused) {
  EXPECT_THROW(said_of([](double) { return 0.0; }, 1), Error);
}

}  // namespace
}  // namespace isac::explain
