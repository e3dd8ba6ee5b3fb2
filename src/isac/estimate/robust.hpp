/// @file
/// Robust least squares over many rows with Ceres as the solver of record and no residual block per row.
///
///   minimise  ½ ( Σ_i ρ(w_i r_i²) − θᵀ S θ ),   r_i = y_i − x_iᵀ θ_lin − f_i(θ_nl)
///
/// ρ(s) = s (squared), Huber or Cauchy with scale c. S is the part of XᵀΩX that noise of the regressors made (errors in
/// variables; zero when not asked for). One pass over contiguous columns gives XᵀΩX, XᵀΩr and the cost; their Cholesky
/// factor R, with RᵀR = XᵀΩX − S, is the one Ceres cost function: residual R⁻ᵀ∇ and Jacobian R have the cost, the gradient
/// and the Gauss–Newton matrix of the problem with one residual block per row, so Ceres takes the same steps. Linear Huber problems start
/// from semi-smooth Newton steps, which end after finitely many; Ceres confirms the answer.
/// Columns should have norms of like size (the caller scales them): the normal matrix then loses no more than its
/// collinearity demands.
/// Threads: const functions may run side by side unless a nonlinear part is set. Errors: none; failure is `converged` = false.
/// Source: docs/derivations/joint_fit.md.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "isac/estimate/joint_fit.hpp"

namespace isac::estimate {

/// What one pass over rows [begin, end) gives; Ω = w ρ′, H = w (ρ′ + 2 ρ″ s) is the true curvature of the loss.
struct Pass {
  Eigen::MatrixXd gram;       ///< Xᵀ Ω X
  Eigen::MatrixXd curvature;  ///< Xᵀ H X, if asked for
  Eigen::VectorXd moment;     ///< Xᵀ Ω r
  double cost = 0;            ///< Σ ρ
  double weight = 0;          ///< Σ Ω
};

class RobustProblem {
 public:
  std::size_t rows = 0;
  std::vector<const double*> columns;  ///< linear regressors
  const double* output = nullptr;
  const double* weight = nullptr;  ///< w, or nullptr for one
  Loss::Kind kind = Loss::Kind::kSquared;
  double scale = 1;        ///< c
  Eigen::MatrixXd excess;  ///< S, less the weight of priors on its diagonal; empty for none

  /// A coefficient that the last linear column has besides its own in rows [begin, end) only: what a run adds for itself. Its
  /// parameters stand behind those of the columns, in the order of this list, which is the order of the rows.
  struct Local {
    std::size_t begin = 0, end = 0;
  };
  std::vector<Local> locals;

  /// Nonlinear part: fills `prediction` (rows) and its derivative columns for the parameters given.
  struct Nonlinear {
    std::vector<double> start, lower, upper;
    std::function<void(const double* parameters, std::vector<double>& prediction,
                       std::vector<std::vector<double>>& derivatives)>
        evaluate;
  };
  Nonlinear nonlinear;

  [[nodiscard]] int linear_size() const { return static_cast<int>(columns.size() + locals.size()); }
  [[nodiscard]] int size() const { return linear_size() + static_cast<int>(nonlinear.start.size()); }

  /// Evaluates the nonlinear part at `theta` (nothing to do for linear problems), for the calls below.
  void linearise(const Eigen::VectorXd& theta) const;
  [[nodiscard]] Pass pass(const Eigen::VectorXd& theta, std::size_t begin, std::size_t end, bool with_gram,
                          bool with_curvature) const;
  /// r_i, unweighted.
  void residuals(const Eigen::VectorXd& theta, std::vector<double>& out) const;

 private:
  /// Pass over columns and nonlinear derivatives, without locals.
  [[nodiscard]] Pass plain_pass(const double* theta, std::size_t begin, std::size_t end, bool with_gram,
                                bool with_curvature) const;
  mutable std::vector<double> remainder_;  ///< output minus nonlinear prediction
  mutable std::vector<double> prediction_;
  mutable std::vector<std::vector<double>> derivatives_;
};

struct RobustSolution {
  Eigen::VectorXd theta;
  bool converged = false;
  std::string report;
};

/// Minimiser from `start` (linear part; zeros will do). Bounds hold for the nonlinear parameters.
[[nodiscard]] RobustSolution solve(const RobustProblem& problem, const Eigen::VectorXd& start);

}  // namespace isac::estimate
