/// @file
/// A small neural network of the residual: what a black box closes of the gap, without a name.
///
///   r ≈ w·tanh(V z + v) + w0,  z standardised inputs; Adam on batches, stopped where parts left out get worse
///
/// Threads: pure; deterministic for a seed. Errors: none.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

namespace baselines {

class Network {
 public:
  /// Columns of `inputs` are samples. Every fifth `part` is left out of the training and says when to stop.
  Network(const Eigen::MatrixXd& inputs, const Eigen::VectorXd& target, const std::vector<unsigned>& part,
          std::uint64_t seed);
  [[nodiscard]] double operator()(const Eigen::VectorXd& input) const;

 private:
  Eigen::VectorXd middle_, spread_;
  Eigen::MatrixXd inner_;  // V, v
  Eigen::VectorXd outer_;  // w, w0
  double scale_ = 1;
};

}  // namespace baselines
