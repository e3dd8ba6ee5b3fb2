// Dependence on one signal that has no formula, beside noise and beside what a whole run shares.
#include "isac/explain/curves.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <vector>

#include "isac/core/units.hpp"
#include "isac/explain/explain.hpp"
#include "prepared_day.hpp"

namespace isac::explain {
namespace {

const std::vector<PlannedRun> kDay = {test::by_hand(40, 0.5, 1.5), test::by_hand(40, 0.4, 2.5),
                                      test::clamped(30, 0.1, 1.2, 6)};

struct Bench {
  test::PreparedDay day;
  Floors floors;
  explicit Bench(std::uint32_t first = 1) : day(test::TiedRig{}, kDay, 2.0, first) {
    floors = floors_of(day.data);
  }
  [[nodiscard]] Curve clearest(const Eigen::VectorXd& residual, double material = 0.25) const {
    return clearest_curve(day.data, day.weights, floors, residual, material, 1);
  }
  /// The residual with `add(run, sample)` in its rows of torque, in σ.
  template <class Add>
  [[nodiscard]] Eigen::VectorXd with(Add&& add) const {
    Eigen::VectorXd r = day.baseline.residual;
    for (std::size_t i = 0; i < day.data.rows.size(); ++i) {
      const Row& row = day.data.rows[i];
      if (row.chain == Chain::kTorque) r[static_cast<Eigen::Index>(i)] += add(row.run, row.sample);
    }
    return r;
  }
};

TEST(Curves, of_fifteen_waves_a_turn_stand_out_of_noise_by_the_angle) {
  const Bench b;
  const Curve curve = b.clearest(
      b.with([&](unsigned run, unsigned k) { return 1.5 * std::sin(15 * b.day.data.runs[run].angle[k]); }));
  EXPECT_TRUE(stands_out(curve)) << curve.z;
  EXPECT_EQ(curve.variable, "angle");
  EXPECT_EQ(curve.chain, Chain::kTorque);
}

TEST(Curves, are_not_seen_in_noise) {
  for (std::uint32_t first = 1; first < 200; first += 20) {
    const Bench b(first);
    const Curve curve = b.clearest(b.day.baseline.residual, 0.1);
    EXPECT_FALSE(stands_out(curve)) << first << " " << curve.variable << " " << curve.z << " " << curve.size
                                    << " " << int(curve.chain);
  }
}

// A clamped run stands at one angle: what all of it shares is no dependence on that.
TEST(Curves, are_no_run_that_is_off_as_a_whole) {
  const Bench b;
  const Curve curve = b.clearest(b.with([](unsigned run, unsigned) { return run == 2 ? 3.0 : 0.0; }));
  EXPECT_FALSE(stands_out(curve)) << curve.variable << " " << curve.z;
}

// At an even speed of about a step for each sample the encoder's steps beat with the clock: its error is in the residual, and in the velocity.
TEST(Curves, are_no_beats_of_the_encoder_with_the_clock) {
  const auto found = [](double steps_for_each_sample) {
    Bench b;
    PreparedRun& run = b.day.data.runs[0];
    const double step = b.day.data.rig.angle_step, even = steps_for_each_sample * step / run.interval;
    const double turn = 2 * kPi * 9 * run.interval;  // 9 Hz
    for (std::size_t k = 0; k < run.velocity.size(); ++k)
      run.velocity[k] = even + 0.5 * step * turn / run.interval * std::cos(turn * static_cast<double>(k));
    return stands_out(b.clearest(b.with([&](unsigned r, unsigned k) {
      return r == 0 ? 3.0 * std::cos(turn * static_cast<double>(k)) : 0.0;
    })));
  };
  EXPECT_FALSE(found(1.01));
  EXPECT_FALSE(found(0.51));
  EXPECT_TRUE(found(0.8));  // a dependence on the speed like any other
}

TEST(Curves, below_what_matters_are_nothing) {
  const Bench b;
  const auto small =
      b.with([&](unsigned run, unsigned k) { return 0.3 * std::sin(15 * b.day.data.runs[run].angle[k]); });
  EXPECT_EQ(b.clearest(small).z, 0.0);
  EXPECT_TRUE(stands_out(b.clearest(small, 0.01)));  // though it is seen
}

// A ripple whose name is not to be considered.
TEST(Curves, that_no_name_fits_are_unknown_and_not_nothing) {
  const test::TiedRig rig;
  std::vector<series::Recording> runs = test::record_all(rig, kDay);
  for (series::Recording& run : runs) {
    std::vector<double>*angle = nullptr, *first = nullptr, *second = nullptr;
    for (series::Column& column : run.columns) {
      if (column.name == "angle") angle = &column.values;
      if (column.name == "F1") first = &column.values;
      if (column.name == "F2") second = &column.values;
    }
    for (std::size_t k = 0; k < angle->size(); ++k) {
      const double force = 0.012 / rig.radius * std::sin(15 * (*angle)[k] + 1);
      (*first)[k] -= 0.5 * force;
      (*second)[k] += 0.5 * force;
    }
  }
  ExplainOptions options{.rig = rig.facts(), .traces = false, .next_experiment = false};
  const Explanation named = explain(runs, {}, options);
  ASSERT_EQ(named.effects.size(), 1U) << named.summary;
  EXPECT_EQ(named.effects.front().id, "torque_ripple");
  options.excluded = {"torque_ripple"};
  const Explanation unnamed = explain(runs, {}, options);
  EXPECT_EQ(unnamed.verdict, Verdict::kUnknown) << unnamed.summary;
  ASSERT_TRUE(unnamed.unknown.has_value());
  EXPECT_EQ(unnamed.unknown->depends_on, std::vector<std::string>{"angle"});
}

}  // namespace
}  // namespace isac::explain
