#include "isac/explain/curves.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <random>
#include <utility>
#include <vector>

#include "isac/explain/encoder_motion.hpp"
namespace isac::explain {
namespace {

constexpr std::size_t kCurveBins = 24;
constexpr std::size_t kFewestCurveRows = 2400, kFewestBlocks = 16;
constexpr int kFlips = 1000;
constexpr double kCurveStandsOut = 4.5;

constexpr std::size_t kOfMotion = 2;  // the first ones
constexpr const char* kVariables[] = {"angle", "velocity", "delta_pressure", "p1", "p2"};

/// Velocities; not a number where the encoder's steps beat with the clock: the reading's error is in the residual then, and its derivative here.
std::vector<std::vector<double>> velocities_of(const Prepared& data) {
  std::vector<std::vector<double>> all;
  for (const PreparedRun& run : data.runs) {
    std::vector<double>& velocity = all.emplace_back(run.velocity);
    const std::vector<unsigned char> beats = beats_with_clock(velocity, run.interval, data.rig.angle_step);
    for (std::size_t k = 0; k < velocity.size(); ++k)
      if (beats[k] != 0) velocity[k] = std::nan("");
  }
  return all;
}

double value_of(const PreparedRun& run, const std::vector<double>& velocity, std::size_t sample,
                std::size_t variable) {
  if (variable < 2) {
    const std::vector<double>& x = variable == 0 ? run.angle : velocity;
    return x.empty() ? std::nan("") : x[sample];
  }
  if (!run.has_pressure) return std::nan("");
  const double p1 = run.pressure[0][sample], p2 = run.pressure[1][sample];
  return variable == 2 ? p2 - p1 : variable == 3 ? p1 : p2;
}

/// Rows of one chain, without the mean of their run.
struct Rows {
  std::vector<std::size_t> index;
  std::vector<double> weighted, plain;
};

Rows rows_of(const Prepared& data, const Eigen::VectorXd& weighted, const Eigen::VectorXd& plain,
             Chain chain) {
  Rows rows;
  struct Mean {
    double weighted = 0, plain = 0, count = 0;
  };
  std::map<unsigned, Mean> means;
  for (std::size_t i = 0; i < data.rows.size(); ++i) {
    if (data.rows[i].chain != chain) continue;
    Mean& m = means[data.rows[i].run];
    m.weighted += weighted[static_cast<Eigen::Index>(i)];
    m.plain += plain[static_cast<Eigen::Index>(i)];
    ++m.count;
    rows.index.push_back(i);
  }
  for (const std::size_t i : rows.index) {
    const Mean& m = means[data.rows[i].run];
    rows.weighted.push_back(weighted[static_cast<Eigen::Index>(i)] - m.weighted / m.count);
    rows.plain.push_back(plain[static_cast<Eigen::Index>(i)] - m.plain / m.count);
  }
  return rows;
}

std::vector<double> quantiles_of(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  std::vector<double> borders;
  for (std::size_t j = 1; j < kCurveBins; ++j) {
    const double at = values[values.size() * j / kCurveBins];
    if (borders.empty() || at > borders.back()) borders.push_back(at);
  }
  return borders;
}

/// z and the rms of the bins' means, in σ.
std::pair<double, double> dependence(const Prepared& data, const std::vector<std::vector<double>>& velocities,
                                     const Rows& rows, std::size_t variable, std::uint64_t seed) {
  std::vector<double> values;
  std::vector<std::size_t> of;
  for (std::size_t k = 0; k < rows.index.size(); ++k) {
    const Row& row = data.rows[rows.index[k]];
    const double x = value_of(data.runs[row.run], velocities[row.run], row.sample, variable);
    if (!std::isfinite(x)) continue;
    values.push_back(x);
    of.push_back(k);
  }
  if (values.size() < kFewestCurveRows) return {};
  const std::vector<double> borders = quantiles_of(values);
  const auto bins = static_cast<Eigen::Index>(borders.size() + 1);
  if (bins < 4) return {};
  Eigen::MatrixXd sums = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(data.blocks), bins);
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(bins), count = Eigen::VectorXd::Zero(bins);
  for (std::size_t k = 0; k < of.size(); ++k) {
    const auto bin = std::upper_bound(borders.begin(), borders.end(), values[k]) - borders.begin();
    sums(static_cast<Eigen::Index>(data.rows[rows.index[of[k]]].block), bin) += rows.weighted[of[k]];
    mean[bin] += rows.plain[of[k]];
    ++count[bin];
  }
  if (static_cast<std::size_t>((sums.rowwise().squaredNorm().array() > 0).count()) < kFewestBlocks) return {};
  for (Eigen::Index j = 0; j < bins; ++j)
    if (const double norm = sums.col(j).norm(); norm > 0) sums.col(j) /= norm;
  const double here = sums.colwise().sum().squaredNorm();
  std::mt19937_64 random(seed);
  double sum = 0, squares = 0;
  Eigen::VectorXd signs(sums.rows());
  for (int flip = 0; flip < kFlips; ++flip) {
    for (Eigen::Index b = 0; b < signs.size(); b += 64) {
      std::uint64_t bits = random();
      for (Eigen::Index k = b; k < std::min(b + 64, signs.size()); ++k, bits >>= 1)
        signs[k] = (bits & 1) != 0 ? 1.0 : -1.0;
    }
    const double q = (sums.transpose() * signs).squaredNorm();
    sum += q;
    squares += q * q;
  }
  const double middle = sum / kFlips, scatter = std::sqrt(squares / kFlips - middle * middle);
  double power = 0;
  for (Eigen::Index j = 0; j < bins; ++j)
    if (count[j] > 0) power += mean[j] * mean[j] / count[j];
  return {scatter > 0 ? (here - middle) / scatter : 0.0, std::sqrt(power / count.sum())};
}

}  // namespace

bool stands_out(const Curve& curve) noexcept {
  return curve.z >= kCurveStandsOut;
}

Curve clearest_curve(const Prepared& data, const Weights& weights, const Floors& floors,
                     const Eigen::VectorXd& weighted, double material, std::uint64_t seed) {
  Curve clearest;
  const Eigen::VectorXd plain = unfiltered(data, weights, weighted);
  const std::vector<std::vector<double>> velocities = velocities_of(data);
  for (const Chain chain : {Chain::kTorque, Chain::kPressure1, Chain::kPressure2, Chain::kMotion}) {
    if (!data.has(chain)) continue;
    const auto c = static_cast<int>(chain);
    const double floor = std::max(floors.white[c], weights.sigma[c]);
    const Rows rows = rows_of(data, weighted, plain, chain);
    // In a pressure's own chain the measured pressures bring along the noise that is in the residual.
    const std::size_t variables =
        chain == Chain::kTorque || chain == Chain::kMotion ? std::size(kVariables) : kOfMotion;
    for (std::size_t v = 0; v < variables; ++v) {
      const auto [z, rms] = dependence(data, velocities, rows, v, seed);
      const double size = rms * weights.sigma[c] / floor;
      if (size >= material && z > clearest.z) clearest = {z, size, chain, kVariables[v]};
    }
  }
  return clearest;
}

}  // namespace isac::explain
