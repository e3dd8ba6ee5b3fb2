/// @file
/// One dataset as every baseline sees it: the refitted base model, what it leaves, and one dictionary of named columns.
///
/// A column is the response of all rows to one amplitude of one effect of the catalogue at one of its starting shapes, freed of
/// what a change of the base model does as well, and scaled to unit rms. So the baselines are given more than their papers
/// ask for: effects with states and of sensors have columns too, derivatives come from the toolkit's kernel, and what they choose
/// is refitted in simulation before its gap is taken. What differs is how they choose.
/// Threads: fill_columns uses two. Errors: isac::Error of the readers.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "isac/explain/proof.hpp"
#include "isac/explain/refine.hpp"
#include "sparse.hpp"

namespace baselines {

struct ColumnOf {
  int hypothesis = -1, shape = 0, amplitude = 0;
  double scale = 1;  ///< amplitude per unit of the column's coefficient
};

struct Bench {
  isac::explain::Prepared data;
  isac::explain::Library library;
  std::optional<isac::explain::Predictor> predictor;
  isac::explain::Weights weights;
  isac::explain::Fit base;
  isac::explain::Around place;
  std::optional<isac::explain::Proof> proof;
  std::optional<isac::explain::Prepared> heldout;

  Eigen::VectorXd target;            ///< measured − base model, projected, unit noise
  std::vector<ColumnOf> columns;     ///< of x
  Eigen::MatrixXf x;                 ///< rows × columns
  std::vector<int> one_of_each;      ///< of every effect the column that fits best by itself
  std::vector<unsigned> run, block;  ///< of each row; a block is ten seconds

  [[nodiscard]] const isac::explain::Hypothesis& of(int column) const {
    return library.hypotheses[static_cast<std::size_t>(columns[static_cast<std::size_t>(column)].hypothesis)];
  }
  /// Values with which a column's effect starts, for a coefficient.
  [[nodiscard]] isac::explain::Active active(int column, double coefficient) const;
  /// Sums over parts of the rows for these columns, of a target; `part` says of each row to which it belongs.
  [[nodiscard]] std::vector<Sums> sums(const std::vector<int>& use, const Eigen::VectorXd& y,
                                       const std::vector<unsigned>& part) const;
};

/// Reads a dataset folder and fits the base model. Not copyable on purpose: parts point at each other.
void open_bench(const std::string& folder, Bench& bench);

}  // namespace baselines
