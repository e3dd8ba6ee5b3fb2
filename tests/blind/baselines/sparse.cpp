#include "sparse.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <random>

namespace baselines {
namespace {

constexpr int kGrid = 20;  // thresholds from 0.01 to 1 of the noise
constexpr double kRidges[] = {1e-4, 1e-2, 1e-1};
constexpr int kBootstraps = 100;
constexpr double kKept = 0.6;

Eigen::VectorXd solve(const Sums& s, const std::vector<int>& use, double ridge = 1e-6) {
  Eigen::MatrixXd g = s.gram(use, use);
  g.diagonal() *= 1 + ridge;
  return g.ldlt().solve(s.score(use));
}

double left(const Sums& s, const std::vector<int>& use, const Eigen::VectorXd& c) {
  const Eigen::VectorXd score = s.score(use);
  return std::max(1e-300, s.energy - 2 * c.dot(score) + c.dot(s.gram(use, use) * c));
}

Terms terms_of(const std::vector<int>& use, const Eigen::VectorXd& c) {
  std::vector<int> order(use.size());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](int a, int b) { return std::abs(c[a]) > std::abs(c[b]); });
  Terms out;
  for (const int i : order) {
    out.columns.push_back(use[static_cast<std::size_t>(i)]);
    out.coefficients.push_back(c[i]);
    out.probability.push_back(1);
  }
  return out;
}

double limit_of(int step) {
  return 0.01 * std::pow(100.0, static_cast<double>(step) / (kGrid - 1));
}

Sums less(const Sums& all, const Sums& one) {
  Sums others = all;
  others.gram -= one.gram;
  others.score -= one.score;
  others.energy -= one.energy;
  others.rows -= one.rows;
  return others;
}

/// Is the mean of the differences above one standard error of it?
bool beyond_one_error(const std::vector<double>& worse) {
  double sum = 0, squares = 0;
  const auto n = static_cast<double>(worse.size());
  for (const double d : worse) sum += d;
  for (const double d : worse) squares += (d - sum / n) * (d - sum / n);
  return sum > std::sqrt(squares * n / std::max(1.0, n - 1));
}

}  // namespace

Sums& Sums::operator+=(const Sums& other) {
  if (gram.size() == 0) return *this = other;
  gram += other.gram;
  score += other.score;
  energy += other.energy;
  rows += other.rows;
  return *this;
}

Sums add(const std::vector<Sums>& blocks) {
  Sums all;
  for (const Sums& one : blocks) all += one;
  return all;
}

Terms threshold(const Sums& sums, const Sparsity& sparsity) {
  std::vector<int> use(static_cast<std::size_t>(sums.score.size()));
  std::iota(use.begin(), use.end(), 0);
  Eigen::VectorXd c = solve(sums, use, sparsity.ridge);
  for (int round = 0; round < 20; ++round) {
    std::vector<int> kept;
    for (std::size_t i = 0; i < use.size(); ++i)
      if (std::abs(c[static_cast<Eigen::Index>(i)]) >= sparsity.limit) kept.push_back(use[i]);
    if (kept.size() == use.size()) break;
    use = std::move(kept);
    if (use.empty()) return {};
    c = solve(sums, use, sparsity.ridge);
  }
  return terms_of(use, c);
}

Sparsity cross_validated(const std::vector<Sums>& runs) {
  struct Tried {
    Sparsity sparsity;
    std::vector<double> error;  // of each run, predicted from the others
    double sum = 0, terms = 0;
  };
  const Sums all = add(runs);
  std::vector<Tried> tried;
  for (const double ridge : kRidges)
    for (int step = 0; step < kGrid; ++step) {
      Tried t{{limit_of(step), ridge}, {}, 0, 0};
      for (const Sums& run : runs) {
        const Terms terms = threshold(less(all, run), t.sparsity);
        const Eigen::VectorXd c = Eigen::Map<const Eigen::VectorXd>(
            terms.coefficients.data(), static_cast<Eigen::Index>(terms.coefficients.size()));
        t.error.push_back(left(run, terms.columns, c));
        t.sum += t.error.back();
        t.terms += static_cast<double>(terms.columns.size());
      }
      tried.push_back(std::move(t));
    }
  const Tried& best = *std::min_element(tried.begin(), tried.end(),
                                        [](const Tried& a, const Tried& b) { return a.sum < b.sum; });
  const Tried* chosen = &best;
  for (const Tried& t : tried) {
    std::vector<double> worse;
    for (std::size_t r = 0; r < runs.size(); ++r) worse.push_back(t.error[r] - best.error[r]);
    if (t.terms < chosen->terms && !beyond_one_error(worse)) chosen = &t;
  }
  return chosen->sparsity;
}

Terms stlsq(const std::vector<Sums>& runs) {
  return threshold(add(runs), cross_validated(runs));
}

Terms ensemble(const std::vector<Sums>& runs, const std::vector<Sums>& blocks, std::uint64_t seed) {
  const Sums all = add(blocks);
  const Sparsity sparsity = cross_validated(runs);
  std::mt19937_64 random(seed);
  std::uniform_int_distribution<std::size_t> any(0, blocks.size() - 1);
  std::vector<int> kept(static_cast<std::size_t>(all.score.size()), 0);
  for (int draw = 0; draw < kBootstraps; ++draw) {
    Sums sample;
    for (std::size_t i = 0; i < blocks.size(); ++i) sample += blocks[any(random)];
    for (const int column : threshold(sample, sparsity).columns) ++kept[static_cast<std::size_t>(column)];
  }
  std::vector<int> use;
  for (std::size_t k = 0; k < kept.size(); ++k)
    if (kept[k] > kKept * kBootstraps) use.push_back(static_cast<int>(k));
  if (use.empty()) return {};
  Terms out = terms_of(use, solve(all, use, sparsity.ridge));
  for (std::size_t i = 0; i < out.columns.size(); ++i)
    out.probability[i] = static_cast<double>(kept[static_cast<std::size_t>(out.columns[i])]) / kBootstraps;
  return out;
}

Terms frols(const Eigen::MatrixXf& x, const Eigen::VectorXd& y, const std::vector<unsigned>& run, int most) {
  const unsigned runs = run.empty() ? 0 : *std::max_element(run.begin(), run.end()) + 1;
  std::vector<int> chosen;
  std::vector<Eigen::VectorXd> columns, orthogonal;
  Eigen::VectorXd rest = y;
  std::vector<double> error(runs, 0.0);  // of predicting every run from the others, with no term at all
  for (Eigen::Index i = 0; i < y.size(); ++i) error[run[static_cast<std::size_t>(i)]] += y[i] * y[i];
  Terms out;
  while (static_cast<int>(chosen.size()) < most) {
    // Error-reduction ratio of each column, orthogonal to those that are in.
    int best = -1;
    double most_gain = 0;
    Eigen::VectorXd best_w;
    const Eigen::VectorXf rest_f = rest.cast<float>();
    const Eigen::VectorXf score = x.transpose() * rest_f;
    for (Eigen::Index j = 0; j < x.cols(); ++j) {
      const Eigen::VectorXf column = x.col(j);
      double norm2 = column.squaredNorm();
      const double whole = norm2;
      for (const Eigen::VectorXd& q : orthogonal) {
        const double part = q.cast<float>().dot(column);
        norm2 -= part * part;
      }
      if (norm2 < 1e-4 * whole) continue;
      const double gain = static_cast<double>(score[j]) * score[j] / norm2;
      if (gain <= most_gain) continue;
      most_gain = gain;
      best = static_cast<int>(j);
    }
    if (best < 0) break;
    Eigen::VectorXd column = x.col(best).cast<double>(), w = column;
    for (const Eigen::VectorXd& q : orthogonal) w -= q.dot(w) * q;
    w.normalize();
    rest -= w.dot(rest) * w;
    orthogonal.push_back(w);
    columns.push_back(std::move(column));
    chosen.push_back(best);
    // Each run predicted by a fit to the others.
    const auto k = static_cast<Eigen::Index>(columns.size());
    std::vector<Sums> sums(runs);
    for (Sums& s : sums) {
      s.gram = Eigen::MatrixXd::Zero(k, k);
      s.score = Eigen::VectorXd::Zero(k);
    }
    Eigen::VectorXd row(k);
    for (Eigen::Index i = 0; i < y.size(); ++i) {
      Sums& s = sums[run[static_cast<std::size_t>(i)]];
      for (Eigen::Index j = 0; j < k; ++j) row[j] = columns[static_cast<std::size_t>(j)][i];
      s.gram += row * row.transpose();
      s.score += y[i] * row;
      s.energy += y[i] * y[i];
    }
    const Sums all = add(sums);
    std::vector<int> use(static_cast<std::size_t>(k));
    std::iota(use.begin(), use.end(), 0);
    std::vector<double> now, better;
    for (const Sums& s : sums) now.push_back(left(s, use, solve(less(all, s), use)));
    for (std::size_t r = 0; r < now.size(); ++r) better.push_back(error[r] - now[r]);
    if (!beyond_one_error(better)) {
      chosen.pop_back();
      columns.pop_back();
      break;
    }
    error = now;
    const Eigen::VectorXd c = solve(all, use);
    out = terms_of(use, c);
  }
  for (int& column : out.columns) column = chosen[static_cast<std::size_t>(column)];
  return out;
}

}  // namespace baselines
