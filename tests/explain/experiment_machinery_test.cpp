// Two tests of the machinery that need data of their own: the size of a gap is told without bias, and a loop that is closed
// over the disturbance does not make up an effect.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include "isac/explain/filters.hpp"
#include "isac/explain/projection.hpp"
#include "isac/explain/proof.hpp"
#include "isac/explain/screen.hpp"
#include "tied_data.hpp"

namespace isac::explain {
namespace {

/// Torque of a hand-driven run with dry friction, noise of its own for every draw.
struct Known {
  series::Recording clean;
  test::TiedRig rig;
  Known() {
    rig.force_noise = 0;
    rig.pressure_noise = 0;
    rig.dry = 0.004;
    clean = test::record(rig, test::by_hand(12, 0.35, 1.0), 3);
  }
  [[nodiscard]] series::Recording noisy(double force_noise, std::uint32_t draw) const {
    std::mt19937 random(draw);
    std::normal_distribution<double> gauss;
    series::Recording out = clean;
    for (const char* name : {"F1", "F2"})
      for (series::Column& column : out.columns)
        if (column.name == name)
          for (double& v : column.values) v += force_noise * gauss(random);
    return out;
  }
};

/// The explainable discrepancy as the gap has it: mean square of what the model leaves, less that of the floor.
TEST(Gap, of_known_size_is_told_without_bias) {
  const Known known;
  constexpr double kForceNoise = 0.3;  // N in each sensor, 0.008 N m: twice the friction
  double sum = 0, squares = 0, floors = 0;
  constexpr int kDraws = 500;
  // The true model without its friction: nothing is refitted, so that the gap is known.
  std::vector<double> truth;
  for (std::uint32_t draw = 0; draw < kDraws; ++draw) {
    const std::vector<series::Recording> runs = {known.noisy(kForceNoise, 100 + draw)};
    const Prepared data = prepare(runs, known.rig.facts(), {}, 4.0);
    const Predictor predictor(data);
    ModelPoint model;
    for (const BaseParameter& p : predictor.base())
      model.base.push_back(p.name == "A"     ? known.rig.A
                           : p.name == "B"   ? known.rig.B
                           : p.name == "C"   ? known.rig.C
                           : p.name == "D"   ? known.rig.D
                           : p.name == "K_C" ? known.rig.K_C
                                             : known.rig.T_C);
    const std::vector<double>* torque[] = {&data.runs.front().torque};
    const double floor = white_noise(torque), left = raw_residual(predictor, model, Chain::kTorque).rms();
    const double ed = left * left - floor * floor;
    sum += ed;
    squares += ed * ed;
    floors += floor / kDraws;
  }
  // What the same model leaves of the run without noise: friction, and steps of the encoder.
  const std::vector<series::Recording> runs = {known.clean};
  const Prepared data = prepare(runs, known.rig.facts(), {}, 4.0);
  const Predictor predictor(data);
  ModelPoint model;
  model.base = {known.rig.A, known.rig.B, known.rig.C, known.rig.D, known.rig.K_C, known.rig.T_C};
  ASSERT_EQ(predictor.base().front().name, "A");
  const double injected = raw_residual(predictor, model, Chain::kTorque).rms();
  EXPECT_NEAR(injected, 0.004, 0.0004) << "friction of one size whatever the speed";
  const double mean = sum / kDraws, error = std::sqrt((squares / kDraws - mean * mean) / kDraws);
  // The floor is a robust deviation, within a per cent of the truth; three standard errors of the mean besides.
  const double white = kForceNoise * std::sqrt(2.0) * known.rig.radius;
  EXPECT_NEAR(floors, white, 0.01 * white);
  EXPECT_NEAR(mean, injected * injected, 3 * error + 2 * 0.005 * white * white);
  // Without the floor taken off the gap would be told five times too large.
  EXPECT_GT(injected * injected + white * white, 4 * mean);
}

/// A joint that a controller holds to a path, its own torque disturbed: the disturbance moves what is measured.
class ClosedLoop {
 public:
  /// p-value of the largest score over columns; `balance`: residual of I φ̈ = T, else of a fit of T by angle, speed and pressure.
  static double p_value(bool balance, std::mt19937_64& random) {
    constexpr double kInertia = 0.0085, kStiffness = 8.5, kDamping = 0.14, kGain = 6, kStep = 0.002;
    constexpr int kPerRow = 8;
    constexpr Eigen::Index kBlocks = 40,
                           kRows = 125;  // two seconds, six times as long as the disturbance remembers
    std::normal_distribution<double> gauss;
    const Eigen::Index n = kBlocks * kRows;
    Eigen::MatrixXd base(n, 3), columns(n, 6);
    Eigen::VectorXd torque(n), acceleration(n);
    double angle = 0, velocity = 0, disturbance = 0.02 * gauss(random);
    const double keep = std::exp(-kStep / 0.3), phase = 6.28 * gauss(random);
    std::array<double, 16> past{};
    for (Eigen::Index i = 0; i < n; ++i) {
      double T = 0, u = 0;
      for (int k = 0; k < kPerRow; ++k) {
        const double t = kStep * static_cast<double>(i * kPerRow + k);
        const double path = 0.25 * std::sin(1.1 * t + phase) + 0.1 * std::sin(2.9 * t);
        u = kGain * (path - angle) + kStiffness * path;
        disturbance = keep * disturbance + 0.02 * std::sqrt(1 - keep * keep) * gauss(random);
        T = -kStiffness * angle - kDamping * velocity + u + disturbance;
        velocity += kStep * T / kInertia;
        angle += kStep * velocity;
      }
      acceleration[i] = T / kInertia;
      torque[i] = T + 0.004 * gauss(random);
      base.row(i) << angle, velocity, u;
      const double lagged = past[static_cast<std::size_t>(i) % past.size()];
      past[static_cast<std::size_t>(i) % past.size()] = angle;
      columns.row(i) << acceleration[i], angle * angle, angle * angle * angle, velocity * std::abs(velocity),
          velocity > 0 ? 1.0 : -1.0, lagged;
    }
    Eigen::VectorXd residual = torque;
    if (balance) {
      residual -= kInertia * acceleration;
    } else {
      const Eigen::MatrixXd q = basis_of(base);
      residual -= q * (q.transpose() * residual);
      columns -= q * (q.transpose() * columns).eval();
    }
    Eigen::MatrixXd scores(kBlocks, columns.cols());
    for (Eigen::Index b = 0; b < kBlocks; ++b)
      scores.row(b) = residual.segment(b * kRows, kRows).transpose() * columns.middleRows(b * kRows, kRows);
    return flip_test(scores, 199, random(), 0.01).p_value;
  }
};

TEST(ClosedLoop, gives_uniform_p_values_by_the_balance_of_motion) {
  std::mt19937_64 random(21);
  constexpr int kDraws = 600;
  std::vector<double> p;
  for (int draw = 0; draw < kDraws; ++draw) p.push_back(ClosedLoop::p_value(true, random));
  std::sort(p.begin(), p.end());
  double distance = 0;
  for (int i = 0; i < kDraws; ++i)
    distance = std::max({distance, std::abs(p[static_cast<std::size_t>(i)] - static_cast<double>(i) / kDraws),
                         std::abs(p[static_cast<std::size_t>(i)] - static_cast<double>(i + 1) / kDraws)});
  // 1.63/√n is passed once in a hundred; the p-values come in steps of 1/200.
  EXPECT_LT(distance, 1.63 / std::sqrt(kDraws) + 1.0 / 200);
}

TEST(ClosedLoop, would_make_up_effects_if_the_torque_were_fitted_by_the_motion_that_it_makes) {
  std::mt19937_64 random(22);
  int alarms = 0;
  for (int draw = 0; draw < 50; ++draw) alarms += ClosedLoop::p_value(false, random) <= 0.05 ? 1 : 0;
  EXPECT_GT(alarms, 45) << "the trap that the balance of motion avoids is there in these data";
}

}  // namespace
}  // namespace isac::explain
