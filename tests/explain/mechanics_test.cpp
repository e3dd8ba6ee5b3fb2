// Play and compliance: what the prediction makes of a joint that the encoder does not quite see.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <utility>

#include "experiment_bench.hpp"
#include "isac/explain/generic_fit.hpp"
#include "isac/explain/left_over.hpp"
#include "isac/explain/predict_parts.hpp"
#include "isac/explain/ranking.hpp"
#include "prepared_day.hpp"

namespace isac::explain {
namespace {

using test::Bench;
using test::by_hand;
using test::TiedRig;

struct Fitted {
  Values values{};
  double gain = 0;  ///< drop of the loss
};

Fitted fitted(const Bench& bench, const std::string& form) {
  const Around place = around(bench.predictor, bench.stem, bench.weights);
  Fitted best;
  for (const Hypothesis& h : bench.library.hypotheses) {
    if (h.info().id != form) continue;
    for (const Values& shape : h.shapes) {
      const Refined now = refine(place, h, shape);
      const double gain = place.residual.squaredNorm() - now.loss;
      if (gain > best.gain) best = {now.values, gain};
    }
  }
  return best;
}

TEST(EncoderPlay, of_little_more_than_a_step_comes_back) {
  TiedRig rig;
  rig.encoder_play = 0.0011;  // 1.4 steps of the encoder
  const Bench bench(rig, {by_hand(30, 0.35, 0.3), by_hand(30, 0.3, 1.0), by_hand(30, 0.35, 3.0)});
  const Fitted play = fitted(bench, "encoder_play");
  EXPECT_NEAR(play.values[0], rig.encoder_play, 0.08 * rig.encoder_play);
  EXPECT_GT(play.gain, fitted(bench, "coulomb_friction").gain + 100);  // ten sigma
}

// A leak of both alike is a valve unit of another gain and lag: wherever noise would put it, what one leaks more than the other is that one's.
TEST(Leak, of_one_muscle_is_not_told_as_one_of_both) {
  TiedRig rig;
  rig.leak[0] = 0.012;
  for (std::uint32_t first = 100; first < 160; first += 10) {
    const test::PreparedDay day(rig, {test::clamped(30, 0.1, 0.5, 12), test::clamped(30, -0.2, 0.8, 9)}, 4.0,
                                first);
    const Around place = around(day.predictor, day.baseline, day.weights);
    const Refined leak = refine(place, day.hypothesis("leak_per_muscle"), {0.03, 0.02});
    EXPECT_NEAR(leak.values[0], rig.leak[0], 0.1 * rig.leak[0]) << first;
    EXPECT_EQ(leak.values[1], 0) << first;
  }
}

TEST(Compliance, within_the_known_inertia_comes_back_although_nobody_saw_its_far_side_begin) {
  TiedRig rig;
  rig.far_inertia = 0.0035;
  const Bench bench(rig, {by_hand(30, 0.35, 1.0), test::free_in_steps(25, 1.7, 0.6),
                          test::free_in_steps(25, 2.9, 0.4), test::clamped(24, 0.1, 0.5, 12)});
  const Fitted within = fitted(bench, "series_elasticity_within");
  EXPECT_NEAR(within.values[0], rig.far_inertia, 0.15 * rig.far_inertia);
  EXPECT_NEAR(within.values[1], rig.far_hertz, 0.04 * rig.far_hertz);
  EXPECT_GT(within.gain, 1.05 * fitted(bench, "series_elasticity").gain);
  EXPECT_GT(within.gain, 1.2 * fitted(bench, "inertia_error").gain);
}

PlannedRun let_go(double seconds, double angle) {
  PlannedRun run = test::free_in_steps(seconds, 2.0, 0.0);
  run.middle_rad = angle;
  run.waveform = "hold";
  return run;
}

// A joint that is let go moves before the first sample, for all that a kernel leaves of it; its far side began at rest.
TEST(Compliance, is_told_by_joints_that_are_let_go) {
  TiedRig rig;
  rig.far_inertia = 0.0035;
  rig.far_hertz = 13;
  const Bench bench(rig, {by_hand(30, 0.35, 1.0), let_go(6, 0.5), let_go(6, -0.4), let_go(6, 0.3),
                          test::clamped(24, 0.1, 0.5, 12)});
  const Fitted within = fitted(bench, "series_elasticity_within");
  EXPECT_NEAR(within.values[0], rig.far_inertia, 0.05 * rig.far_inertia);
  EXPECT_NEAR(within.values[1], rig.far_hertz, 0.01 * rig.far_hertz);
  EXPECT_GT(within.gain, 1.3 * fitted(bench, "inertia_error").gain);
  // What the linear screen prefers lies where the refit gets there.
  const Screen s = screen(around(bench.predictor, bench.stem, bench.weights), bench.library, {.flips = 99});
  const auto begun = std::find_if(s.candidates.begin(), s.candidates.end(), [&](const Screened& c) {
    return bench.library.hypotheses[static_cast<std::size_t>(c.hypothesis)].info().id ==
           std::string("series_elasticity_within");
  });
  ASSERT_NE(begun, s.candidates.end());
  EXPECT_NEAR(begun->start[1], rig.far_hertz, 1.0);
}

TEST(ForceLag, of_a_third_of_a_sample_comes_back) {
  for (const double lag : {0.0006, 0.002, 0.006}) {
    TiedRig rig;
    rig.force_lag = lag;
    const Bench bench(
        rig, {by_hand(20, 0.35, 3.0), by_hand(20, 0.3, 1.0), test::clamped(20, 0.1, 1.2, 3, "steps")});
    EXPECT_NEAR(fitted(bench, "sensor_lag").values[0], lag, 0.1 * lag);
  }
}

TEST(ForceGain, gains_nothing_by_smoothing_the_noise_of_a_torque_that_is_smooth_already) {
  TiedRig rig;
  rig.known_inertia = 0.93 * rig.inertia;
  const Bench bench(rig, {by_hand(30, 0.35, 3.0), by_hand(30, 0.3, 1.0), test::clamped(30, 0.1, 1.2, 3),
                          test::free_in_steps(20, 1.7, 0.6), test::free_in_steps(20, 2.9, 0.4)});
  const double inertia = fitted(bench, "inertia_error").gain, forces = fitted(bench, "force_gain_error").gain;
  EXPECT_GT(inertia, 1000);
  EXPECT_NEAR(forces, inertia, 12) << "two gains are one inertia, and a parameter more";
}

TEST(Threshold, that_only_one_run_falls_below_comes_back) {
  TiedRig rig;
  rig.threshold = 0.3 * kPascalPerKgfCm2;
  PlannedRun low = test::clamped(20, 0.1, 0.9, 10);
  low.mean_pressure_kgcm2 = 1.1;
  PlannedRun lower = low;
  lower.mean_pressure_kgcm2 = 0.9;
  lower.pressure_swing_kgcm2 = 0.85;
  lower.seconds = 4;
  const Bench bench(rig, {by_hand(30, 0.35, 1.0), low, lower});
  EXPECT_NEAR(fitted(bench, "threshold_pressure").values[0], rig.threshold, 0.02 * rig.threshold);
}

/// What an effect adds to the rows of the torque beside a model, by its own sum and by the difference of two predictions.
void expect_it_adds_up(const Bench& bench, const ModelPoint& model, const Active& effect) {
  ASSERT_TRUE(bench.predictor.adds_up(model, *effect.hypothesis));
  const auto rows = static_cast<Eigen::Index>(bench.predictor.rows());
  Eigen::VectorXd added = Eigen::VectorXd::Zero(rows), without = added, with = added;
  bench.predictor.predict_addition(model, effect, added);
  bench.predictor.predict(model, bit(Chain::kTorque), without);
  ModelPoint both = model;
  both.effects.push_back(effect);
  bench.predictor.predict(both, bit(Chain::kTorque), with);
  const double largest = added.cwiseAbs().maxCoeff();
  EXPECT_GT(largest, 1e-3);
  EXPECT_LT((with - without - added).cwiseAbs().maxCoeff(), 1e-6 * largest);
}

TEST(ForceReadings, that_are_shifted_leave_a_torque_what_it_is_and_others_do_not) {
  const Bench bench(TiedRig{}, {by_hand(20, 0.35, 1.0), by_hand(20, 0.3, 3.0)});
  for (const char* shifted : {"force_offset", "force_drift"}) {
    ModelPoint model = bench.stem.model;
    model.effects.push_back({bench.find(shifted), {0.4, -0.3}});
    expect_it_adds_up(bench, model, {bench.find("coulomb_friction"), {0.02}});
    expect_it_adds_up(bench, model, {bench.find("torque_ripple"), {0.01, 0.02, 16}});
  }
  ModelPoint model = bench.stem.model;
  model.effects.push_back({bench.find("force_gain_error"), {0.05, -0.02}});
  EXPECT_FALSE(bench.predictor.adds_up(model, *bench.find("coulomb_friction")));
}

// Where no sensor has a memory, its reading at a row is that of the torque there.
TEST(ForceReadings, by_row_are_those_of_the_whole_recording) {
  const Bench bench(TiedRig{}, {by_hand(20, 0.35, 1.0), by_hand(20, 0.3, 3.0)});
  ModelPoint model = bench.stem.model;
  model.effects.push_back({bench.find("force_gain_error"), {0.05, -0.02}});
  model.effects.push_back({bench.find("cubic_stiffness"), {0.05}});
  Eigen::VectorXd rows = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(bench.predictor.rows()));
  bench.predictor.predict(model, bit(Chain::kTorque), rows);
  double off = 0, largest = 0;
  for (std::size_t r = 0; r < bench.data.runs.size(); ++r) {
    const std::vector<double> whole = bench.predictor.full_rate(model, r).torque;
    for (std::size_t i = bench.data.run_begin[r]; i < bench.data.run_begin[r + 1]; ++i) {
      if (bench.data.rows[i].chain != Chain::kTorque) continue;
      off = std::max(off, std::abs(rows[static_cast<Eigen::Index>(i)] - whole[bench.data.rows[i].sample]));
      largest = std::max(largest, std::abs(whole[bench.data.rows[i].sample]));
    }
  }
  EXPECT_LT(off, 2e-3 * largest);  // a smooth torque, which the kernel hardly changes
}

// A loop that is compiled for one effect, and the loop for several that looks them up.
TEST(Valves, move_alike_by_either_loop) {
  const Bench bench(TiedRig{}, {by_hand(20, 0.35, 1.0), test::clamped(20, 0.1, 0.8, 6)});
  const std::pair<const char*, Values> effects[] = {{"supply_droop", {2.5e5, 0.3, 1.0}},
                                                    {"second_order_lag", {0.01}},
                                                    {"valve_deadband", {2e3}},
                                                    {"valve_hysteresis", {3e3}},
                                                    {"flow_limit", {1e4}}};
  for (const auto& [id, values] : effects) {
    ModelPoint model = bench.stem.model;
    model.effects.push_back({bench.find(id), values});
    Eigen::VectorXd one = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(bench.predictor.rows())),
                    both = one, none = one;
    bench.predictor.predict(bench.stem.model, kPressureChains, none);
    bench.predictor.predict(model, kPressureChains, one);
    model.effects.push_back({bench.find("volume_coupling"), {1e-6}});  // Pa/rad: next to nothing
    bench.predictor.predict(model, kPressureChains, both);
    EXPECT_GT((one - none).cwiseAbs().maxCoeff(), 100) << id;  // Pa
    EXPECT_LT((one - both).cwiseAbs().maxCoeff(), 1e-3) << id;
  }
}

// Angles pass the kernel after a slip was taken off and before a gain is; beside a gain both ways must end alike.
TEST(Slip, of_nothing_changes_nothing_beside_a_gain_of_the_encoder) {
  const Bench bench(TiedRig{}, {by_hand(20, 0.35, 1.0), by_hand(20, 0.3, 3.0)});
  ModelPoint model = bench.stem.model;
  model.effects.push_back({bench.find("encoder_gain"), {0.09}});
  Eigen::VectorXd with_gain = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(bench.predictor.rows())),
                  with_both = with_gain;
  bench.predictor.predict(model, kAllChains, with_gain);
  model.effects.push_back({bench.find("encoder_slip"), {1e-7, 60}});
  bench.predictor.predict(model, kAllChains, with_both);
  for (std::size_t i = 0; i < bench.data.rows.size(); ++i) {
    if (bench.data.rows[i].chain != Chain::kTorque) continue;
    ASSERT_NEAR(with_both[static_cast<Eigen::Index>(i)], with_gain[static_cast<Eigen::Index>(i)], 5e-5) << i;
  }
}

TEST(Slip, within_a_run_is_the_best_of_many_moments) {
  const Bench bench(TiedRig{}, {by_hand(20, 0.35, 1.0), by_hand(20, 0.3, 3.0)});
  const Ranking ranking(bench.data, bench.library);
  Trial trial;
  trial.hypothesis = static_cast<int>(bench.find("encoder_slip") - bench.library.hypotheses.data());
  trial.values = {1e-3, bench.data.runs[1].day_offset - 0.5};
  const int between = ranking.parameters_of(trial);
  trial.values[1] = bench.data.runs[1].day_offset + 10;
  EXPECT_EQ(ranking.parameters_of(trial), between + kChoosingOne);
}

// Two that leave the same residual: of an inertia and an encoder's gain that one is told first which is what its name says.
TEST(Twins, are_told_in_the_order_of_what_their_names_say) {
  const Bench bench(TiedRig{}, {by_hand(20, 0.35, 1.0), test::free_in_steps(20, 1.7, 0.6)});
  const Ranking ranking(bench.data, bench.library);
  const auto place = [&](const char* id) {
    return static_cast<int>(bench.find(id) - bench.library.hypotheses.data());
  };
  const auto first = [&](double inertia, double of_gain = 1) {
    std::vector<Trial> trials(2);
    trials[0].hypothesis = place("inertia_error");
    trials[0].values = {inertia};
    trials[1].hypothesis = place("encoder_gain");
    trials[1].values = {-inertia / bench.data.rig.inertia};
    for (Trial& t : trials) {
      t.residual = 0.5 * bench.stem.residual;
      t.loss = t.residual.squaredNorm();
    }
    trials[1].loss *= of_gain;
    ranking.rank(trials, bench.stem.residual);
    EXPECT_TRUE(trials[0].in_set && trials[1].in_set);
    return ranking.id_of(trials.front());
  };
  EXPECT_EQ(first(5e-4), "inertia_error");
  EXPECT_EQ(first(-5e-4), "encoder_gain");
  EXPECT_EQ(first(5e-4, 0.999), "inertia_error");  // though the gain fits a little better
}

TEST(Screen, lets_any_shape_of_an_effect_speak_for_it) {
  TiedRig rig;
  rig.dry = 0.02;
  const Bench bench(rig, {by_hand(20, 0.35, 1.0), by_hand(20, 0.3, 0.4), by_hand(20, 0.3, 3.0)});
  const Screen s = screen(around(bench.predictor, bench.stem, bench.weights), bench.library, {.flips = 199});
  int not_of_most_gain = 0;
  for (const Screened& c : s.candidates) {
    double T = 0, rare_p = 1, of_most_gain = 0;
    for (const Screened& shape : s.shapes)
      if (shape.hypothesis == c.hypothesis) {
        T = std::max(T, shape.T);
        rare_p = std::min(rare_p, shape.rare_p);
        if (shape.shape == c.shape) of_most_gain = shape.T;
      }
    EXPECT_EQ(c.T, T) << c.hypothesis;
    EXPECT_EQ(c.rare_p, rare_p) << c.hypothesis;
    not_of_most_gain += of_most_gain < T ? 1 : 0;
  }
  EXPECT_GT(not_of_most_gain, 0);
}

// The search begins with one side, or with both at like shares of the reach; the other side must be found from there.
TEST(Stops, on_both_sides_come_back_from_a_start_that_has_one) {
  TiedRig rig;
  rig.stop_at = 0.12;
  rig.stop = 1.5;
  const Bench bench(
      rig, {by_hand(20, 0.35, 1.0), test::free_in_steps(25, 1.7, 0.6), test::free_in_steps(25, 2.9, 0.6)});
  const Around place = around(bench.predictor, bench.stem, bench.weights);
  const Hypothesis* h = bench.find("end_stop");
  const Refined both = refine(place, *h, {1, 0.14, -3.0});
  EXPECT_NEAR(both.values[1], rig.stop_at, 0.01);
  EXPECT_NEAR(both.values[2], -rig.stop_at, 0.01);
  EXPECT_NEAR(both.values[0], rig.stop, 0.1 * rig.stop);
}

// A force that goes on falling below zero is read by a sensor that can be pushed: nothing hangs slack, and the rows count.
TEST(Slack, is_where_a_reading_stays_and_not_where_it_passes_through_zero) {
  TiedRig rig;
  rig.common = 40;
  const PlannedRun wide = test::clamped(20, 0.1, 1.2, 5);
  const auto loaded = [&] {
    const Bench bench(rig, {by_hand(20, 0.35, 1.0), wide});
    const std::vector<unsigned char>& rows = bench.data.runs[1].loaded;
    return static_cast<double>(std::count(rows.begin(), rows.end(), 1)) / static_cast<double>(rows.size());
  };
  EXPECT_GT(loaded(), 0.95);
  rig.pushes = false;
  EXPECT_LT(loaded(), 0.8);
}

// Zeros of both pressure sensors that are off by the same are a valve zero, for all that a recording says.
TEST(Twins, both_sensors_zeros_stand_beside_a_valve_zero) {
  const Bench bench(TiedRig{}, {by_hand(20, 0.35, 1.0), test::clamped(20, 0.1, 1.2, 5)});
  const Ranking ranking(bench.data, bench.library);
  const auto ranked = [&](double apart) {
    std::vector<Trial> trials(2);
    trials[0].hypothesis =
        static_cast<int>(bench.find("pressure_gain_error") - bench.library.hypotheses.data());
    trials[1].hypothesis = static_cast<int>(bench.find("pressure_offset") - bench.library.hypotheses.data());
    trials[0].values = {0, 500};
    trials[1].values = {500, 500};
    for (Trial& t : trials) t.residual = 0.5 * bench.stem.residual;
    trials[1].residual += apart * bench.stem.residual;
    for (Trial& t : trials) t.loss = t.residual.squaredNorm();
    ranking.rank(trials, bench.stem.residual);
    EXPECT_EQ(ranking.id_of(trials[0]), "pressure_gain_error");
    return trials[1].in_set;
  };
  EXPECT_TRUE(ranked(0));
  EXPECT_FALSE(ranked(1));
}

/// Two candidates that leave as much as one another, in places that have nothing to do with one another.
std::vector<Trial> equally_good(const Bench& bench, const char* first, const char* second) {
  std::vector<Trial> trials(2);
  for (std::size_t i = 0; i < 2; ++i) {
    trials[i].hypothesis =
        static_cast<int>(bench.find(i == 0 ? first : second) - bench.library.hypotheses.data());
    trials[i].residual = 0.5 * bench.stem.residual;
  }
  trials[1].residual.head(trials[1].residual.size() / 2) *= -1;
  for (Trial& t : trials) t.loss = t.residual.squaredNorm();
  return trials;
}

// As many numbers each: the gain of a force is no general case of its offset that has to lead to stay in the set.
TEST(Ranking, keeps_a_gain_beside_an_offset_that_fits_as_well) {
  const Bench bench(TiedRig{}, {by_hand(20, 0.35, 1.0), test::clamped(20, 0.1, 1.2, 5)});
  const Ranking ranking(bench.data, bench.library);
  std::vector<Trial> trials = equally_good(bench, "force_offset", "force_gain_error");
  ranking.rank(trials, bench.stem.residual);
  EXPECT_EQ(ranking.id_of(trials[0]), "force_offset");
  EXPECT_TRUE(trials[1].in_set);
  trials = equally_good(bench, "coulomb_friction", "stribeck_friction");
  ranking.rank(trials, bench.stem.residual);
  EXPECT_EQ(ranking.id_of(trials[0]), "coulomb_friction");
  EXPECT_FALSE(trials[1].in_set);
}

// A compliance of many hertz is an inertia. Four sigma of it are no other thing where both close a hundred sigma and more; where they close thirty they are.
TEST(Ranking, a_compliance_is_farther_from_an_inertia_than_any_equation_from_the_truth) {
  const Bench bench(TiedRig{}, {by_hand(20, 0.35, 1.0), test::free_in_steps(20, 1.7, 0.6)});
  const Ranking ranking(bench.data, bench.library);
  const Eigen::VectorXd left = 0.5 * bench.stem.residual;
  Eigen::VectorXd off =
      left;  // across what is left: a change that makes of noise no more noise than its own square
  for (Eigen::Index i = 0; i < off.size(); i += 2) off[i] = -off[i];
  off -= left * (left.dot(off) / left.squaredNorm());
  const Comparison apart = compare(bench.data, left, left + off, 0, noise_density(bench.data, left));
  const auto first = [&](double closed) {  // in sigma
    std::vector<Trial> trials(2);
    trials[0].hypothesis =
        static_cast<int>(bench.find("series_elasticity") - bench.library.hypotheses.data());
    trials[0].values = {0.004, 13, 0.08};
    trials[0].residual = left;
    trials[1].hypothesis = static_cast<int>(bench.find("inertia_error") - bench.library.hypotheses.data());
    trials[1].values = {5e-4};
    trials[1].residual = left + 8 / apart.separation * off;
    for (Trial& t : trials) t.loss = t.residual.squaredNorm();
    ranking.rank(trials, left + closed / apart.separation * off);
    return ranking.id_of(trials.front());
  };
  EXPECT_EQ(first(30), "series_elasticity");
  EXPECT_EQ(first(150), "inertia_error");
}

TEST(Ranking, knows_no_rival_of_another_reading) {
  const Bench bench(TiedRig{}, {by_hand(20, 0.35, 1.0), test::clamped(20, 0.1, 1.2, 5)});
  const Ranking ranking(bench.data, bench.library);
  std::vector<Trial> trials = equally_good(bench, "coulomb_friction", "leak");
  EXPECT_FALSE(ranking.share_readings(trials[0], trials[1]));
  ranking.rank(trials, bench.stem.residual);
  EXPECT_FALSE(trials[1].in_set);
  // A pressure sensor's zero enters both.
  trials = equally_good(bench, "coulomb_friction", "pressure_offset");
  EXPECT_TRUE(ranking.share_readings(trials[0], trials[1]));
  ranking.rank(trials, bench.stem.residual);
  EXPECT_TRUE(trials[1].in_set);
}

// What noise puts behind more often than that is told too; not what was taken out of the set, a case of what is in it, or another reading.
TEST(Ranking, tells_what_noise_may_have_put_behind_once_in_a_hundred_days) {
  const Bench bench(TiedRig{}, {by_hand(20, 0.35, 1.0), test::clamped(20, 0.1, 1.2, 5)});
  const Ranking ranking(bench.data, bench.library);
  const auto told = [&](const char* rival, double behind) {
    std::vector<Trial> trials = equally_good(bench, "coulomb_friction", rival);
    trials[0].in_set = true;
    trials[1].behind.t = behind;
    trials[1].behind.separation = 6;
    ranking.widen(trials);
    EXPECT_NEAR(trials[0].weight + trials[1].weight, kSurest, 1e-12);
    EXPECT_EQ(trials[1].weight > 0, trials[1].in_set);
    return trials[1].in_set;
  };
  EXPECT_TRUE(told("cubic_stiffness", 1.7));
  EXPECT_TRUE(told("cubic_stiffness", 2.3));
  EXPECT_FALSE(told("cubic_stiffness", 2.4));
  EXPECT_FALSE(told("cubic_stiffness", 1.6));
  EXPECT_FALSE(told("stribeck_friction", 2));
  EXPECT_FALSE(told("leak", 2));
}

TEST(LeftOver, casts_a_doubt_by_its_size_beside_the_first_effects) {
  const auto doubts = [](double p, double share, double first, Chain chain = Chain::kTorque) {
    return casts_a_doubt(p, share * first, chain, first, true);
  };
  constexpr double kSeldom = 0.001, kLikely = 0.01;
  EXPECT_TRUE(doubts(kSeldom, 0.061, 1));
  EXPECT_FALSE(doubts(kSeldom, 0.059, 1));
  EXPECT_TRUE(doubts(kSeldom, 0.096, 2.72));
  EXPECT_FALSE(doubts(kSeldom, 0.06, 2.72));  // so much of its own equation may be wrong
  EXPECT_FALSE(doubts(kSeldom, 0.099, 8));
  EXPECT_TRUE(doubts(kSeldom, 0.101, 8));
  EXPECT_FALSE(doubts(kLikely, 0.099, 1));
  EXPECT_TRUE(doubts(kLikely, 0.101, 1));
  EXPECT_FALSE(doubts(0.03, 0.5, 1));
  EXPECT_TRUE(doubts(kSeldom, 0.016, 1, Chain::kPressure1));
  EXPECT_FALSE(doubts(kLikely, 0.029, 1, Chain::kPressure1));
}

TEST(Growth, is_the_same_by_its_series_and_by_the_exponential) {
  for (const double s : {1e-9, 1e-4, 0.019999, 0.020001, 0.1, 0.399, 0.401, 3.0})
    for (const double sign : {-1.0, 1.0})
      EXPECT_NEAR(growth(sign * s), std::expm1(sign * s) / (sign * s), 2e-11 * std::exp(s)) << sign * s;
}

TEST(Twins, two_sensors_that_err_by_the_same_have_one_cause) {
  const Bench bench(TiedRig{}, {by_hand(20, 0.35, 1.0), test::clamped(20, 0.1, 1.2, 5)});
  const Ranking ranking(bench.data, bench.library);
  const auto alike = [&](const char* id, Values values) {
    Trial t;
    t.hypothesis = static_cast<int>(bench.find(id) - bench.library.hypotheses.data());
    t.values = values;
    return ranking.err_alike(t);
  };
  EXPECT_TRUE(alike("pressure_offset", {500, 520}));
  EXPECT_TRUE(alike("pressure_offset", {-500, -490}));
  EXPECT_FALSE(alike("pressure_offset", {500, 300}));
  EXPECT_FALSE(alike("pressure_offset", {500, -500}));
  EXPECT_FALSE(alike("pressure_offset", {500, 0}));
  EXPECT_FALSE(alike("coulomb_friction", {0.02, 0.02}));
}

// Both gains by the same: that fits a little better, by noise; it needs a coincidence, and the other does not.
TEST(Ranking, puts_one_cause_before_two_sensors_that_err_by_the_same) {
  const Bench bench(TiedRig{}, {by_hand(20, 0.35, 1.0), test::free_in_steps(20, 1.5, 0.6)});
  const Ranking ranking(bench.data, bench.library);
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  const auto rows = static_cast<Eigen::Index>(bench.data.rows.size());
  Eigen::VectorXd noise(rows), apart(rows);
  for (double& x : noise) x = normal(random);
  for (double& x : apart) x = normal(random);
  apart -= noise * (noise.dot(apart) / noise.squaredNorm());
  const auto first_of = [&](double first, double second, const char* other, double sigma) {
    std::vector<Trial> trials(2);
    trials[0].hypothesis = static_cast<int>(bench.find("force_gain_error") - bench.library.hypotheses.data());
    trials[0].values = {first, second};
    trials[0].residual = noise;
    trials[1].hypothesis = static_cast<int>(bench.find(other) - bench.library.hypotheses.data());
    trials[1].values = {1e-3};
    const double between =
        compare(bench.data, noise, noise + apart, 0, noise_density(bench.data, noise)).separation;
    trials[1].residual = noise + apart * (sigma / between);
    for (Trial& t : trials) t.loss = t.residual.squaredNorm();
    ranking.rank(trials, noise + apart * (100 / between));
    return ranking.id_of(trials.front());
  };
  // Half of the sigma of data that lie between them it is behind.
  EXPECT_EQ(first_of(0.05, 0.051, "inertia_error", 5), "inertia_error");
  EXPECT_EQ(first_of(0.05, 0.051, "encoder_gain", 5), "encoder_gain");
  EXPECT_EQ(first_of(0.05, -0.02, "inertia_error", 5), "force_gain_error");
  EXPECT_EQ(first_of(0.05, 0.051, "inertia_error", 10), "force_gain_error") << "far behind";
}

}  // namespace
}  // namespace isac::explain
