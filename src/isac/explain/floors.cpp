#include "isac/explain/floors.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "isac/explain/filters.hpp"
#include "isac/series/statistics.hpp"

namespace isac::explain {

Floors floors_of(const Prepared& data) {
  Floors floors;
  std::vector<const std::vector<double>*> torque, pressure;
  for (const PreparedRun& run : data.runs) {
    if (run.has_torque) torque.push_back(&run.torque);
    for (const auto& p : run.raw_pressure)
      if (!p.empty()) pressure.push_back(&p);
  }
  if (!torque.empty()) floors.white[0] = floors.white[3] = white_noise(torque);
  if (!pressure.empty()) floors.white[1] = floors.white[2] = white_noise(pressure);
  return floors;
}

void add_slow_part(const Weights& noise, Floors& floors) {
  for (int c = 0; c < kChains; ++c) {
    floors.slow[c] = noise.sigma[c] * std::sqrt(noise.colour[c].slow + noise.colour[c].wander);
    if (floors.slow[c] > 0)
      floors.from[c] = "differences, and what is left that is slow and follows no signal";
  }
}

void reweight(const Prepared& data, const Fit& fit, Weights& weights) {
  for (int c = 0; c < kChains; ++c) {
    std::vector<double> fast;
    std::vector<double> piece;
    unsigned run = ~0U;
    const auto flush = [&] {
      const auto window = static_cast<std::ptrdiff_t>(16);
      double sum = 0;
      for (std::ptrdiff_t k = 0; k < static_cast<std::ptrdiff_t>(piece.size()); ++k) {
        sum += piece[static_cast<std::size_t>(k)];
        if (k >= 2 * window) {
          sum -= piece[static_cast<std::size_t>(k - 2 * window)];
          fast.push_back(piece[static_cast<std::size_t>(k - window)] - sum / static_cast<double>(2 * window));
        }
      }
      piece.clear();
    };
    for (std::size_t i = 0; i < data.rows.size(); ++i) {
      if (static_cast<int>(data.rows[i].chain) != c) continue;
      if (data.rows[i].run != run) flush();
      run = data.rows[i].run;
      piece.push_back(fit.residual[static_cast<Eigen::Index>(i)]);
    }
    flush();
    const double spread = series::robust_deviation(fast);
    if (spread > 0 && std::isfinite(spread)) weights.sigma[c] *= spread;
  }
  if (data.has(Chain::kPressure1))
    weights.sigma[1] = weights.sigma[2] = std::max(weights.sigma[1], weights.sigma[2]);
}

double correlation_seconds(const Prepared& data, const Eigen::VectorXd& residual) {
  double longest = 0;
  for (const Chain chain : {Chain::kTorque, Chain::kMotion, Chain::kPressure1}) {
    std::vector<std::vector<double>> pieces;
    unsigned run = ~0U;
    for (std::size_t i = 0; i < data.rows.size(); ++i) {
      if (data.rows[i].chain != chain) continue;
      if (data.rows[i].run != run) pieces.emplace_back();
      run = data.rows[i].run;
      pieces.back().push_back(residual[static_cast<Eigen::Index>(i)]);
    }
    if (pieces.empty()) continue;
    const double spacing = data.runs.front().interval * data.stride * (chain == Chain::kPressure1 ? 2 : 1);
    longest = std::max(longest, series::correlation_time(pieces) * spacing);
  }
  return longest;
}

double size_over_floor(const Prepared& data, const Weights& weights, const Floors& floors,
                       const Eigen::VectorXd& difference, Chain* where) {
  double sum[kChains] = {}, best = 0;
  std::size_t rows[kChains] = {};
  const Eigen::VectorXd plain = unfiltered(data, weights, difference);
  for (std::size_t i = 0; i < data.rows.size(); ++i) {
    const auto c = static_cast<std::size_t>(data.rows[i].chain);
    sum[c] += plain[static_cast<Eigen::Index>(i)] * plain[static_cast<Eigen::Index>(i)];
    ++rows[c];
  }
  for (int c = 0; c < kChains; ++c) {
    if (rows[c] == 0) continue;
    const double floor =
        std::isfinite(floors.white[c]) ? std::max(floors.white[c], weights.sigma[c]) : weights.sigma[c];
    const double size = std::sqrt(sum[c] / static_cast<double>(rows[c])) * weights.sigma[c] / floor;
    if (size > best) {
      best = size;
      if (where != nullptr) *where = static_cast<Chain>(c);
    }
  }
  return best;
}

}  // namespace isac::explain
