/// @file
/// Sparse regression as the literature has it, on one dictionary: y = X c + noise, columns of X of unit rms.
///
///   STLSQ    least squares, drop |c| < λ, repeat (Brunton, Proctor and Kutz 2016)
///   ensemble STLSQ on bootstraps of blocks; a term counts that is kept in more than 60 % of them (Fasel and others 2022)
///   FROLS    one term after another by error-reduction ratio (Billings 2013)
///
/// λ, the ridge and the number of FROLS terms by predicting each run from the others: the sparsest within one standard error of
/// the best. (By AICc, as Mangan and others 2017, 20 to 40 terms are kept where nothing is hidden: rows are not independent.)
/// Threads: pure. Errors: none.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

namespace baselines {

/// Sums over one block of rows.
struct Sums {
  Eigen::MatrixXd gram;   ///< XᵀX
  Eigen::VectorXd score;  ///< Xᵀy
  double energy = 0;      ///< yᵀy
  double rows = 0;
  Sums& operator+=(const Sums& other);
};
[[nodiscard]] Sums add(const std::vector<Sums>& blocks);

struct Terms {
  std::vector<int> columns;
  std::vector<double> coefficients;  ///< largest contribution first, in units of the rows' noise
  std::vector<double> probability;   ///< of the ensemble; 1 elsewhere
};

struct Sparsity {
  double limit = 0.1, ridge = 1e-4;  ///< of the noise; of a column's energy
};
[[nodiscard]] Terms threshold(const Sums& sums, const Sparsity& sparsity);
/// `runs`: sums of each run.
[[nodiscard]] Sparsity cross_validated(const std::vector<Sums>& runs);
[[nodiscard]] Terms stlsq(const std::vector<Sums>& runs);
[[nodiscard]] Terms ensemble(const std::vector<Sums>& runs, const std::vector<Sums>& blocks,
                             std::uint64_t seed);
/// `x`: all columns; `run`: of each row; at most `most` terms.
[[nodiscard]] Terms frols(const Eigen::MatrixXf& x, const Eigen::VectorXd& y,
                          const std::vector<unsigned>& run, int most);

}  // namespace baselines
