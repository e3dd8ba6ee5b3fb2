/// @file
/// Refit of one effect beside a model whose own parameters are eliminated by projection: what a search can afford for each
/// of its candidates.
///
///   r(q) = min over d of ‖(1 − Q Qᵀ)(r₀ + x(q) + H d)‖,   min ‖r(q)‖² over the effect's parameters q within their bounds
///
/// r₀ is the model's residual, x(q) the effect's response, Q an orthonormal basis of the sensitivities of all that was fitted:
/// a linear change of the model's parameters costs nothing. H are the slopes of tolerances that stand at a bound, having stood in for
/// what is missing as far as they may: beside the effect they come back (d within what is left of their bounds).
/// fit.hpp's refit() repeats the winners without that linearisation.
/// Threads: safe on separate arguments. Errors: none. Source: Golub and Pereyra 1973; docs/derivations/explain.md.
#pragma once

#include <Eigen/Core>

#include "isac/explain/fit.hpp"

namespace isac::explain {

/// A model in whose surroundings effects are tried.
struct Around {
  const Predictor* predictor = nullptr;
  const Fit* fit = nullptr;
  const Weights* weights = nullptr;
  Eigen::MatrixXd basis;     ///< Q
  Eigen::VectorXd here;      ///< its prediction of all rows
  Eigen::VectorXd residual;  ///< (1 − Q Qᵀ) r₀
  Held held;                 ///< slopes projected
  Eigen::MatrixXd held_gram;

  [[nodiscard]] Eigen::VectorXd project(const Eigen::VectorXd& x) const;
  /// A projected residual with what the held tolerances take of it when they come back.
  [[nodiscard]] Eigen::VectorXd release(Eigen::VectorXd left) const;
  /// What is left of the residual beside a projected response at its best amplitude, with the tolerances come back as far as it lets them.
  [[nodiscard]] Eigen::VectorXd left_beside(const Eigen::Ref<const Eigen::VectorXd>& x) const;
};

/// A place's residual beside directions that are taken one after another, each at its best amplitude with the held tolerances come back as far
/// as it and those before it let them.
class Beside {
 public:
  explicit Beside(const Around& place);

  /// The residual without what was taken, the tolerances still held.
  [[nodiscard]] const Eigen::VectorXd& held() const noexcept { return held_; }
  /// Square of what were left if this one, of unit length and orthogonal to those before it, was taken too.
  [[nodiscard]] double loss_with(const Eigen::VectorXd& unit) const;
  void take(const Eigen::VectorXd& unit);
  [[nodiscard]] Eigen::VectorXd left() const;

 private:
  const Around& place_;
  Eigen::VectorXd held_;
  Eigen::MatrixXd slopes_, gram_;
};

[[nodiscard]] Around around(const Predictor& predictor, const Fit& fit, const Weights& weights);

struct Refined {
  Values values{};
  Eigen::VectorXd residual;  ///< r(q), all rows
  double loss = 0;
};

[[nodiscard]] Refined refine(const Around& place, const Hypothesis& hypothesis, const Values& start,
                             int iterations = 8);

}  // namespace isac::explain
