#include "isac/estimate/pose_design.hpp"

#include <nlopt.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "isac/estimate/linear_algebra.hpp"

namespace isac::estimate {
namespace {

using Matrix = Eigen::MatrixXd;
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr int kRandomSets = 100;
constexpr int kMostRounds = 20;
constexpr int kMostSteps = 300;      // of NLopt for one pose
constexpr double kTooMuch = 100;     // penalty of a pose that muscles cannot hold, per squared excess
constexpr int kMostDraws = 1000;     // for a random pose that they can
constexpr double kRoundGain = 1e-4;  // of the criterion's logarithm: errors to five parts in 100 000

/// x_i of the Halton sequence in base `base`, in (0, 1).
double halton(int i, int base) {
  double share = 1, value = 0;
  for (int rest = i; rest > 0; rest /= base) {
    share /= base;
    value += share * (rest % base);
  }
  return value;
}

class Designer {
 public:
  Designer(const MassArm& arm, const PoseDesignOptions& options)
      : arm_(arm), options_(options), masses_(arm.chain.mass_count) {
    felt_.fill(false);
    for (std::size_t j = 0; j < kArmJoints; ++j) {
      const double middle = (arm.limits.lower[j] + arm.limits.upper[j]) / 2;
      lower_[j] = std::min(arm.limits.lower[j] + options.spare_angle, middle);
      upper_[j] = std::max(arm.limits.upper[j] - options.spare_angle, middle);
    }
    find_felt_joints();
  }

  [[nodiscard]] ArmVector theta_of(const ArmVector& phi) const {
    ArmVector theta = models::multiply<double, 6>(arm_.coupling, phi);
    for (std::size_t j = 0; j < kArmJoints; ++j) theta[j] += arm_.middle[j];
    return theta;
  }

  /// Information of one pose.
  [[nodiscard]] Matrix information(const ArmVector& phi) const {
    const auto frames = models::chain_frames(arm_.chain, theta_of(phi));
    Matrix regressors = Matrix::Zero(static_cast<Eigen::Index>(kArmJoints), masses_);
    for (int m = 0; m < masses_; ++m) {
      const ArmVector torque = models::gravity_per_kilogram(arm_.chain, frames, m);
      for (std::size_t j = 0; j < static_cast<std::size_t>(arm_.joints); ++j)
        if (options_.measured[j])
          regressors(static_cast<Eigen::Index>(j), m) = torque[j] / options_.torque_noise[j];
    }
    return regressors.transpose() * regressors;
  }

  /// The lower the better; infinite where the masses cannot be told.
  [[nodiscard]] double criterion(const Matrix& sum) const {
    const Cholesky factor = cholesky(sum);
    if (!factor.positive) return kInfinity;
    const Matrix& root = factor.lower;
    if (options_.criterion == DesignCriterion::kD) {
      double logarithm = 0;
      for (Eigen::Index k = 0; k < root.rows(); ++k) logarithm -= 2 * std::log(root(k, k));
      return logarithm;
    }
    const Matrix inverse = inverse_symmetric(sum);
    double trace = 0;
    for (Eigen::Index k = 0; k < inverse.rows(); ++k) {
      const double size = arm_.chain.masses[static_cast<std::size_t>(k)].mass;
      trace += inverse(k, k) / (size > 0 ? size * size : 1);
    }
    return std::log(trace);
  }

  /// How far the pose asks more than the limit of Δp, as a share of it; 0 where muscles hold it.
  [[nodiscard]] double excess(const ArmVector& phi) const {
    if (!(options_.delta_pressure_limit > 0)) return 0;
    const ArmVector gravity = models::multiply_transposed<double, 6>(
        arm_.coupling, models::gravity_torque(arm_.chain, theta_of(phi)));
    double most = 0;
    for (std::size_t j = 0; j < arm_.actuators.size(); ++j) {
      const MassActuator& a = arm_.actuators[j];
      const double r = a.wheel_radius;
      const double delta = (-a.A * r * r * phi[j] - gravity[j]) / (a.B * r);
      if (std::isfinite(delta)) most = std::max(most, std::abs(delta) / options_.delta_pressure_limit - 1);
    }
    return most;
  }
  /// A pose from numbers in [0, 1): felt joints over their range, the others at rest.
  template <class Uniform>
  [[nodiscard]] ArmVector pose_from(Uniform uniform) const {
    ArmVector phi{};
    for (std::size_t j = 0; j < static_cast<std::size_t>(arm_.joints); ++j) {
      const double low = lower_[j], high = upper_[j];
      const double share = uniform(j);
      phi[j] = felt_[j] ? low + (high - low) * share : std::clamp(0.0, low, high);
    }
    return phi;
  }

  [[nodiscard]] std::vector<ArmVector> greedy(const Matrix& start) const;
  void refine(const Matrix& start, std::vector<ArmVector>& poses) const;
  [[nodiscard]] Matrix sum_of(const std::vector<ArmVector>& poses) const {
    Matrix sum = Matrix::Zero(masses_, masses_);
    for (const ArmVector& phi : poses) sum += information(phi);
    return sum;
  }
  [[nodiscard]] std::vector<double> errors_of(const Matrix& sum) const {
    std::vector<double> out(static_cast<std::size_t>(masses_), kInfinity);
    const Cholesky factor = cholesky(sum);
    if (!factor.positive) return out;
    const Matrix inverse = inverse_symmetric(sum);
    for (std::size_t k = 0; k < out.size(); ++k)
      out[k] = std::sqrt(inverse(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(k)));
    return out;
  }
  [[nodiscard]] std::vector<double> random_errors() const;

  [[nodiscard]] Matrix recorded() const {
    Matrix sum = Matrix::Zero(masses_, masses_);
    if (options_.recorded.size() == static_cast<std::size_t>(masses_ * masses_))
      sum = Eigen::Map<const Matrix>(options_.recorded.data(), masses_, masses_);
    return sum;
  }

 private:
  /// Angles that change some information somewhere; the others need not move.
  void find_felt_joints() {
    felt_.fill(true);
    std::array<bool, kArmJoints> felt{};
    for (int i = 1; i <= 16; ++i) {
      const ArmVector phi = pose_from([i](std::size_t j) { return halton(i, kBases[j]); });
      const Matrix here = information(phi);
      for (std::size_t j = 0; j < static_cast<std::size_t>(arm_.joints); ++j) {
        ArmVector moved = phi;
        moved[j] += 0.1;
        if ((information(moved) - here).norm() > 1e-9 * (here.norm() + 1e-300)) felt[j] = true;
      }
    }
    felt_ = felt;
  }

  static constexpr std::array<int, kArmJoints> kBases{2, 3, 5, 7, 11, 13};
  const MassArm& arm_;
  const PoseDesignOptions& options_;
  int masses_;
  std::array<bool, kArmJoints> felt_{};
  ArmVector lower_{}, upper_{};
};

std::vector<ArmVector> Designer::greedy(const Matrix& start) const {
  std::vector<ArmVector> candidates;
  std::vector<Matrix> shares;
  for (int i = 1; i <= options_.candidates; ++i) {
    const ArmVector phi = pose_from([i](std::size_t j) { return halton(i, kBases[j]); });
    if (excess(phi) > 0) continue;
    candidates.push_back(phi);
    shares.push_back(information(candidates.back()));
  }
  if (candidates.empty()) return {};
  double largest = 0;
  for (const Matrix& share : shares) largest = std::max(largest, share.trace());
  // A touch of information in every direction, so that the first pose can be chosen before the sum can be inverted.
  Matrix sum = start + 1e-6 * largest * Matrix::Identity(masses_, masses_);
  std::vector<ArmVector> poses;
  for (int n = 0; n < options_.poses; ++n) {
    std::size_t best = 0;
    double least = kInfinity;
    for (std::size_t i = 0; i < candidates.size(); ++i) {
      const double value = criterion(sum + shares[i]);
      if (value < least) {
        least = value;
        best = i;
      }
    }
    sum += shares[best];
    poses.push_back(candidates[best]);
  }
  return poses;
}

struct PoseProblem {
  const Designer* designer;
  Matrix others;  // information of all poses but the one that moves
};

double cost_of(unsigned n, const double* x, double*, void* data) {
  const auto& problem = *static_cast<const PoseProblem*>(data);
  ArmVector phi{};
  std::copy_n(x, n, phi.begin());
  const double value = problem.designer->criterion(problem.others + problem.designer->information(phi)) +
                       kTooMuch * std::pow(problem.designer->excess(phi), 2);
  return std::isfinite(value) ? value : 1e300;
}

void Designer::refine(const Matrix& start, std::vector<ArmVector>& poses) const {
  const auto joints = static_cast<unsigned>(arm_.joints);
  Matrix sum = start + sum_of(poses);
  double before = criterion(sum);
  for (int round = 0; round < kMostRounds; ++round) {
    for (ArmVector& phi : poses) {
      PoseProblem problem{this, sum - information(phi)};
      ArmVector lower = lower_, upper = upper_, x = phi;
      for (std::size_t j = 0; j < joints; ++j)
        if (!felt_[j]) lower[j] = upper[j] = x[j];
      nlopt_opt search = nlopt_create(NLOPT_LN_BOBYQA, joints);
      nlopt_set_min_objective(search, cost_of, &problem);
      nlopt_set_lower_bounds(search, lower.data());
      nlopt_set_upper_bounds(search, upper.data());
      nlopt_set_initial_step1(search, 0.2);
      nlopt_set_xtol_abs1(search, 1e-4);
      nlopt_set_maxeval(search, kMostSteps);
      double least = cost_of(joints, phi.data(), nullptr, &problem);
      double found = 0;
      const nlopt_result result = nlopt_optimize(search, x.data(), &found);
      nlopt_destroy(search);
      // Roundoff stops leave the best point so far in x: what counts is whether it is better.
      const bool better = (result > 0 || result == NLOPT_ROUNDOFF_LIMITED) && found < least;
      if (better && excess(x) <= 1e-3) phi = x;
      sum = problem.others + information(phi);
    }
    sum = start + sum_of(poses);
    const double after = criterion(sum);
    if (!(before - after > kRoundGain)) break;
    before = after;
  }
}

std::vector<double> Designer::random_errors() const {
  std::mt19937_64 engine(20030531);
  std::vector<double> squares(static_cast<std::size_t>(masses_), 0);
  for (int set = 0; set < kRandomSets; ++set) {
    std::vector<ArmVector> poses;
    for (int i = 0; i < options_.poses; ++i) {
      ArmVector phi{};
      int draws = 0;
      do {
        phi = pose_from([&engine](std::size_t) { return static_cast<double>(engine() >> 11) * 0x1p-53; });
      } while (excess(phi) > 0 && ++draws < kMostDraws);
      poses.push_back(phi);
    }
    const auto errors = errors_of(sum_of(poses));
    for (std::size_t k = 0; k < squares.size(); ++k) squares[k] += errors[k] * errors[k] / kRandomSets;
  }
  for (double& s : squares) s = std::sqrt(s);
  return squares;
}

}  // namespace

PoseDesign design_poses(const MassArm& arm, const PoseDesignOptions& options) {
  const Designer designer(arm, options);
  const Matrix recorded = designer.recorded();
  const Matrix start =
      options.add_to_recorded ? recorded : Matrix(Matrix::Zero(recorded.rows(), recorded.cols()));
  PoseDesign design;
  design.phi = designer.greedy(start);
  designer.refine(start, design.phi);
  for (const ArmVector& phi : design.phi) design.theta.push_back(designer.theta_of(phi));
  const Matrix sum = designer.sum_of(design.phi);
  design.std_errors = designer.errors_of(sum);
  if (!options.recorded.empty()) design.with_recorded = designer.errors_of(sum + recorded);
  design.random_std_errors = designer.random_errors();
  const Eigen::VectorXd eigen = symmetric_eigen(sum).values;
  design.condition = std::sqrt(eigen[eigen.size() - 1] / std::max(eigen[0], 0.0));
  return design;
}

}  // namespace isac::estimate
