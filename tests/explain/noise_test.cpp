// What the noise is taken for: its colour, its wandering zero, and how much of a pressure's reading is pressure.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "isac/core/units.hpp"
#include "isac/estimate/linear_algebra.hpp"
#include "isac/explain/colours.hpp"
#include "isac/explain/encoder_motion.hpp"
#include "isac/explain/filters.hpp"
#include "isac/explain/quiet_pressure.hpp"
#include "isac/explain/weights.hpp"
#include "tied_data.hpp"

namespace isac::explain {
namespace {

constexpr double kStep = 0.008;  // s between rows

/// Rows of one chain in runs of one length, a gap of so many rows in the middle of each.
Prepared rows_of_runs(std::size_t runs, unsigned per_run, unsigned gap = 3) {
  Prepared data;
  data.runs.resize(runs);
  for (unsigned r = 0; r < runs; ++r) {
    data.runs[r].interval = kStep / 4;
    for (unsigned k = 0; k < per_run; ++k)
      data.rows.push_back({.run = r,
                           .sample = 4 * (k < per_run / 2 ? k : k + gap),
                           .atom = 0,
                           .block = 0,
                           .chain = Chain::kTorque});
  }
  return data;
}

/// White noise, an Ornstein–Uhlenbeck process of this memory, and a zero of memory 100 s.
Eigen::VectorXd noise(const Prepared& data, double white, double slow, double memory, double wander,
                      unsigned seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  Eigen::VectorXd out(static_cast<Eigen::Index>(data.rows.size()));
  double z = 0, d = 0;
  for (std::size_t i = 0; i < data.rows.size(); ++i) {
    const bool begins = i == 0 || data.rows[i - 1].run != data.rows[i].run;
    const double dt = begins ? 1e9 : kStep / 4 * (data.rows[i].sample - data.rows[i - 1].sample);
    const double stay = std::exp(-dt / memory), keep = std::exp(-dt / 100);
    z = stay * z + std::sqrt(slow * (1 - stay * stay)) * normal(random);
    d = keep * d + std::sqrt(wander * (1 - keep * keep)) * normal(random);
    out[static_cast<Eigen::Index>(i)] = std::sqrt(white) * normal(random) + z + d;
  }
  return out;
}

TEST(LogLikelihood, is_largest_near_the_colour_that_the_noise_has) {
  const Prepared data = rows_of_runs(6, 4000);
  const Eigen::VectorXd rows = noise(data, 1, 0.5, 0.3, 0.4, 31);
  const auto of = [&](double white, double slow, double memory, double wander) {
    Weights weights;
    weights.colour[0] = {white, slow, memory, wander};
    weights.take(data);
    return log_likelihood(data, weights, rows);
  };
  const double right = of(1, 0.5, 0.3, 0.4);
  for (const double wrong : {of(1.9, 0, 0, 0), of(1.5, 0, 0, 0.4), of(1, 0.9, 0.3, 0), of(2, 0.5, 0.3, 0.4),
                             of(1, 0.5, 3, 0.4), of(1, 0.02, 0.3, 0.4)})
    EXPECT_LT(wrong, right - 5);
  // White noise: −½ Σ (y²/w + ln w).
  EXPECT_NEAR(of(2, 0, 0, 0),
              -0.5 * (rows.squaredNorm() / 2 + static_cast<double>(data.rows.size()) * std::log(2.0)), 1e-6);
}

double correlation(const Prepared& data, const Eigen::VectorXd& x, std::size_t lag) {
  double product = 0, squares = 0;
  for (std::size_t i = lag; i < data.rows.size(); ++i) {
    if (data.rows[i].run != data.rows[i - lag].run) continue;
    const auto k = static_cast<Eigen::Index>(i);
    product += x[k] * x[k - static_cast<Eigen::Index>(lag)];
    squares += x[k] * x[k];
  }
  return product / squares;
}

TEST(Colour, is_the_same_where_a_chain_begins_with_a_gap) {
  const Prepared data = rows_of_runs(6, 4000);
  Prepared late = data;
  for (std::size_t i = 1; late.rows[i].run == 0; ++i) late.rows[i].sample += 4;
  const Eigen::VectorXd rows = noise(data, 1.0, 4.0, 0.2, 0, 2);
  const Colour before = colour_of(data, rows, Chain::kTorque), after = colour_of(late, rows, Chain::kTorque);
  EXPECT_GT(before.slow, 2);
  EXPECT_NEAR(after.slow, before.slow, 0.05 * before.slow);
  EXPECT_NEAR(after.memory, before.memory, 0.05 * before.memory);
  EXPECT_NEAR(after.white, before.white, 0.05 * before.white);
}

TEST(Colour, passes_columns_side_by_side_as_it_passes_each) {
  const Prepared data = rows_of_runs(3, 400);
  Weights weights;
  weights.sigma[0] = 0.5;
  weights.colour[0] = {.white = 4.0, .slow = 16.0, .memory = 0.2, .wander = 12.0};
  weights.take(data);
  Eigen::MatrixXd columns(static_cast<Eigen::Index>(data.rows.size()), 7);  // a group of four, and three
  for (Eigen::Index c = 0; c < columns.cols(); ++c)
    columns.col(c) = noise(data, 1.0, 4.0, 0.2, 3.0, 50 + static_cast<unsigned>(c));
  Eigen::MatrixXd together = columns;
  weigh(data, weights, together);
  const Eigen::MatrixXd back = unfiltered_each(data, weights, together);
  for (Eigen::Index c = 0; c < columns.cols(); ++c) {
    Eigen::VectorXd alone = columns.col(c);
    weigh(data, weights, alone);
    EXPECT_EQ(alone, together.col(c)) << c;
    EXPECT_EQ(unfiltered(data, weights, alone), back.col(c)) << c;
  }
}

TEST(Colour, is_gone_from_what_the_filter_leaves_and_comes_back_without_it) {
  const Prepared data = rows_of_runs(6, 4000);
  const Eigen::VectorXd before = noise(data, 1.0, 4.0, 0.2, 3.0, 1);
  Weights weights;
  weights.sigma[0] = 0.5;
  weights.colour[0] = {.white = 4.0, .slow = 16.0, .memory = 0.2, .wander = 12.0};  // in units of σ²
  weights.take(data);
  Eigen::VectorXd rows = before;
  weigh(data, weights, rows);
  EXPECT_GT(correlation(data, before, 5), 0.6);
  for (const std::size_t lag : {1U, 2U, 5U, 20U, 60U})
    EXPECT_LT(std::abs(correlation(data, rows, lag)), 0.02) << lag;  // three sigma of 24 000 rows
  EXPECT_NEAR(rows.squaredNorm() / static_cast<double>(rows.size()), 4.0, 0.15);  // the white part's variance
  const Eigen::VectorXd back = unfiltered(data, weights, rows);
  EXPECT_LT((back - before / 0.5).cwiseAbs().maxCoeff(), 1e-9);
  // The same without what take() kept.
  Weights plain = weights;
  plain.filter.reset();
  Eigen::VectorXd again = before;
  weigh(data, plain, again);
  EXPECT_EQ((again - rows).cwiseAbs().maxCoeff(), 0.0);
}

/// Torque and motion of the same runs, read by sensors of one zero: y = n + d, y' = n' + 2 d (a σ half as large).
struct OneZero {
  Prepared data;
  Eigen::VectorXd rows, zero;  ///< the zero's part of the rows; none in those of the torque, which tell it
  Weights weights;

  explicit OneZero(unsigned seed, unsigned per_run = 2000) {
    const Prepared torque = rows_of_runs(5, per_run);
    const Eigen::VectorXd d = noise(torque, 0, 0, 1, 9, seed), n = noise(torque, 1, 0, 1, 0, seed + 1),
                          m = noise(torque, 4, 0, 1, 0, seed + 2);
    data.runs = torque.runs;
    for (PreparedRun& run : data.runs)
      for (unsigned k = 0; k < 4 * (per_run + 4); ++k) run.time.push_back(run.interval * k);
    rows.resize(2 * d.size());
    zero = Eigen::VectorXd::Zero(rows.size());
    data.run_begin = {0};
    for (unsigned r = 0; r < 5; ++r) {
      for (const Chain chain : {Chain::kTorque, Chain::kMotion})
        for (unsigned k = 0; k < per_run; ++k) {
          const auto of = static_cast<Eigen::Index>(r * per_run + k);
          rows[static_cast<Eigen::Index>(data.rows.size())] =
              d[of] + (chain == Chain::kTorque ? n[of] : m[of]);
          if (chain == Chain::kMotion) zero[static_cast<Eigen::Index>(data.rows.size())] = d[of];
          data.rows.push_back(torque.rows[static_cast<std::size_t>(of)]);
          data.rows.back().chain = chain;
        }
      data.run_begin.push_back(data.rows.size());
    }
    weights.sigma[static_cast<int>(Chain::kMotion)] = 2;
    weights.colour[static_cast<int>(Chain::kTorque)] = {.white = 1, .slow = 0, .memory = 0, .wander = 9};
    weights.one_zero = true;
    weights.take(data);
  }

  /// Rows in their chains' σ.
  [[nodiscard]] Eigen::VectorXd over_sigma(Eigen::VectorXd of) const {
    for (std::size_t i = 0; i < data.rows.size(); ++i)
      of[static_cast<Eigen::Index>(i)] /= weights.sigma[static_cast<int>(data.rows[i].chain)];
    return of;
  }
};

TEST(OneZero, of_torque_and_motion_is_taken_off_the_motion_and_comes_back) {
  const OneZero day(5);
  const Eigen::VectorXd plain = day.over_sigma(day.rows);
  Eigen::VectorXd rows = day.rows;
  weigh(day.data, day.weights, rows);
  double before = 0, after = 0, count = 0;
  for (std::size_t i = 0; i < day.data.rows.size(); ++i) {
    if (day.data.rows[i].chain != Chain::kMotion) continue;
    before += plain[static_cast<Eigen::Index>(i)] * plain[static_cast<Eigen::Index>(i)];
    after += rows[static_cast<Eigen::Index>(i)] * rows[static_cast<Eigen::Index>(i)];
    ++count;
  }
  EXPECT_GT(before / count, 1.25);        // white of variance one and the zero
  EXPECT_NEAR(after / count, 1.0, 0.06);  // white, and what the filter does not know of the zero
  EXPECT_LT((unfiltered(day.data, day.weights, rows) - plain).cwiseAbs().maxCoeff(), 1e-9);
  const Eigen::VectorXd without = without_shared_zero(day.data, day.weights, plain);
  for (std::size_t i = 0; i < day.data.rows.size(); ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    ASSERT_NEAR(without[k], day.data.rows[i].chain == Chain::kMotion ? rows[k] : plain[k], 1e-12);
  }
}

// What the model's torque lacks of what moves the joint is the difference of the two, which no sensor's zero touches.
TEST(OneZero, leaves_a_constant_of_the_models_torque_as_certain_as_white_noise_does) {
  double squares = 0;
  constexpr int kDays = 40;
  for (unsigned seed = 1; seed <= kDays; ++seed) {
    const OneZero day(10 * seed);
    Eigen::VectorXd constant = Eigen::VectorXd::Zero(day.rows.size()), rows = day.rows;
    for (std::size_t i = 0; i < day.data.rows.size(); ++i)
      if (day.data.rows[i].chain == Chain::kTorque) constant[static_cast<Eigen::Index>(i)] = 1;
    weigh(day.data, day.weights, constant);
    weigh(day.data, day.weights, rows);
    const double found = constant.dot(rows) / constant.squaredNorm();
    squares += found * found / kDays;
  }
  // Beside the torque alone it has the zero's standard deviation, 3/√5 = 1.3; here white noise of 2 √(1/10 000) and what the zero's steps leave.
  EXPECT_LT(std::sqrt(squares), 0.1);
}

// Functions of the signals, taken out of each chain by itself, take another share of the zero out of either: here each run's mean out of the torque and none
// of it out of the motion. Taken off after that, the zero lacks those means, and the motion's noise seems slow.
TEST(OneZero, is_taken_off_the_motion_before_functions_take_their_share) {
  int wandering = 0;
  double slow = 0, slow_after = 0;
  for (unsigned seed = 1; seed <= 12; ++seed) {
    OneZero day(10 * seed, 6000);
    day.data.with_free_torque = true;
    const Eigen::VectorXd rows = day.over_sigma(day.rows);
    const Cleaned means_of_the_torque = [&](const Eigen::VectorXd& left) {
      Eigen::VectorXd out = left;
      std::vector<double> mean(5, 0.0), n(5, 0.0);
      const auto each = [&](const auto& what) {
        for (std::size_t i = 0; i < day.data.rows.size(); ++i)
          if (day.data.rows[i].chain == Chain::kTorque)
            what(static_cast<Eigen::Index>(i), day.data.rows[i].run);
      };
      each([&](Eigen::Index i, std::size_t run) { mean[run] += left[i], n[run] += 1; });
      each([&](Eigen::Index i, std::size_t run) { out[i] -= mean[run] / n[run]; });
      return out;
    };
    Weights weights = day.weights;
    take_colours(day.data, rows, means_of_the_torque, weights);
    if (!weights.one_zero) continue;
    ++wandering;
    const auto slow_of = [](const Colour& colour) { return colour.slow + colour.wander; };
    slow += slow_of(weights.colour[static_cast<int>(Chain::kMotion)]);
    slow_after += slow_of(colour_of(
        day.data, without_shared_zero(day.data, weights, means_of_the_torque(rows)), Chain::kMotion));
  }
  ASSERT_GE(wandering, 6);
  EXPECT_LT(slow / wandering, 1.0);  // 9/4 is the zero's, in this chain's σ²
  EXPECT_GT(slow_after, 3 * slow) << slow_after << " " << slow;
}

// What is taken off the motion is not the zero but what the torque's noisy rows tell of it: a run's mean of that error against the derivation.
TEST(OneZero, is_told_by_the_torque_with_the_error_that_the_derivation_has) {
  constexpr std::size_t kRows = 2000;
  double measured = 0, runs = 0;
  for (unsigned seed = 1; seed <= 40; ++seed) {
    const OneZero day(10 * seed, kRows);
    const Eigen::VectorXd rows = day.over_sigma(day.rows), zero = day.over_sigma(day.zero);
    const Eigen::VectorXd error = without_shared_zero(day.data, day.weights, rows) - rows + zero;
    for (std::size_t i = 0; i < day.data.rows.size(); i += kRows)
      if (day.data.rows[i].chain == Chain::kMotion) {
        const double mean = error.segment(static_cast<Eigen::Index>(i), kRows).mean();
        measured += mean * mean;
        ++runs;
      }
  }
  const SlowError told = error_of_zero({.white = 1, .slow = 0, .memory = 0, .wander = 9}, kStep);
  const double share = 0.5;
  EXPECT_NEAR(share * share * 2 * told.variance * told.memory / (kRows * kStep) / (measured / runs), 1.0,
              0.25);
}

// That error is slow, and functions of the signals take it out of the rows that a colour is read off: here the means of quarters of a second.
TEST(OneZero, leaves_the_motion_at_least_the_error_with_which_the_torque_tells_it) {
  constexpr Eigen::Index kTogether = 30;
  int wandering = 0;
  for (unsigned seed = 1; seed <= 6; ++seed) {
    OneZero day(10 * seed, 6000);
    day.data.with_free_torque = true;
    const Eigen::VectorXd rows = day.over_sigma(day.rows);
    const Cleaned of_the_motion = [&](const Eigen::VectorXd& left) {
      Eigen::VectorXd out = left;
      for (Eigen::Index i = 0; i + kTogether <= left.size(); i += kTogether)
        if (day.data.rows[static_cast<std::size_t>(i)].chain == Chain::kMotion)
          out.segment(i, kTogether).array() -= left.segment(i, kTogether).mean();
      return out;
    };
    Weights weights = day.weights;
    take_colours(day.data, rows, of_the_motion, weights);
    if (!weights.one_zero) continue;
    ++wandering;
    const Colour& motion = weights.colour[static_cast<int>(Chain::kMotion)];
    const SlowError told = error_of_zero(weights.colour[static_cast<int>(Chain::kTorque)], kStep);
    EXPECT_GE(motion.slow * motion.memory, 0.25 * told.variance * told.memory * (1 - 1e-12));
    const Colour read =
        colour_of(day.data, of_the_motion(without_shared_zero(day.data, weights, rows)), Chain::kMotion);
    EXPECT_LT(read.slow * read.memory, 0.5 * motion.slow * motion.memory);  // it would not be read off
  }
  ASSERT_GE(wandering, 3);
}

TEST(Colour, makes_of_a_jump_what_it_is_worth_beside_noise_that_cannot_jump) {
  // Generalised least squares by the filter against the same by the covariance matrix itself.
  const Prepared data = rows_of_runs(1, 300);
  Weights weights;
  weights.colour[0] = {.white = 1.0, .slow = 5.0, .memory = 0.3, .wander = 0};
  Eigen::VectorXd jump(300);
  for (Eigen::Index k = 0; k < 300; ++k) jump[k] = (k / 40) % 2 == 0 ? 1.0 : -1.0;
  Eigen::MatrixXd covariance(300, 300);
  for (Eigen::Index i = 0; i < 300; ++i)
    for (Eigen::Index k = 0; k < 300; ++k) {
      const double dt = kStep / 4 *
                        std::abs(static_cast<double>(data.rows[static_cast<std::size_t>(i)].sample) -
                                 static_cast<double>(data.rows[static_cast<std::size_t>(k)].sample));
      covariance(i, k) = (i == k ? 1.0 : 0.0) + 5.0 * std::exp(-dt / 0.3);
    }
  Eigen::VectorXd rows = jump;
  weigh(data, weights, rows);
  const double exact = jump.dot(estimate::solve_symmetric(covariance, jump));
  EXPECT_NEAR(rows.squaredNorm(), exact, 1e-9 * exact);
}

TEST(Colour, is_read_off_a_residual) {
  const Prepared data = rows_of_runs(8, 5600, 0);
  int wandering = 0;
  for (unsigned seed = 1; seed <= 12; ++seed) {
    const Colour slow = colour_of(data, noise(data, 1.0, 3.0, 0.15, 0.0, seed), Chain::kTorque);
    EXPECT_NEAR(slow.slow, 3.0, 0.5) << seed;
    EXPECT_NEAR(slow.memory, 0.15, 0.04) << seed;
    wandering += slow.wander > 0 ? 1 : 0;
    const Colour zero = colour_of(data, noise(data, 1.0, 0.0, 0.1, 8.0, 100 + seed), Chain::kTorque);
    EXPECT_GT(zero.wander, 1.0) << seed;
    EXPECT_LT(zero.wander, 40.0) << seed;  // eight runs of 45 s hold few turns of 100 s
  }
  EXPECT_LE(wandering, 1);  // three standard errors
}

// A filter that takes off what is not there makes neighbouring blocks cancel, and p-values large.
TEST(Colour, of_white_noise_is_none) {
  const Prepared data = rows_of_runs(10, 3000);
  constexpr int kSeeds = 200;
  int coloured = 0, found = 0;
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    coloured += colour_of(data, noise(data, 1, 0, 0.1, 0, 1000 + seed), Chain::kTorque).slow > 0 ? 1 : 0;
    found += colour_of(data, noise(data, 1, 0.05, 0.3, 0, 2000 + seed), Chain::kTorque).slow > 0 ? 1 : 0;
  }
  EXPECT_LE(coloured, 0.03 * kSeeds);  // three sigma, of the best of some memories
  EXPECT_EQ(found, kSeeds) << "a twentieth of the white part's variance";
}

TEST(Colour, finds_a_zero_that_wanders_by_a_fifth_of_the_rows_noise) {
  const Prepared data = rows_of_runs(6, 5600, 0);
  int found = 0;
  for (unsigned seed = 1; seed <= 12; ++seed) {
    const Colour zero = colour_of(data, noise(data, 1.0, 0.0, 0.1, 0.04, 200 + seed), Chain::kTorque);
    found += zero.wander > 0.04 / 5 && zero.wander < 0.04 * 5 ? 1 : 0;
  }
  EXPECT_GE(found, 10);
}

/// There and back at speeds between 0.12 and 0.4 rad/s with round corners, as an encoder of 8000 steps reads it; the true velocity beside it.
struct Stroke {
  std::vector<double> angle, velocity;
};
Stroke stroke(double start, double seconds) {
  Stroke s;
  double angle = start, pushed = 0, velocity = 0;
  const double step = 2 * kPi / 8000;
  for (double t = 0; t < seconds; t += 1e-4) {
    const double speed = 0.12 + 0.07 * (static_cast<int>(t / 4.0) % 5);
    const double wanted = std::fmod(t, 4.0) < 2.0 ? speed : -speed;
    pushed += 1e-4 / 0.03 * (wanted - pushed);  // a hand does not jump in acceleration
    velocity += 1e-4 / 0.03 * (pushed - velocity);
    angle += 1e-4 * velocity;
    if (static_cast<double>(s.angle.size()) * 0.002 > t + 5e-5) continue;
    s.angle.push_back(step * (std::floor(angle / step) + 0.5));
    s.velocity.push_back(velocity);
  }
  return s;
}

TEST(QuietVelocity, does_not_pass_an_encoders_steps_for_less_damping_and_some_friction) {
  // T = −D φ̇ fitted by φ̇ and sgn φ̇ as they are read: with φ̇ noisy the first is too small, and the second takes what it lacks.
  const double step = 2 * kPi / 8000;
  double narrow = 0, quiet = 0;
  constexpr int kStarts = 8;
  for (int start = 0; start < kStarts; ++start) {
    const Stroke s = stroke(0.37 * start * step, 60);
    const std::vector<double> truth = low_pass(s.velocity, 3);
    const auto friction_of = [&](const std::vector<double>& v) {
      double vv = 0, vs = 0, ss = 0, yv = 0, ys = 0;
      for (std::size_t k = 100; k + 100 < v.size(); ++k) {
        const double sign = truth[k] > 0.02 ? 1 : truth[k] < -0.02 ? -1 : 0;
        vv += v[k] * v[k], vs += v[k] * sign, ss += sign * sign, yv += truth[k] * v[k], ys += truth[k] * sign;
      }
      return (ys * vv - yv * vs) / (ss * vv - vs * vs);  // rad/s that the sign stands for
    };
    narrow += friction_of(low_pass_derivative(s.angle, 3, 0.002, 1)) / kStarts;
    quiet += friction_of(quiet_velocity(s.angle, 3, 0.002, step)) / kStarts;
  }
  EXPECT_GT(narrow, 1e-3);
  EXPECT_LT(std::abs(quiet),
            0.5 * narrow);  // at some speeds the steps beat with the samples: slow, and no kernel helps
}

TEST(QuietVelocity, leaves_nothing_of_a_hands_reversals_that_passes_for_a_memory_of_the_velocity) {
  // What is left, along the velocity of the last 0.1 s less the velocity.
  const double step = 2 * kPi / 8000, interval = 0.002, stay = std::exp(-interval / 0.1);
  double along = 0, squares = 0;
  for (int start = 0; start < 8; ++start) {
    std::vector<double> angle, velocity;
    double true_angle = 0.37 * start * step;
    for (int k = 0; k < 10000; ++k) {
      velocity.push_back(1.5 * std::tanh(6 * std::sin(kPi * interval * k)));  // turns within 0.15 s
      angle.push_back(step * (std::floor(true_angle / step) + 0.5));
      true_angle += interval * 1.5 * std::tanh(6 * std::sin(kPi * interval * (k + 0.5)));
    }
    const std::vector<double> exact = low_pass(velocity, 3), quiet = quiet_velocity(angle, 3, interval, step);
    double remembered = 0;
    for (std::size_t k = 0; k + 100 < exact.size(); ++k) {
      remembered = stay * remembered + (1 - stay) * exact[k];
      if (k < 100) continue;
      const double memory = remembered - exact[k];
      along += memory * (quiet[k] - exact[k]);
      squares += memory * memory;
    }
  }
  EXPECT_LT(std::abs(along / squares), 1e-4);  // with the second moment alone 3.9e-4
}

TEST(QuietVelocity, leaves_nothing_of_slow_turns_that_passes_for_friction_which_falls) {
  // The velocity's error along friction that falls within 0.03 rad/s, which is read off the same counts: rad/s that D takes for friction.
  const double step = 2 * kPi / 8000, interval = 0.002;
  double narrow_along = 0, quiet_along = 0, squares = 0;
  for (int start = 0; start < 36; ++start) {
    const double turn = 1.2 + 0.15 * (start % 12), most = (0.6 + 0.1 * (start % 12)) / turn;  // rad/s
    const double kernel_passes = std::exp(-0.5 * std::pow(turn * 3 * interval, 2));
    std::vector<double> angle, velocity;
    for (int k = 0; k < 20000; ++k) {
      const double t = interval * k, drift = 1.3e-3;  // no two turns are alike within a step
      angle.push_back(step *
                      std::round(drift * t / step + 0.1 * start - most / turn * std::cos(turn * t) / step));
      velocity.push_back(drift + most * std::sin(turn * t) * kernel_passes);
    }
    const auto along = [&](const std::vector<double>& way, double* norm2) {
      const std::vector<double> dry = dry_velocity(angle, way, interval, step);
      double sum = 0;
      for (std::size_t k = 200; k + 200 < dry.size(); ++k) {
        if (dry[k] == 0) continue;
        const double falls = std::copysign(std::exp(-std::pow(dry[k] / 0.03, 2)), dry[k]);
        sum += falls * (way[k] - velocity[k]);
        if (norm2 != nullptr) *norm2 += falls * falls;
      }
      return sum;
    };
    narrow_along += along(low_pass_derivative(angle, 3, interval, 1), nullptr);
    quiet_along += along(quiet_velocity(angle, 3, interval, step), &squares);
  }
  EXPECT_GT(narrow_along / squares, 2e-3);
  EXPECT_LT(std::abs(quiet_along / squares),
            4e-4);  // 2.2e-3 with one wider kernel, chosen as if steps were white noise
}

TEST(QuietVelocity, loses_nothing_of_a_joint_that_swings) {
  // A decaying swing with its third harmonic, as a compliance that a command excites: what is left at its turns, along the direction of motion.
  const double step = 2 * kPi / 8000, interval = 0.002, kernel = 3 * interval;
  double along = 0, count = 0;
  for (int start = 0; start < 20; ++start) {
    const double turn = 24 + start, most = 2.5;  // rad/s
    std::vector<double> angle, exact;
    for (int k = 0; k < 1500; ++k) {
      const double t = interval * k, far = most * std::exp(-0.5 * t);
      const auto swing = [&](double harmonic) { return std::sin(harmonic * turn * t); };
      const auto way = [&](double harmonic) { return -std::cos(harmonic * turn * t) / (harmonic * turn); };
      const auto passes = [&](double harmonic) {
        return std::exp(-0.5 * std::pow(harmonic * turn * kernel, 2));
      };
      angle.push_back(step * std::round(0.37 * start + far * (way(1) - 0.1 * way(3)) / step));
      exact.push_back(far * (swing(1) * passes(1) - 0.1 * swing(3) * passes(3)));
    }
    const std::vector<double> quiet = quiet_velocity(angle, 3, interval, step);
    for (std::size_t k = 100; k + 100 < exact.size(); ++k) {
      if (std::abs(exact[k]) > 0.7 * most) continue;
      along += std::copysign(1.0, exact[k]) * (quiet[k] - exact[k]);
      ++count;
    }
  }
  EXPECT_LT(std::abs(along / count), 2e-4);  // rad/s; 6.5e-4 where only the power of the difference is asked
}

TEST(QuietVelocity, follows_a_quick_motion_as_the_narrow_kernel_does) {
  const double step = 2 * kPi / 8000, turn = 2 * kPi * 4;
  std::vector<double> angle, exact;
  for (int k = 0; k < 5000; ++k) {
    const double t = 0.002 * k;
    angle.push_back(step * (std::floor(0.4 * std::sin(turn * t) / step) + 0.5));
    exact.push_back(0.4 * turn * std::cos(turn * t) * std::exp(-0.5 * turn * turn * 0.006 * 0.006));
  }
  const std::vector<double> quiet = quiet_velocity(angle, 3, 0.002, step),
                            narrow = low_pass_derivative(angle, 3, 0.002, 1);
  double quiet2 = 0, narrow2 = 0;
  for (std::size_t k = 100; k + 100 < exact.size(); ++k) {
    quiet2 += (quiet[k] - exact[k]) * (quiet[k] - exact[k]);
    narrow2 += (narrow[k] - exact[k]) * (narrow[k] - exact[k]);
  }
  EXPECT_LT(quiet2, 1.2 * narrow2);
  EXPECT_EQ(quiet_velocity(angle, 3, 0.002, std::nan("")), narrow);
}

TEST(QuietAcceleration, carries_less_of_the_encoders_steps_and_follows_a_quick_motion) {
  const double step = 2 * kPi / 8000, interval = 0.002, sigma = 0.020;
  struct Noise {
    double quiet = 0, narrow = 0, along = 0, squares = 0;
  };
  const auto noise_of = [&](double hertz) {
    const double turn = 2 * kPi * hertz;
    std::vector<double> angle, exact;
    for (int k = 0; k < 10000; ++k) {
      const double t = interval * k;
      angle.push_back(step *
                      (std::floor((0.4 * std::sin(turn * t) + 0.002 * std::sin(37 * t)) / step) + 0.5));
      exact.push_back(-0.4 * turn * turn * std::sin(turn * t) * std::exp(-0.5 * turn * turn * sigma * sigma) -
                      0.002 * 37 * 37 * std::sin(37 * t) * std::exp(-0.5 * 37 * 37 * sigma * sigma));
    }
    const std::vector<double> quiet = quiet_acceleration(angle, sigma / interval, interval, step),
                              narrow = low_pass_derivative(angle, sigma / interval, interval, 2);
    Noise n;
    for (std::size_t k = 200; k + 200 < exact.size(); ++k) {
      n.quiet += (quiet[k] - exact[k]) * (quiet[k] - exact[k]);
      n.narrow += (narrow[k] - exact[k]) * (narrow[k] - exact[k]);
      n.along += (quiet[k] - exact[k]) * exact[k];
      n.squares += exact[k] * exact[k];
    }
    return n;
  };
  const Noise slow = noise_of(0.5), quick = noise_of(4);
  EXPECT_LT(slow.quiet, 0.7 * slow.narrow);
  EXPECT_LT(quick.quiet, 1.2 * quick.narrow);
  EXPECT_LT(std::abs(slow.along),
            4e-3 * slow.squares);  // a swing of 2 mrad at 6 Hz is hardly more than the steps
  EXPECT_LT(std::abs(quick.along), 1e-3 * quick.squares);
}

// Even strokes at 1.02 steps of the encoder for each sample: the steps beat with the clock at 10 Hz, which the kernel passes.
TEST(Beats, of_the_encoder_with_the_clock_are_hushed_within_even_strokes) {
  const double step = 2 * kPi / 8000, interval = 0.002, sigma = 3, speed = 1.02 * step / interval;
  std::vector<double> read, exact;
  for (int k = 0; k < 6000; ++k) {
    const double t = interval * k;
    exact.push_back(speed * (2 - std::abs(std::fmod(t, 4.0) - 2)));
    read.push_back(step * (std::floor(exact.back() / step) + 0.5));
  }
  std::vector<double> angle = low_pass(read, sigma), velocity = quiet_velocity(read, sigma, interval, step);
  const std::vector<double> before = angle, rough = velocity;
  hush_beats(read, interval, step, angle, velocity);
  double off = 0, was_off = 0, wrong = 0, was_wrong = 0;
  for (std::size_t k = 1; k + 1 < exact.size(); ++k) {
    const double in_stroke = std::fmod(interval * static_cast<double>(k), 2.0),
                 way = velocity[k] > 0 ? 1 : -1;
    if (in_stroke < 0.7 || in_stroke > 1.3) continue;
    off += (angle[k] - exact[k]) * (angle[k] - exact[k]);
    was_off += (before[k] - exact[k]) * (before[k] - exact[k]);
    wrong += (velocity[k] - way * speed) * (velocity[k] - way * speed);
    was_wrong += (rough[k] - way * speed) * (rough[k] - way * speed);
  }
  EXPECT_LT(off, 0.02 * was_off);
  EXPECT_LT(wrong, 0.02 * was_wrong);
  for (std::size_t k = 950; k < 1050; ++k) EXPECT_EQ(angle[k], before[k]) << "at the turn";
}

TEST(Beats, are_where_the_speed_is_even_and_a_multiple_of_half_a_step_for_each_sample) {
  const double step = 2 * kPi / 8000, interval = 0.002;
  const auto share = [&](double steps, double swing) {
    std::vector<double> velocity;
    for (int k = 0; k < 3000; ++k)
      velocity.push_back((steps + swing * std::sin(2 * kPi * interval * k)) * step / interval);
    const std::vector<unsigned char> beats = beats_with_clock(velocity, interval, step);
    return static_cast<double>(std::count(beats.begin(), beats.end(), 1)) / 3000;
  };
  for (const double steps : {0.5, 1.0, -1.02, 2.47}) EXPECT_EQ(share(steps, 0), 1.0) << steps;
  for (const double steps : {0.0, 0.02, 0.75, -1.3}) EXPECT_EQ(share(steps, 0), 0.0) << steps;
  EXPECT_LT(share(1.0, 2.0), 0.05) << "passed, not kept";
  EXPECT_EQ(beats_with_clock(std::vector<double>(100, 1.0), interval, std::nan("")),
            std::vector<unsigned char>(100, 0));
}

/// Runs of the tied rig whose pressure readings carry slow noise, felt by the torque or not.
std::vector<series::Recording> with_slow_pressure_noise(bool felt) {
  const test::TiedRig rig;
  PlannedRun steps = test::clamped(30, 0.1, 1.2, 5, "steps"), sines = test::clamped(30, -0.2, 1.0, 4);
  PlannedRun hand = test::by_hand(30, 0.4, 1.5), other = test::by_hand(30, 0.4, 0.8, 0.5);
  other.mean_pressure_kgcm2 = 3.5;
  auto runs = test::record_all(rig, {steps, sines, hand, other});
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal;
  for (series::Recording& run : runs) {
    std::vector<double>*p1 = nullptr, *p2 = nullptr, *f1 = nullptr, *f2 = nullptr;
    for (series::Column& c : run.columns) {
      if (c.name == "p1") p1 = &c.values;
      if (c.name == "p2") p2 = &c.values;
      if (c.name == "F1") f1 = &c.values;
      if (c.name == "F2") f2 = &c.values;
    }
    const double stay = std::exp(-0.002 / 0.3), fresh = std::sqrt(1 - stay * stay);
    double z[2] = {normal(random), normal(random)};
    for (std::size_t k = 0; k < p1->size(); ++k) {
      for (double& value : z) value = stay * value + fresh * normal(random);
      const double off1 = 2000 * z[0], off2 = 2000 * z[1];  // Pa
      (*p1)[k] += off1;
      (*p2)[k] += off2;
      if (!felt) continue;
      const double torque = rig.B * rig.radius * 0.5 * (off2 - off1);
      (*f1)[k] -= 0.5 * torque / rig.radius;
      (*f2)[k] += 0.5 * torque / rig.radius;
    }
  }
  return runs;
}

TEST(QuietPressure, keeps_what_the_torque_follows_and_drops_what_only_the_sensor_says) {
  const test::TiedRig rig;
  for (const bool felt : {false, true}) {
    const auto runs = with_slow_pressure_noise(felt);
    Prepared data = prepare(runs, rig.facts(), {}, 2.0);
    const QuietPressure quiet = QuietPressure::learn(data);
    // The middle band holds most of it: memory 0.3 s.
    if (felt) {
      EXPECT_GT(quiet.felt()[1], 0.8);
    } else {
      EXPECT_LT(quiet.felt()[1], 0.25);
    }
    // Noise of 2 kPa and a memory of 0.3 s in either sensor leaves a run's mean of half their difference uncertain by √(2·0.3 s/30 s) of
    // √½ of that; what the torque follows is no error.
    const double expected = std::sqrt(0.5) * 2000 * std::sqrt(2 * 0.3 / 30);
    for (const PreparedRun& run : data.runs) {
      if (felt) {
        EXPECT_LT(run.mean_pressure_error, 0.3 * expected);
      } else {
        EXPECT_GT(run.mean_pressure_error, 0.4 * expected);
        EXPECT_LT(run.mean_pressure_error, 1.6 * expected);
      }
    }
  }
}

TEST(QuietPressure, knows_the_error_of_a_runs_mean_though_readings_are_missing) {
  const test::TiedRig rig;
  auto runs = with_slow_pressure_noise(false);
  for (series::Column& c : runs[1].columns)
    if (c.name == "p1")
      for (std::size_t k = 4000; k < 4040; ++k) c.values[k] = std::nan("");
  Prepared data = prepare(runs, rig.facts(), {}, 2.0);
  (void)QuietPressure::learn(data);
  for (const PreparedRun& run : data.runs) {
    EXPECT_GT(run.mean_pressure_error, 20);
    EXPECT_LT(run.mean_pressure_error, 500);
  }
}

// The lag by which a sensor's noise is known is fitted to that noise: what it is off by stands in the torque of all runs alike.
TEST(QuietPressure, knows_what_the_error_of_the_fitted_lag_makes) {
  test::TiedRig rig;
  rig.pressure_noise = 0;
  PlannedRun steps = test::clamped(20, 0.1, 1.2, 5, "steps"), sines = test::clamped(20, -0.2, 1.0, 4);
  const std::vector<series::Recording> clean =
      test::record_all(rig, {steps, sines, test::by_hand(20, 0.4, 1.5)});
  const Prepared truth = prepare(clean, rig.facts(), {}, 2.0);
  std::mt19937_64 random(17);
  std::normal_distribution<double> normal;
  constexpr int kDraws = 40;
  double squares = 0;
  for (int draw = 0; draw < kDraws; ++draw) {
    std::vector<series::Recording> runs = clean;
    const double stay = std::exp(-0.002 / 0.1), fresh = std::sqrt(1 - stay * stay);
    for (series::Recording& run : runs)
      for (series::Column& c : run.columns) {
        if (c.name != "p1" && c.name != "p2") continue;
        double z = normal(random);
        for (double& p : c.values) p += 2000 * (z = stay * z + fresh * normal(random));  // Pa
      }
    Prepared data = prepare(runs, rig.facts(), {}, 2.0);
    (void)QuietPressure::learn(data);
    double product = 0, norm2 = 0;
    for (std::size_t r = 0; r < data.runs.size(); ++r) {
      const PreparedRun& run = data.runs[r];
      ASSERT_EQ(run.lag_pressure_error.size(), run.time.size());
      for (std::size_t k = 0; k < run.time.size(); ++k) {
        const double e = run.lag_pressure_error[k];
        const auto half = [&](const auto& p) { return 0.5 * (p[1][k] - p[0][k]); };
        product += e * (half(run.pressure) - half(truth.runs[r].smooth_pressure));
        norm2 += e * e;
      }
    }
    ASSERT_GT(norm2, 0);
    squares += product / norm2 * (product / norm2);
  }
  EXPECT_GT(squares / kDraws, 0.5);
  EXPECT_LT(squares / kDraws, 1.8);
}

TEST(QuietPressure, leaves_readings_alone_without_commands) {
  const test::TiedRig rig;
  auto runs = test::record_all(rig, {test::by_hand(20, 0.4, 1.5), test::by_hand(20, 0.3, 0.7)});
  for (series::Recording& run : runs)
    std::erase_if(run.columns,
                  [](const series::Column& c) { return c.name == "p1_cmd" || c.name == "p2_cmd"; });
  Prepared data = prepare(runs, rig.facts(), {}, 2.0);
  const std::vector<double> before = data.runs[0].pressure[0];
  const QuietPressure quiet = QuietPressure::learn(data);
  EXPECT_EQ(before, data.runs[0].pressure[0]);
}

TEST(QuietPressure, moves_no_pressure_where_the_valve_is_its_lag) {
  // A reading is low-passed; held against a prediction that is not, σ²/(2 T²) = 6e-4 of what is still to come would be left.
  test::TiedRig rig;
  rig.pressure_noise = 0.0005 * kPascalPerKgfCm2;
  rig.force_noise = 3;  // the torque says nothing, so rules say all
  Prepared data =
      prepare(test::record_all(rig, {test::clamped(40, 0.1, 1.0, 8), test::clamped(40, -0.1, 1.0, 2, "steps"),
                                     test::by_hand(40, 0.3, 1.0)}),
              rig.facts(), {}, 4.0);
  (void)QuietPressure::learn(data);
  double product = 0, squares = 0;
  for (const PreparedRun& run : data.runs)
    for (int i = 0; i < 2; ++i)
      for (std::size_t k = 500; k + 100 < run.time.size(); ++k) {
        const double ahead = run.command[i][k] - run.smooth_pressure[i][k];
        product += ahead * (run.pressure[i][k] - run.smooth_pressure[i][k]);
        squares += ahead * ahead;
      }
  EXPECT_LT(std::abs(product / squares), 1e-4);
}

}  // namespace
}  // namespace isac::explain
