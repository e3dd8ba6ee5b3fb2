#include "isac/record/plan_file.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "isac/core/error.hpp"

namespace isac::record {
namespace {

constexpr double kKgf = kPascalPerKgfCm2;

bool same(double a, double b) {
  return a == b || (std::isnan(a) && std::isnan(b));
}

void expect_same(const series::PlanRun& a, const series::PlanRun& b) {
  EXPECT_EQ(a.experiment, b.experiment);
  EXPECT_EQ(a.waveform, b.waveform);
  for (double series::PlanRun::*field :
       {&series::PlanRun::duration, &series::PlanRun::delta_pressure, &series::PlanRun::mean_pressure,
        &series::PlanRun::amplitude, &series::PlanRun::middle, &series::PlanRun::peak_speed,
        &series::PlanRun::pressure_swing, &series::PlanRun::pressure_period})
    EXPECT_TRUE(same(a.*field, b.*field)) << a.*field << " " << b.*field;
}

TEST(PlanFile, reads_what_a_person_writes) {
  const series::Plan plan = read_plan(std::filesystem::path(ISAC_SOURCE_DIR) / "fixtures/plan/friction.toml");
  ASSERT_EQ(plan.runs.size(), 5U);
  EXPECT_EQ(plan.separates, (std::vector<std::string>{"coulomb_friction", "pressure_dependent_friction"}));
  EXPECT_EQ(plan.runs[0].experiment, "constant-pressure");
  EXPECT_EQ(plan.runs[0].mean_pressure, 2 * kKgf);
  EXPECT_EQ(plan.runs[1].middle, 0.05);
  EXPECT_TRUE(std::isnan(plan.runs[2].mean_pressure));  // the rig's
  EXPECT_EQ(plan.runs[3].waveform, "steps");
  EXPECT_EQ(plan.runs[4].pressure_period, 8);
}

TEST(PlanFile, writes_round_numbers_as_a_person_would) {
  series::Plan plan;
  plan.runs.push_back({.experiment = "free", .duration = 60, .pressure_swing = 0.6 * kKgf});
  const std::string text = format_plan(plan);
  EXPECT_NE(text.find("duration = \"60.0 s\""), std::string::npos) << text;
  EXPECT_NE(text.find("pressure_swing = \"0.6 kg/cm2\""), std::string::npos) << text;
  EXPECT_EQ(text.find("amplitude"), std::string::npos) << "what is as usual is not written";
}

TEST(PlanFile, reads_back_the_same_bits_of_any_plan) {
  std::mt19937_64 random(7);
  const auto uniform = [&random](double low, double high) {
    return low + (high - low) * static_cast<double>(random() >> 11) * 0x1.0p-53;
  };
  const char* experiments[] = {"constant-pressure", "constant-angle", "free", "pcu-step"};
  const char* waveforms[] = {"", "triangle", "sine", "steps", "hold"};
  for (int round = 0; round < 200; ++round) {
    series::Plan plan{.reason = "because \"it\" \\ must", .separates = {"a", "b"}};
    for (int i = 0; i <= round % 4; ++i) {
      plan.runs.push_back({.experiment = experiments[random() % 4],
                           .duration = uniform(1, 3000),
                           .delta_pressure = uniform(-2, 2) * kKgf,
                           .mean_pressure = random() % 2 == 0 ? std::nan("") : uniform(1, 4) * kKgf,
                           .amplitude = uniform(0.01, 1),
                           .middle = random() % 2 == 0 ? std::nan("") : uniform(-1, 1),
                           .peak_speed = uniform(0.01, 6),
                           .pressure_swing = random() % 2 == 0 ? 0 : uniform(0.01, 1) * kKgf,
                           .pressure_period = uniform(0.1, 60),
                           .waveform = waveforms[random() % 5]});
    }
    const series::Plan back = parse_plan(format_plan(plan), "plan.toml");
    EXPECT_EQ(back.reason, plan.reason);
    EXPECT_EQ(back.separates, plan.separates);
    ASSERT_EQ(back.runs.size(), plan.runs.size());
    for (std::size_t i = 0; i < plan.runs.size(); ++i) expect_same(back.runs[i], plan.runs[i]);
  }
}

}  // namespace
}  // namespace isac::record
