#include "plant.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "baseline.hpp"
#include "catalogue.hpp"

namespace blind {
namespace {

/// A joint let go at `angle`, both muscles at p0.
RunPlan let_go(double angle, double seconds) {
  RunPlan run;
  run.experiment = "free";
  run.free = true;
  run.release_angle = angle;
  run.command_1.assign(static_cast<std::size_t>(seconds * kRate), 3.0);
  run.command_2 = run.command_1;
  return run;
}

/// A few short runs of every kind.
std::vector<RunPlan> short_day(const Rig& rig) {
  Random random(9);
  std::vector<RunPlan> runs = draw_day(rig, random);
  for (RunPlan& run : runs) {
    for (auto* column : {&run.hand, &run.hand_velocity, &run.command_1, &run.command_2})
      column->resize(std::min<std::size_t>(column->size(), 6000));
  }
  return runs;
}

bool same(const Signals& a, const Signals& b) {
  return a.angle == b.angle && a.p1 == b.p1 && a.p2 == b.p2 && a.F1 == b.F1 && a.F2 == b.F2;
}

TEST(Plant, keeps_the_energy_of_a_free_joint_without_damping) {
  Rig rig;
  rig.C = rig.D = 0.0;
  const Signals s = simulate(rig, let_go(0.5, 10.0), Hidden{});
  const double stiffness = -rig.A * rig.r * rig.r, omega = std::sqrt(stiffness / rig.inertia);
  // Fifty swings at 10 kHz: Runge-Kutta loses (ω h)⁵/144 of the amplitude's share per radian, below 1e-10 in all, and
  // its phase is off by t ω (ω h)⁴/120, below 1e-9.
  for (std::size_t k = 0; k < s.angle.size(); k += 7)
    ASSERT_NEAR(s.angle[k], 0.5 * std::cos(omega * static_cast<double>(k) * kRowTime), 1e-7) << k;
}

TEST(Plant, takes_out_of_a_free_joint_the_energy_that_damping_takes) {
  Rig rig;
  rig.C = 0.0;
  const Signals s = simulate(rig, let_go(0.5, 1.5), Hidden{});
  const double k = -rig.A * rig.r * rig.r, decay = rig.D / (2.0 * rig.inertia);
  const double omega = std::sqrt(k / rig.inertia - decay * decay);
  for (std::size_t i = 0; i < s.angle.size(); ++i) {
    const double t = static_cast<double>(i) * kRowTime;
    const double exact =
        0.5 * std::exp(-decay * t) * (std::cos(omega * t) + decay / omega * std::sin(omega * t));
    ASSERT_NEAR(s.angle[i], exact, 1e-7) << t;
  }
}

TEST(Plant, loses_the_same_angle_at_every_half_swing_to_dry_friction_and_then_sticks) {
  Rig rig;
  rig.C = rig.D = 0.0;
  Hidden hidden;
  hidden.bearing = 0.2;
  const Signals s = simulate(rig, let_go(0.5, 6.0), hidden);
  const double stiffness = -rig.A * rig.r * rig.r, lost = 2.0 * hidden.bearing / stiffness;
  std::vector<double> turns = {0.5};
  for (std::size_t k = 1; k + 1 < s.angle.size(); ++k)
    if ((s.angle[k] - s.angle[k - 1]) * (s.angle[k + 1] - s.angle[k]) < 0.0)
      turns.push_back(std::abs(s.angle[k]));
  ASSERT_GT(turns.size(), 5u);
  // A row may miss the turning point by 1 ms: φ (ω · 1 ms)²/2 = 0.05 % of the angle.
  for (std::size_t i = 1; i < 6; ++i) EXPECT_NEAR(turns[i], turns[i - 1] - lost, 6e-4) << i;
  EXPECT_EQ(s.angle.back(), s.angle[s.angle.size() - 500]) << "it stands still";
  EXPECT_LE(std::abs(s.angle.back()) * stiffness, hidden.bearing);
}

TEST(Plant, holds_a_stuck_joint_by_the_friction_inside_the_muscles) {
  Hidden hidden;
  hidden.coulomb = 1.0;
  const Rig rig;
  const Signals s = simulate(rig, let_go(0.05, 1.0), hidden);  // 0.42 N m of stiffness, less than friction
  EXPECT_EQ(s.angle.back(), 0.05);
  EXPECT_NEAR(s.F2.back() - s.F1.back(), 0.0, 1e-9) << "what the muscles give to the joint is nothing";
}

TEST(Plant, lets_a_joint_go_no_further_beyond_its_stop_than_a_hand_holds_it) {
  const Rig rig;
  Hidden hidden;
  hidden.stop_stiffness = 200.0;
  hidden.stop_angle = 0.3;
  hidden.stop_side = 1;
  EXPECT_NEAR(simulate(rig, let_go(0.7, 0.5), hidden, 1e-4).angle.front(), 0.4, 2e-3);  // 20 N m
  EXPECT_NEAR(simulate(rig, let_go(-0.7, 0.5), hidden, 1e-4).angle.front(), -0.7,
              2e-3);  // no stop on that side
  EXPECT_NEAR(simulate(rig, let_go(0.7, 0.5), Hidden{}, 1e-4).angle.front(), 0.7, 2e-3);
}

TEST(Plant, does_not_depend_on_its_step) {
  const Rig rig;
  Hidden hidden;
  hidden.hysteresis = 0.2;
  hidden.hysteresis_reach = 0.05;
  hidden.coulomb = 0.05;
  hidden.second_lag = 0.02;
  for (const RunPlan& run : short_day(rig)) {
    const Signals coarse = simulate(rig, run, hidden, 1e-4), fine = simulate(rig, run, hidden, 5e-5);
    for (std::size_t k = 0; k < coarse.angle.size(); ++k) {
      // A tenth of an encoder step, a hundredth of the noise of forces and pressures.
      ASSERT_NEAR(coarse.angle[k], fine.angle[k], 8e-5) << run.experiment << k;
      ASSERT_NEAR(coarse.F1[k], fine.F1[k], 0.02) << run.experiment << k;
      ASSERT_NEAR(coarse.p1[k], fine.p1[k], 4e-5) << run.experiment << k;
    }
  }
}

TEST(Plant, answers_a_step_of_the_valve_with_a_first_order_lag_after_its_dead_time) {
  Rig rig;
  Hidden hidden;
  hidden.dead_time = 0.0123;
  RunPlan run = let_go(0.0, 2.0);
  run.free = false;
  run.hand.assign(run.command_1.size(), 0.0);
  run.hand_velocity = run.hand;
  for (std::size_t k = 100; k < run.command_1.size(); ++k) run.command_1[k] = 4.0;
  const Signals s = simulate(rig, run, hidden);
  for (std::size_t k = 0; k < s.p1.size(); ++k) {
    const double t = static_cast<double>(k) * kRowTime - 0.2 - hidden.dead_time;
    // The step that holds the change takes its mean: off by (h/T_C)²/8.
    ASSERT_NEAR(s.p1[k], t > 0.0 ? 4.0 - std::exp(-t / rig.T_C) : 3.0, 1e-6) << t;
  }
}

TEST(Plant, gives_the_same_bits_for_every_effect_that_is_off) {
  const Rig rig;
  const std::vector<RunPlan> runs = short_day(rig);
  std::vector<Signals> plain;
  for (const RunPlan& run : runs) plain.push_back(simulate(rig, run, Hidden{}, 1e-3));
  for (const Effect& one : effects()) {
    Random random(21);
    Hidden hidden;
    one.apply(hidden, 0.0, one.draw(random));
    for (std::size_t i = 0; i < runs.size(); ++i)
      ASSERT_TRUE(same(simulate(rig, runs[i], hidden, 1e-3), plain[i]))
          << one.id << " in " << runs[i].experiment;
  }
}

TEST(Plant, changes_the_recording_for_every_effect_that_is_on) {
  const Rig rig;
  const std::vector<RunPlan> runs = short_day(rig);
  for (const Effect& one : effects()) {
    Random random(21);
    Hidden hidden;
    one.apply(hidden, one.largest, one.draw(random));
    bool changed = false;
    for (const RunPlan& run : runs)
      changed = changed || !same(simulate(rig, run, hidden, 1e-3), simulate(rig, run, Hidden{}, 1e-3));
    EXPECT_TRUE(changed) << one.id;
  }
}

TEST(Plant, shows_an_effect_of_the_joint_to_no_force_sensor_of_a_driven_run) {
  const Rig rig;
  const std::vector<RunPlan> runs = short_day(rig);
  for (const Effect& one : effects()) {
    if (one.subsystem != "joint" || one.id == "backlash") continue;  // play moves the wheel, so the muscles
    Random random(21);
    Hidden hidden;
    one.apply(hidden, one.largest, one.draw(random));
    for (const RunPlan& run : runs) {
      if (run.free) continue;
      ASSERT_TRUE(same(simulate(rig, run, hidden, 1e-3), simulate(rig, run, Hidden{}, 1e-3))) << one.id;
    }
  }
}

}  // namespace
}  // namespace blind
