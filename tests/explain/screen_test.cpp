// The tests of a screen: where few blocks carry an effect, and where whole runs share their zero.
#include "isac/explain/screen.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>
#include <stdexcept>

#include "isac/estimate/linear_algebra.hpp"
#include "isac/explain/gate.hpp"
#include "tied_data.hpp"

namespace isac::explain {
namespace {

constexpr std::size_t kBlocks = 200, kCarry = 12;

/// One effect that a dozen of two hundred blocks carry, unequally, in noise whose scatter differs from block to block.
Screen screen_of(double sigma, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform(0.5, 2.0);
  Screen screen;
  Column c;
  c.hypothesis = 0;
  c.atom_score = c.atom_norm = Eigen::VectorXd::Zero(kBlocks);
  double all = 0;
  for (Eigen::Index b = 0; b < static_cast<Eigen::Index>(kCarry); ++b)
    all += c.atom_norm[b * 10] = uniform(random);
  for (Eigen::Index b = 0; b < static_cast<Eigen::Index>(kCarry); ++b) {
    const double norm2 = c.atom_norm[b * 10];
    c.atom_score[b * 10] =
        norm2 * sigma / std::sqrt(all) + std::sqrt(norm2) * uniform(random) * normal(random);
  }
  c.norm2 = c.chain_norm2[0] = all;
  c.score = c.atom_score.sum();
  screen.columns.push_back(c);
  return screen;
}

struct Setting {
  Prepared data;
  Library library;
  Setting() {
    const test::TiedRig rig;
    data = prepare(test::record_all(rig, {test::by_hand(20, 0.3, 1.0)}), rig.facts(), {}, 4.0);
    library = make_library(data);
    data.rows.clear();
    for (unsigned b = 0; b < kBlocks; ++b)
      data.rows.push_back({.run = 0, .sample = b, .atom = b, .block = b, .chain = Chain::kTorque});
    data.atoms = data.blocks = kBlocks;
    data.block_of_atom.clear();
    for (unsigned b = 0; b < kBlocks; ++b) data.block_of_atom.push_back(b);
  }
};

/// A dozen functions of the signals, in noise that scatters the same in every block.
std::vector<Column> functions_that_scatter(double scatter, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  std::vector<Column> columns(12);
  for (Column& c : columns) {
    c.atom_score = c.atom_norm = Eigen::VectorXd::Zero(kBlocks);
    for (Eigen::Index b = 0; b < c.atom_norm.size(); ++b) {
      c.atom_norm[b] = 1;
      c.atom_score[b] = scatter * normal(random);
    }
    c.norm2 = c.chain_norm2[0] = kBlocks;
    c.score = c.atom_score.sum();
  }
  return columns;
}

TEST(Judge, few_blocks_give_a_small_p_to_noise_no_more_often_than_it_says) {
  const Setting setting;
  std::mt19937_64 random(5);
  constexpr int kDraws = 2000;
  int small = 0, rare = 0;
  for (int i = 0; i < kDraws; ++i) {
    Screen screen = screen_of(0, random);
    judge(screen, setting.data, setting.library, {.flips = 19});
    ASSERT_LT(screen.columns[0].carried_by, kCarry + 0.5);
    small += screen.rare_p <= 0.05 ? 1 : 0;
    rare += screen.rare_p <= 0.01 ? 1 : 0;
  }
  EXPECT_LE(small, 0.065 * kDraws);  // three standard errors above 5 %
  EXPECT_GE(small, 0.015 * kDraws);  // a test that never rejects would say nothing
  EXPECT_LE(rare, 0.017 * kDraws);
}

TEST(Judge, few_blocks_that_agree_are_significant_although_they_are_their_own_yardstick) {
  const Setting setting;
  std::mt19937_64 random(6);
  for (int i = 0; i < 50; ++i) {
    Screen screen = screen_of(40, random);
    judge(screen, setting.data, setting.library, {.flips = 19});
    EXPECT_LT(screen.columns[0].T, std::sqrt(1.0 * kCarry) + 1e-9);  // below any limit of a whole search
    EXPECT_LT(screen.rare_p, 1e-4);
  }
}

/// What a refit of two amplitudes closes, in some blocks of `setting`: each row its own block, so that before = noise + a x₁ + b x₂.
double p_of_two(const Setting& setting, double sigma, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform(0.5, 1.5);
  const auto n = static_cast<Eigen::Index>(kBlocks);
  Eigen::VectorXd before(n);
  Eigen::MatrixXd x = Eigen::MatrixXd::Zero(n, 2);
  for (Eigen::Index b = 0; b < n; ++b) before[b] = normal(random);
  for (Eigen::Index b = 0; b < static_cast<Eigen::Index>(kCarry); ++b) {
    x(b * 10, 0) = uniform(random);
    x(b * 10, 1) = b % 2 == 0 ? uniform(random) : -uniform(random);
  }
  before += sigma * (x.col(0) / x.col(0).norm() - x.col(1) / x.col(1).norm());
  const Eigen::VectorXd after = before - x * estimate::least_squares(x, before);
  return p_of_refit(setting.data, before, after);
}

/// Of an effect that five blocks carry, whose noise is `loud` times as large there as elsewhere.
double p_of_five(const Setting& setting, double sigma, double loud, std::mt19937_64& random) {
  constexpr Eigen::Index kFive = 5;
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform(0.7, 1.4);
  Eigen::VectorXd before(static_cast<Eigen::Index>(kBlocks)), x = Eigen::VectorXd::Zero(before.size());
  for (Eigen::Index b = 0; b < before.size(); ++b) {
    const bool carries = b % 10 == 0 && b < 10 * kFive;
    before[b] = (carries ? loud : 1.0) * normal(random);
    if (carries) x[b] = uniform(random);
  }
  before += sigma / x.norm() * x;
  const Eigen::VectorXd after = before - x * (x.dot(before) / x.squaredNorm());
  return p_in_its_blocks(setting.data, before, after, {}, {.unit = 1, .blocks = 150});
}

TEST(PValueInItsBlocks, is_small_no_more_often_than_it_says_where_the_noise_is_far_louder) {
  const Setting setting;
  std::mt19937_64 random(8);
  constexpr int kDraws = 2000;
  const auto share_below = [&](double p, double loud) {
    int below = 0;
    for (int i = 0; i < kDraws; ++i) below += p_of_five(setting, 0, loud, random) <= p ? 1 : 0;
    return static_cast<double>(below) / kDraws;
  };
  EXPECT_LE(share_below(0.01, 1), 0.017);
  EXPECT_GE(share_below(0.05, 1), 0.015);  // a test that never rejects would say nothing
  // Two blocks for the noise being as elsewhere cost that much where it is not; by its variance elsewhere alone it is four in five.
  EXPECT_LE(share_below(0.01, 10), 0.07);
  EXPECT_LE(share_below(1e-4, 10), 0.012);
  // So little louder that chance hides it now and then: by the variance elsewhere alone it is one in five.
  EXPECT_LE(share_below(0.01, 2), 0.06);
  EXPECT_GE(share_below(0.01, 2), 0.005);
}

TEST(PValueInItsBlocks, is_small_where_few_blocks_agree) {
  const Setting setting;
  std::mt19937_64 random(9);
  int small = 0;
  for (int i = 0; i < 200; ++i) small += p_of_five(setting, 12, 1, random) < 1e-4 ? 1 : 0;
  EXPECT_GE(small, 190);
  for (int i = 0; i < 50; ++i) EXPECT_LT(p_of_five(setting, 30, 1, random), 1e-6);
}

TEST(PValueOfARefit, is_small_where_two_amplitudes_are_large_in_few_blocks) {
  const Setting setting;
  std::mt19937_64 random(7);
  for (int i = 0; i < 50; ++i) EXPECT_LT(p_of_two(setting, 60, random), 1e-3);
}

// It counts one freedom less than the blocks, and two were fitted: the search asks it of what is five sigma only, and counts all columns.
TEST(PValueOfARefit, of_noise_passes_no_search) {
  const Setting setting;
  std::mt19937_64 random(8);
  constexpr int kDraws = 4000;
  int passed = 0;
  for (int i = 0; i < kDraws; ++i) passed += p_of_two(setting, 0, random) * 50 <= 0.005 ? 1 : 0;
  EXPECT_LE(passed, 0.005 * kDraws);
}

constexpr unsigned kRuns = 10;

/// A response that rests within its runs, beside noise of its blocks and a zero of each run.
Screen resting_screen(double effect, double zero, bool resting, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  Screen screen;
  Column c;
  c.hypothesis = 0;
  c.atom_norm = Eigen::VectorXd::Ones(kBlocks);
  c.atom_score = Eigen::VectorXd::Zero(kBlocks);
  for (Eigen::Index run = 0; run < kRuns; ++run) {
    const double of_run = zero * normal(random);
    for (Eigen::Index b = 0; b < static_cast<Eigen::Index>(kBlocks / kRuns); ++b)
      c.atom_score[run * static_cast<Eigen::Index>(kBlocks / kRuns) + b] = effect + of_run + normal(random);
  }
  c.norm2 = c.chain_norm2[0] = kBlocks;
  c.score = c.atom_score.sum();
  if (resting) c.atom_left = c.atom_score - c.score / c.norm2 * c.atom_norm;
  screen.columns.push_back(c);
  return screen;
}

Setting setting_of_runs() {
  Setting setting;
  setting.data.runs.assign(kRuns, setting.data.runs.front());
  for (Row& row : setting.data.rows) row.run = row.block / (kBlocks / kRuns);
  return setting;
}

TEST(Judge, takes_no_zero_that_moves_between_runs_for_what_rests_within_them) {
  const Setting setting = setting_of_runs();
  std::mt19937_64 random(7);
  constexpr int kDraws = 2000;
  int by_runs = 0, by_blocks = 0;
  for (int i = 0; i < kDraws; ++i) {
    for (const bool resting : {true, false}) {
      Screen screen = resting_screen(0, 1.0, resting, random);
      judge(screen, setting.data, setting.library, {.flips = 19});
      (resting ? by_runs : by_blocks) += screen.columns[0].T > 1.96 ? 1 : 0;
    }
  }
  EXPECT_LE(by_runs, 0.065 * kDraws);  // three standard errors above 5 %
  EXPECT_GE(by_runs, 0.02 * kDraws);
  EXPECT_GE(by_blocks, 0.3 * kDraws);  // what blocks alone would make of it
}

TEST(Judge, still_sees_what_rests_within_runs_where_the_runs_agree) {
  const Setting setting = setting_of_runs();
  std::mt19937_64 random(8);
  int seen = 0;
  for (int i = 0; i < 200; ++i) {
    Screen screen = resting_screen(1.0, 0.0, true, random);
    judge(screen, setting.data, setting.library, {.flips = 19});
    seen += screen.columns[0].T > 4 ? 1 : 0;
  }
  EXPECT_GE(seen, 190);
}

// An error that a whole run shares scatters in none of its blocks: it is counted, in T and in the flips.
TEST(Judge, counts_the_error_that_all_blocks_of_a_run_share) {
  const Setting setting = setting_of_runs();
  std::mt19937_64 random(12);
  std::normal_distribution<double> normal;
  constexpr int kDraws = 2000;
  const double shared = 0.25;  // of a block's own deviation; 1.1 of that of the sum of its run's twenty
  int counted = 0, ignored = 0, small = 0;
  for (int i = 0; i < kDraws; ++i)
    for (const bool known : {true, false}) {
      Screen screen = resting_screen(0, shared, false, random);
      Column& c = screen.columns[0];
      if (known) c.shared_error = Eigen::VectorXd::Constant(kRuns, shared * c.norm2 / kRuns);
      judge(screen, setting.data, setting.library, {.flips = 19});
      (known ? counted : ignored) += c.T > 1.96 ? 1 : 0;
      if (known) small += screen.p_value <= 0.05 ? 1 : 0;
    }
  EXPECT_LE(counted, 0.065 * kDraws);
  EXPECT_GE(counted, 0.035 * kDraws);
  EXPECT_LE(small, 0.065 * kDraws);
  EXPECT_GE(small, 0.035 * kDraws);
  EXPECT_GE(ignored, 0.12 * kDraws);
}

TEST(Judge, scatter_of_runs_is_that_of_what_is_left_beside_the_column) {
  // A drift of which a tolerance, held at its bound, took a constant: its scores grow from run to run, and so does what its own
  // amplitude leaves of them. With the tolerance come back nothing but noise is left.
  const Setting setting = setting_of_runs();
  std::mt19937_64 random(9);
  std::normal_distribution<double> normal;
  Screen screen = resting_screen(0, 0, true, random);
  Column& c = screen.columns[0];
  Eigen::VectorXd noise(static_cast<Eigen::Index>(kBlocks));
  for (Eigen::Index b = 0; b < noise.size(); ++b) {
    noise[b] = normal(random);
    c.atom_score[b] = 2.0 + 4.0 * (static_cast<double>(b / (kBlocks / kRuns)) - 4.5) + noise[b];
  }
  c.score = c.atom_score.sum();
  c.atom_left = c.atom_score - c.score / c.norm2 * c.atom_norm;
  judge(screen, setting.data, setting.library, {.flips = 19});
  EXPECT_LT(screen.columns[0].T, 1);
  screen.columns[0].atom_left = noise.array() - noise.mean();
  judge(screen, setting.data, setting.library, {.flips = 19});
  EXPECT_GT(screen.columns[0].T, 2);  // what its blocks show
}

TEST(Around, leaves_beside_a_response_what_least_squares_within_the_tolerances_leave) {
  std::mt19937_64 random(10);
  std::normal_distribution<double> normal;
  const auto draw = [&](Eigen::Index cols) {
    Eigen::MatrixXd m(60, cols);
    for (double& v : m.reshaped()) v = normal(random);
    return m;
  };
  int at_bound = 0;
  for (int i = 0; i < 50; ++i) {
    Around place;
    place.held.slopes = draw(2);
    place.held.low = Eigen::Vector2d(0, -0.4);
    place.held.high = Eigen::Vector2d(0.4, 0);
    place.held_gram = place.held.slopes.transpose() * place.held.slopes;
    const Eigen::VectorXd x = draw(1);
    place.residual = draw(1) + 3 * x - 0.3 * place.held.slopes.col(0) + 0.6 * place.held.slopes.col(1);
    const double left = place.left_beside(x).squaredNorm();
    // By hand: the amplitude is free, the two others lie on a grid within their bounds.
    double least = 1e300;
    Eigen::Vector2d best(0, 0);
    for (double a = 0; a <= 0.4001; a += 0.01)
      for (double b = -0.4; b <= 1e-9; b += 0.01) {
        const Eigen::VectorXd r =
            place.residual + a * place.held.slopes.col(0) + b * place.held.slopes.col(1);
        const double loss = r.squaredNorm() - std::pow(x.dot(r), 2) / x.squaredNorm();
        if (loss >= least) continue;
        least = loss;
        best = {a, b};
      }
    EXPECT_LE(left, least * (1 + 1e-9));
    EXPECT_GE(left, least * (1 - 2e-3));  // half a step of the grid
    at_bound += best[1] < -0.395 ? 1 : 0;
  }
  EXPECT_GE(at_bound, 40);
}

TEST(Judge, measures_a_large_rare_effect_by_what_its_refit_leaves_elsewhere) {
  const Setting setting;
  std::mt19937_64 random(7);
  const auto functions = [&](double scatter) { return functions_that_scatter(scatter, random); };
  Column stop;  // thirty sigma of white noise in one block
  stop.hypothesis = 0;
  stop.atom_score = stop.atom_norm = Eigen::VectorXd::Zero(kBlocks);
  stop.atom_norm[3] = stop.norm2 = stop.chain_norm2[0] = 100;
  stop.atom_score[3] = stop.score = 300;
  Screen screen;
  screen.columns = functions(20);  // the baseline has bent towards it, and misses everything else
  screen.columns.push_back(stop);
  judge(screen, setting.data, setting.library, {.flips = 99});
  EXPECT_GT(screen.rare_p, 0.05);
  judge(screen, setting.data, setting.library, {.flips = 99}, {.hypothesis = 0, .functions = functions(1)});
  EXPECT_LT(screen.rare_p, 1e-10);
  // The yardstick is that hypothesis' alone.
  judge(screen, setting.data, setting.library, {.flips = 99}, {.hypothesis = 1, .functions = functions(1)});
  EXPECT_GT(screen.rare_p, 0.05);
}

// Half of what is material is asked for only where it is beyond doubt that something is there.
TEST(Gate, leaves_no_doubt_fifty_times_below_the_level) {
  const Prepared data;
  const Library library;
  const Gatekeeper gate(data, library, 0.01, 0.1);
  Screen screen;
  screen.limit = 4;
  const auto doubtless = [&](double flips, double rare, double max_T) {
    screen.p_value = flips;
    screen.rare_p = rare;
    screen.max_T = max_T;
    return gate.judge(screen, {}, {}, false, {}).beyond_doubt;
  };
  EXPECT_FALSE(doubtless(0.0005, 1, 4.2)) << "the least p of 1999 flips, and T hardly beyond its limit";
  EXPECT_TRUE(doubtless(0.0005, 1, 4.9));  // 4.9² − 4² = 8.0 > 2 ln 50 = 7.8
  EXPECT_FALSE(doubtless(0.4, 0.0004, 3));
  EXPECT_TRUE(doubtless(0.4, 0.00005, 3));
  EXPECT_FALSE(doubtless(0.4, 1, 3));
}

TEST(JointP, of_two_tests_is_small_no_more_often_than_it_says) {
  constexpr double kLevel = 0.005;
  // The two at their worst: never small together. P(joint ≤ α) = P(flips ≤ f(α)) + P(rare ≤ g(α)).
  for (const double alpha : {0.0005, 0.005, 0.006, 0.05, 0.5, 0.9}) {
    double flips = 0, rare = 0;
    for (double p = 1e-5; p < 1; p += 1e-5) {
      if (joint_p(p, 1, kLevel) <= alpha) flips = p;
      if (joint_p(1, p, kLevel) <= alpha) rare = p;
    }
    EXPECT_LE(flips + rare, alpha + 2e-5) << alpha;
    EXPECT_GE(flips + rare, 0.98 * alpha - 2e-5) << alpha;
  }
  EXPECT_EQ(joint_p(1, 1, kLevel), 1);
  for (const bool first : {true, false}) {
    EXPECT_LE(joint_p(first ? 0.0024 : 1, first ? 1 : 0.0024, kLevel), kLevel);
    EXPECT_GT(joint_p(first ? 0.0026 : 1, first ? 1 : 0.0026, kLevel), kLevel);
  }
  // A test that seldom speaks costs next to nothing where nothing is found.
  EXPECT_NEAR(joint_p(0.5, 1, kLevel), 0.5, 0.007);
}

TEST(Flips, are_the_same_whoever_reckons_them) {
  std::mt19937_64 random(11);
  std::normal_distribution<double> normal;
  Eigen::MatrixXd scores(130, 40);
  for (Eigen::Index i = 0; i < scores.size(); ++i) scores.data()[i] = normal(random);
  const FlipTest one = flip_test(scores, 999, 3, 0.01),
                 two = flip_test(scores, 999, 3, 0.01, std::nullopt, 2);
  EXPECT_EQ(one.p_value, two.p_value);
  EXPECT_EQ(one.limit, two.limit);
  EXPECT_EQ(one.statistic, two.statistic);
}

TEST(KeptResponses, serve_a_screen_beside_another_torque_as_well) {
  const test::TiedRig rig{.dry = 0.02};
  const Prepared data =
      prepare(test::record_all(rig, {test::by_hand(20, 0.35, 0.6), test::by_hand(20, 0.3, 2.0)}), rig.facts(),
              {}, 2.0);
  const Library library = make_library(data);
  const Predictor predictor(data);
  const Weights weights{{0.0025, 120, 120, 0.005}, {}, false, {}};
  const Fit stem = fit_baseline(predictor, library.tolerances, weights);
  Active friction;
  for (const Hypothesis& h : library.hypotheses)
    if (h.id() == "coulomb_friction") friction = {&h, h.shapes.front()};
  const Fit with = refit(predictor, stem, {friction}, weights);
  const ScreenOptions options{.flips = 99, .dictionary = true};
  Responses kept;
  (void)screen(around(predictor, stem, weights), library, options, &kept);
  const Around place = around(predictor, with, weights);
  const Screen again = screen(place, library, options, &kept), anew = screen(place, library, options);
  ASSERT_EQ(again.columns.size(), anew.columns.size());
  for (std::size_t k = 0; k < anew.columns.size(); ++k)
    EXPECT_NEAR(again.columns[k].T, anew.columns[k].T, 0.02)
        << (anew.columns[k].hypothesis >= 0
                ? library.hypotheses[static_cast<std::size_t>(anew.columns[k].hypothesis)].info().id
                : anew.columns[k].name.c_str());
}

TEST(KeptResponses, are_not_taken_where_what_was_added_changes_them) {
  const test::TiedRig rig;
  const Prepared data = prepare(test::record_all(rig, {test::by_hand(20, 0.35, 0.6)}), rig.facts(), {}, 2.0);
  const Library library = make_library(data);
  const auto find = [&](const char* id) -> const Hypothesis& {
    for (const Hypothesis& h : library.hypotheses)
      if (h.id() == id) return h;
    throw std::runtime_error(id);
  };
  const auto beside = [&](const char* id) {
    Fit fit;
    fit.model.effects.push_back({&find(id), {}});
    return fit;
  };
  EXPECT_TRUE(Responses::hold(beside("coulomb_friction"), find("cubic_stiffness")));
  EXPECT_FALSE(Responses::hold(beside("coulomb_friction"), find("coulomb_friction")));
  EXPECT_FALSE(Responses::hold(beside("coulomb_friction"), find("force_gain_error")));
  EXPECT_FALSE(Responses::hold(beside("force_gain_error"), find("cubic_stiffness")));
  EXPECT_FALSE(Responses::hold(beside("force_gain_error"), find("force_offset")));
  EXPECT_TRUE(Responses::hold(beside("encoder_offset"), find("cubic_stiffness")));
  EXPECT_FALSE(Responses::hold(beside("encoder_offset"), find("force_offset")));
}

/// A led joint twice and a free one, whose readings are off by what is set; blocks of two seconds.
Prepared day_with_errors(const test::TiedRig& rig) {
  Prepared data = prepare(test::record_all(rig, {test::by_hand(20, 0.35, 0.6), test::by_hand(20, 0.3, 2.0),
                                                 test::free_in_steps(30, 6, 0.4)}),
                          rig.facts(), {}, 2.0);
  for (PreparedRun& run : data.runs) {
    run.mean_pressure_error = 0;
    run.lag_pressure_error.clear();
    run.slow_torque_error.clear();
  }
  return data;
}

TEST(ErrorsOfReading, are_of_the_rows_that_they_enter_in_deviations_of_these) {
  Prepared data = day_with_errors({});
  data.runs[0].mean_pressure_error = 200;
  data.runs[1].lag_pressure_error.assign(data.runs[1].time.size(), 30);
  data.runs[2].slow_torque_error.assign(data.runs[2].time.size(), 0.001);
  const Library library = make_library(data);
  const Predictor predictor(data);
  const Weights weights{{0.0025, 120, 120, 0.005}, {}, false, {}};
  const Fit stem = fit_baseline(predictor, library.tolerances, weights);
  const ErrorsOfReading errors = errors_of_reading(around(predictor, stem, weights));
  const double gain = predictor.pressure_gain(stem.model);
  int of[kChains] = {};
  for (std::size_t i = 0; i < data.rows.size(); ++i) {
    const Row& row = data.rows[i];
    const auto k = static_cast<Eigen::Index>(i);
    const bool torque = row.chain == Chain::kTorque, motion = row.chain == Chain::kMotion;
    ASSERT_NEAR(errors.of_run[k], torque && row.run == 0 ? gain * 200 / 0.0025 : 0.0, 1e-9);
    ASSERT_NEAR(errors.of_day[0][k], torque && row.run == 1 ? gain * 30 / 0.0025 : 0.0, 1e-9);
    ASSERT_NEAR(errors.of_day[1][k], motion && row.run == 2 ? 0.001 / 0.005 : 0.0, 1e-9);
    ++of[static_cast<int>(row.chain)];
  }
  EXPECT_NE(gain, 0);
  EXPECT_GT(of[static_cast<int>(Chain::kTorque)], 1000);
  EXPECT_GT(of[static_cast<int>(Chain::kMotion)], 1000);
}

TEST(ErrorsOfReading, reach_the_scatter_of_every_score_together) {
  const test::TiedRig rig{.dry = 0.02};
  const Prepared exact = day_with_errors(rig);
  Prepared off = exact;
  // Each by itself, then all three: Σ e² of a column is the sum of theirs.
  const auto run_off = [&] {
    off.runs[0].mean_pressure_error = 300;
    off.runs[1].mean_pressure_error = 100;
  };
  const auto lag_off = [&] {
    for (PreparedRun& run : off.runs) {
      run.lag_pressure_error.resize(run.time.size());
      for (std::size_t k = 0; k < run.time.size(); ++k)
        run.lag_pressure_error[k] = 80 * std::sin(0.8 * run.time[k]);
    }
  };
  const auto bends_off = [&] {
    off.runs[2].slow_torque_error.resize(off.runs[2].time.size());
    for (std::size_t k = 0; k < off.runs[2].time.size(); ++k)
      off.runs[2].slow_torque_error[k] = 0.003 * std::sin(2 * off.runs[2].time[k]);
  };
  const Weights weights{{0.0025, 120, 120, 0.005}, {}, false, {}};
  const Library library = make_library(exact);
  const Predictor of_exact(exact);
  const Fit stem = fit_baseline(of_exact, library.tolerances, weights);
  const auto screened = [&](const Prepared& data) {
    const Predictor predictor(data);
    return screen(around(predictor, stem, weights), library, {.flips = 19, .dictionary = true});
  };
  const Screen none = screened(exact);
  std::vector<Screen> alone;
  for (const std::function<void()>& set :
       {std::function<void()>(run_off), std::function<void()>(lag_off), std::function<void()>(bends_off)}) {
    off = exact;
    set();
    alone.push_back(screened(off));
  }
  off = exact;
  run_off();
  lag_off();
  bends_off();
  const Screen all = screened(off);
  ASSERT_EQ(all.columns.size(), none.columns.size());
  int reached[3] = {}, larger = 0, compared = 0;
  for (std::size_t k = 0; k < all.columns.size(); ++k) {
    const Column &c = all.columns[k], &before = none.columns[k];
    ASSERT_EQ(before.shared_error.squaredNorm(), 0);
    double sum = 0;
    for (std::size_t e = 0; e < alone.size(); ++e) {
      const double error2 = alone[e].columns[k].shared_error.squaredNorm();
      reached[e] += error2 > 0.01 * c.norm2 ? 1 : 0;
      sum += error2;
    }
    ASSERT_NEAR(c.shared_error.squaredNorm(), sum, 1e-9 * (1 + sum));
    if (!(before.T > 0) || c.resting > Column::kResting) continue;
    // T = |Σ g|/√(Σ n² + Σ e²)
    const double scatter2 = std::pow(before.score / before.T, 2);
    EXPECT_NEAR(c.T, std::abs(c.score) / std::sqrt(scatter2 + sum), 1e-6 * before.T) << k;
    larger += sum > 0.01 * scatter2 ? 1 : 0;
    ++compared;
  }
  for (const int columns : reached) EXPECT_GT(columns, 10);
  EXPECT_GT(larger, 10);
  EXPECT_GT(compared, 50);
}

}  // namespace
}  // namespace isac::explain
