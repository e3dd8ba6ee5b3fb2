#include "isac/estimate/mass_fit.hpp"

#include <algorithm>
#include <boost/math/distributions/fisher_f.hpp>
#include <cmath>

#include "isac/core/error.hpp"
#include "isac/estimate/linear_algebra.hpp"
#include "isac/estimate/mass_problem.hpp"
#include "isac/series/statistics.hpp"

namespace isac::estimate {

MassState mass_state(const MassProblem& problem, const Eigen::VectorXd& values) {
  MassState out;
  problem.linearise(values, out.jacobian, out.residual);
  const double largest = out.jacobian.cwiseAbs().maxCoeff();
  out.informative.resize(problem.data.size());
  for (std::size_t i = 0; i < problem.data.size(); ++i) {
    out.informative[i] =
        out.jacobian.row(static_cast<Eigen::Index>(i)).cwiseAbs().maxCoeff() > 1e-9 * largest;
    out.freedom += out.informative[i] ? 1 : 0;
  }
  out.freedom -= static_cast<long>(problem.unknowns.size()) - problem.priors();
  const Eigen::MatrixXd gram = out.jacobian.transpose() * out.jacobian;
  out.covariance = inverse_symmetric(gram);
  return out;
}

namespace {

using Kind = MassUnknown::Kind;

constexpr double kCorner = 1.5;           // of Huber's loss, in noises: 96 % efficient on clean data
constexpr double kSquaresShare = 0.7785;  // E ψ² of a unit normal at that corner
constexpr double kCleanFactor = 1.0371;   // E ψ² / (E ψ′)² there
constexpr double kOutlier = 0.01;         // level over all poses, at which a pose is named
constexpr double kGross = 1e-4;           // … at which it is left out
constexpr double kMostLeftOut = 0.2;      // of the poses
constexpr double kTwoSided = 1.959964;    // 95 % of a normal
constexpr double kWidestZero = 0.35;      // rad, half a 95 % interval: wider tells nothing about an encoder
constexpr double kNoiseDenied =
    0.001;  // p-value of the residuals under the noise told, below which it is estimated

/// Huber's variance factor over that of least squares: (Σψ²/ν)/(mean ψ′)², with his correction for few rows.
double loss_factor(const MassState& state, std::size_t unknowns) {
  double squares = 0, inside = 0, rows = 0;
  for (std::size_t i = 0; i < state.informative.size(); ++i) {
    if (!state.informative[i]) continue;
    const double r = state.residual[static_cast<Eigen::Index>(i)];
    squares += std::pow(std::min(std::abs(r), kCorner), 2);
    inside += std::abs(r) < kCorner ? 1 : 0;
    rows += 1;
  }
  if (state.freedom <= 0 || !(inside > 0)) return 1;
  const double share = inside / rows;
  const double correction = 1 + static_cast<double>(unknowns) / rows * (1 - share) / share;
  return correction * correction * squares / static_cast<double>(state.freedom) / (share * share);
}

/// Solves, and where the noise is unknown scales it until Σψ² is what unit noise gives (Huber's proposal 2).
MassSolution solve_scaled(MassProblem& problem, const Eigen::VectorXd& start, bool scale_noise,
                          double huber) {
  MassSolution solution = solve_masses(problem, start, scale_noise ? 0 : huber);
  if (!scale_noise) return solution;
  double largest = 0;
  for (const MassDatum& row : problem.data) largest = std::max(largest, std::abs(row.gravity));
  for (int turn = 0; turn < 12; ++turn) {
    const MassState state = mass_state(problem, solution.values);
    if (state.freedom <= 0) return solution;
    std::vector<double> sizes;
    for (std::size_t i = 0; i < problem.data.size(); ++i)
      if (state.informative[i]) sizes.push_back(std::abs(state.residual[static_cast<Eigen::Index>(i)]));
    double factor = 0;
    if (turn == 0) {  // 1.4826 times the median is a normal's deviation; the fit took its share of the rows
      factor = 1.4826 * series::median(sizes) *
               std::sqrt(static_cast<double>(sizes.size()) / static_cast<double>(state.freedom));
    } else {
      double squares = 0;
      for (const double size : sizes) squares += std::pow(huber > 0 ? std::min(size, kCorner) : size, 2);
      factor = std::sqrt(squares / static_cast<double>(state.freedom) / (huber > 0 ? kSquaresShare : 1));
    }
    for (MassDatum& row : problem.data) row.noise = std::max(row.noise * factor, 1e-12 * largest + 1e-300);
    solution = solve_masses(problem, solution.values, huber);
    if (turn > 0 && std::abs(factor - 1) < 1e-4) break;
  }
  return solution;
}

/// p-value of every pose's residuals, leverage taken out; F where the noise is estimated from the same residuals.
void judge_poses(const MassProblem& problem, const MassState& state, bool estimated,
                 std::vector<MassPoseResult>& poses) {
  std::vector<double> sum(poses.size(), 0), count(poses.size(), 0);
  for (std::size_t i = 0; i < problem.data.size(); ++i) {
    if (!state.informative[i]) continue;
    const auto row = static_cast<Eigen::Index>(i);
    const Eigen::VectorXd x = state.jacobian.row(row);
    const double left = 1 - x.dot(state.covariance * x);
    if (left < 1e-6) continue;
    sum[problem.data[i].pose] += state.residual[row] * state.residual[row] / left;
    count[problem.data[i].pose] += 1;
  }
  for (std::size_t p = 0; p < poses.size(); ++p) {
    if (poses[p].left_out || !(count[p] > 0) || state.freedom <= 0) continue;
    if (estimated) {
      const boost::math::fisher_f f(count[p], static_cast<double>(state.freedom));
      poses[p].p_value = boost::math::cdf(boost::math::complement(f, sum[p] / count[p]));
    } else {
      poses[p].p_value = series::chi_square_upper(sum[p], count[p]);
    }
    poses[p].outlier = poses[p].p_value * static_cast<double>(poses.size()) < kOutlier;
  }
}

double condition_of(const MassProblem& problem, const MassState& state) {
  std::vector<Eigen::Index> columns;
  for (std::size_t k = 0; k < problem.unknowns.size(); ++k)
    if (problem.unknowns[k].kind == Kind::kMass) columns.push_back(static_cast<Eigen::Index>(k));
  Eigen::MatrixXd regressors(static_cast<Eigen::Index>(problem.data.size()),
                             static_cast<Eigen::Index>(columns.size()));
  for (std::size_t c = 0; c < columns.size(); ++c)
    for (Eigen::Index i = 0; i < regressors.rows(); ++i)
      regressors(i, static_cast<Eigen::Index>(c)) =
          state.jacobian(i, columns[c]) * problem.data[static_cast<std::size_t>(i)].noise;
  if (columns.empty() || columns.size() < problem.arm.mass_names.size()) return std::nan("");
  const Eigen::VectorXd s = singular_values(regressors);
  return s[0] / s[s.size() - 1];
}

void require_actuators(const MassArm& arm, const MassFitOptions& options) {
  if (!options.from_pressures && !options.torques_by_model) return;
  bool known = arm.actuators.size() == static_cast<std::size_t>(arm.joints);
  for (const MassActuator& actuator : arm.actuators)
    known = known && std::isfinite(actuator.A) && std::isfinite(actuator.B) &&
            std::isfinite(actuator.wheel_radius);
  if (!known)
    throw Error(ErrorKind::kAnswerIsNo, "actuators_unknown",
                "torques by the actuators' model need A, B and chain_wheel_diameter of every [[actuator]] in "
                "the arm file; add them");
}

/// The fit's steps on one problem; every step leaves `fit_` as far as it is known.
class Fitter {
 public:
  Fitter(const MassArm& arm, std::span<const MassPose> recorded, const MassFitOptions& options)
      : options_(options),
        problem_(arm, options),
        told_(std::any_of(options.torque_noise.begin(), options.torque_noise.end(),
                          [](double n) { return std::isfinite(n); })) {
    prepare(recorded);
  }

  MassFit run() {
    choice_ = choose_unknowns(problem_, options_);
    do {
      fit_once();
    } while (leave_out_worst() || refuse_widest());
    conclude();
    return std::move(fit_);
  }

 private:
  void prepare(std::span<const MassPose> recorded);
  void fit_once();
  bool leave_out_worst();
  bool refuse_widest();
  void conclude();
  void reset_noise() {
    if (told_) return;
    for (MassDatum& row : problem_.data) row.noise = noise_factor_[row.pose];
  }

  MassFitOptions options_;
  MassProblem problem_;
  bool told_;  // the noise of the torques is given
  std::vector<double> noise_factor_;
  std::vector<MassDatum> every_;
  MassChoice choice_;
  MassSolution solution_;
  MassState state_;
  MassFit fit_;
};

void Fitter::prepare(std::span<const MassPose> recorded) {
  MassReading reading = read_mass_poses(problem_, recorded, options_, told_);
  noise_factor_ = std::move(reading.noise_factor);
  fit_.sign = reading.sign;
  fit_.friction = reading.friction;
  fit_.warnings = std::move(reading.warnings);
  every_ = problem_.data;
  for (const MassPose& pose : problem_.poses) {
    MassPoseResult result;
    result.name = pose.name;
    result.angle = pose.angle;
    fit_.poses.push_back(result);
  }
}

void Fitter::fit_once() {
  if (problem_.unknowns.empty()) return;
  const double huber = options_.robust ? kCorner : 0;
  std::erase_if(problem_.unknowns, [](const MassUnknown& u) { return u.has_prior(); });
  reset_noise();
  Eigen::VectorXd start = choice_.start;
  add_actuator_unknowns(problem_, start);
  const bool can_estimate = mass_state(problem_, start).freedom > 0;
  fit_.noise_estimated = !told_ && can_estimate;
  if (!told_ && !can_estimate)
    for (MassDatum& row : problem_.data) row.noise *= options_.assumed_noise;
  solution_ = solve_scaled(problem_, start, fit_.noise_estimated, huber);
  state_ = mass_state(problem_, solution_.values);
  if (told_ && can_estimate) {
    double squares = 0;
    for (std::size_t i = 0; i < problem_.data.size(); ++i)
      if (state_.informative[i]) squares += std::pow(state_.residual[static_cast<Eigen::Index>(i)], 2);
    if (series::chi_square_upper(squares, static_cast<double>(state_.freedom)) < kNoiseDenied) {
      fit_.noise_estimated = true;
      solution_ = solve_scaled(problem_, solution_.values, true, huber);
      state_ = mass_state(problem_, solution_.values);
    }
  }
  for (MassPoseResult& pose : fit_.poses) {
    pose.outlier = false;
    if (!pose.left_out) pose.p_value = 1;
  }
  judge_poses(problem_, state_, fit_.noise_estimated, fit_.poses);
}

/// A pose that the others contradict by far is taken out, the worst first; false when there is none.
bool Fitter::leave_out_worst() {
  if (!options_.robust || problem_.unknowns.empty()) return false;
  const auto rank = [](const MassPoseResult& pose) { return pose.left_out ? 2 : pose.p_value; };
  const auto worst = std::min_element(fit_.poses.begin(), fit_.poses.end(),
                                      [&](const auto& a, const auto& b) { return rank(a) < rank(b); });
  const auto poses = static_cast<double>(fit_.poses.size());
  const auto out = static_cast<double>(
      std::count_if(fit_.poses.begin(), fit_.poses.end(), [](const auto& p) { return p.left_out; }));
  if (worst->left_out || worst->p_value * poses >= kGross || out + 1 > kMostLeftOut * poses) return false;
  worst->left_out = true;
  problem_.data = every_;
  std::erase_if(problem_.data, [this](const MassDatum& row) { return fit_.poses[row.pose].left_out; });
  choice_ = choose_unknowns(problem_, options_);
  return true;
}

/// A zero or an offset that the poses tell only to within nothing is refused, the widest first; false when there is none.
bool Fitter::refuse_widest() {
  std::size_t widest = problem_.unknowns.size();
  double excess = 1;
  for (std::size_t k = 0; k < problem_.unknowns.size(); ++k) {
    const MassUnknown& unknown = problem_.unknowns[k];
    double limit = unknown.kind == Kind::kZero ? kWidestZero : 0;
    if (unknown.kind == Kind::kOffset) {
      for (const MassDatum& row : problem_.data)
        if (row.joint == unknown.index) limit = std::max({limit, std::abs(row.gravity), 3 * row.noise});
    }
    const auto at = static_cast<Eigen::Index>(k);
    const double half = kTwoSided * std::sqrt(std::max(state_.covariance(at, at), 0.0));
    if (limit > 0 && half > excess * limit) {
      excess = half / limit;
      widest = k;
    }
  }
  if (widest == problem_.unknowns.size()) return false;
  Estimated refused;
  refused.name = problem_.unknowns[widest].name;
  refused.unit = problem_.unknowns[widest].unit;
  refused.identifiable = false;
  refused.reason =
      "These poses tell it so badly that it would only spoil the masses: record more poses that turn this "
      "joint and those around it.";
  choice_.refused.push_back(refused);
  problem_.unknowns.erase(problem_.unknowns.begin() + static_cast<std::ptrdiff_t>(widest));
  Eigen::VectorXd start(choice_.start.size() - 1);
  for (Eigen::Index k = 0, to = 0; k < choice_.start.size(); ++k)
    if (k != static_cast<Eigen::Index>(widest)) start[to++] = choice_.start[k];
  choice_.start = start;
  return true;
}

void Fitter::conclude() {
  const auto n = static_cast<Eigen::Index>(problem_.unknowns.size());
  const std::size_t masses = problem_.arm.mass_names.size();
  fit_.random_errors.assign(masses, std::nan(""));
  fit_.model_errors.assign(masses, std::nan(""));
  fit_.correlation.assign(masses * masses, std::nan(""));
  fit_.information.assign(masses * masses, 0);
  std::vector<Estimated> answers = choice_.refused;
  if (n > 0) {
    fit_.converged = solution_.converged;
    fit_.solver_summary = solution_.report;
    fit_.degrees_of_freedom = std::max(state_.freedom, 0L);
    fit_.condition = condition_of(problem_, state_);
    const double factor = state_.freedom <= 0 || !options_.robust ? 1
                          : fit_.noise_estimated ? loss_factor(state_, problem_.unknowns.size())
                                                 : kCleanFactor;
    const auto rows = static_cast<Eigen::Index>(problem_.data.size());
    const Eigen::MatrixXd measured = state_.jacobian.topRows(rows),
                          prior = state_.jacobian.bottomRows(state_.jacobian.rows() - rows);
    const Eigen::MatrixXd information = measured.transpose() * measured / factor;
    const Eigen::Index own = n - problem_.priors();  // the unknowns without prior come first
    const Eigen::MatrixXd total = inverse_symmetric(information + prior.transpose() * prior);
    const Eigen::MatrixXd random = inverse_symmetric(information.topLeftCorner(own, own));
    const double reach =
        fit_.noise_estimated ? series::student_t_limit(0.95, static_cast<double>(state_.freedom)) : kTwoSided;
    for (Eigen::Index k = 0; k < own; ++k) {
      const MassUnknown& unknown = problem_.unknowns[static_cast<std::size_t>(k)];
      Estimated answer;
      answer.name = unknown.name;
      answer.unit = unknown.unit;
      answer.value = solution_.values[k];
      answer.std_error = std::sqrt(total(k, k));
      answer.ci_low = answer.value - reach * answer.std_error;
      answer.ci_high = answer.value + reach * answer.std_error;
      const bool part_of_sum = std::any_of(choice_.refused.begin(), choice_.refused.end(),
                                           [&](const Estimated& r) { return r.name == answer.name; });
      if (part_of_sum) continue;  // fitted in place of a sum that alone is known, and refused by name
      answers.push_back(answer);
      if (unknown.kind != Kind::kMass) continue;
      fit_.random_errors[unknown.index] = std::sqrt(random(k, k));
      fit_.model_errors[unknown.index] = std::sqrt(std::max(total(k, k) - random(k, k), 0.0));
      for (Eigen::Index l = 0; l < own; ++l) {
        const MassUnknown& other = problem_.unknowns[static_cast<std::size_t>(l)];
        if (other.kind != Kind::kMass) continue;
        fit_.correlation[unknown.index * masses + other.index] =
            total(k, l) / std::sqrt(total(k, k) * total(l, l));
        fit_.information[unknown.index * masses + other.index] = information(k, l);
      }
    }
  }
  // In the arm's order first, then what was asked for besides; a refused name that was fitted before it was refused stands once.
  for (const std::string& name : problem_.arm.mass_names)
    for (const Estimated& answer : answers)
      if (answer.name == name) fit_.masses.push_back(answer);
  for (const Estimated& answer : answers)
    if (std::find(problem_.arm.mass_names.begin(), problem_.arm.mass_names.end(), answer.name) ==
        problem_.arm.mass_names.end())
      fit_.others.push_back(answer);
  std::sort(fit_.others.begin(), fit_.others.end(),
            [](const auto& a, const auto& b) { return a.name < b.name; });
  std::vector<MassDatum> shown = every_;
  if (n > 0 && !problem_.data.empty()) {
    // All noises were scaled alike: what became of the first row's holds for the left-out ones.
    const MassDatum& first = problem_.data.front();
    const auto same = std::find_if(shown.begin(), shown.end(), [&](const MassDatum& row) {
      return row.pose == first.pose && row.joint == first.joint;
    });
    const double scale = first.noise / same->noise;
    for (MassDatum& row : shown) row.noise *= scale;
  }
  fill_rows(problem_, shown, solution_.values, fit_);
  add_warnings(problem_, solution_.values, state_, fit_);
  if (n > 0) check_unmodelled(problem_, solution_.values, state_, fit_);
}

}  // namespace

MassFit fit_masses(const MassArm& arm, std::span<const MassPose> recorded, const MassFitOptions& options) {
  require_actuators(arm, options);
  return Fitter(arm, recorded, options).run();
}

}  // namespace isac::estimate
