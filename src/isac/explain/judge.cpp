// From the scores of blocks to p-values; see the head of screen.hpp.
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <numeric>
#include <random>
#include <utility>

#include "isac/explain/screen.hpp"
#include "isac/explain/workers.hpp"
#include "isac/series/statistics.hpp"

namespace isac::explain {
namespace {

constexpr double kCarryingBlocks = 8;
// T cannot pass the square root of the blocks that carry a column: with fewer than these, and most of the chain elsewhere, it has
// no power in a whole search.
constexpr double kFewBlocks = 8, kShareOfBlocks = 0.25;
// And with fewer than these it can pass a whole search's limit, about 4, only if they all agree.
constexpr double kBoundingBlocks = 25;
constexpr double kHeldByThem = 0.9;  // of a column's squares lies in the blocks that are called its own
constexpr int kBlocksElsewhere = 20;
constexpr double kMostByChance = 2;  // deviations, of the largest of dozens of functions
constexpr double kAsElsewhere = 2;   // blocks that speak for the noise being as it is elsewhere
// Of the level at which something counts as found; and of what lies beyond it, where a share that seldom speaks would only keep p-values
// from being uniform.
constexpr double kShareOfEach = 0.5, kRareBeyond = 0.002;

/// Scatter of a score without its own part: √Σ l_b²/(1 − h_b)², l_b = g_b − a n_b with a = Σ g/Σ n, h_b = n_b/Σ n, and how many parts carry it.
struct Jackknife {
  double scatter = 0, carried_by = 0;
};

Jackknife jackknife(const Eigen::VectorXd& left, const Eigen::VectorXd& norm2) {
  const double all = norm2.sum();
  return {std::sqrt((left.array() / (1 - (norm2.array() / all).min(0.99))).square().sum()),
          all * all / norm2.squaredNorm()};
}

double jackknife_p(double score, const Eigen::VectorXd& noise, const Eigen::VectorXd& norm2,
                   double shared_error2) {
  const Jackknife of = jackknife(noise - score / norm2.sum() * norm2, norm2);
  if (!(of.carried_by > 2)) return 1;  // no freedom is left
  const double scatter = std::sqrt(of.scatter * of.scatter + shared_error2);
  return scatter > 0 ? series::student_t_two_sided(std::abs(score) / scatter, of.carried_by - 1) : 1.0;
}

/// Degrees of freedom of a variance that is F > 1 times one told by many, the rest told by few (Satterthwaite): F²/(1/ν + (F − 1)²/ν_few).
double freedom_of_both(double F, double many, double few) {
  return F * F / (1 / std::max(1.0, many) + (F - 1) * (F - 1) / std::max(1.0, few));
}

/// p-value of a score of which whole runs scatter more than their blocks do:
///
///   W = Σ_b l_b²/(1 − h_b)²,  R the same of whole runs,  F = R/W > 1:
///   t = |Σ g|/√R with ν = F²/(1/ν_W + (F − 1)²/ν_R) degrees of freedom (Satterthwaite)
std::optional<double> p_by_runs(double score, const Eigen::VectorXd& left, const Eigen::VectorXd& norm2,
                                const std::vector<Eigen::Index>& run_of_block, Eigen::Index runs) {
  Eigen::VectorXd run_left = Eigen::VectorXd::Zero(runs), run_norm2 = Eigen::VectorXd::Zero(runs);
  for (Eigen::Index b = 0; b < left.size(); ++b) {
    run_left[run_of_block[static_cast<std::size_t>(b)]] += left[b];
    run_norm2[run_of_block[static_cast<std::size_t>(b)]] += norm2[b];
  }
  const Jackknife blocks = jackknife(left, norm2), whole = jackknife(run_left, run_norm2);
  if (!(whole.scatter > blocks.scatter) || !(blocks.scatter > 0)) return std::nullopt;
  const double F = whole.scatter * whole.scatter / (blocks.scatter * blocks.scatter);
  return series::student_t_two_sided(std::abs(score) / whole.scatter,
                                     freedom_of_both(F, blocks.carried_by - 1, whole.carried_by - 1));
}

/// What scores of any function of the signals scatter, chain by chain, in blocks that a column does not live in.
class ScatterElsewhere {
 public:
  ScatterElsewhere(const std::vector<Column>& columns,
                   const std::function<Eigen::VectorXd(const Eigen::VectorXd&)>& joined,
                   std::vector<std::vector<char>> there)
      : there_(std::move(there)) {
    for (const Column& c : columns) {
      if (c.hypothesis >= 0 || c.norm2 <= 0) continue;
      Functions& f = chains_[static_cast<int>(c.chain)];
      f.score2.push_back(joined(c.noise()).cwiseAbs2());
      f.norm2.push_back(joined(c.atom_norm));
    }
  }

  /// The largest of the functions; 0 where too little is left to tell.
  Elsewhere scatter(int chain, const Eigen::VectorXd& own_norm2) const {
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
    Elsewhere found;
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
      if (blocks < kBlocksElsewhere || norm2 <= 0.05 * f.norm2[k].sum()) continue;
      // The largest of many alike is too large by what chance makes of their maximum.
      const double scatter = score2 / norm2 / (1 + kMostByChance * std::sqrt(2.0 / blocks));
      if (scatter > found.unit) found = {scatter, blocks};
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

}  // namespace

FlipTest flip_test(const Eigen::MatrixXd& scores, int flips, std::uint64_t seed, double significance,
                   std::optional<double> statistic, int threads) {
  const Eigen::Index blocks = scores.rows(), columns = scores.cols();
  if (columns == 0) return {};  // nothing was looked for
  Eigen::MatrixXd scaled = scores;
  for (Eigen::Index j = 0; j < columns; ++j) {
    const double norm = scaled.col(j).norm();
    if (norm > 0) scaled.col(j) /= norm;
  }
  const double observed =
      statistic.value_or(columns > 0 ? scaled.colwise().sum().cwiseAbs().maxCoeff() : 0.0);
  std::mt19937_64 random(seed);
  constexpr Eigen::Index kAtOnce = 128;
  std::vector<Eigen::MatrixXd> signs;
  for (int done = 0; done < flips; done += kAtOnce) {
    const Eigen::Index now = std::min<Eigen::Index>(kAtOnce, flips - done);
    Eigen::MatrixXd& of_these = signs.emplace_back(now, blocks);
    for (Eigen::Index i = 0; i < now; ++i)
      for (Eigen::Index b = 0; b < blocks; b += 64) {
        std::uint64_t bits = random();
        for (Eigen::Index k = b; k < std::min(b + 64, blocks); ++k, bits >>= 1)
          of_these(i, k) = (bits & 1) != 0 ? 1.0 : -1.0;
      }
  }
  std::vector<Eigen::VectorXd> largest(signs.size());
  share_work(threads, signs.size(),
             [&](std::size_t i) { largest[i] = (signs[i] * scaled).cwiseAbs().rowwise().maxCoeff(); });
  std::vector<double> all;
  all.reserve(static_cast<std::size_t>(flips));
  int reached = 1;
  for (const Eigen::VectorXd& of_these : largest) {
    all.insert(all.end(), of_these.data(), of_these.data() + of_these.size());
    reached += static_cast<int>((of_these.array() >= observed * (1 - 1e-12)).count());
  }
  FlipTest test;
  test.statistic = observed;
  test.p_value = static_cast<double>(reached) / static_cast<double>(flips + 1);
  test.limit = series::quantile(all, 1 - significance);
  return test;
}

ErrorsOfReading errors_of_reading(const Around& place) {
  const Prepared& data = place.predictor->data();
  const auto rows = static_cast<Eigen::Index>(data.rows.size());
  ErrorsOfReading errors;
  Eigen::VectorXd& of_lag = errors.of_day[0];
  Eigen::VectorXd& of_bends = errors.of_day[1];
  errors.of_run = of_lag = of_bends = Eigen::VectorXd::Zero(rows);
  const double gain = place.predictor->pressure_gain(place.fit->model);
  for (Eigen::Index i = 0; i < rows; ++i) {
    const Row& row = data.rows[static_cast<std::size_t>(i)];
    const PreparedRun& run = data.runs[row.run];
    if (row.chain == Chain::kMotion && !run.slow_torque_error.empty())
      of_bends[i] = run.slow_torque_error[row.sample];
    if (row.chain != Chain::kTorque) continue;
    errors.of_run[i] = gain * run.mean_pressure_error;
    if (!run.lag_pressure_error.empty()) of_lag[i] = gain * run.lag_pressure_error[row.sample];
  }
  for (Eigen::VectorXd* error : {&errors.of_run, &of_lag, &of_bends})
    if (error->squaredNorm() > 0) weigh(data, *place.weights, *error);
  return errors;
}

Yardstick yardstick_beside(const Screen& screen, const Around& place, Responses& kept, int hypothesis,
                           const Eigen::VectorXd& residual) {
  const Prepared& data = place.predictor->data();
  Yardstick yardstick{.hypothesis = hypothesis,
                      .functions = {},
                      .own_p = p_of_refit(data, place.residual, residual, errors_of_reading(place))};
  std::size_t function = 0;
  for (const Column& known : screen.columns) {
    if (known.hypothesis >= 0) continue;
    const Eigen::VectorXf& x = kept.function(function++);
    Column c;
    c.chain = known.chain;
    c.norm2 = known.norm2;
    c.atom_score = c.atom_norm = Eigen::VectorXd::Zero(known.atom_score.size());
    for (Eigen::Index i = 0; i < x.size(); ++i) {
      const auto b = static_cast<Eigen::Index>(data.rows[static_cast<std::size_t>(i)].atom);
      const double value = x[i];
      c.atom_score[b] -= value * residual[i];
      c.atom_norm[b] += value * value;
    }
    yardstick.functions.push_back(std::move(c));
  }
  return yardstick;
}

namespace {

/// What a refit closed, before − after, block by block.
struct Closed {
  Eigen::VectorXd left, norm2;  ///< Σ after·closed, Σ closed²
  double score = 0, shared_error2 = 0;
  std::vector<Eigen::Index> run_of_block;
  Jackknife own;
};

std::optional<Closed> closed_by(const Prepared& data, const Eigen::VectorXd& before,
                                const Eigen::VectorXd& after, const ErrorsOfReading& errors) {
  const auto blocks = static_cast<Eigen::Index>(data.blocks);
  Closed c;
  c.left = c.norm2 = Eigen::VectorXd::Zero(blocks);
  c.run_of_block.assign(data.blocks, 0);
  Eigen::VectorXd run_error = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(data.runs.size()));
  Eigen::Vector<double, ErrorsOfReading::kOfDay> day_error = {0, 0};
  for (std::size_t i = 0; i < data.rows.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(i), block = static_cast<Eigen::Index>(data.rows[i].block);
    const double closed = before[row] - after[row];
    c.norm2[block] += closed * closed;
    c.left[block] += after[row] * closed;
    c.run_of_block[data.rows[i].block] = static_cast<Eigen::Index>(data.rows[i].run);
    if (errors.of_run.size() == 0) continue;
    run_error[static_cast<Eigen::Index>(data.rows[i].run)] += closed * errors.of_run[row];
    for (Eigen::Index e = 0; e < day_error.size(); ++e) day_error[e] += closed * errors.of_day[e][row];
  }
  if (!(c.norm2.sum() > 0)) return std::nullopt;
  c.score = c.norm2.sum() + c.left.sum();
  c.shared_error2 = run_error.squaredNorm() + day_error.squaredNorm();
  c.own = jackknife(c.left, c.norm2);
  return c;
}

}  // namespace

double p_of_refit(const Prepared& data, const Eigen::VectorXd& before, const Eigen::VectorXd& after,
                  const ErrorsOfReading& errors) {
  const std::optional<Closed> c = closed_by(data, before, after, errors);
  if (!c || !(c->own.carried_by > 2) || !(c->own.scatter > 0)) return 1;
  const double scatter = std::sqrt(c->own.scatter * c->own.scatter + c->shared_error2);
  const double p = series::student_t_two_sided(std::abs(c->score) / scatter, c->own.carried_by - 1);
  return std::max(
      p, p_by_runs(c->score, c->left, c->norm2, c->run_of_block, static_cast<Eigen::Index>(data.runs.size()))
             .value_or(0));
}

double p_in_its_blocks(const Prepared& data, const Eigen::VectorXd& before, const Eigen::VectorXd& after,
                       const ErrorsOfReading& errors, const Elsewhere& elsewhere) {
  const std::optional<Closed> c = closed_by(data, before, after, errors);
  if (!c || !(elsewhere.unit > 0)) return 1;
  const double variance = elsewhere.unit * c->norm2.sum(),
               louder = c->own.carried_by > 2 ? c->own.scatter * c->own.scatter / variance : 1.0;
  if (!(louder > 1))
    return series::student_t_two_sided(std::abs(c->score) / std::sqrt(variance + c->shared_error2),
                                       elsewhere.blocks);
  const double few = c->own.carried_by - 1, F = (kAsElsewhere + few * louder) / (kAsElsewhere + few);
  return series::student_t_two_sided(std::abs(c->score) / std::sqrt(F * variance + c->shared_error2),
                                     freedom_of_both(F, elsewhere.blocks, kAsElsewhere + few));
}

double joint_p(double flips, double rare, double level) noexcept {
  const auto least = [&](double p, double beyond) {
    const double spent = kShareOfEach * level;
    return p <= spent ? p / kShareOfEach : level + (p - spent) / beyond;
  };
  return std::min({1.0, least(flips, 1 - kRareBeyond), least(rare, kRareBeyond)});
}

void judge(Screen& result, const Prepared& data, const Library& library, const ScreenOptions& options,
           const Yardstick& yardstick) {
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
  std::vector<Eigen::Index> run_of_block(static_cast<std::size_t>(blocks), 0);
  for (const Row& row : data.rows) {
    seen[static_cast<std::size_t>(row.chain)][row.block] = 1;
    run_of_block[row.block] = static_cast<Eigen::Index>(row.run);
  }
  for (int c = 0; c < kChains; ++c)
    chain_blocks[c] = static_cast<double>(
        std::count(seen[static_cast<std::size_t>(c)].begin(), seen[static_cast<std::size_t>(c)].end(), 1));
  const auto chains_of = [&](const Column& c) {
    return c.hypothesis >= 0 ? library.hypotheses[static_cast<std::size_t>(c.hypothesis)].chains
                             : bit(c.chain);
  };
  const auto told_by_runs = [&](const Column& c) -> std::optional<double> {
    if (c.atom_left.size() == 0) return std::nullopt;
    return p_by_runs(c.score, joined(c.atom_left), joined(c.atom_norm), run_of_block,
                     static_cast<Eigen::Index>(data.runs.size()));
  };
  for (Column& c : result.columns) {
    c.T = 0;
    c.rare_p = 1;
    c.elsewhere = {};
    if (c.norm2 <= 0) continue;
    const double scatter2 = joined(c.noise()).squaredNorm() + c.shared_error.squaredNorm();
    c.T = scatter2 > 0 ? std::abs(c.score) / std::sqrt(scatter2) : 0;
    c.unit = scatter2 / c.norm2;
    c.carried_by = c.norm2 * c.norm2 / joined(c.atom_norm).squaredNorm();
    if (const std::optional<double> p = told_by_runs(c); p && *p > 0)
      c.T = std::min(c.T, series::normal_two_sided_limit(*p));
    if (c.carried_by >= kCarryingBlocks) units.push_back(c.unit);
  }
  if (!units.empty()) result.noise_unit = std::max(0.05, series::median(units));
  Eigen::Index shared = 0;
  for (const Column& c : result.columns) shared = std::max(shared, c.shared_error.size());
  Eigen::MatrixXd scores =
      Eigen::MatrixXd::Zero(blocks + shared, static_cast<Eigen::Index>(result.columns.size()));
  double rare_columns = 0;
  const ScatterElsewhere elsewhere(result.columns, joined, seen), beside(yardstick.functions, joined, seen);
  for (std::size_t k = 0; k < result.columns.size(); ++k) {
    Column& c = result.columns[k];
    const Eigen::VectorXd noise = joined(c.noise());
    scores.col(static_cast<Eigen::Index>(k)).head(blocks) = noise;
    scores.col(static_cast<Eigen::Index>(k)).segment(blocks, c.shared_error.size()) = c.shared_error;
    double most = 0;
    for (int chain = 0; chain < kChains; ++chain)
      if ((chains_of(c) & (1U << chain)) != 0) most = std::max(most, chain_blocks[chain]);
    if (c.norm2 <= 0 || c.hypothesis < 0 || c.carried_by >= kBoundingBlocks) continue;
    const Eigen::VectorXd own = joined(c.atom_norm);
    if (c.carried_by < std::min(kFewBlocks, kShareOfBlocks * most)) {
      c.elsewhere = {1, static_cast<int>(blocks)};
      for (int chain = 0; chain < kChains; ++chain) {
        if (c.chain_norm2[chain] <= 1e-3 * c.norm2) continue;
        const Elsewhere there =
            (c.hypothesis == yardstick.hypothesis ? beside : elsewhere).scatter(chain, own);
        c.elsewhere.unit = std::max(c.elsewhere.unit,
                                    there.blocks > 0 ? there.unit : std::numeric_limits<double>::infinity());
        c.elsewhere.blocks = std::min(c.elsewhere.blocks, there.blocks);
      }
      if (std::isfinite(c.elsewhere.unit))
        c.rare_p = series::student_t_two_sided(
            std::abs(c.score) / std::sqrt(c.elsewhere.unit * c.norm2 + c.shared_error.squaredNorm()),
            c.elsewhere.blocks);
    } else {
      c.rare_p = jackknife_p(c.score, noise, own, c.shared_error.squaredNorm());
    }
    c.rare_p = std::max(c.rare_p, told_by_runs(c).value_or(0));
    if (const auto least = yardstick.least_p.find(c.hypothesis); least != yardstick.least_p.end())
      c.rare_p = std::max(c.rare_p, least->second);
    if (c.hypothesis == yardstick.hypothesis) c.rare_p = std::min(c.rare_p, yardstick.own_p);
    ++rare_columns;
  }
  result.rare_p = 1;
  for (Column& c : result.columns) {
    c.rare_p = std::min(1.0, c.rare_p * rare_columns);
    result.rare_p = std::min(result.rare_p, c.rare_p);
  }
  const auto flipped = [&](auto&& takes, double level) {
    std::vector<Eigen::Index> of;
    double largest = 0;
    for (std::size_t k = 0; k < result.columns.size(); ++k) {
      if (!takes(result.columns[k])) continue;
      of.push_back(static_cast<Eigen::Index>(k));
      largest = std::max(largest, result.columns[k].T);
    }
    return flip_test(scores(Eigen::all, of), options.flips, options.seed, level, largest, options.threads);
  };
  const FlipTest test = flipped([](const Column&) { return true; }, kShareOfEach * options.significance);
  result.p_value = test.p_value;
  result.max_T = test.statistic;
  result.limit = test.limit;
  result.rare_limit = kShareOfEach * options.significance;
  for (int chain = 0; chain < kChains; ++chain) {
    const auto alone = [&](const Column& c) { return chains_of(c) == 1U << chain; };
    double rare = 1;
    for (const Column& c : result.columns)
      if (alone(c)) rare = std::min(rare, c.rare_p);
    if (chain_blocks[chain] > 0)
      result.chain_p[chain] =
          joint_p(flipped(alone, options.significance).p_value, rare, options.significance);
  }

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
    const double reach = std::max(b.reach, s.reach), T = std::max(b.T, s.T),
                 rare_p = b.hypothesis < 0 ? s.rare_p : std::min(b.rare_p, s.rare_p);
    if (b.hypothesis < 0 || s.gain > b.gain) b = s;
    b.reach = reach;
    b.T = T;  // what any of its shapes shows: the whole search's p is of all of them
    b.rare_p = rare_p;
  }
  result.candidates.clear();
  for (const Screened& s : best)
    if (s.hypothesis >= 0) result.candidates.push_back(s);
  std::stable_sort(result.candidates.begin(), result.candidates.end(),
                   [](const Screened& a, const Screened& b) { return a.gain > b.gain; });
}

}  // namespace isac::explain
