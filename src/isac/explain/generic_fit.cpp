#include "isac/explain/generic_fit.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "isac/explain/refine.hpp"
#include "isac/explain/workers.hpp"

namespace isac::explain {
namespace {

constexpr std::size_t kTried = 24;     // columns that enter the selection, best first
constexpr double kWorthTaking = 0.10;  // of the first column's gain
constexpr double kWorthTakingUnits = 12;
constexpr std::size_t kMostTaken = 3;
constexpr double kNearLimit = 0.7;  // of the search's limit
constexpr int kParametersOfOne = 1 + kChoosingOne;
constexpr double kNearlyTheBest = 0.5;  // of the best gain: with the tolerances come back it may be the best
constexpr double kGone = 1e-9;          // ‖rows‖²: those before it were all of it

struct Next {
  std::size_t entry;
  double gain = 0;  ///< tolerances held
  double loss = 0;  ///< tolerances come back, where that was asked for
};

/// The function that takes most; with `come_back` the one that leaves least beside tolerances that come back, of those that take nearly the
/// most while they are held. (A constant took more than a drift while half a step of the encoder stood for a part of either.)
Next next_of(const std::vector<GenericRows>& entries, const Beside& beside, bool come_back) {
  std::vector<double> gains(entries.size(), 0.0);
  for (std::size_t e = 0; e < entries.size(); ++e) {
    const double norm2 = entries[e].rows.squaredNorm(), score = entries[e].rows.dot(beside.held());
    if (norm2 > kGone) gains[e] = score * score / norm2;
  }
  const auto largest = std::max_element(gains.begin(), gains.end());
  if (largest == gains.end() || !(*largest > 0)) return {entries.size()};
  Next best{static_cast<std::size_t>(largest - gains.begin()), *largest};
  if (!come_back) return best;
  best.loss = std::numeric_limits<double>::infinity();
  for (std::size_t e = 0; e < entries.size(); ++e) {
    if (gains[e] < kNearlyTheBest * *largest) continue;
    const double loss = beside.loss_with(entries[e].rows.normalized());
    if (loss < best.loss) best = {e, gains[e], loss};
  }
  return best;
}

GenericFit fit(const Around& place, const StandingOut& among, double noise_unit, bool come_back) {
  GenericFit fit;
  fit.chain = among.chain;
  std::vector<GenericRows> entries = among.functions;
  Beside beside(place);
  double first = 0, loss = 0;
  while (fit.functions.size() < kMostTaken) {
    const Next next = next_of(entries, beside, come_back);
    if (next.entry == entries.size()) break;
    const GenericRows& taken = entries[next.entry];
    if (fit.functions.empty()) first = next.gain;
    if (next.gain < kWorthTaking * first || next.gain < kWorthTakingUnits * noise_unit) break;
    // What the tolerances do as well once they come back need not be taken.
    if (come_back && !fit.functions.empty() && loss - next.loss < kWorthTakingUnits * noise_unit) break;
    loss = next.loss;
    fit.gain += next.gain;
    fit.functions.push_back(taken.function);
    fit.of_reading.push_back(taken.of_reading);
    const Eigen::VectorXd unit = taken.rows.normalized();
    beside.take(unit);
    for (GenericRows& e : entries) e.rows -= unit.dot(e.rows) * unit;
  }
  // Beside a name, tolerances that were held at a bound come back: beside functions as well.
  fit.residual = fit.functions.empty() ? place.residual : beside.left();
  return fit;
}

/// Each function once more as an error of what the force sensors read: torque and motion are both held against that.
void add_readings(const Around& place, StandingOut& among, int threads) {
  const Prepared& data = place.predictor->data();
  if (among.chain != Chain::kTorque && among.chain != Chain::kMotion) return;
  if (!data.has(Chain::kTorque) || !data.has(Chain::kMotion)) return;
  const Dictionary generic(data);
  const std::size_t n = among.functions.size();
  among.functions.resize(2 * n);
  share_work(threads, n, [&](std::size_t i) {
    const std::size_t function = among.functions[i].function;
    Eigen::VectorXd rows = generic.rows(generic.in(function, Chain::kTorque)) +
                           generic.rows(generic.in(function, Chain::kMotion));
    weigh(data, *place.weights, rows);
    among.functions[n + i] = {function, place.project(rows), true};
  });
}

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
    if (c.norm2 > 1e-9 && c.T >= kNearLimit * screen.limit)
      order.emplace_back(c.score * c.score / c.norm2, index);
    ++index;
  }
  if (order.empty()) return out;
  std::sort(order.rbegin(), order.rend());
  out.chain = generic.chain(order.front().second);
  for (const auto& [gain, function] : order) {
    if (out.functions.size() >= kTried) break;
    if (generic.chain(function) == out.chain) out.functions.push_back({function, {}, false});
  }
  share_work(threads, out.functions.size(), [&](std::size_t i) {
    Eigen::VectorXd rows = generic.rows(out.functions[i].function);
    weigh(data, *place.weights, rows);
    out.functions[i].rows = place.project(rows);
  });
  return out;
}

GenericFit fit_generic(const Around& place, const StandingOut& among, double noise_unit) {
  return fit(place, among, noise_unit, false);
}

GenericFit fit_generic(const Around& place, const Screen& screen, int threads) {
  return fit(place, standing_out(place, screen, threads), screen.noise_unit, false);
}

GenericFit rival_without_a_name(const Around& place, const Screen& screen, int threads) {
  StandingOut among = standing_out(place, screen, threads);
  add_readings(place, among, threads);
  return fit(place, among, screen.noise_unit, true);
}

std::string names_of(const GenericFit& generic, const Prepared& data) {
  const Dictionary dictionary(data);
  std::string names;
  for (std::size_t i = 0; i < generic.functions.size(); ++i) {
    const std::string name = dictionary.name(generic.functions[i]);
    names += (names.empty() ? "" : ", ") +
             (generic.of_reading[i] ? "force reading" + name.substr(name.find(':')) : name);
  }
  return names;
}

Comparison behind_generic(const Prepared& data, const Eigen::VectorXd& named, int named_parameters,
                          const GenericFit& generic) {
  return compare(data, generic.residual, named,
                 named_parameters - kParametersOfOne * static_cast<int>(generic.functions.size()),
                 noise_density(data, generic.residual));
}

}  // namespace isac::explain
