#include "isac/explain/unknown.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "isac/core/units.hpp"
#include "isac/explain/generic_fit.hpp"

namespace isac::explain {
namespace {

constexpr int kShapeBins = 24;

/// What the picture's abscissa is, for a variable of the dictionary.
double abscissa(const PreparedRun& run, std::size_t k, const std::string& variable) {
  if (variable == "angle" || variable == "memory") return run.angle.empty() ? kNotKnown : run.angle[k];
  if (variable == "velocity" || variable == "direction")
    return run.velocity.empty() ? kNotKnown : run.velocity[k];
  if (variable == "time") return run.day_offset + run.time[k];
  if (!run.has_pressure) return kNotKnown;
  const double p1 = run.pressure[0][k] / kPascalPerKgfCm2, p2 = run.pressure[1][k] / kPascalPerKgfCm2;
  return variable == "mean_pressure" ? 0.5 * (p1 + p2) : 0.5 * (p2 - p1);
}

const char* unit_of(const std::string& variable) {
  if (variable == "angle" || variable == "memory") return "rad";
  if (variable == "velocity" || variable == "direction") return "rad/s";
  return variable == "time" ? "s" : "kg/cm2";
}

/// The signal that a variable is read from: the direction of motion is the velocity's.
const std::string& signal_of(const std::string& variable) {
  static const std::string kVelocity = "velocity";
  return variable == "direction" ? kVelocity : variable;
}

void fill_shape(const Around& place, Chain chain, Unknown& unknown) {
  const Prepared& data = place.predictor->data();
  double low = 1e300, high = -1e300;
  for (const Row& row : data.rows) {
    if (row.chain != chain) continue;
    const double x = abscissa(data.runs[row.run], row.sample, unknown.variable);
    if (!std::isfinite(x)) continue;
    low = std::min(low, x);
    high = std::max(high, x);
  }
  if (!(high > low)) return;
  const double scale = place.weights->sigma[static_cast<int>(chain)] /
                       (chain == Chain::kPressure1 || chain == Chain::kPressure2 ? kPascalPerKgfCm2 : 1.0);
  struct Sum {
    double total = 0, count = 0;
  };
  std::vector<std::map<unsigned, Sum>> bins(kShapeBins);  // by block
  const Eigen::VectorXd residual = unfiltered(data, *place.weights, place.residual);
  for (std::size_t i = 0; i < data.rows.size(); ++i) {
    const Row& row = data.rows[i];
    if (row.chain != chain) continue;
    const double x = abscissa(data.runs[row.run], row.sample, unknown.variable);
    if (!std::isfinite(x)) continue;
    const auto bin = std::min<std::size_t>(kShapeBins - 1,
                                           static_cast<std::size_t>((x - low) / (high - low) * kShapeBins));
    Sum& s = bins[bin][row.block];
    s.total -= residual[static_cast<Eigen::Index>(i)] * scale;  // measured − predicted
    s.count += 1;
  }
  for (int b = 0; b < kShapeBins; ++b) {
    const auto& blocks = bins[static_cast<std::size_t>(b)];
    double total = 0, count = 0, scatter = 0;
    for (const auto& [block, s] : blocks) {
      total += s.total;
      count += s.count;
    }
    if (blocks.size() < 3) continue;  // too thin to draw
    const double mean = total / count;
    for (const auto& [block, s] : blocks) scatter += (s.total - s.count * mean) * (s.total - s.count * mean);
    const double m = static_cast<double>(blocks.size());
    unknown.at.push_back(low + (b + 0.5) * (high - low) / kShapeBins);
    unknown.shape.push_back(mean);
    unknown.band.push_back(1.96 * std::sqrt(scatter * m / (m - 1)) / count);
  }
}

}  // namespace

Unknown describe_unknown(const Around& place, const Screen& screen) {
  Unknown unknown;
  const Prepared& data = place.predictor->data();
  const Dictionary generic(data);
  const GenericFit fit = fit_generic(place, screen);
  if (fit.functions.empty()) return unknown;
  const Chain chain = fit.chain;
  static constexpr const char* kSubsystem[] = {"muscle", "pcu", "pcu", "joint"};
  static constexpr const char* kSignal[] = {"torque", "p1", "p2", "motion"};
  unknown.subsystem = kSubsystem[static_cast<int>(chain)];
  unknown.signal = kSignal[static_cast<int>(chain)];
  unknown.unit =
      chain == Chain::kPressure1 || chain == Chain::kPressure2 ? "kg/cm2" : data.baseline.output_unit;

  std::set<std::string> depends, tried;
  for (const std::size_t function : fit.functions) {
    const std::vector<std::string> variables = generic.variables(function);
    if (depends.empty()) unknown.variable = variables.empty() ? "angle" : variables.back();
    for (const std::string& v : variables) depends.insert(signal_of(v));
  }
  for (std::size_t c = 0; c < generic.size(); ++c)
    if (generic.chain(c) == chain)
      for (const std::string& v : generic.variables(c))
        if (depends.count(signal_of(v)) == 0) tried.insert(signal_of(v));
  unknown.depends_on.assign(depends.begin(), depends.end());
  unknown.independent.assign(tried.begin(), tried.end());
  // Of what is explainable: the chain's squares beyond those of its noise.
  double squares = 0;
  for (std::size_t i = 0; i < data.rows.size(); ++i)
    if (data.rows[i].chain == chain)
      squares += fit.residual[static_cast<Eigen::Index>(i)] * fit.residual[static_cast<Eigen::Index>(i)];
  double rows = 0;
  for (const Row& row : data.rows) rows += row.chain == chain ? 1.0 : 0.0;
  const double left = std::max(0.0, squares - rows);
  unknown.share = fit.gain > 0 ? fit.gain / (fit.gain + left) : 0.0;
  unknown.variable_unit = unit_of(unknown.variable);
  fill_shape(place, chain, unknown);
  return unknown;
}

}  // namespace isac::explain
