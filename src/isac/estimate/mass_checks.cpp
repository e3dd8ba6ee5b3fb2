#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "isac/estimate/linear_algebra.hpp"
#include "isac/estimate/mass_problem.hpp"
#include "isac/series/statistics.hpp"

namespace isac::estimate {
namespace {

using Kind = MassUnknown::Kind;
constexpr double kSetLevel = 0.01;  // of a false alarm in the whole set of candidates
constexpr double kDegree = 0.0174532925199433;

struct Candidate {
  std::string cause, unit;
  Eigen::VectorXd column;  // over the noise, prior rows zero
  bool zero = false;
};

bool fitted(const MassProblem& problem, Kind kind, std::size_t index) {
  return std::any_of(problem.unknowns.begin(), problem.unknowns.end(),
                     [&](const MassUnknown& u) { return u.kind == kind && u.index == index; });
}

std::vector<Candidate> candidates(const MassProblem& problem, const Eigen::VectorXd& values) {
  std::vector<Candidate> out;
  const Eigen::Index rows = static_cast<Eigen::Index>(problem.data.size()) + problem.priors();
  const auto extend = [rows](const Eigen::VectorXd& column) {
    Eigen::VectorXd longer = Eigen::VectorXd::Zero(rows);
    longer.head(column.size()) = column;
    return longer;
  };
  for (std::size_t j = 0; j < static_cast<std::size_t>(problem.arm.joints); ++j) {
    const std::string number = std::to_string(j + 1);
    if (!fitted(problem, Kind::kZero, j)) {
      out.push_back({"zero of " + std::string(problem.actuator_angles ? "phi" : "theta") + number, "rad",
                     extend(problem.column({Kind::kZero, j, {}, {}}, values)), true});
    }
    const bool measured = std::any_of(problem.data.begin(), problem.data.end(),
                                      [j](const MassDatum& row) { return row.joint == j; });
    if (!measured) continue;
    if (!fitted(problem, Kind::kOffset, j)) {
      out.push_back({"torque offset of joint " + number, "N m",
                     extend(problem.column({Kind::kOffset, j, {}, {}}, values)), false});
    }
    // The predicted torque, not the measured one, whose noise is in the residual too.
    Eigen::VectorXd gain = Eigen::VectorXd::Zero(rows);
    for (std::size_t i = 0; i < problem.data.size(); ++i) {
      const MassDatum& row = problem.data[i];
      if (row.joint == j)
        gain[static_cast<Eigen::Index>(i)] = problem.predict(row, values, nullptr) / row.noise;
    }
    out.push_back({"torque gain of joint " + number, "-", std::move(gain), false});
  }
  return out;
}

struct Score {
  double amount = 0, p_value = 1, seen_per_unit = 0;
};

}  // namespace

void check_unmodelled(const MassProblem& problem, const Eigen::VectorXd& values, const MassState& state,
                      MassFit& fit) {
  const auto own = static_cast<double>(static_cast<Eigen::Index>(problem.unknowns.size()) - problem.priors());
  const std::vector<Candidate> all = candidates(problem, values);
  std::vector<Score> scores;
  fit.sensitivities.clear();
  for (const Candidate& candidate : all) {
    const Eigen::VectorXd moved =
        least_squares(state.jacobian, candidate.column);  // what the fit makes of one unit of the error
    const Eigen::VectorXd rest = candidate.column - state.jacobian * moved;
    MassSensitivity sensitivity{candidate.cause, candidate.unit, std::vector<double>(fit.masses.size(), 0)};
    for (std::size_t k = 0; k < problem.unknowns.size(); ++k) {
      if (problem.unknowns[k].kind == Kind::kMass)
        sensitivity.per_unit[problem.unknowns[k].index] = moved[static_cast<Eigen::Index>(k)];
    }
    fit.sensitivities.push_back(std::move(sensitivity));
    Score score;
    const double length = rest.norm();
    score.seen_per_unit = length;
    // Rows that neither the unknowns nor this error move are no evidence: their torque may never have been measured.
    double squares = 0, freedom = -own;
    for (Eigen::Index i = 0; i < static_cast<Eigen::Index>(problem.data.size()); ++i) {
      if (!state.informative[static_cast<std::size_t>(i)] && candidate.column[i] == 0) continue;
      squares += state.residual[i] * state.residual[i];
      freedom += 1;
    }
    if (length > 1e-6 * candidate.column.norm() && length > 0 && state.freedom > 0 && freedom > 1) {
      score.amount = rest.dot(state.residual) / (length * length);
      const double left = std::max(squares - std::pow(rest.dot(state.residual) / length, 2), 0.0);
      const double spread = std::sqrt(std::max(left / (freedom - 1), 1e-24));
      score.p_value = series::student_t_two_sided(score.amount * length / spread, freedom - 1);
    }
    scores.push_back(score);
  }
  const auto count = static_cast<double>(std::max<std::size_t>(all.size(), 1));
  std::vector<std::size_t> seen;
  for (std::size_t i = 0; i < all.size(); ++i)
    if (scores[i].p_value * count < kSetLevel) seen.push_back(i);
  std::sort(seen.begin(), seen.end(),
            [&](std::size_t a, std::size_t b) { return scores[a].p_value < scores[b].p_value; });
  if (!seen.empty()) {
    const std::size_t best = seen.front();
    std::string text =
        fmt::format("The residuals follow the {}, about {:.3g} {} (p = {:.1g}): the masses are biased by it",
                    all[best].cause, scores[best].amount,
                    all[best].unit == "-" ? "of its value" : all[best].unit, scores[best].p_value);
    if (seen.size() > 1) text += "; the " + all[seen[1]].cause + " would explain them too";
    text += all[best].zero            ? "; check the encoder's middle, or fit it with --unknowns zeros."
            : all[best].unit == "N m" ? "; fit it with --unknowns offsets."
                                      : "; identify that joint's actuator anew.";
    fit.warnings.push_back({"unmodelled_error", text});
  }
  // What no residual of these poses would show: one degree of a zero below two standard deviations.
  std::string hidden;
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (!all[i].zero || scores[i].seen_per_unit * kDegree > 2) continue;
    for (std::size_t m = 0; m < fit.masses.size(); ++m) {
      const double shift = std::abs(fit.sensitivities[i].per_unit[m]) * kDegree;
      if (!fit.masses[m].identifiable || shift < 0.5 * fit.masses[m].std_error || !(shift > 0)) continue;
      hidden += fmt::format("{}{} moves {} by {:.3g} kg", hidden.empty() ? "" : ", ", all[i].cause,
                            fit.masses[m].name, shift);
    }
  }
  if (!hidden.empty()) {
    fit.warnings.push_back({"hidden_zero",
                            "An angle that is wrong by one degree would not show in these poses, and is not "
                            "part of the standard errors: " +
                                hidden + "; calibrate the encoders' middles first."});
  }
}

}  // namespace isac::estimate
