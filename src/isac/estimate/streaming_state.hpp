/// @file
/// What a StreamingJointFit carries from block to block: the pilot, the open run's last rows, the sums and a thinned sample.
///
///   per block of time: score = Σ Xᵀ Ω(r₀) r₀ + S θ₀,   curvature = Σ Xᵀ H(r₀) X − S,   gram = Σ Xᵀ Ω(r₀) X
///
/// Internal to the room `estimate`. Units: SI. Threads: one state per thread. Throws isac::Error as streaming_joint_fit.hpp.
/// Source: docs/derivations/joint_fit.md.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <limits>
#include <vector>

#include "isac/estimate/block_covariance.hpp"
#include "isac/estimate/joint_core.hpp"
#include "isac/estimate/joint_fit.hpp"
#include "isac/estimate/joint_rows.hpp"
#include "isac/estimate/joint_terms.hpp"
#include "isac/estimate/robust.hpp"
#include "isac/estimate/row_recipe.hpp"
#include "isac/estimate/streaming_joint_fit.hpp"

namespace isac::estimate {

/// Sums over one block of time.
struct OpenBlock {
  BlockSums sums;
  Eigen::MatrixXd gram;
  std::size_t rows = 0;
  std::size_t run = 0;
  void add(const OpenBlock& other) {
    sums.score += other.sums.score;
    sums.curvature += other.sums.curvature;
    gram += other.gram;
    rows += other.rows;
  }
};

/// Least and greatest finite angle of one run, rad.
struct AngleRange {
  double low = std::numeric_limits<double>::infinity(), high = -std::numeric_limits<double>::infinity();
};

/// Rows `begin` and on of `from` behind those of `to`; the name stays.
void append_rows(JointRun& to, const JointRun& from, std::size_t begin = 0);

struct StreamingJointFit::State {
  JointFitOptions options;
  JointTerms terms;
  std::size_t pilot_rows;

  std::vector<JointRun> waiting;  ///< rows kept until the pilot can be made
  std::size_t waiting_rows = 0;
  bool ready = false;

  StatedRecipe stated;
  JointCore pilot;
  Eigen::VectorXd start;  ///< θ₀ of the kept columns, and of the angle's zero behind them
  bool zero = false;
  Loss loss;
  double pilot_interval = 0;
  double base = 0;  ///< variance of the output's own noise, for the weights
  std::size_t block_rows = 1;

  JointRun carry;  ///< the last rows of the run, which the next block's window needs
  std::vector<OpenBlock> blocks;
  std::vector<AngleRange> ranges;  ///< of the runs
  bool open = false;
  Eigen::MatrixXd plain_gram;
  Eigen::VectorXd plain_moment;
  double plain_square = 0;
  std::size_t rows = 0, outliers = 0, seen = 0;
  JointRows sample;
  std::size_t stride = 1, counter = 0;

  State(const JointFitOptions& o, std::size_t n);

  /// Recipe, θ₀, scale of the loss and length of the blocks from the waiting rows.
  void make_pilot();
  /// Puts the waiting rows into the sums.
  void take_waiting();
  void clear_sample();
  /// Rows that a block's edge takes away on each side.
  [[nodiscard]] std::size_t halo() const;
  /// The same at the end, where a late output takes away rows too.
  [[nodiscard]] std::size_t tail() const;
  /// Rows of the open run, or the first of another; those whose window is complete go into the sums.
  void consume(const JointRun& block);
  void add_rows(const JointRows& fresh);
  void begin_block();
  /// Every stride-th row, for ranges and quantiles.
  void keep_sample(const JointRows& fresh);
};

}  // namespace isac::estimate
