#include "isac/explain/quiet_pressure.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <vector>

#include "isac/core/units.hpp"
#include "isac/estimate/linear_algebra.hpp"
#include "isac/explain/filters.hpp"
#include "isac/explain/screen.hpp"
#include "isac/explain/workers.hpp"

namespace isac::explain {
namespace {

constexpr double kBetween = 0.15, kSlow = 1.0;  // s, kernels between the bands
constexpr std::size_t kStride = 10;             // samples between the rows that G is fitted to
constexpr double kPrior =
    0.5;  // standard deviation of λ about 1 beforehand: where the torque cannot tell, the reading stands
constexpr double kSettled = 0.4;  // s at a run's start in which p(0) is still felt
constexpr double kBlock = 5;      // s
constexpr int kFunctions = 29;
using Functions = Eigen::Matrix<double, kFunctions, 1>;

/// Least squares whose columns may nearly depend on each other, for each column of y.
Eigen::MatrixXd solve(const Eigen::MatrixXd& x, const Eigen::MatrixXd& y) {
  const Eigen::VectorXd norm = x.colwise().norm().cwiseMax(1e-12);
  const Eigen::MatrixXd scaled = x * norm.cwiseInverse().asDiagonal();
  Eigen::MatrixXd gram = estimate::gram_of(scaled);
  gram.diagonal().array() += 1e-6;
  return norm.cwiseInverse().asDiagonal() * estimate::solve_symmetric_each(gram, scaled.transpose() * y);
}

/// Least squares on the columns that the data bear out: the least certain goes, one at a time, until every column but the first (a
/// constant) is kErrors of its standard errors from zero. The errors are those of blocks of time (a sandwich), as what is left is
/// far from white; `block` counts from 0.
Eigen::VectorXd solve_significant(const Eigen::MatrixXd& x, const Eigen::VectorXd& y,
                                  const std::vector<std::size_t>& block) {
  constexpr double kErrors = 3.5;
  const Eigen::VectorXd norm = x.colwise().norm().cwiseMax(1e-12);
  const Eigen::MatrixXd scaled = x * norm.cwiseInverse().asDiagonal();
  Eigen::MatrixXd gram = estimate::gram_of(scaled);
  gram.diagonal().array() += 1e-6;
  const Eigen::VectorXd right = scaled.transpose() * y;
  std::vector<Eigen::Index> in(static_cast<std::size_t>(x.cols()));
  std::iota(in.begin(), in.end(), 0);
  Eigen::VectorXd beta;
  while (true) {
    const Eigen::MatrixXd inner = gram(in, in);
    beta = estimate::solve_symmetric(inner, right(in));
    const Eigen::MatrixXd part = scaled(Eigen::all, in);
    const Eigen::VectorXd left = y - part * beta;
    Eigen::MatrixXd score = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(block.back()) + 1, part.cols());
    for (Eigen::Index n = 0; n < part.rows(); ++n)
      score.row(static_cast<Eigen::Index>(block[static_cast<std::size_t>(n)])) += left[n] * part.row(n);
    const Eigen::VectorXd error = estimate::solve_symmetric_each(inner, score.transpose()).rowwise().norm();
    Eigen::Index least = 0;
    double certain = kErrors;
    for (Eigen::Index c = 1; c < beta.size(); ++c)
      if (const double t = std::abs(beta[c]) / std::max(error[c], 1e-300); !(t >= certain)) {
        certain = t;
        least = c;
      }
    if (least == 0) break;
    in.erase(in.begin() + least);
  }
  Eigen::VectorXd all = Eigen::VectorXd::Zero(x.cols());
  all(in) = beta;
  return norm.cwiseInverse().asDiagonal() * all;
}

/// Sums over one valve's rows, and block by block, of s = ∂p̂/∂T_C, p̂ (to which ∂p̂/∂K_C is alike) and e = p − p̂.
struct ScoresOfLag {
  double ss = 0, sp = 0, pp = 0;
  std::vector<std::array<double, 2>> of_block = {};  // Σ s e, Σ p̂ e

  void add(std::size_t block, double s, double p, double e) {
    ss += s * s;
    sp += s * p;
    pp += p * p;
    if (of_block.size() <= block) of_block.resize(block + 1, {});
    of_block[block][0] += s * e;
    of_block[block][1] += p * e;
  }
};

/// Of the lag that both valves share, beside the gain that they share, by the scatter of blocks about what the fit leaves, s.
double deviation_of_lag(const ScoresOfLag (&valves)[2]) {
  double ss = 0, sp = 0, pp = 0, squares = 0;
  for (const ScoresOfLag& v : valves) ss += v.ss, sp += v.sp, pp += v.pp;
  if (!(pp > 0)) return 0;
  const double share = sp / pp, norm2 = ss - share * sp;
  for (const ScoresOfLag& v : valves)
    for (const auto& block : v.of_block) {
      const double score = block[0] - share * block[1];
      squares += score * score;
    }
  return norm2 > 0 ? std::sqrt(squares) / norm2 : 0.0;
}

/// What a valve's pressure may depend on by rule, at one sample; pressures in kg/cm².
class Rules {
 public:
  Rules(const PreparedRun& run, const std::vector<double> (&predicted)[2], double lag, int valve)
      : run_(run), own_(predicted[valve]), other_(predicted[1 - valve]), lag_(lag) {
    const std::vector<double>& u = run.command[valve];
    const double times[] = {0.3 * lag, 2.5 * lag, 1.0, 5.0};
    for (int i = 0; i < 4; ++i) {
      double p = u.front();
      const double keep = std::exp(-run.interval / times[i]);
      for (const double command : u) {
        lagged_[i].push_back(p / kPascalPerKgfCm2);
        p = command + keep * (p - command);
      }
    }
  }
  Functions at(std::size_t k) const {
    const double bar = kPascalPerKgfCm2, q = own_[k] / bar, w = rate(own_, k), o = other_[k] / bar,
                 v = rate(other_, k), day = 1e-3 * (run_.day_offset + run_.time[k]);
    const bool moves = !run_.angle.empty();
    const double angle = moves ? run_.angle[k] : 0, speed = moves ? run_.velocity[k] : 0;
    Functions f;
    f << 1, q, q * q, q * q * q, w, std::abs(w), w * std::abs(w), w * w * w, q * w, q * std::abs(w),
        std::tanh(5 * w), lagged_[0][k], lagged_[1][k], lagged_[2][k], lagged_[3][k], o, v, std::abs(v),
        o * q, std::max(0.0, q - 4), std::max(0.0, q + o - 7), angle, speed, std::abs(speed), angle * angle,
        1e-2 * run_.time[k], day, day * q, day * w;
    return f;
  }

 private:
  double rate(const std::vector<double>& p, std::size_t k) const {  // of the lag, kg/cm² in its time
    const std::size_t a = k == 0 ? 0 : k - 1, b = std::min(k + 1, p.size() - 1);
    return (p[b] - p[a]) / (static_cast<double>(b - a) * run_.interval) * lag_ / kPascalPerKgfCm2;
  }
  const PreparedRun& run_;
  const std::vector<double>&own_, &other_;
  double lag_;
  std::vector<double> lagged_[4];
};

}  // namespace

struct QuietPressure::Parts {
  std::vector<double> by_rule[2];       ///< p̂ + G, low-passed; empty where the run has no commands
  std::vector<double> rest[2][kBands];  ///< r, by bands
  std::vector<double> by_lag[kBands];   ///< of (p2 − p1)/2 what p̂ gains by a second of lag, by bands
};

namespace {

/// x, low-passed as a reading is, in three bands.
void cut_into_bands(const std::vector<double>& x, double sigma, double interval,
                    std::vector<double> (&bands)[QuietPressure::kBands]) {
  const std::vector<double> narrow = low_pass(x, sigma), middle = wide_low_pass(x, kBetween / interval);
  bands[2] = wide_low_pass(x, kSlow / interval);
  for (int b = 0; b < 2; ++b) bands[b].resize(x.size());
  for (std::size_t k = 0; k < x.size(); ++k) {
    bands[0][k] = narrow[k] - middle[k];
    bands[1][k] = middle[k] - bands[2][k];
  }
}

/// Of the valves' first-order lag, what a second more of it makes of their pressures.
struct ByLag {
  ModelPoint longer;
  double more = 0;  // s
  explicit ByLag(const ModelPoint& model) : longer(model), more(0.01 * model.base.back()) {
    longer.base.back() += more;
  }
};

/// How far a run is from its beginning, where p(0) is still felt: 0 to 1.
double known_at(double time) {
  return std::clamp((time / kSettled - 1) / 0.5, 0.0, 1.0);
}

}  // namespace

std::vector<QuietPressure::Parts> QuietPressure::parts_of(const Prepared& data, int threads) const {
  std::vector<Parts> all(data.runs.size());
  const Predictor predictor(data);
  ModelPoint model = model_;
  model.base.resize(predictor.base().size());
  const double lag = model_.base.back();
  const ByLag by_lag(model);
  share_work(threads, data.runs.size(), [&](std::size_t r) {
    const PreparedRun& run = data.runs[r];
    if (!run.has_command) return;
    const Predictor::FullRate rate = predictor.full_rate(model, r);
    if (rate.pressure[0].empty()) return;
    const double sigma = data.smoothing.torque / run.interval;
    for (int i = 0; i < 2; ++i) {
      const Rules rules(run, rate.pressure, lag, i);
      std::vector<double> ruled = rate.pressure[i], rest(ruled.size());
      double mean = 0, settled = 0;
      for (std::size_t k = 0; k < ruled.size(); ++k) {
        ruled[k] += kPascalPerKgfCm2 * by_rule_[i].dot(rules.at(k));
        rest[k] = run.raw_pressure[i][k] - ruled[k];
        if (run.time[k] < 2 * kSettled || !std::isfinite(rest[k])) continue;
        mean += rest[k];
        settled += 1;
      }
      // Where a run stands at pressures that were not fitted, the functions may be off by a constant; its own mean says by how much.
      mean /= std::max(1.0, settled);
      for (std::size_t k = 0; k < ruled.size(); ++k) {
        ruled[k] += mean;
        rest[k] -= mean;
        // The rough lag does not know where the run began.
        const double known = known_at(run.time[k]);
        ruled[k] += (1 - known) * rest[k];
        rest[k] *= known;
      }
      all[r].by_rule[i] = low_pass(ruled, sigma);
      cut_into_bands(rest, sigma, run.interval, all[r].rest[i]);
    }
    // A run's mean and its beginning stand as they were read, whatever the lag.
    const Predictor::FullRate longer = predictor.full_rate(by_lag.longer, r);
    std::vector<double> gained(run.time.size());
    double mean = 0, settled = 0;
    for (std::size_t k = 0; k < gained.size(); ++k) {
      gained[k] =
          0.5 * (longer.pressure[1][k] - rate.pressure[1][k] - longer.pressure[0][k] + rate.pressure[0][k]) /
          by_lag.more;
      if (run.time[k] < 2 * kSettled) continue;
      mean += gained[k];
      settled += 1;
    }
    mean /= std::max(1.0, settled);
    for (std::size_t k = 0; k < gained.size(); ++k) gained[k] = known_at(run.time[k]) * (gained[k] - mean);
    cut_into_bands(gained, sigma, run.interval, all[r].by_lag);
  });
  return all;
}

QuietPressure QuietPressure::learn(Prepared& data, const ModelPoint* known, int threads) {
  QuietPressure quiet;
  if (!data.baseline.terms.empty() || !data.has(Chain::kPressure1) || !data.has(Chain::kPressure2) ||
      !data.has(Chain::kTorque))
    return quiet;
  double pressure_gain = 0;
  {
    const Predictor predictor(data, threads);
    Weights weights;
    weights.sigma[1] = weights.sigma[2] = 150;  // Pa: the chains share nothing, so any scale will do
    const Fit fit = fit_baseline(predictor, {}, weights);
    quiet.model_ = known != nullptr ? *known : fit.model;
    quiet.model_.rest.clear();
    pressure_gain = fit.model.base[1];
    const double lag = fit.model.base.back();
    const ByLag by_lag(quiet.model_);
    ScoresOfLag scores[2];
    bool learnt[2] = {false, false};
    share_work(threads, 2, [&](std::size_t valve) {
      const auto i = static_cast<int>(valve);
      std::vector<Functions> rows;
      std::vector<double> off;
      std::vector<std::size_t> block;
      std::size_t last_run = 0, last_time = 0;
      for (std::size_t r = 0; r < data.runs.size(); ++r) {
        const PreparedRun& run = data.runs[r];
        if (!run.has_command) continue;
        const Predictor::FullRate rate = predictor.full_rate(quiet.model_, r);
        const Rules rules(run, rate.pressure, lag, i);
        // Low-passed as the reading is: of a first-order lag, a Gaussian makes σ²/(2 T²) of what is still to come.
        const std::vector<double> predicted =
                                      low_pass(rate.pressure[i], data.smoothing.torque / run.interval),
                                  longer = low_pass(predictor.full_rate(by_lag.longer, r).pressure[i],
                                                    data.smoothing.torque / run.interval);
        for (std::size_t k = 0; k < run.time.size(); k += kStride)
          if (run.usable[k] != 0 && run.time[k] > kSettled) {
            rows.push_back(rules.at(k));
            const auto time = static_cast<std::size_t>(run.time[k] / kBlock);
            if (block.empty() || r != last_run || time != last_time)
              block.push_back(block.empty() ? 0 : block.back() + 1);
            else
              block.push_back(block.back());
            last_run = r;
            last_time = time;
            off.push_back((run.smooth_pressure[i][k] - predicted[k]) / kPascalPerKgfCm2);
            scores[i].add(block.back(), (longer[k] - predicted[k]) / (by_lag.more * kPascalPerKgfCm2),
                          predicted[k] / kPascalPerKgfCm2, off.back());
          }
      }
      if (rows.size() < 20 * kFunctions) return;
      Eigen::MatrixXd x(static_cast<Eigen::Index>(rows.size()), kFunctions);
      for (std::size_t n = 0; n < rows.size(); ++n) x.row(static_cast<Eigen::Index>(n)) = rows[n];
      quiet.by_rule_[i] =
          solve_significant(x, Eigen::Map<const Eigen::VectorXd>(off.data(), x.rows()), block);
      learnt[i] = quiet.by_rule_[i].allFinite();
    });
    if (!learnt[0] || !learnt[1]) return quiet;
    quiet.lag_error_ = deviation_of_lag(scores);
  }
  const std::vector<Parts> parts = quiet.parts_of(data, threads);
  const std::vector<PreparedRun> read = data.runs;  // should the torque tell nothing
  quiet.known_ = true;
  quiet.felt_ = {0, 0, 0};
  quiet.apply(data, parts);

  // Torque = its base, generic functions of quiet signals, and the bands.
  const Dictionary generic(data);
  std::vector<Eigen::Index> of_torque;
  std::vector<Eigen::Index> at, kept;  // rows with all parts, and where they are among those of the torque
  const Eigen::MatrixXd functions = generic.rows_of(Chain::kTorque, of_torque);
  for (std::size_t i = 0; i < of_torque.size(); ++i)
    if (!parts[data.rows[static_cast<std::size_t>(of_torque[i])].run].by_rule[0].empty()) {
      at.push_back(of_torque[i]);
      kept.push_back(static_cast<Eigen::Index>(i));
    }
  const auto n = static_cast<Eigen::Index>(at.size());
  Eigen::VectorXd y(n), cubed(n);
  Eigen::MatrixXd bands(n, kBands);
  const double gain = pressure_gain * data.rig.wheel_radius;
  for (Eigen::Index i = 0; i < n; ++i) {
    const Row& row = data.rows[static_cast<std::size_t>(at[static_cast<std::size_t>(i)])];
    const PreparedRun& run = data.runs[row.run];
    y[i] = run.smooth_torque[row.sample];
    cubed[i] = std::pow(run.velocity[row.sample], 3);
    for (int b = 0; b < kBands; ++b)
      bands(i, b) =
          0.5 * gain * (parts[row.run].rest[1][b][row.sample] - parts[row.run].rest[0][b][row.sample]);
  }
  Eigen::MatrixXd x(n, functions.cols() + 1);
  x.leftCols(functions.cols()) = functions(kept, Eigen::all);
  x.col(functions.cols()) = cubed;
  const bool enough = n > 20 * (x.cols() + kBands);
  if (enough) {
    Eigen::MatrixXd of(n, kBands + 1);
    of << bands, y;
    of -= x * solve(x, of);
    bands = of.leftCols(kBands);
    y = of.col(kBands);
    const Eigen::VectorXd felt = solve(bands, y), left = y - bands * felt;
    for (int b = 0; b < kBands; ++b) {
      // Scatter of its score over blocks of time.
      Eigen::VectorXd score = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(data.blocks));
      for (Eigen::Index i = 0; i < n; ++i)
        score[data.rows[static_cast<std::size_t>(at[static_cast<std::size_t>(i)])].block] +=
            bands(i, b) * left[i];
      const double norm2 = bands.col(b).squaredNorm(), error = score.norm() / std::max(norm2, 1e-300);
      const double told = 1 / (error * error), before = 1 / (kPrior * kPrior);
      quiet.felt_[static_cast<std::size_t>(b)] =
          norm2 > 0 && std::isfinite(felt[b])
              ? std::clamp((told * felt[b] + before) / (told + before), 0.0, 1.0)
              : 1.0;
    }
  } else {
    quiet.felt_ = {1, 1, 1};
  }
  data.runs = read;
  quiet.apply(data, parts);
  return quiet;
}

void QuietPressure::apply(Prepared& data) const {
  if (known_) apply(data, parts_of(data, 1));
}

void QuietPressure::apply(Prepared& data, const std::vector<Parts>& parts) const {
  for (std::size_t r = 0; r < data.runs.size(); ++r)
    for (int i = 0; i < 2; ++i) {
      const Parts& part = parts[r];
      if (part.by_rule[i].empty()) continue;
      std::vector<double>& p = data.runs[r].pressure[i];
      for (std::size_t k = 0; k < p.size(); ++k) {
        p[k] = part.by_rule[i][k];
        for (std::size_t b = 0; b < kBands; ++b) p[k] += felt_[b] * part.rest[i][b][k];
      }
    }
  for (std::size_t r = 0; r < data.runs.size(); ++r) {
    PreparedRun& run = data.runs[r];
    const bool changed = !parts[r].by_rule[0].empty();
    run.mean_pressure_error = changed ? error_of_mean(parts[r], run) : 0.0;
    run.lag_pressure_error.assign(changed ? run.time.size() : 0, 0.0);
    for (std::size_t k = 0; k < run.lag_pressure_error.size(); ++k)
      for (std::size_t b = 0; b < kBands; ++b)
        run.lag_pressure_error[k] += lag_error_ * (1 - felt_[b]) * parts[r].by_lag[b][k];
  }
}

/// Of what was taken out, a run's mean stays in: as uncertain as blocks of it say.
double QuietPressure::error_of_mean(const Parts& parts, const PreparedRun& run) const {
  std::vector<double> blocks;
  const std::size_t n = run.time.size();
  for (std::size_t k = 0; k < n; ++k) {
    const auto block = static_cast<std::size_t>(static_cast<double>(k) * run.interval / kBlock);
    if (block >= blocks.size()) blocks.resize(block + 1, 0.0);
    double out = 0;
    for (std::size_t b = 0; b < kBands; ++b)
      out += 0.5 * (1 - felt_[b]) * (parts.rest[1][b][k] - parts.rest[0][b][k]);
    if (std::isfinite(out)) blocks[block] += out;
  }
  const auto count = static_cast<double>(blocks.size());
  if (count < 2) return 0;
  double squares = 0;  // of sums about their mean, which is nothing
  for (const double sum : blocks) squares += sum * sum;
  return std::sqrt(squares * count / (count - 1)) / static_cast<double>(n);
}

}  // namespace isac::explain
