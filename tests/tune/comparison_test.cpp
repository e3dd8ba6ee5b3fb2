// Ziegler-Nichols, Chien-Hrones-Reswick, the seed's own gains, its procedure, and the optimised ones on the same 200 joints.
#include <gtest/gtest.h>

#include <cstdio>
#include <string>
#include <vector>

#include "isac/core/units.hpp"
#include "isac/tune/assess.hpp"
#include "isac/tune/linear_step.hpp"
#include "isac/tune/optimise.hpp"
#include "isac/tune/procedure.hpp"
#include "isac/tune/rules.hpp"

namespace isac::tune {
namespace {

constexpr double kKg = kPascalPerKgfCm2;

Gains cascade(double kp, double ki, const control::PidGains<double>& inner) {
  Gains g;
  g.position = {.proportional = kp, .integral = ki};
  g.torque = inner;
  return g;
}
Gains pid(const control::PidGains<double>& k) {
  Gains g;
  g.structure = control::Structure::kPid;
  g.position = k;
  return g;
}
Gains pid_reported(double kp, double ki, double kd) {
  return pid({.proportional = kp * kKg, .integral = ki * kKg, .derivative = kd * kKg});
}

struct Row {
  std::string name;
  Gains gains;
  Assessment as_is, equal;
};

void print(const Row& row, const Assessment& a, const char* kind) {
  const Gains& g = row.gains;
  const double unit = g.structure == control::Structure::kPid ? kKg : 1.0;
  std::printf(
      "| %s | %s | %.3g, %.3g, %.3g; %.3g, %.3g | %.1f | %.1f | %.1f | %.1f | %.2f | %.2f | %.1f | %.0f | "
      "%.0f |\n",
      row.name.c_str(), kind, g.position.proportional / unit, g.position.integral / unit,
      g.position.derivative / unit, g.torque.proportional / kKg, g.torque.integral / kKg, 1e3 * a.tracking,
      1e3 * a.tracking_p95, 100 * a.overshoot, 100 * a.overshoot_p95, a.settling, a.modulus_p05,
      a.effort / kKg, 100 * a.stable_share, 100 * a.good_share);
}

TEST(Comparison, optimised_gains_track_better_than_every_rule_at_the_same_robustness) {
  const JointModel model = testbed_model();
  LagPlant plant;
  ASSERT_TRUE(ok(lag_plant(model, plant)));
  std::array<double, kDrawnParameters> errors{};
  errors.fill(0.03);
  const auto draws = draw_joints(model, independent(errors), 200, 7),
             design = draw_joints(model, independent(errors), 200, 8);
  const Limits limits;
  const auto critical = ultimate(plant_loop(model));
  ASSERT_TRUE(critical);
  const auto shape = step_shape(plant);
  const control::PidGains<double> seeds_inner{.proportional = 0.1 * kKg, .integral = 10 * kKg};
  const auto chr = [&](Aim aim, Overshoot o) {
    return pid(chien_hrones_reswick(shape, plant.gain, Form::kPid, aim, o));
  };

  std::vector<Row> rows = {
      {"seed's PI-MBPI, 5.3", cascade(4, 8, seeds_inner), {}, {}},
      {"seed's PID, ZN as run", pid_reported(0.4, 7, 0.08), {}, {}},
      {"seed's PID, CHR as run", pid_reported(0.2, 4, 0.0014), {}, {}},
      {"ZN, PID", pid(ziegler_nichols(*critical, Form::kPid)), {}, {}},
      {"CHR, reference, 0 %", chr(Aim::kReference, Overshoot::kNone), {}, {}},
      {"CHR, reference, 20 %", chr(Aim::kReference, Overshoot::kTwentyPercent), {}, {}},
      {"CHR, disturbance, 0 %", chr(Aim::kDisturbance, Overshoot::kNone), {}, {}},
      {"CHR, disturbance, 20 %", chr(Aim::kDisturbance, Overshoot::kTwentyPercent), {}, {}},
      {"ZN on PI-MBPI's outer loop", *tune_outer_by_ziegler_nichols(model, seeds_inner), {}, {}},
      {"seed's procedure, 6.3", *tune_by_procedure(model), {}, {}}};
  const Optimised mbpi = optimise(model, design, {rows[0].gains, rows.back().gains}, {.limits = limits});
  const Optimised best_pid = optimise(model, design, {rows[3].gains, rows[1].gains}, {.limits = limits});
  Gains measured = rows[0].gains;
  measured.structure = control::Structure::kCascade;
  const Optimised pipi = optimise(model, design, {measured}, {.limits = limits});
  std::printf("evaluations %d %d %d\n", mbpi.evaluations, best_pid.evaluations, pipi.evaluations);
  std::vector<Row> found = {{"optimised PI-MBPI", mbpi.gains, {}, {}},
                            {"optimised PID", best_pid.gains, {}, {}},
                            {"optimised PI-PI", pipi.gains, {}, {}}};
  std::printf(
      "| gains | | K_P, K_I, K_D; inner K_P, K_I | tracking | 95 %% | overshoot | 95 %% | settling | modulus "
      "5 %% | effort | stable | within |\n");
  for (Row& row : found) {
    row.as_is = assess(model, draws, row.gains, limits);
    print(row, row.as_is, "as is");
    // What was asked for: 95 % of joints that were not used in the search.
    EXPECT_EQ(row.as_is.stable_share, 1.0) << row.name;
    EXPECT_GE(row.as_is.good_share, 0.95) << row.name;
  }
  const double best = found[0].as_is.tracking;
  for (Row& row : rows) {
    row.as_is = assess(model, draws, row.gains, limits);
    print(row, row.as_is, "as is");
    EXPECT_TRUE(row.as_is.good_share < 0.95 || row.as_is.tracking > best) << row.name;
    const auto equal = brought_to_limits(draws, model, row.gains, limits);
    if (!equal) {
      std::printf("| %s | at the limits | no factor holds them |\n", row.name.c_str());
      continue;
    }
    Row scaled{row.name, *equal, {}, {}};
    scaled.equal = assess(model, draws, *equal, limits);
    print(scaled, scaled.equal, "at the limits");
    for (const Row& optimised : found) EXPECT_LT(optimised.as_is.tracking, scaled.equal.tracking) << row.name;
    // Not by a hair: the worst twentieth of the optimised joints tracks better than the mean of any rule's.
    EXPECT_LT(found[0].as_is.tracking_p95, scaled.equal.tracking) << row.name;
  }
}

}  // namespace
}  // namespace isac::tune
