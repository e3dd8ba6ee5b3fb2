/// @file
/// Joint refit of the baseline and any effects by Ceres, and the sensitivities that a fit leaves behind.
///
///   min Σ ((y_pred(θ) − y)/σ_chain)²,  θ = baseline, tolerances, effects, within bounds
///
/// Only the chains that the effects touch are refitted; rows of the others keep the residual of the fit it starts from.
/// Derivatives are forward differences of the simulation, but for baseline terms, which are linear.
/// Units: weighted rows. Threads: safe on separate arguments. Errors: none; `converged` says so.
/// Source: docs/derivations/explain.md.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "isac/explain/coordinates.hpp"
#include "isac/explain/predict.hpp"
#include "isac/explain/weights.hpp"

namespace isac::explain {

struct Fit {
  ModelPoint model;  ///< tolerances first among its effects
  std::size_t tolerances = 0;
  std::vector<Coordinate> coordinates;
  Eigen::VectorXd residual;  ///< weighted, all rows: (prediction − measured)/σ
  double loss = 0;           ///< ‖residual‖²
  bool converged = false;
  unsigned chains = kAllChains;  ///< that were refitted

  [[nodiscard]] double value(const Coordinate& c) const;
};

/// The baseline alone, with its tolerances, and, if asked for, where within a step of the encoder each resting run stands.
[[nodiscard]] Fit fit_baseline(const Predictor& predictor, const std::vector<Hypothesis>& tolerances,
                               const Weights& weights, bool resting_angles = true);
inline constexpr int kRefitIterations = 8;  ///< beside what is there already, once the search has ended
/// `start.model` with `effects` added at their values, all refitted together.
[[nodiscard]] Fit refit(const Predictor& predictor, const Fit& start, const std::vector<Active>& effects,
                        const Weights& weights, int iterations = 12);
/// The last steps of a fit, within the bounds that it does not touch, by Ceres.
[[nodiscard]] Fit polished(const Predictor& predictor, Fit fit, const Weights& weights);

/// A fitted model beside other runs: its coordinates, with where each of those that rest stands within a step of the encoder; `model` is of
/// those runs.
[[nodiscard]] Fit beside_other_runs(const Predictor& predictor, const Fit& fit, ModelPoint model,
                                    Eigen::VectorXd residual);

/// Tolerances that stand at a bound: the derivative of the rows by each, and how far it may still go, in its scale.
struct Held {
  Eigen::MatrixXd slopes;
  Eigen::VectorXd low, high;
};

/// Weighted derivative of the rows by each coordinate that is inside its bounds; columns in the order of `coordinates`,
/// `used` says which. Tolerances at a bound have none: they go to `held`.
[[nodiscard]] Eigen::MatrixXd sensitivities(const Predictor& predictor, const Fit& fit,
                                            const Weights& weights, std::vector<Coordinate>* used = nullptr,
                                            Held* held = nullptr);

/// Difference of the rows when an effect is added to the fit's model, nothing refitted. `here` is the model's own prediction of all rows.
[[nodiscard]] Eigen::VectorXd change(const Predictor& predictor, const Fit& fit, const Eigen::VectorXd& here,
                                     const Active& effect);
/// The same, weighted.
[[nodiscard]] Eigen::VectorXd response(const Predictor& predictor, const Fit& fit,
                                       const Eigen::VectorXd& here, const Active& effect,
                                       const Weights& weights);

}  // namespace isac::explain
