#include <ceres/ceres.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "isac/estimate/block_covariance.hpp"
#include "isac/estimate/identifiability.hpp"
#include "isac/estimate/robust.hpp"
#include "isac/estimate/streaming_joint_fit.hpp"
#include "joint_data.hpp"

using namespace isac;
using namespace isac::estimate;
using namespace isac::test;

namespace {

/// A small robust problem with outliers and columns of very different size.
struct Small {
  std::vector<double> x[3], y, w;
  explicit Small(unsigned seed) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    for (int i = 0; i < 4000; ++i) {
      const double a = normal(random), b = normal(random), c = 0.8 * a + 0.6 * normal(random);
      x[0].push_back(1e-4 * a);
      x[1].push_back(2e3 * b);
      x[2].push_back(c);
      y.push_back(-2e4 * x[0].back() + 1e-3 * x[1].back() + 0.7 * c + 0.001 * normal(random) +
                  (i % 50 == 0 ? 0.05 : 0.0));
      w.push_back(0.5 + (i % 7) / 7.0);
    }
  }
  RobustProblem problem(Loss::Kind kind) const {
    RobustProblem p;
    p.rows = y.size();
    for (const auto& column : x) p.columns.push_back(column.data());
    p.output = y.data();
    p.weight = w.data();
    p.kind = kind;
    p.scale = 0.0013;
    return p;
  }
};

struct Row {
  double x0, x1, x2, y, root;
  template <class T>
  bool operator()(const T* p, T* r) const {
    r[0] = root * (y - p[0] * 1e4 * x0 - p[1] * 1e-3 * x1 - p[2] * x2);
    return true;
  }
};

}  // namespace

TEST(RobustProblem, gives_the_answer_of_ceres_row_by_row) {
  // Noise of a thousandth: row by row, Ceres stalls where steps drown in the rounding of the cost, some 1e-6 standard errors out.
  const Small data(3);
  for (const auto kind : {Loss::Kind::kSquared, Loss::Kind::kHuber, Loss::Kind::kCauchy}) {
    ceres::Problem rows;
    double p[3] = {-2, 1, 0.7};  // Cauchy's loss has other valleys: both start in the same one
    for (std::size_t i = 0; i < data.y.size(); ++i) {
      ceres::LossFunction* loss = nullptr;
      if (kind == Loss::Kind::kHuber) loss = new ceres::HuberLoss(0.0013);
      if (kind == Loss::Kind::kCauchy) loss = new ceres::CauchyLoss(0.0013);
      rows.AddResidualBlock(new ceres::AutoDiffCostFunction<Row, 1, 3>(new Row{
                                data.x[0][i], data.x[1][i], data.x[2][i], data.y[i], std::sqrt(data.w[i])}),
                            loss, p);
    }
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::DENSE_QR;
    options.function_tolerance = options.gradient_tolerance =
        1e-30;  // to the end: its default stops at 1e-8 of the answer
    options.parameter_tolerance = 1e-14;
    options.max_num_iterations = 500;
    options.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &rows, &summary);
    const RobustSolution ours = solve(data.problem(kind), Eigen::Vector3d(-2e4, 1e-3, 0.7));
    EXPECT_TRUE(ours.converged) << ours.report;
    const double theirs[3] = {p[0] * 1e4, p[1] * 1e-3, p[2]};
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(ours.theta[k], theirs[k], 1e-9 * std::abs(theirs[k]));
  }
}

TEST(RobustProblem, moment_and_curvature_are_the_derivatives_of_its_cost) {
  const Small data(5);
  for (const auto kind : {Loss::Kind::kSquared, Loss::Kind::kCauchy}) {
    const RobustProblem problem = data.problem(kind);
    const Eigen::Vector3d theta(-1.99995e4, 1.0000005e-3, 0.7002), step(1e-3, 1e-10, 1e-7);
    const Pass here = problem.pass(theta, 0, problem.rows, true, true);
    for (int k = 0; k < 3; ++k) {
      Eigen::Vector3d up = theta, down = theta;
      up[k] += step[k];
      down[k] -= step[k];
      const Pass above = problem.pass(up, 0, problem.rows, true, true),
                 below = problem.pass(down, 0, problem.rows, true, true);
      const double slope =
          0.5 * (above.cost - below.cost) / (2 * step[k]);  // cost is twice what is minimised
      EXPECT_NEAR(slope, -here.moment[k],
                  1e-6 * here.moment.cwiseAbs().maxCoeff() + 1e-5 * std::abs(here.moment[k]));
      for (int j = 0; j < 3; ++j) {
        const double bend = -(above.moment[j] - below.moment[j]) / (2 * step[k]);
        EXPECT_NEAR(bend, here.curvature(j, k), 1e-5 * std::sqrt(here.gram(j, j) * here.gram(k, k)));
      }
    }
  }
}

TEST(RobustProblem, sums_of_parts_are_the_sum_of_the_whole) {
  const Small data(6);
  const RobustProblem problem = data.problem(Loss::Kind::kHuber);
  const Eigen::Vector3d theta(-2e4, 1e-3, 0.7);
  const Pass whole = problem.pass(theta, 0, 4000, true, true), a = problem.pass(theta, 0, 1233, true, true),
             b = problem.pass(theta, 1233, 4000, true, true);
  // Rounding of 4000 terms.
  EXPECT_LT((whole.gram - a.gram - b.gram).cwiseAbs().maxCoeff(), 1e-12 * whole.gram.cwiseAbs().maxCoeff());
  EXPECT_NEAR(whole.cost, a.cost + b.cost, 1e-12 * whole.cost);
}

TEST(BlockCovariance, of_single_rows_is_the_classical_one_under_white_noise) {
  // Blocks of equal design and white noise: CR2 estimates σ² (XᵀX)⁻¹ without bias.
  std::mt19937 random(9);
  std::normal_distribution<double> normal;
  double sum = 0;
  constexpr int kRuns = 300, kRows = 20;
  for (int run = 0; run < kRuns; ++run) {
    std::vector<double> y(kRows);
    double mean = 0;
    for (double& v : y) mean += v = normal(random);
    mean /= kRows;
    std::vector<BlockSums> blocks;
    for (const double v : y)
      blocks.push_back({Eigen::VectorXd::Constant(1, v - mean), Eigen::MatrixXd::Ones(1, 1)});
    const BlockCovariance covariance = block_covariance(blocks);
    sum += covariance.covariance(0, 0);
    EXPECT_NEAR(covariance.degrees_of_freedom[0], kRows - 1, 1e-9);
  }
  // χ² with 19 · 300 degrees of freedom: 1.9 % standard deviation, four of them.
  EXPECT_NEAR(sum / kRuns, 1.0 / kRows, 0.076 / kRows);
}

TEST(Identifiability, names_still_columns_noise_and_combinations_whatever_their_units) {
  Eigen::MatrixXd x = Eigen::MatrixXd::Random(500, 5);
  x.col(3) = 2.0 * x.col(0) - x.col(1);
  x.col(4).setZero();
  for (const double unit : {1.0, 1e-9}) {
    Eigen::MatrixXd scaled = x;
    scaled.col(0) *= unit;
    const Eigen::MatrixXd gram = scaled.transpose() * scaled;
    Eigen::MatrixXd excess = Eigen::MatrixXd::Zero(5, 5);
    excess(2, 2) = 0.9 * gram(2, 2);
    const Rank rank = find_rank(gram, excess);
    EXPECT_EQ(rank.fault[0], Rank::Fault::kCombination);
    EXPECT_EQ(rank.fault[1], Rank::Fault::kCombination);
    EXPECT_EQ(rank.fault[2], Rank::Fault::kNoiseOnly);
    EXPECT_EQ(rank.fault[3], Rank::Fault::kCombination);
    EXPECT_EQ(rank.fault[4], Rank::Fault::kStill);
    EXPECT_EQ(rank.kept.size(), 2u);
  }
}

namespace {

JointRun part(const JointRun& run, std::size_t begin, std::size_t end) {
  JointRun out;
  out.name = run.name;
  const auto cut = [&](const std::vector<double>& c) {
    return std::vector<double>(c.begin() + static_cast<long>(begin), c.begin() + static_cast<long>(end));
  };
  out.time = cut(run.time);
  out.angle = cut(run.angle);
  out.delta_pressure = cut(run.delta_pressure);
  out.mean_pressure = cut(run.mean_pressure);
  out.output = cut(run.output);
  return out;
}

JointFit stream(const std::vector<JointRun>& runs, const JointFitOptions& options) {
  StreamingJointFit fit(options, 4000);
  for (const JointRun& run : runs)
    for (std::size_t b = 0; b < run.time.size(); b += 1777)
      fit.add(part(run, b, std::min(run.time.size(), b + 1777)));
  return fit.finish();
}

}  // namespace

TEST(StreamingJointFit, without_loss_is_the_fit_in_memory) {
  Sensors sensors;
  sensors.jitter = 0;
  std::vector<JointRun> runs;
  for (const double dp : {-1.0, 1.0})
    runs.push_back(record(fast(dp), Truth{}, sensors, static_cast<unsigned>(30 + dp)));
  auto options = options_for(Truth{});
  options.loss.kind = Loss::Kind::kSquared;
  options.effective_variance = false;
  options.differentiator.window = 21;
  options.noise.angle = 2.3e-4;
  options.noise.delta_pressure = 280;
  const JointFit whole = fit_joint(runs, {}, options), streamed = stream(runs, options);
  EXPECT_EQ(whole.samples, streamed.samples);
  for (const char* name : {"A", "B", "C", "D"}) {
    const Estimated &a = find(whole.parameters, name), &b = find(streamed.parameters, name);
    EXPECT_NEAR(a.value, b.value, 1e-9 * std::abs(a.value)) << name;
  }
  EXPECT_NEAR(whole.rmse, streamed.rmse, 1e-9 * whole.rmse);
}

TEST(StreamingJointFit, with_loss_stays_within_a_fraction_of_a_standard_error) {
  Sensors sensors;
  sensors.spikes = 0.01;
  sensors.coloured = 0.02;
  std::vector<JointRun> runs;
  for (const double dp : {-1.0, 0.0, 1.0})
    runs.push_back(record(fast(dp), Truth{}, sensors, static_cast<unsigned>(50 + dp)));
  const JointFit whole = fit_joint(runs, {}, options_for(Truth{})),
                 streamed = stream(runs, options_for(Truth{}));
  for (const char* name : {"A", "C", "D"}) {
    const Estimated &a = find(whole.parameters, name), &b = find(streamed.parameters, name);
    ASSERT_TRUE(b.identifiable) << b.reason;
    EXPECT_NEAR(a.value, b.value, 0.5 * a.std_error) << name;
    EXPECT_NEAR(a.std_error, b.std_error, 0.5 * a.std_error) << name;
  }
}

TEST(StreamingJointFit, parts_merge_into_the_whole) {
  std::vector<JointRun> runs;
  for (unsigned k = 0; k < 3; ++k)
    runs.push_back(record(fast(static_cast<double>(k) - 1.0), Truth{}, Sensors{}, 80 + k));
  const auto options = options_for(Truth{});
  StreamingJointFit one(options, 4000), two(options, 4000);
  one.add(runs[0]);
  two.add(runs[0]);
  StreamingJointFit other = two.fork();
  one.add(runs[1]);
  one.add(runs[2]);
  two.add(runs[1]);
  other.add(runs[2]);
  two.merge(other);
  const JointFit a = one.finish(), b = two.finish();
  EXPECT_EQ(a.samples, b.samples);
  // The same sums in another order of adding.
  for (std::size_t k = 0; k < a.parameters.size(); ++k) {
    EXPECT_NEAR(a.parameters[k].value, b.parameters[k].value, 1e-10 * std::abs(a.parameters[k].value));
    EXPECT_NEAR(a.parameters[k].std_error, b.parameters[k].std_error, 1e-6 * a.parameters[k].std_error);
  }
}
