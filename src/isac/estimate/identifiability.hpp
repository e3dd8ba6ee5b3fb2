/// @file
/// What data can and cannot tell of a linear model, without any threshold that depends on units.
///
/// Before the fit: a regressor that is noise only (its information beyond the others, after the noise of the regressors is
/// taken out, is less than half of what it seems to be) or that is a combination of others (null direction of the
/// normal matrix with unit diagonal) cannot be fitted. After the fit: a parameter is known when its 95 % interval is narrow against its
/// own value (a quarter) or against what matters (a hundredth of the output's range, made at the edge of the
/// operating range). A term whose inputs never come near the operating range is refused whatever the noise says: below
/// a sixth of the speed, damping is told from friction and hysteresis only by the model's good will.
/// Threads: pure. Source: docs/derivations/joint_fit.md.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

namespace isac::estimate {

/// Columns that cannot be fitted at all, and why.
struct Rank {
  enum class Fault { kNone, kStill, kNoiseOnly, kCombination };
  std::vector<Fault> fault;                ///< per column
  std::vector<std::vector<int>> partners;  ///< for combinations: the other columns involved
  std::vector<int> kept;  ///< columns to fit: all without fault, and enough of each combination
};

/// `gram` = XᵀX, `excess` = what noise of the regressors made of it.
[[nodiscard]] Rank find_rank(const Eigen::MatrixXd& gram, const Eigen::MatrixXd& excess);

/// Variance inflation of each estimate by the others: diag(C⁻¹), C the normal matrix with unit diagonal.
[[nodiscard]] Eigen::VectorXd variance_inflation(const Eigen::MatrixXd& gram);

inline constexpr double kRelativeWidth = 0.25;   ///< half an interval over the value
inline constexpr double kMatteringShare = 0.01;  ///< of the output's half range
inline constexpr double kSpeedShare = 0.16;      ///< of the operating speed: 1.0 rad/s of 2π
inline constexpr double kReachShare = 0.05;      ///< of the operating angle and pressure

}  // namespace isac::estimate
