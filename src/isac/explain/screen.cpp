#include "isac/explain/screen.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <numeric>
#include <random>
#include <thread>
#include <utility>

#include "isac/series/statistics.hpp"

namespace isac::explain {
namespace {

constexpr double kCarryingBlocks = 8;
constexpr double kMimicked = 1e-5;  // of a response's squares left by the projection: all of it is mimicked
// T cannot pass the square root of the blocks that carry a column: with fewer than these, and most of the chain elsewhere, it has
// no power in a whole search.
constexpr double kFewBlocks = 8, kShareOfBlocks = 0.25;
// And with fewer than these it can pass a whole search's limit, about 4, only if they all agree.
constexpr double kBoundingBlocks = 25;
constexpr double kHeldByThem = 0.9;  // of a column's squares lies in the blocks that are called its own
constexpr int kBlocksElsewhere = 20;

/// Values with one amplitude at its start and the others absent; all of them if there is no choice.
std::vector<Values> directions(const Hypothesis& h, const Values& shape) {
  std::vector<std::size_t> amplitudes;
  for (int i = 0; i < h.info().parameter_count; ++i)
    if (h.amplitude[static_cast<std::size_t>(i)] && h.free[static_cast<std::size_t>(i)])
      amplitudes.push_back(static_cast<std::size_t>(i));
  if (amplitudes.size() < 2) return {shape};
  std::vector<Values> all;
  for (const std::size_t keep : amplitudes) {
    Values v = null_values(h, shape);
    v[keep] = shape[keep];
    all.push_back(v);
  }
  return all;
}

/// Least squares within signs: the best subset of columns whose amplitudes are allowed (at most four columns).
struct SignedFit {
  double gain = 0;
  Eigen::VectorXd amplitude;
};

SignedFit signed_fit(const Eigen::MatrixXd& gram, const Eigen::VectorXd& score,
                     const std::vector<bool>& positive_only) {
  const int n = static_cast<int>(score.size());
  SignedFit best;
  best.amplitude = Eigen::VectorXd::Zero(n);
  for (int mask = 1; mask < (1 << n); ++mask) {
    std::vector<int> use;
    for (int i = 0; i < n; ++i)
      if ((mask >> i & 1) != 0 && gram(i, i) > 0) use.push_back(i);
    if (use.empty()) continue;
    const auto k = static_cast<Eigen::Index>(use.size());
    Eigen::MatrixXd g(k, k);
    Eigen::VectorXd s(k);
    for (Eigen::Index i = 0; i < k; ++i) {
      s[i] = score[use[static_cast<std::size_t>(i)]];
      for (Eigen::Index j = 0; j < k; ++j)
        g(i, j) = gram(use[static_cast<std::size_t>(i)], use[static_cast<std::size_t>(j)]);
      g(i, i) *= 1 + 1e-6;
    }
    const Eigen::VectorXd a = g.ldlt().solve(s);
    bool allowed = a.allFinite();
    for (Eigen::Index i = 0; i < k && allowed; ++i)
      allowed = !positive_only[static_cast<std::size_t>(use[static_cast<std::size_t>(i)])] || a[i] >= 0;
    if (!allowed) continue;
    const double gain = s.dot(a);
    if (gain <= best.gain) continue;
    best.gain = gain;
    best.amplitude.setZero();
    for (Eigen::Index i = 0; i < k; ++i) best.amplitude[use[static_cast<std::size_t>(i)]] = a[i];
  }
  return best;
}

/// p-value of a score whose own part is taken out of its scatter: t = Σ g / √Σ (g_b − a n_b)²/(1 − h_b)², a = Σ g/Σ n, h_b = n_b/Σ n.
double jackknife_p(const Eigen::VectorXd& score, const Eigen::VectorXd& norm2, double carried_by) {
  if (!(carried_by > 2)) return 1;  // no freedom is left
  const double all = norm2.sum(), amplitude = score.sum() / all;
  const Eigen::ArrayXd left = (score - amplitude * norm2).array() / (1 - (norm2.array() / all).min(0.99));
  const double scatter = std::sqrt(left.square().sum());
  return scatter > 0 ? series::student_t_two_sided(std::abs(score.sum()) / scatter, carried_by - 1) : 1.0;
}

struct Task {
  int hypothesis, shape;
};

/// What scores of any function of the signals scatter, chain by chain, in blocks that a column does not live in.
class Elsewhere {
 public:
  Elsewhere(const std::vector<Column>& columns,
            const std::function<Eigen::VectorXd(const Eigen::VectorXd&)>& joined,
            std::vector<std::vector<char>> there)
      : there_(std::move(there)) {
    for (const Column& c : columns) {
      if (c.hypothesis >= 0 || c.norm2 <= 0) continue;
      Functions& f = chains_[static_cast<int>(c.chain)];
      f.score2.push_back(joined(c.atom_score).cwiseAbs2());
      f.norm2.push_back(joined(c.atom_norm));
    }
  }

  struct Scatter {
    double largest =
        0;  ///< variance per unit of norm beyond the column's own blocks; 0 where too little is left to tell
    int blocks = 0;  ///< that it was measured in
  };
  Scatter scatter(int chain, const Eigen::VectorXd& own_norm2) const {
    std::vector<Eigen::Index> order(static_cast<std::size_t>(own_norm2.size()));
    std::iota(order.begin(), order.end(), Eigen::Index{0});
    std::sort(order.begin(), order.end(),
              [&](Eigen::Index a, Eigen::Index b) { return own_norm2[a] > own_norm2[b]; });
    std::vector<char> own(order.size(), 0);
    double held = 0;
    const double all = own_norm2.sum();
    for (const Eigen::Index b : order) {
      if (held >= kHeldByThem * all) break;
      held += own_norm2[b];
      own[static_cast<std::size_t>(b)] = 1;
    }
    Scatter found;
    const Functions& f = chains_[chain];
    for (std::size_t k = 0; k < f.score2.size(); ++k) {
      double score2 = 0, norm2 = 0;
      int blocks = 0;
      for (Eigen::Index b = 0; b < own_norm2.size(); ++b) {
        if (own[static_cast<std::size_t>(b)] != 0 ||
            there_[static_cast<std::size_t>(chain)][static_cast<std::size_t>(b)] == 0)
          continue;
        score2 += f.score2[k][b];
        norm2 += f.norm2[k][b];
        ++blocks;
      }
      if (blocks >= kBlocksElsewhere && norm2 > 0.05 * f.norm2[k].sum() && score2 > found.largest * norm2)
        found = {score2 / norm2, blocks};
    }
    return found;
  }

 private:
  struct Functions {
    std::vector<Eigen::VectorXd> score2, norm2;  // of blocks
  };
  Functions chains_[kChains];
  std::vector<std::vector<char>> there_;  ///< by chain and block: has it rows there?
};

struct Done {
  std::vector<Column> columns;
  Screened screened;
};

}  // namespace

Eigen::MatrixXd basis_of(const Eigen::MatrixXd& sensitivities) {
  Eigen::MatrixXd scaled = sensitivities;
  for (Eigen::Index j = 0; j < scaled.cols(); ++j) {
    const double norm = scaled.col(j).norm();
    if (norm > 0) scaled.col(j) /= norm;
  }
  // Gram–Schmidt twice: columns are few, and nearly dependent ones must fall away instead of becoming noise.
  Eigen::MatrixXd q(scaled.rows(), scaled.cols());
  Eigen::Index count = 0;
  for (Eigen::Index j = 0; j < scaled.cols(); ++j) {
    Eigen::VectorXd v = scaled.col(j);
    for (int round = 0; round < 2; ++round)
      for (Eigen::Index k = 0; k < count; ++k) v -= q.col(k).dot(v) * q.col(k);
    const double norm = v.norm();
    if (norm > 1e-7) q.col(count++) = v / norm;
  }
  q.conservativeResize(scaled.rows(), count);
  return q;
}

FlipTest flip_test(const Eigen::MatrixXd& scores, int flips, std::uint64_t seed, double significance) {
  const Eigen::Index blocks = scores.rows(), columns = scores.cols();
  Eigen::MatrixXd scaled = scores;
  for (Eigen::Index j = 0; j < columns; ++j) {
    const double norm = scaled.col(j).norm();
    if (norm > 0) scaled.col(j) /= norm;
  }
  const double observed = columns > 0 ? scaled.colwise().sum().cwiseAbs().maxCoeff() : 0.0;
  std::vector<double> all;
  all.reserve(static_cast<std::size_t>(flips));
  std::mt19937_64 random(seed);
  int reached = 1;
  constexpr Eigen::Index kAtOnce = 128;
  for (int done = 0; done < flips; done += kAtOnce) {
    const Eigen::Index now = std::min<Eigen::Index>(kAtOnce, flips - done);
    Eigen::MatrixXd signs(now, blocks);
    for (Eigen::Index i = 0; i < now; ++i)
      for (Eigen::Index b = 0; b < blocks; b += 64) {
        std::uint64_t bits = random();
        for (Eigen::Index k = b; k < std::min(b + 64, blocks); ++k, bits >>= 1)
          signs(i, k) = (bits & 1) != 0 ? 1.0 : -1.0;
      }
    const Eigen::VectorXd largest = (signs * scaled).cwiseAbs().rowwise().maxCoeff();
    all.insert(all.end(), largest.data(), largest.data() + largest.size());
    reached += static_cast<int>((largest.array() >= observed * (1 - 1e-12)).count());
  }
  FlipTest test;
  test.statistic = observed;
  test.p_value = static_cast<double>(reached) / static_cast<double>(flips + 1);
  test.limit = series::quantile(all, 1 - significance);
  return test;
}

Screen screen(const Around& place, const Library& library, const ScreenOptions& options) {
  const Predictor& predictor = *place.predictor;
  const Prepared& data = predictor.data();
  const auto n = static_cast<Eigen::Index>(predictor.rows());
  const auto atoms = static_cast<Eigen::Index>(data.atoms);
  const Eigen::VectorXd& residual = place.residual;

  const auto summarise = [&](Eigen::VectorXd& x, Column& column) {
    column.raw_norm2 = x.squaredNorm();
    x = place.project(x);
    column.atom_score = Eigen::VectorXd::Zero(atoms);
    column.atom_norm = Eigen::VectorXd::Zero(atoms);
    for (Eigen::Index i = 0; i < n; ++i) {
      const auto b = static_cast<Eigen::Index>(data.rows[static_cast<std::size_t>(i)].atom);
      column.atom_score[b] -=
          x[i] * residual[i];  // prediction − measured: an effect that is missing has the other sign
      column.atom_norm[b] += x[i] * x[i];
      column.chain_norm2[static_cast<int>(data.rows[static_cast<std::size_t>(i)].chain)] += x[i] * x[i];
    }
    const Eigen::VectorXd plain = unfiltered(data, *place.weights, x);
    for (Eigen::Index i = 0; i < n; ++i)
      column.plain_norm2[static_cast<int>(data.rows[static_cast<std::size_t>(i)].chain)] +=
          plain[i] * plain[i];
    column.norm2 = column.atom_norm.sum();
    // A third of a percent of a response is how its column was low-passed, not what the effect does.
    if (column.norm2 < kMimicked * std::max(column.raw_norm2, 1e-300)) {
      column.atom_score.setZero();
      column.norm2 = 0;
    }
    column.score = column.atom_score.sum();
  };

  std::vector<Task> tasks;
  // What a tolerance takes up within its bounds is no finding. (Nor could it be tested: the response to a shift of the angle
  // contains the encoder's noise twice.)
  const auto taken_up = [&](const Hypothesis& h) {
    for (std::size_t i = 0; i < place.fit->tolerances; ++i) {
      const Active& a = place.fit->model.effects[i];
      if (a.hypothesis->effect != h.effect) continue;
      const double margin = 0.01 * (a.hypothesis->upper[0] - a.hypothesis->lower[0]);
      return a.values[0] > a.hypothesis->lower[0] + margin && a.values[0] < a.hypothesis->upper[0] - margin;
    }
    return false;
  };
  for (std::size_t h = 0; h < library.hypotheses.size(); ++h)
    for (std::size_t s = 0; !taken_up(library.hypotheses[h]) && s < library.hypotheses[h].shapes.size(); ++s)
      tasks.push_back({static_cast<int>(h), static_cast<int>(s)});
  const Dictionary generic(data);
  const std::size_t effects = tasks.size();
  if (options.dictionary)
    for (std::size_t d = 0; d < generic.size(); ++d) tasks.push_back({-1, static_cast<int>(d)});
  std::vector<Done> done(tasks.size());
  std::atomic<std::size_t> next{0};
  const auto work = [&] {
    for (std::size_t t = next++; t < tasks.size(); t = next++) {
      if (t >= effects) {
        const auto d = static_cast<std::size_t>(tasks[t].shape);
        Column c;
        c.name = generic.name(d);
        c.chain = generic.chain(d);
        Eigen::VectorXd rows = generic.rows(d);
        weigh(data, *place.weights, rows);
        summarise(rows, c);
        done[t].columns.push_back(std::move(c));
        continue;
      }
      const Hypothesis& h = library.hypotheses[static_cast<std::size_t>(tasks[t].hypothesis)];
      const Values& shape = h.shapes[static_cast<std::size_t>(tasks[t].shape)];
      const std::vector<Values> ways = directions(h, shape);
      Eigen::MatrixXd x(n, static_cast<Eigen::Index>(ways.size()));
      std::vector<bool> positive;
      Done& result = done[t];
      for (std::size_t a = 0; a < ways.size(); ++a) {
        Eigen::VectorXd column = response(predictor, *place.fit, place.here, {&h, ways[a]}, *place.weights);
        Column c;
        c.hypothesis = tasks[t].hypothesis;
        c.shape = tasks[t].shape;
        c.amplitude = static_cast<int>(a);
        if (!column.allFinite()) column.setZero();
        summarise(column, c);
        x.col(static_cast<Eigen::Index>(a)) = column;
        result.columns.push_back(std::move(c));
        // An amplitude that cannot change its sign: its bound is at its absence.
        bool one_way = true;
        for (int i = 0; i < h.info().parameter_count; ++i) {
          const auto k = static_cast<std::size_t>(i);
          if (!h.amplitude[k] || (ways.size() > 1 && ways[a][k] == h.info().parameters[i].null_value))
            continue;
          const double null = h.info().parameters[i].null_value;
          if (h.lower[k] < null && h.upper[k] > null) one_way = false;
        }
        positive.push_back(one_way);
      }
      const auto m = static_cast<Eigen::Index>(ways.size());
      Eigen::VectorXd score(m);
      for (Eigen::Index a = 0; a < m; ++a) score[a] = result.columns[static_cast<std::size_t>(a)].score;
      const Eigen::MatrixXd gram = x.transpose() * x;
      const SignedFit linear = signed_fit(gram, score, positive);
      Screened& s = result.screened;
      s.hypothesis = tasks[t].hypothesis;
      s.shape = tasks[t].shape;
      s.gain = linear.gain;
      double all = 0;
      for (std::size_t a = 0; a < ways.size(); ++a) {
        const double amplitude = linear.amplitude[static_cast<Eigen::Index>(a)];
        all += amplitude * amplitude * result.columns[a].norm2;
        for (int c = 0; c < kChains; ++c)
          s.chain_norm2[c] += amplitude * amplitude * result.columns[a].plain_norm2[c];
      }
      // Parts that lie against one another are less together than each by itself.
      for (double& norm2 : s.chain_norm2) norm2 *= all > 0 ? linear.gain / all : 0.0;
      s.start = null_values(h, shape);
      for (std::size_t a = 0; a < ways.size(); ++a) {
        s.reach = std::max(s.reach, std::sqrt(result.columns[a].norm2));
        for (int i = 0; i < h.info().parameter_count; ++i) {
          const auto k = static_cast<std::size_t>(i);
          const double null = h.info().parameters[i].null_value;
          if (!std::isfinite(null)) {
            s.start[k] = shape[k];
            continue;
          }
          if (ways.size() > 1 && ways[a][k] == null) continue;
          const double factor = h.info().linear || h.info().hook == models::Hook::kTorque
                                    ? std::clamp(linear.amplitude[static_cast<Eigen::Index>(a)], -50.0, 50.0)
                                    : std::clamp(linear.amplitude[static_cast<Eigen::Index>(a)], -4.0, 4.0);
          s.start[k] = std::clamp(null + factor * (shape[k] - null), h.lower[k], h.upper[k]);
        }
      }
    }
  };
  std::vector<std::thread> pool;
  for (int i = 1; i < options.threads; ++i) pool.emplace_back(work);
  work();
  for (std::thread& thread : pool) thread.join();

  Screen result;
  for (Done& d : done) {
    for (Column& c : d.columns) result.columns.push_back(std::move(c));
    if (d.screened.hypothesis >= 0) result.shapes.push_back(d.screened);
  }
  judge(result, data, library, options);
  return result;
}

void judge(Screen& result, const Prepared& data, const Library& library, const ScreenOptions& options) {
  const auto blocks = static_cast<Eigen::Index>(data.blocks);
  const auto joined = [&](const Eigen::VectorXd& atoms) {
    Eigen::VectorXd sum = Eigen::VectorXd::Zero(blocks);
    for (Eigen::Index a = 0; a < atoms.size(); ++a)
      sum[data.block_of_atom[static_cast<std::size_t>(a)]] += atoms[a];
    return sum;
  };
  // Scatter of a score per unit of norm, and how many blocks carry it. A column that few blocks of its chain carry takes the
  // largest scatter that any function of the signals has elsewhere: slow noise scatters slow columns most. Where there is too
  // little elsewhere, nothing can be said of it.
  std::vector<double> units;
  double chain_blocks[kChains] = {};
  std::vector<std::vector<char>> seen(kChains, std::vector<char>(static_cast<std::size_t>(blocks), 0));
  for (const Row& row : data.rows) seen[static_cast<std::size_t>(row.chain)][row.block] = 1;
  for (int c = 0; c < kChains; ++c)
    chain_blocks[c] = static_cast<double>(
        std::count(seen[static_cast<std::size_t>(c)].begin(), seen[static_cast<std::size_t>(c)].end(), 1));
  const auto chains_of = [&](const Column& c) {
    return c.hypothesis >= 0 ? library.hypotheses[static_cast<std::size_t>(c.hypothesis)].chains
                             : bit(c.chain);
  };
  for (Column& c : result.columns) {
    c.T = 0;
    c.rare_p = 1;
    if (c.norm2 <= 0) continue;
    const double scatter2 = joined(c.atom_score).squaredNorm();
    c.T = scatter2 > 0 ? std::abs(c.score) / std::sqrt(scatter2) : 0;
    c.unit = scatter2 / c.norm2;
    c.carried_by = c.norm2 * c.norm2 / joined(c.atom_norm).squaredNorm();
    if (c.carried_by >= kCarryingBlocks) units.push_back(c.unit);
  }
  if (!units.empty()) result.noise_unit = std::max(0.05, series::median(units));
  Eigen::MatrixXd scores(blocks, static_cast<Eigen::Index>(result.columns.size()));
  double rare_columns = 0;
  const Elsewhere elsewhere(result.columns, joined, std::move(seen));
  for (std::size_t k = 0; k < result.columns.size(); ++k) {
    Column& c = result.columns[k];
    scores.col(static_cast<Eigen::Index>(k)) = joined(c.atom_score);
    double most = 0;
    for (int chain = 0; chain < kChains; ++chain)
      if ((chains_of(c) & (1U << chain)) != 0) most = std::max(most, chain_blocks[chain]);
    if (c.norm2 <= 0 || c.hypothesis < 0 || c.carried_by >= kBoundingBlocks) continue;
    const Eigen::VectorXd own = joined(c.atom_norm);
    if (c.carried_by < std::min(kFewBlocks, kShareOfBlocks * most)) {
      double unit = 1;
      int seen_in = static_cast<int>(blocks);
      for (int chain = 0; chain < kChains; ++chain) {
        if (c.chain_norm2[chain] <= 1e-3 * c.norm2) continue;
        const Elsewhere::Scatter there = elsewhere.scatter(chain, own);
        unit = std::max(unit, there.blocks > 0 ? there.largest : std::numeric_limits<double>::infinity());
        seen_in = std::min(seen_in, there.blocks);
      }
      if (std::isfinite(unit))
        c.rare_p = series::student_t_two_sided(std::abs(c.score) / std::sqrt(unit * c.norm2), seen_in);
    } else {
      c.rare_p = jackknife_p(scores.col(static_cast<Eigen::Index>(k)), own, c.carried_by);
    }
    ++rare_columns;
  }
  result.rare_p = 1;
  for (Column& c : result.columns) {
    c.rare_p = std::min(1.0, c.rare_p * rare_columns);
    result.rare_p = std::min(result.rare_p, c.rare_p);
  }
  const FlipTest test = flip_test(scores, options.flips, options.seed, options.significance);
  result.p_value = test.p_value;
  result.max_T = test.statistic;
  result.limit = test.limit;

  // The best shape speaks for a hypothesis.
  struct OfShape {
    double T = 0, rare_p = 1;
  };
  std::map<std::pair<int, int>, OfShape> tests;
  for (const Column& c : result.columns) {
    OfShape& t = tests[{c.hypothesis, c.shape}];
    t.T = std::max(t.T, c.T);
    t.rare_p = std::min(t.rare_p, c.rare_p);
  }
  std::vector<Screened> best(library.hypotheses.size());
  for (Screened& s : result.shapes) {
    const OfShape& t = tests[{s.hypothesis, s.shape}];
    s.T = t.T;
    s.rare_p = t.rare_p;
    Screened& b = best[static_cast<std::size_t>(s.hypothesis)];
    const double reach = std::max(b.reach, s.reach);
    if (b.hypothesis < 0 || s.gain > b.gain) b = s;
    b.reach = reach;
  }
  result.candidates.clear();
  for (const Screened& s : best)
    if (s.hypothesis >= 0) result.candidates.push_back(s);
  std::stable_sort(result.candidates.begin(), result.candidates.end(),
                   [](const Screened& a, const Screened& b) { return a.gain > b.gain; });
}

}  // namespace isac::explain
