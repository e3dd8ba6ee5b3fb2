#include "isac/explain/where.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "isac/core/units.hpp"
#include "isac/explain/labels.hpp"
#include "isac/explain/variable_words.hpp"
#include "isac/series/statistics.hpp"

namespace isac::explain {
namespace {

constexpr int kBins = 6;
constexpr double kWorthSaying = 0.08;       // nats: below it the region is where the rows are
constexpr double kTimeCounts = 0.5;         // of what a signal says
constexpr double kSignificantChain = 0.15;  // of all that is explainable
constexpr std::size_t kMostRegions = 4;

struct Variable {
  const char* name;
  std::string unit;
  std::vector<double> value;  ///< one for each row of the chain; NaN where it has none
};

/// Angle travelled since the direction last turned, rad; NaN before the first turn and while standing still.
std::vector<double> travel_since_reversal(const PreparedRun& run) {
  std::vector<double> out(run.angle.size(), kNotKnown);
  double sign = 0, turned_at = kNotKnown;
  for (std::size_t k = 0; k < run.angle.size(); ++k) {
    const double w = run.dry_velocity[k];
    if (w == 0) continue;
    const double now = w > 0 ? 1 : -1;
    if (sign != 0 && now != sign) turned_at = run.angle[k];
    sign = now;
    out[k] = std::abs(run.angle[k] - turned_at);
  }
  return out;
}

std::vector<Variable> variables_of(const Prepared& data, const std::vector<std::size_t>& rows) {
  std::vector<Variable> all = {{"angle", "rad", {}},
                               {"velocity", "rad/s", {}},
                               {"speed", "rad/s", {}},
                               {"delta_pressure", "kg/cm2", {}},
                               {"mean_pressure", "kg/cm2", {}},
                               {"direction", "", {}},
                               {"travel since the reversal", "rad", {}},
                               {"time in the run", "s", {}},
                               {"time of the day", "s", {}}};
  for (Variable& v : all) v.unit = axis_unit(v.unit, data.baseline);
  std::vector<std::vector<double>> travel(data.runs.size());
  for (const std::size_t i : rows) {
    const Row& row = data.rows[i];
    const PreparedRun& run = data.runs[row.run];
    const std::size_t k = row.sample;
    const bool moves = !run.angle.empty();
    if (moves && travel[row.run].empty()) travel[row.run] = travel_since_reversal(run);
    const double dry = moves ? run.dry_velocity[k] : kNotKnown;
    const double delta = run.has_pressure ? 0.5 * (run.pressure[1][k] - run.pressure[0][k]) : kNotKnown;
    const double mean = run.has_pressure ? 0.5 * (run.pressure[1][k] + run.pressure[0][k]) : kNotKnown;
    const double values[] = {moves ? run.angle[k] : kNotKnown,
                             moves ? run.velocity[k] : kNotKnown,
                             moves ? std::abs(run.velocity[k]) : kNotKnown,
                             delta / kPascalPerKgfCm2,
                             mean / kPascalPerKgfCm2,
                             dry > 0 ? 1.0 : (dry < 0 ? -1.0 : (dry == 0 ? 0.0 : kNotKnown)),
                             moves ? travel[row.run][k] : kNotKnown,
                             run.time[k],
                             run.day_offset + run.time[k]};
    for (std::size_t v = 0; v < all.size(); ++v) all[v].value.push_back(values[v]);
  }
  return all;
}

/// Borders between bins that hold equally many rows; equal values are never parted.
std::vector<double> borders_of(const std::vector<double>& values) {
  std::vector<double> sorted;
  for (const double v : values)
    if (std::isfinite(v)) sorted.push_back(v);
  if (sorted.size() < 20 * kBins) return {};
  std::sort(sorted.begin(), sorted.end());
  std::vector<double> borders = {sorted.front()};
  for (int b = 1; b < kBins; ++b) {
    const double at = sorted[sorted.size() * static_cast<std::size_t>(b) / kBins];
    if (at > borders.back()) borders.push_back(at);
  }
  if (sorted.back() > borders.back()) borders.push_back(sorted.back());
  return borders;
}

struct Best {
  double says = 0, low = 0, high = 0, share = 0;
};

/// What a range that holds `share` of the weight in `rows` of the rows says, in nats.
double information(double share, double rows) {
  const double s = std::clamp(share, 1e-9, 1 - 1e-9), q = std::clamp(rows, 1e-9, 1 - 1e-9);
  return s > q ? s * std::log(s / q) + (1 - s) * std::log((1 - s) / (1 - q)) : 0.0;
}

Best best_range(const std::vector<double>& borders, const std::vector<double>& bin_weight,
                const std::vector<double>& bin_rows, double all_weight, double all_rows) {
  Best best;
  const std::size_t bins = bin_weight.size();
  for (std::size_t from = 0; from < bins; ++from) {
    double weight = 0, rows = 0;
    for (std::size_t to = from; to < bins; ++to) {
      weight += bin_weight[to];
      rows += bin_rows[to];
      const double share = std::clamp(weight / all_weight, 0.0, 1.0);
      const double says = information(share, rows / all_rows);
      if (says > best.says) best = {says, borders[from], borders[to + 1], share};
    }
  }
  return best;
}

/// Mean square of the quietest quarter of the blocks: what noise makes, where nothing better is known.
double quiet_level(const Prepared& data, const Eigen::VectorXd& residual,
                   const std::vector<std::size_t>& rows) {
  std::vector<double> sum(data.blocks, 0.0), count(data.blocks, 0.0), level;
  for (const std::size_t i : rows) {
    sum[data.rows[i].block] +=
        residual[static_cast<Eigen::Index>(i)] * residual[static_cast<Eigen::Index>(i)];
    ++count[data.rows[i].block];
  }
  for (std::size_t b = 0; b < sum.size(); ++b)
    if (count[b] > 0) level.push_back(sum[b] / count[b]);
  return level.empty() ? 0.0 : series::quantile(level, 0.25);
}

std::vector<std::size_t> rows_of(const Prepared& data, Chain chain) {
  std::vector<std::size_t> rows;
  for (std::size_t i = 0; i < data.rows.size(); ++i)
    if (data.rows[i].chain == chain) rows.push_back(i);
  return rows;
}

}  // namespace

const char* subsystem_of(Chain chain) noexcept {
  return chain == Chain::kTorque ? "muscle" : (chain == Chain::kMotion ? "joint" : "pcu");
}

std::string in_words(const Region& region) {
  if (region.variable == "direction")
    return region.low < region.high ? "while moving"
           : region.low > 0         ? "moving up"
                                    : (region.high < 0 ? "moving down" : "standing still");
  return fmt::format("at {} from {} to {} {}",
                     variable_in_words(region.variable, of_linear_axis(region.unit)), rounded(region.low),
                     rounded(region.high), region.unit);
}

std::vector<Region> regions_of(const Prepared& data, Chain chain, const Eigen::VectorXd& weight) {
  const std::vector<std::size_t> rows = rows_of(data, chain);
  std::vector<std::pair<double, Region>> found;
  for (const Variable& v : variables_of(data, rows)) {
    const bool direction = std::string(v.name) == "direction";
    const std::vector<double> borders =
        direction ? std::vector<double>{-1.5, -0.5, 0.5, 1.5} : borders_of(v.value);
    if (borders.size() < 3) continue;
    std::vector<double> bin_weight(borders.size() - 1, 0.0), bin_rows(borders.size() - 1, 0.0);
    double all_weight = 0, all_rows = 0, known_weight = 0, known_rows = 0;
    for (std::size_t n = 0; n < rows.size(); ++n) {
      const double w = weight[static_cast<Eigen::Index>(rows[n])];
      all_weight += w;
      ++all_rows;
      if (!std::isfinite(v.value[n])) continue;
      const auto above = std::upper_bound(borders.begin() + 1, borders.end() - 1, v.value[n]);
      const auto bin = static_cast<std::size_t>(above - borders.begin() - 1);
      bin_weight[bin] += w;
      ++bin_rows[bin];
      known_weight += w;
      ++known_rows;
    }
    if (!(all_weight > 0)) return {};
    if (known_weight <= 0) continue;
    const double known = std::min(1.0, known_weight / all_weight);
    if (direction) {
      const auto one = [&](double low, double high, double w, double r) {
        const double share = std::clamp(w / all_weight, 0.0, 1.0);
        const double says = information(share, r / all_rows);
        if (says >= kWorthSaying) found.emplace_back(says, Region{"", "", v.name, low, high, v.unit, share});
      };
      one(-1, 1, bin_weight[0] + bin_weight[2], bin_rows[0] + bin_rows[2]);
      for (std::size_t b = 0; b < 3; ++b)
        one(static_cast<double>(b) - 1, static_cast<double>(b) - 1, bin_weight[b], bin_rows[b]);
      continue;
    }
    // Among the rows that have the variable: that a row has it at all is no region.
    Best best = best_range(borders, bin_weight, bin_rows, known_weight, known_rows);
    // Time is named where nothing else says as much: which run came first is a choice of whoever recorded.
    best.says *= known * (std::string(v.unit) == "s" ? kTimeCounts : 1.0);
    best.share *= known;
    const double range = borders.back() - borders.front();
    for (double* end : {&best.low, &best.high})
      if (std::abs(*end) < 1e-6 * range) *end = 0;
    // A variable that rests (pressures free of their noise do) differs by nothing that could be read: no region.
    if (rounded(best.low) == rounded(best.high)) continue;
    if (best.says >= kWorthSaying)
      found.emplace_back(best.says, Region{"", "", v.name, best.low, best.high, v.unit, best.share});
  }
  std::stable_sort(found.begin(), found.end(),
                   [](const auto& a, const auto& b) { return a.first > b.first; });
  std::vector<Region> regions;
  for (auto& [says, region] : found) {
    region.subsystem = subsystem_of(chain);
    region.signal = label_of(data, chain).signal;
    regions.push_back(std::move(region));
  }
  return regions;
}

std::vector<Region> regions(const Predictor& predictor, const Library& library, const Found& found) {
  if (!found.gate.significant) return {};
  const Prepared& data = predictor.data();
  const bool explained = !found.added.empty();
  const auto n = static_cast<Eigen::Index>(data.rows.size());
  struct Part {
    Chain chain;
    double weight;
    Eigen::VectorXd rows;
  };
  std::vector<Part> parts;
  double all = 0;
  const Eigen::VectorXd unexplained = unfiltered(data, found.weights, found.baseline.residual),
                        left = unfiltered(data, found.weights, found.model.residual);
  for (const Chain chain : {Chain::kTorque, Chain::kPressure1, Chain::kPressure2, Chain::kMotion}) {
    const std::vector<std::size_t> rows = rows_of(data, chain);
    if (rows.empty()) continue;
    Part part{chain, 0, Eigen::VectorXd::Zero(n)};
    const double quiet = explained ? 0.0 : quiet_level(data, unexplained, rows);
    for (const std::size_t i : rows) {
      const auto k = static_cast<Eigen::Index>(i);
      const double before = unexplained[k], after = left[k];
      part.rows[k] = before * before - (explained ? after * after : quiet);
      part.weight += part.rows[k];
    }
    if (part.weight <= 0) continue;
    all += part.weight;
    parts.push_back(std::move(part));
  }
  std::stable_sort(parts.begin(), parts.end(),
                   [](const Part& a, const Part& b) { return a.weight > b.weight; });
  std::vector<Region> out;
  for (const Part& part : parts) {
    if (part.weight < kSignificantChain * all) break;
    std::vector<Region> found_here = regions_of(data, part.chain, part.rows);
    if (found_here.empty())  // everywhere alike
      found_here.push_back({subsystem_of(part.chain), label_of(data, part.chain).signal, "everywhere",
                            kNotKnown, kNotKnown, "", 1.0});
    if (found_here.size() > kMostRegions) found_here.resize(kMostRegions);
    for (Region& region : found_here) {
      // A named effect knows its side better than the chain in which it shows.
      for (const int h : found.added) {
        const Hypothesis& added = library.hypotheses[static_cast<std::size_t>(h)];
        if ((added.chains & bit(part.chain)) == 0) continue;
        region.subsystem = subsystem_name(added.info().where);
        break;
      }
      out.push_back(std::move(region));
    }
  }
  return out;
}

}  // namespace isac::explain
