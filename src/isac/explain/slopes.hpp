/// @file
/// Derivatives of a model's rows by its coordinates: forward differences of the prediction, but for baseline terms, which are linear.
///
///   column j = ∂y/∂θ_j · scale_j / σ_chain, 0 in the rows of chains that θ_j does not enter
///
/// Shapes: rows × coordinates. Threads: shares the columns among the predictor's. Errors: none. Source: docs/derivations/explain.md.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "isac/explain/coordinates.hpp"
#include "isac/explain/weights.hpp"

namespace isac::explain {

/// Weighted slopes, a column for each coordinate at its value. `here`: the model's own prediction of all rows.
[[nodiscard]] Eigen::MatrixXd slopes_of(const Predictor& predictor, const ModelPoint& model,
                                        const Eigen::VectorXd& here, const Weights& weights,
                                        const std::vector<Coordinate>& coordinates,
                                        const std::vector<double>& values);

}  // namespace isac::explain
