#include "isac/explain/weights.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "isac/core/units.hpp"
#include "isac/explain/workers.hpp"

namespace isac::explain {
namespace {

constexpr double kKernelForgets =
    4.3;  // standard deviations of the kernel: beyond, white noise has left 1 % of correlation
constexpr double kLongestLag = 1.2;                 // s
constexpr double kShortest = 0.03, kLongest = 3.0;  // s, of the memory
constexpr int kMemories = 24;
constexpr double kFastest = 4.0;    // Hz
constexpr double kWanders = 100.0;  // s, memory of a zero that wanders
constexpr double kWanderBin = 2.0;  // s, rows whose mean is one reading of the zero
constexpr double kByChance = 9;     // twice the logarithm of the likelihoods' ratio

bool is_slow(const Colour& c) {
  return (c.slow > 0 && c.memory > 0) || c.wander > 0;
}

}  // namespace

/// Decays, gains and scales of the noise's Kalman filter, row by row: they do not depend on what is filtered.
struct NoiseFilter {
  struct Gains {
    double stay1 = 0, stay2 = 0, gain1 = 0, gain2 = 0, scale = 1;
  };
  const Prepared* data = nullptr;
  std::size_t rows = 0;
  std::vector<Gains> gains;
  /// Of rows of the motion, where torque and motion have one zero: the row of the torque that last told it, −1 where none did.
  std::vector<std::ptrdiff_t> told_by;
  double share = 0;  ///< σ_torque/σ_motion

  NoiseFilter(const Prepared& of, const Weights& weights) : data(&of), rows(of.rows.size()), gains(rows) {
    const Colour(&colours)[kChains] = weights.colour;
    if (weights.one_zero) find_partners(weights);
    const Row* last = nullptr;
    double p11 = 0, p12 = 0, p22 = 0;
    double stay1 = 0, stay2 = 0;
    unsigned step = 0;
    for (std::size_t i = 0; i < rows; ++i) {
      const Row& row = of.rows[i];
      const Colour& c = colours[static_cast<int>(row.chain)];
      if (!is_slow(c)) {
        last = nullptr;
        continue;
      }
      Gains& g = gains[i];
      if (last == nullptr || last->run != row.run || last->chain != row.chain || row.sample <= last->sample) {
        p11 = c.slow, p12 = 0, p22 = c.wander;
        step = 0;
      } else {
        if (row.sample - last->sample != step) {
          step = row.sample - last->sample;
          const double dt = step * of.runs[row.run].interval;
          stay1 = c.memory > 0 ? std::exp(-dt / c.memory) : 0;
          stay2 = std::exp(-dt / kWanders);
        }
        g.stay1 = stay1, g.stay2 = stay2;
        p11 = stay1 * stay1 * p11 + c.slow * (1 - stay1 * stay1);
        p12 *= stay1 * stay2;
        p22 = stay2 * stay2 * p22 + c.wander * (1 - stay2 * stay2);
      }
      const double to1 = p11 + p12, to2 = p12 + p22, spread = to1 + to2 + c.white;
      g.gain1 = to1 / spread, g.gain2 = to2 / spread;
      g.scale = std::sqrt(c.white / spread);
      p11 -= g.gain1 * to1, p12 -= g.gain1 * to2, p22 -= g.gain2 * to2;
      last = &row;
    }
  }

  void find_partners(const Weights& weights) {
    constexpr double kStillTold = 1.0;  // s
    share = weights.sigma[static_cast<int>(Chain::kTorque)] / weights.sigma[static_cast<int>(Chain::kMotion)];
    told_by.assign(rows, -1);
    std::size_t torque = 0;  // rows of a run's torque come before those of its motion, both by time
    for (std::size_t i = 0; i < rows; ++i) {
      const Row& row = data->rows[i];
      if (row.chain != Chain::kMotion) continue;
      if (i == 0 || data->rows[i - 1].chain != Chain::kMotion) torque = data->run_begin[row.run];
      const auto tells = [&](std::size_t k) {
        return data->rows[k].chain == Chain::kTorque && data->rows[k].sample <= row.sample;
      };
      if (!tells(torque)) continue;
      while (tells(torque + 1)) ++torque;
      if ((row.sample - data->rows[torque].sample) * data->runs[row.run].interval <= kStillTold)
        told_by[i] = static_cast<std::ptrdiff_t>(torque);
    }
  }

  /// The zero that a row of the motion shares, in its σ, from the zeros along the rows before.
  [[nodiscard]] double shared(std::size_t i, const std::vector<double>& zero) const {
    return told_by.empty() || told_by[i] < 0 ? 0.0 : share * zero[static_cast<std::size_t>(told_by[i])];
  }
};

bool Weights::is_coloured() const noexcept {
  return std::any_of(std::begin(colour), std::end(colour), is_slow);
}

void Weights::take(const Prepared& data) {
  filter = is_coloured() ? std::make_shared<const NoiseFilter>(data, *this) : nullptr;
}

namespace {

std::shared_ptr<const NoiseFilter> filter_of(const Prepared& data, const Weights& weights) {
  if (weights.filter && weights.filter->data == &data && weights.filter->rows == data.rows.size())
    return weights.filter;
  return weights.is_coloured() ? std::make_shared<const NoiseFilter>(data, weights) : nullptr;
}

}  // namespace

namespace {

/// What the filter remembers of N columns side by side: one column's next row waits for its last, and not for the others'.
template <int N>
struct Memories {
  double m1[N] = {}, m2[N] = {};
  std::vector<double> zero[N];

  Memories(std::size_t rows, bool one_zero) {
    for (auto& z : zero) z.resize(one_zero ? rows : 0);
  }
  /// `step(column, what is known of the row beforehand)` is the row's innovation.
  template <class Step>
  void take(const NoiseFilter& filter, std::size_t row, const Step& step) {
    const NoiseFilter::Gains& g = filter.gains[row];
    for (int c = 0; c < N; ++c) {
      m1[c] *= g.stay1;
      m2[c] *= g.stay2;
      const double innovation = step(c, filter.shared(row, zero[c]), m1[c], m2[c], g.scale);
      m1[c] += g.gain1 * innovation;
      m2[c] += g.gain2 * innovation;
      if (!zero[c].empty()) zero[c][row] = m2[c];
    }
  }
};

template <int N>
void weigh_some(const Prepared& data, const Weights& weights, const NoiseFilter* filter,
                Eigen::Ref<Eigen::MatrixXd> columns) {
  double* y[N];
  for (int c = 0; c < N; ++c) y[c] = columns.col(c).data();
  Memories<N> memories(data.rows.size(), filter != nullptr && weights.one_zero);
  for (std::size_t i = 0; i < data.rows.size(); ++i) {
    const double sigma = weights.sigma[static_cast<int>(data.rows[i].chain)];
    for (int c = 0; c < N; ++c) y[c][i] /= sigma;
    if (filter == nullptr) continue;
    memories.take(*filter, i, [&](int c, double shared, double m1, double m2, double scale) {
      const double innovation = y[c][i] - shared - m1 - m2;
      y[c][i] = scale * innovation;
      return innovation;
    });
  }
}

template <int N>
void unfilter_some(const Prepared& data, const Weights& weights, const NoiseFilter& filter,
                   Eigen::Ref<Eigen::MatrixXd> columns) {
  double* e[N];
  for (int c = 0; c < N; ++c) e[c] = columns.col(c).data();
  Memories<N> memories(data.rows.size(), weights.one_zero);
  for (std::size_t i = 0; i < data.rows.size(); ++i)
    memories.take(filter, i, [&](int c, double shared, double m1, double m2, double scale) {
      const double innovation = e[c][i] / scale;
      e[c][i] = shared + m1 + m2 + innovation;
      return innovation;
    });
}

/// Calls work.operator()<N>(first column) for groups of four columns, and of one for what is left.
template <class Work>
void in_groups(Eigen::Index columns, int threads, const Work& work) {
  const Eigen::Index fours = columns / 4;
  share_work(threads, static_cast<std::size_t>(fours + columns % 4), [&](std::size_t group) {
    const auto g = static_cast<Eigen::Index>(group);
    if (g < fours)
      work.template operator()<4>(4 * g);
    else
      work.template operator()<1>(3 * fours + g);
  });
}

}  // namespace

void weigh(const Prepared& data, const Weights& weights, Eigen::Ref<Eigen::MatrixXd> columns, int threads) {
  const std::shared_ptr<const NoiseFilter> filter = filter_of(data, weights);
  in_groups(columns.cols(), threads, [&]<int N>(Eigen::Index first) {
    weigh_some<N>(data, weights, filter.get(), columns.middleCols(first, N));
  });
}

Eigen::VectorXd unfiltered(const Prepared& data, const Weights& weights, const Eigen::VectorXd& weighted) {
  const std::shared_ptr<const NoiseFilter> filter = filter_of(data, weights);
  Eigen::VectorXd rows = weighted;
  if (filter) unfilter_some<1>(data, weights, *filter, rows);
  return rows;
}

Eigen::MatrixXd unfiltered_each(const Prepared& data, const Weights& weights, Eigen::MatrixXd weighted) {
  const std::shared_ptr<const NoiseFilter> filter = filter_of(data, weights);
  if (!filter) return weighted;
  in_groups(weighted.cols(), 1, [&]<int N>(Eigen::Index first) {
    unfilter_some<N>(data, weights, *filter, weighted.middleCols(first, N));
  });
  return weighted;
}

Eigen::VectorXd without_shared_zero(const Prepared& data, const Weights& weights, Eigen::VectorXd rows) {
  Weights only;  // of the motion's rows nothing but the zero is taken off
  std::copy(std::begin(weights.sigma), std::end(weights.sigma), std::begin(only.sigma));
  only.colour[static_cast<int>(Chain::kTorque)] = weights.colour[static_cast<int>(Chain::kTorque)];
  only.one_zero = true;
  Eigen::VectorXd weighed = rows;
  for (std::size_t i = 0; i < data.rows.size(); ++i)
    weighed[static_cast<Eigen::Index>(i)] *= weights.sigma[static_cast<int>(data.rows[i].chain)];
  weigh(data, only, weighed);
  for (std::size_t i = 0; i < data.rows.size(); ++i)
    if (data.rows[i].chain == Chain::kMotion)
      rows[static_cast<Eigen::Index>(i)] = weighed[static_cast<Eigen::Index>(i)];
  return rows;
}

namespace {

/// Variance of a zero that wanders with a memory of 100 s, by maximum likelihood: means of bins are d + white noise, d starts anywhere in each
/// piece (a constant of a run may be an effect). Zero unless the likelihoods' ratio speaks for it.
double wander_of(const std::vector<std::vector<double>>& pieces, std::size_t rows_per_bin) {
  if (rows_per_bin == 0) return 0;
  std::vector<std::vector<double>> bins;
  double squares = 0;
  std::size_t count = 0;
  for (const std::vector<double>& x : pieces) {
    bins.emplace_back();
    for (std::size_t k = 0; k + rows_per_bin <= x.size(); k += rows_per_bin) {
      double sum = 0;
      for (std::size_t i = k; i < k + rows_per_bin; ++i) sum += x[i];
      bins.back().push_back(sum / static_cast<double>(rows_per_bin));
      squares += bins.back().back() * bins.back().back();
      ++count;
    }
  }
  constexpr std::size_t kFewest = 20;
  if (count < bins.size() + kFewest || !(squares > 0)) return 0;
  const double stay = std::exp(-kWanderBin / kWanders);
  // Log likelihood with the white noise's variance at its best, for a wander of `ratio` times that variance.
  double white = 0;
  const auto log_likelihood = [&](double ratio) {
    constexpr double kAnywhere = 1e8;
    double misfit = 0, log_spread = 0, n = 0;
    for (const std::vector<double>& x : bins) {
      double d = 0, p = kAnywhere;
      for (std::size_t k = 0; k < x.size(); ++k) {
        if (k > 0) {
          d *= ratio > 0 ? stay : 1;
          p = ratio > 0 ? stay * stay * p + ratio * (1 - stay * stay) : p;
          const double spread = p + 1;
          misfit += (x[k] - d) * (x[k] - d) / spread;
          log_spread += std::log(spread);
          ++n;
        }
        const double gain = p / (p + 1);
        d += gain * (x[k] - d);
        p -= gain * p;
      }
    }
    white = misfit / n;
    return -0.5 * (n * std::log(white) + log_spread);
  };
  const double still = log_likelihood(0);
  double most = still, wander = 0;
  for (double decade = -2; decade < 2.51; decade += 0.125) {
    const double ratio = std::pow(10.0, decade), here = log_likelihood(ratio);
    if (here <= most) continue;
    most = here;
    wander = ratio * white;
  }
  return 2 * (most - still) > kByChance ? wander : 0.0;
}

}  // namespace

Colour colour_of(const Prepared& data, const Eigen::VectorXd& residual, Chain chain) {
  // Pieces without gaps. (A free run's torque has one wherever the joint rests; driven runs show the same sensors.)
  const auto belongs = [&](const Row& row) {
    return row.chain == chain &&
           !(chain == Chain::kTorque && data.with_free_torque && data.runs[row.run].is_free);
  };
  std::vector<std::vector<double>> pieces;
  double spacing = 0;
  unsigned step = 0;  // the shortest: a chain may begin with a gap
  const Row* last = nullptr;
  const auto follows = [&](const Row& row) {
    return last != nullptr && last->run == row.run && row.sample > last->sample;
  };
  for (const Row& row : data.rows) {
    if (!belongs(row)) continue;
    if (follows(row) && (step == 0 || row.sample - last->sample < step)) {
      step = row.sample - last->sample;
      spacing = step * data.runs[row.run].interval;
    }
    last = &row;
  }
  last = nullptr;
  for (std::size_t i = 0; i < data.rows.size(); ++i) {
    const Row& row = data.rows[i];
    if (!belongs(row)) continue;
    if (!follows(row) || row.sample - last->sample != step) pieces.emplace_back();
    pieces.back().push_back(residual[static_cast<Eigen::Index>(i)]);
    last = &row;
  }
  Colour none;
  if (!(spacing > 0)) return none;
  const auto lags = static_cast<std::size_t>(kLongestLag / spacing);
  std::vector<double> covariance(lags + 1, 0.0), count(lags + 1, 0.0);
  for (const std::vector<double>& x : pieces)
    for (std::size_t lag = 0; lag <= lags && lag < x.size(); ++lag) {
      double sum = 0;
      for (std::size_t k = lag; k < x.size(); ++k) sum += x[k] * x[k - lag];
      covariance[lag] += sum;
      count[lag] += static_cast<double>(x.size() - lag);
    }
  for (std::size_t lag = 0; lag <= lags; ++lag)
    if (count[lag] > 0) covariance[lag] /= count[lag];
  const double kernel = chain == Chain::kMotion ? data.smoothing.motion : data.smoothing.torque;
  const auto first = static_cast<std::size_t>(std::ceil(kKernelForgets * kernel / spacing));
  if (first + 8 > lags || !(covariance[0] > 0)) return none;

  Colour best;
  best.wander = wander_of(pieces, static_cast<std::size_t>(std::lround(kWanderBin / spacing)));
  const double wander = std::clamp(covariance[std::min(lags, first * 4)], 0.0, best.wander);
  // Density at low frequencies if there was nothing slow: what a sum of covariances beyond the kernel scatters by.
  double still = covariance[0] - wander;
  for (std::size_t lag = 1; lag < first; ++lag) still += 2 * (covariance[lag] - wander);
  still = std::max(still, 0.1 * covariance[0]);
  double least = std::numeric_limits<double>::infinity();
  for (int m = 0; m < kMemories; ++m) {
    const double memory = kShortest * std::pow(kLongest / kShortest, m / (kMemories - 1.0));
    double product = 0, squares = 0, misfit = 0;
    for (std::size_t lag = first; lag <= lags; ++lag) {
      const double shape = std::exp(-static_cast<double>(lag) * spacing / memory);
      product += count[lag] * (covariance[lag] - wander) * shape;
      squares += count[lag] * shape * shape;
    }
    if (!(squares > 0)) continue;  // too many gaps
    if (!(product > 0) || product * product < kByChance * still * still * squares) product = 0;
    const double slow = std::clamp(product / squares, 0.0, covariance[0]);
    for (std::size_t lag = first; lag <= lags; ++lag) {
      const double off =
          covariance[lag] - wander - slow * std::exp(-static_cast<double>(lag) * spacing / memory);
      misfit += count[lag] * off * off;
    }
    if (misfit >= least) continue;
    least = misfit;
    best = {1, slow, memory, best.wander};
  }
  // What is left within the kernel's reach: its sum is the density at low frequencies. Noise of a derivative has little there and
  // much beyond; the variance of one row bounds it.
  double density = 0;
  for (std::size_t lag = 0; lag < first; ++lag)
    density += (lag == 0 ? 1 : 2) * (covariance[lag] - wander -
                                     best.slow * std::exp(-static_cast<double>(lag) * spacing / best.memory));
  best.white = std::max({density, covariance[0] - wander - best.slow, 0.1 * covariance[0]});
  // Faster than this a model of jumps is no better than the encoder tells when they happen: no weight is gained there.
  const double turns = 2 * kPi * kFastest * best.memory;
  best.white = std::max(best.white, 2 * best.slow * best.memory / (spacing * (1 + turns * turns)));
  return best;
}

namespace {

/// s between the rows of a chain's runs, where nothing lies between; 0 without two rows.
double rows_apart(const Prepared& data, Chain chain) {
  double apart = 0;
  for (std::size_t i = 1; i < data.rows.size(); ++i) {
    const Row &before = data.rows[i - 1], &row = data.rows[i];
    if (row.chain != chain || before.chain != chain || row.run != before.run || row.sample <= before.sample)
      continue;
    const double here = (row.sample - before.sample) * data.runs[row.run].interval;
    if (apart == 0 || here < apart) apart = here;
  }
  return apart;
}

/// The zero that is taken off the motion is not the zero, but what the torque's rows tell of it: noise as slow as the filter forgets. Functions of the
/// signals take most of it out of the rows that a colour is read off, so it is the least that a colour may be.
void admit_error_of_zero(const Prepared& data, Weights& weights) {
  const double apart = rows_apart(data, Chain::kTorque);
  if (!(apart > 0)) return;
  const SlowError error = error_of_zero(weights.colour[static_cast<int>(Chain::kTorque)], apart);
  const double share =
      weights.sigma[static_cast<int>(Chain::kTorque)] / weights.sigma[static_cast<int>(Chain::kMotion)];
  Colour& motion = weights.colour[static_cast<int>(Chain::kMotion)];
  if (motion.slow * motion.memory >= share * share * error.variance * error.memory) return;
  motion.slow = share * share * error.variance;
  motion.memory = error.memory;
}

}  // namespace

SlowError error_of_zero(const Colour& colour, double apart) {
  const double moves = colour.wander * (1 - std::exp(-2 * apart / kWanders)),
               noise = colour.white + 2 * colour.slow * colour.memory / apart,
               variance = 0.5 * (moves + std::sqrt(moves * moves + 4 * moves * noise));
  return {variance, apart * (variance + noise) / variance};
}

void take_colours(const Prepared& data, const Eigen::VectorXd& residual, const Cleaned& cleaned,
                  Weights& weights) {
  constexpr int kTorque = static_cast<int>(Chain::kTorque), kMotion = static_cast<int>(Chain::kMotion);
  const Eigen::VectorXd noise = cleaned(residual);
  for (int c = 0; c < kChains; ++c)
    if (data.has(static_cast<Chain>(c))) weights.colour[c] = colour_of(data, noise, static_cast<Chain>(c));
  // The same force sensors read the torque and what the motion is held against.
  const double wander = weights.colour[kTorque].wander;
  const bool both = wander > 0 && data.has(Chain::kMotion);
  weights.one_zero = both && data.with_free_torque;
  if (weights.one_zero) {
    weights.colour[kMotion] =
        colour_of(data, cleaned(without_shared_zero(data, weights, residual)), Chain::kMotion);
    admit_error_of_zero(data, weights);
  } else if (both) {
    const double ratio = weights.sigma[kTorque] / weights.sigma[kMotion];
    weights.colour[kMotion].wander = std::max(weights.colour[kMotion].wander, ratio * ratio * wander);
  }
  weights.take(data);
}

double log_likelihood(const Prepared& data, const Weights& weights, const Eigen::VectorXd& residual) {
  const std::shared_ptr<const NoiseFilter> filter = filter_of(data, weights);
  Eigen::VectorXd rows = residual;
  for (std::size_t i = 0; i < data.rows.size(); ++i)
    rows[static_cast<Eigen::Index>(i)] *= weights.sigma[static_cast<int>(data.rows[i].chain)];
  weigh(data, weights, rows);
  double sum = 0;
  for (std::size_t i = 0; i < data.rows.size(); ++i) {
    const double white = weights.colour[static_cast<int>(data.rows[i].chain)].white,
                 e = rows[static_cast<Eigen::Index>(i)];
    sum += e * e / white + std::log(white) - (filter ? 2 * std::log(filter->gains[i].scale) : 0.0);
  }
  return -0.5 * sum;
}

}  // namespace isac::explain
