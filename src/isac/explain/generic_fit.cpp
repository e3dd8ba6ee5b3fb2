#include "isac/explain/generic_fit.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "isac/explain/workers.hpp"

namespace isac::explain {
namespace {

constexpr std::size_t kTried = 24;     // columns that enter the selection, best first
constexpr double kWorthTaking = 0.10;  // of the first column's gain
constexpr double kWorthTakingUnits = 12;
constexpr std::size_t kMostTaken = 3;
constexpr double kStandsOut = 0.7;  // of the search's limit
constexpr int kParametersOfOne = 1 + kChoosingOne;

}  // namespace

StandingOut standing_out(const Around& place, const Screen& screen, int threads) {
  StandingOut out;
  const Prepared& data = place.predictor->data();
  const Dictionary generic(data);
  // Of each column: its gain if it were alone. The best of them decides the chain.
  std::vector<std::pair<double, std::size_t>> order;
  std::size_t index = 0;
  for (const Column& c : screen.columns) {
    if (c.hypothesis >= 0) continue;
    if (c.norm2 > 1e-9 && c.T >= kStandsOut * screen.limit)
      order.emplace_back(c.score * c.score / c.norm2, index);
    ++index;
  }
  if (order.empty()) return out;
  std::sort(order.rbegin(), order.rend());
  out.chain = generic.chain(order.front().second);
  for (const auto& [gain, function] : order) {
    if (out.functions.size() >= kTried) break;
    if (generic.chain(function) == out.chain) out.functions.push_back({function, {}});
  }
  share_work(threads, out.functions.size(), [&](std::size_t i) {
    Eigen::VectorXd rows = generic.rows(out.functions[i].function);
    weigh(data, *place.weights, rows);
    out.functions[i].rows = place.project(rows);
  });
  return out;
}

GenericFit fit_generic(const Around& place, const StandingOut& among, double noise_unit) {
  GenericFit fit;
  fit.residual = place.residual;
  fit.chain = among.chain;
  std::vector<GenericRows> entries = among.functions;
  double first = 0;
  while (fit.functions.size() < kMostTaken) {
    std::size_t best = entries.size();
    double best_gain = 0;
    for (std::size_t e = 0; e < entries.size(); ++e) {
      const double norm2 = entries[e].rows.squaredNorm();
      if (norm2 < 1e-9) continue;
      const double score = entries[e].rows.dot(fit.residual);
      if (score * score / norm2 <= best_gain) continue;
      best_gain = score * score / norm2;
      best = e;
    }
    if (best == entries.size()) break;
    if (fit.functions.empty()) first = best_gain;
    if (best_gain < kWorthTaking * first || best_gain < kWorthTakingUnits * noise_unit) break;
    fit.gain += best_gain;
    fit.functions.push_back(entries[best].function);
    const Eigen::VectorXd unit = entries[best].rows.normalized();
    fit.residual -= unit.dot(fit.residual) * unit;
    for (GenericRows& e : entries) e.rows -= unit.dot(e.rows) * unit;
  }
  // Beside a name, tolerances that were held at a bound come back: beside functions as well.
  if (!fit.functions.empty()) fit.residual = place.release(std::move(fit.residual));
  return fit;
}

GenericFit fit_generic(const Around& place, const Screen& screen, int threads) {
  return fit_generic(place, standing_out(place, screen, threads), screen.noise_unit);
}

Comparison behind_generic(const Prepared& data, const Eigen::VectorXd& named, int named_parameters,
                          const GenericFit& generic) {
  return compare(data, generic.residual, named,
                 named_parameters - kParametersOfOne * static_cast<int>(generic.functions.size()),
                 noise_density(data, generic.residual));
}

}  // namespace isac::explain
