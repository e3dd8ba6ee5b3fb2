#include "isac/explain/colours.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "isac/core/units.hpp"

namespace isac::explain {
namespace {

constexpr double kKernelForgets =
    4.3;  // standard deviations of the kernel: beyond, white noise has left 1 % of correlation
constexpr double kLongestLag = 1.2;                 // s
constexpr double kShortest = 0.03, kLongest = 3.0;  // s, of the memory
constexpr int kMemories = 24;
constexpr double kFastest = 4.0;    // Hz
constexpr double kWanderBin = 2.0;  // s, rows whose mean is one reading of the zero
constexpr double kByChance = 9;     // twice the logarithm of the likelihoods' ratio

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
  const double stay = std::exp(-kWanderBin / kWanderMemory);
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

/// Is a chain's colour read off this row? (A free run's torque has a gap wherever the joint rests; driven runs show the same sensors.)
bool tells_colour(const Prepared& data, const Row& row, Chain chain) {
  return row.chain == chain &&
         !(chain == Chain::kTorque && data.with_free_torque && data.runs[row.run].is_free);
}

bool follows(const Row* last, const Row& row) {
  return last != nullptr && last->run == row.run && row.sample > last->sample;
}

/// Between rows of a chain without a gap: the shortest, for a chain may begin with one. 0 without two rows.
struct Spacing {
  unsigned step = 0;  // samples
  double seconds = 0;
};

Spacing spacing_of(const Prepared& data, Chain chain) {
  Spacing spacing;
  const Row* last = nullptr;
  for (const Row& row : data.rows) {
    if (!tells_colour(data, row, chain)) continue;
    if (follows(last, row) && (spacing.step == 0 || row.sample - last->sample < spacing.step)) {
      spacing.step = row.sample - last->sample;
      spacing.seconds = spacing.step * data.runs[row.run].interval;
    }
    last = &row;
  }
  return spacing;
}

}  // namespace

Colour colour_of(const Prepared& data, const Eigen::VectorXd& residual, Chain chain) {
  const Colour none;
  const Spacing spacing = spacing_of(data, chain);
  if (!(spacing.seconds > 0)) return none;
  std::vector<std::vector<double>> pieces;  // without gaps
  const Row* last = nullptr;
  for (std::size_t i = 0; i < data.rows.size(); ++i) {
    const Row& row = data.rows[i];
    if (!tells_colour(data, row, chain)) continue;
    if (!follows(last, row) || row.sample - last->sample != spacing.step) pieces.emplace_back();
    pieces.back().push_back(residual[static_cast<Eigen::Index>(i)]);
    last = &row;
  }
  const auto lags = static_cast<std::size_t>(kLongestLag / spacing.seconds);
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
  const auto first = static_cast<std::size_t>(std::ceil(kKernelForgets * kernel / spacing.seconds));
  if (first + 8 > lags || !(covariance[0] > 0)) return none;

  Colour best;
  best.wander = wander_of(pieces, static_cast<std::size_t>(std::lround(kWanderBin / spacing.seconds)));
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
      const double shape = std::exp(-static_cast<double>(lag) * spacing.seconds / memory);
      product += count[lag] * (covariance[lag] - wander) * shape;
      squares += count[lag] * shape * shape;
    }
    if (!(squares > 0)) continue;  // too many gaps
    if (!(product > 0) || product * product < kByChance * still * still * squares) product = 0;
    const double slow = std::clamp(product / squares, 0.0, covariance[0]);
    for (std::size_t lag = first; lag <= lags; ++lag) {
      const double off =
          covariance[lag] - wander - slow * std::exp(-static_cast<double>(lag) * spacing.seconds / memory);
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
    density += (lag == 0 ? 1 : 2) *
               (covariance[lag] - wander -
                best.slow * std::exp(-static_cast<double>(lag) * spacing.seconds / best.memory));
  best.white = std::max({density, covariance[0] - wander - best.slow, 0.1 * covariance[0]});
  // Faster than this a model of jumps is no better than the encoder tells when they happen: no weight is gained there.
  const double turns = 2 * kPi * kFastest * best.memory;
  best.white = std::max(best.white, 2 * best.slow * best.memory / (spacing.seconds * (1 + turns * turns)));
  return best;
}

namespace {

/// The zero that is taken off the motion is not the zero, but what the torque's rows tell of it: noise as slow as the filter forgets. Functions of the
/// signals take most of it out of the rows that a colour is read off, so it is the least that a colour may be.
void admit_error_of_zero(const Prepared& data, Weights& weights) {
  const double apart = spacing_of(data, Chain::kTorque).seconds;
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
  const double moves = colour.wander * (1 - std::exp(-2 * apart / kWanderMemory)),
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

}  // namespace isac::explain
