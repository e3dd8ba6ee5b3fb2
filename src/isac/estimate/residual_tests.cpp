#include "isac/estimate/residual_tests.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "isac/estimate/linear_algebra.hpp"
#include "isac/series/statistics.hpp"

namespace isac::estimate {
namespace {

constexpr double kLevel = 0.01;
constexpr double kMaterial =
    1e-3;  // of the output's half range: less than that is significant, not important
constexpr std::size_t kMostRows = 60000;

struct Candidate {
  const char* words;
  std::vector<double> values;
};

struct Group {
  const char* name;
  const char* input;
  const char* hint;
  const char* term;  ///< of the catalogue, which would describe it
  std::vector<Candidate> candidates;
};

/// What to call so that the term is fitted along.
std::string with_term(const JointFitOptions& options, const char* term) {
  std::string out = "--terms ";
  for (const std::string& known : options.terms) {
    if (known == term) return "other terms of the catalogue (docs/effects.md)";
    out += known + ",";
  }
  return out + term;
}

ResidualTest whiteness(const JointRows& rows, std::span<const double> residual, int window) {
  std::vector<std::vector<double>> pieces;
  for (const RunRows& run : rows.runs) {
    std::vector<double> piece;
    for (std::size_t i = run.begin; i < run.end; i += static_cast<std::size_t>(window))
      piece.push_back(residual[i]);
    if (!piece.empty()) pieces.push_back(std::move(piece));
  }
  // Robust: a spike must not hide correlation.
  std::vector<double> all;
  for (const auto& piece : pieces) all.insert(all.end(), piece.begin(), piece.end());
  const double limit = 3.0 * series::robust_deviation(all, true);
  for (auto& piece : pieces)
    for (double& v : piece) v = std::clamp(v, -limit, limit);
  const series::LjungBox box = series::ljung_box(pieces, 20);
  ResidualTest test{.name = "whiteness",
                    .statistic = box.statistic,
                    .p_value = box.p_value,
                    .passed = box.p_value > kLevel,
                    .sentence = {}};
  test.sentence =
      test.passed
          ? fmt::format(
                "The residual is white at {} samples' distance (Ljung-Box p = {:.2g}): nothing periodic or "
                "slow is left in it.",
                window, box.p_value)
          : fmt::format(
                "The residual is not white (Ljung-Box p = {:.1g}): it remembers its past, by coloured noise "
                "or a missing effect; the intervals are made by blocks of time and allow for it.",
                box.p_value);
  return test;
}

}  // namespace

std::vector<ResidualTest> residual_tests(const JointRows& rows, const FittedRows& fitted,
                                         std::span<const BlockRange> blocks, int window,
                                         const JointFitOptions& options) {
  const std::span<const double> residual = fitted.residual, omega = fitted.omega;
  std::vector<ResidualTest> out;
  if (rows.size() == 0) return out;
  out.push_back(whiteness(rows, residual, window));
  if (blocks.size() < 4) return out;

  // Every stride-th row carries all that a test of slow functions needs.
  const std::size_t stride = std::max<std::size_t>(1, rows.size() / kMostRows);
  std::vector<std::size_t> index;
  std::vector<std::size_t> block_of;
  for (std::size_t b = 0; b < blocks.size(); ++b)
    for (std::size_t i = blocks[b].begin; i < blocks[b].end; i += stride) {
      index.push_back(i);
      block_of.push_back(b);
    }
  const auto n = static_cast<Eigen::Index>(index.size());
  const auto own = static_cast<Eigen::Index>(fitted.used.size());
  const auto zeros = static_cast<Eigen::Index>(fitted.zero.empty() ? 0 : 1 + fitted.resting.size());
  const Eigen::Index p = own + zeros;
  Eigen::MatrixXd x(n, p);
  Eigen::VectorXd w(n), r(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const std::size_t row = index[static_cast<std::size_t>(i)];
    for (Eigen::Index k = 0; k < own; ++k) x(i, k) = fitted.used[static_cast<std::size_t>(k)][row];
    if (zeros > 0) x(i, own) = fitted.zero[row];
    for (Eigen::Index k = own + 1; k < p; ++k) {
      const RobustProblem::Local& run = fitted.resting[static_cast<std::size_t>(k - own - 1)];
      x(i, k) = row >= run.begin && row < run.end ? fitted.zero[row] : 0.0;
    }
    w[i] = omega[row];
    r[i] = residual[row];
  }
  const Eigen::VectorXd scale = x.colwise().norm().cwiseMax(1e-300).cwiseInverse();
  const Eigen::MatrixXd unit = x * scale.asDiagonal();
  const Eigen::MatrixXd weighted = w.asDiagonal() * unit;
  const Eigen::MatrixXd normal = unit.transpose() * weighted;

  const auto column = [&](auto&& f) {
    std::vector<double> values(index.size());
    for (std::size_t i = 0; i < index.size(); ++i) values[i] = f(rows.state(index[i]));
    return values;
  };
  const double p0 = options.reference_pressure;
  std::vector<Group> groups;
  groups.push_back(
      {"residual_against_angle",
       "the angle",
       "stiffness that is not a straight line, or a slack muscle",
       "cubic_stiffness",
       {{"angle", column([](const JointState& s) { return s.angle; })},
        {"square of the angle", column([](const JointState& s) { return s.angle * s.angle; })},
        {"cube of the angle", column([](const JointState& s) { return s.angle * s.angle * s.angle; })}}});
  groups.push_back({"residual_against_velocity",
                    "the velocity",
                    "damping of another law",
                    "quadratic_damping",
                    {{"velocity", column([](const JointState& s) { return s.velocity; })},
                     {"velocity times its size",
                      column([](const JointState& s) { return s.velocity * std::abs(s.velocity); })},
                     {"cube of the velocity",
                      column([](const JointState& s) { return s.velocity * s.velocity * s.velocity; })}}});
  groups.push_back({"residual_against_direction",
                    "the direction of motion",
                    "Coulomb friction or hysteresis",
                    "coulomb_friction",
                    {{"direction", column([](const JointState& s) {
                        return s.velocity > 0 ? 1.0 : s.velocity < 0 ? -1.0 : 0.0;
                      })}}});
  groups.push_back({"residual_against_pressure",
                    "the pressure difference",
                    "torque that is not linear in pressure",
                    "nonlinear_pressure_gain",
                    {{"pressure difference", column([](const JointState& s) { return s.delta_pressure; })},
                     {"square of the pressure difference",
                      column([](const JointState& s) { return s.delta_pressure * s.delta_pressure; })},
                     {"cube of the pressure difference", column([](const JointState& s) {
                        return s.delta_pressure * s.delta_pressure * s.delta_pressure;
                      })},
                     {"pressure difference times angle",
                      column([](const JointState& s) { return s.delta_pressure * s.angle; })}}});
  groups.push_back({"residual_against_mean_pressure",
                    "the mean pressure",
                    "unequal muscles, or stiffness with pressure",
                    "pressure_dependent_stiffness",
                    {{"mean pressure", column([p0](const JointState& s) {
                        return s.mean_pressure == 0.0 ? 0.0 : s.mean_pressure - p0;
                      })},
                     {"mean pressure times angle", column([p0](const JointState& s) {
                        return s.mean_pressure == 0.0 ? 0.0 : (s.mean_pressure - p0) * s.angle;
                      })}}});
  groups.push_back({"residual_against_constant",
                    "a constant",
                    "an offset of the sensors or the torque",
                    "offset",
                    {{"constant", column([](const JointState&) { return 1.0; })}}});
  groups.push_back({"residual_against_time",
                    "the time since the start",
                    "drift or creep",
                    "thermal_drift",
                    {{"time", column([](const JointState& s) { return s.time; })}}});

  const auto [low, high] = std::minmax_element(rows.output.begin(), rows.output.end());
  const double half_range = 0.5 * (*high - *low);
  for (const Group& group : groups) {
    double best_p = 1, best_t = 0, best_size = 0;
    const char* best_words = nullptr;
    int tried = 0;
    for (const Candidate& candidate : group.candidates) {
      const Eigen::Map<const Eigen::VectorXd> z(candidate.values.data(), n);
      const double before = z.norm();
      if (!std::isfinite(before) || before == 0) continue;
      const Eigen::VectorXd rest = z - unit * solve_symmetric(normal, weighted.transpose() * z);
      if (rest.norm() < 1e-4 * before) continue;  // the model already has it
      Eigen::VectorXd score = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(blocks.size()));
      for (Eigen::Index i = 0; i < n; ++i)
        score[static_cast<Eigen::Index>(block_of[static_cast<std::size_t>(i)])] += w[i] * rest[i] * r[i];
      if (!(score.squaredNorm() > 0)) continue;
      ++tried;
      const double t = score.sum() / score.norm();
      const double p_value = series::student_t_two_sided(t, static_cast<double>(blocks.size()) - 1.0);
      if (best_words == nullptr || p_value < best_p) {
        best_p = p_value;
        best_t = t;
        best_words = candidate.words;
        const double slope = score.sum() / (w.array() * rest.array().square()).sum();
        best_size = std::abs(slope) * rest.norm() / std::sqrt(static_cast<double>(n));
      }
    }
    if (best_words == nullptr) continue;
    ResidualTest test{.name = group.name,
                      .statistic = best_t,
                      .p_value = std::min(1.0, best_p * tried),
                      .passed = true,
                      .sentence = {}};
    const bool follows = test.p_value <= kLevel;
    test.passed = !follows || best_size < kMaterial * half_range;
    test.sentence =
        !follows ? fmt::format("The residual does not follow {} (p = {:.2g}).", group.input, test.p_value)
        : test.passed
            ? fmt::format(
                  "The residual follows {} by {:.1g} {} rms, less than a thousandth of the output's range: "
                  "many rows "
                  "show it, no use of the model does.",
                  group.input, best_size, options.output_unit)
            : fmt::format(
                  "The residual still follows {} ({}, {:.2g} {} rms, p = {:.1g}): the model may miss {}; try "
                  "{}.",
                  group.input, best_words, best_size, options.output_unit, test.p_value, group.hint,
                  with_term(options, group.term));
    out.push_back(std::move(test));
  }
  return out;
}

}  // namespace isac::estimate
