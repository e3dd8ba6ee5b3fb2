#include "isac/explain/unknown.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <set>

#include "isac/core/units.hpp"
#include "isac/explain/generic_fit.hpp"

namespace isac::explain {
namespace {

constexpr int kShapeBins = 24;
constexpr double kNearlyAll = 0.9;  // of what functions took

/// What the picture's abscissa is, for a variable of the dictionary.
double abscissa(const PreparedRun& run, std::size_t k, const std::string& variable) {
  if (variable == "angle" || variable == "memory") return run.angle.empty() ? kNotKnown : run.angle[k];
  if (variable == "velocity" || variable == "direction")
    return run.velocity.empty() ? kNotKnown : run.velocity[k];
  if (variable == "time") return run.day_offset + run.time[k];
  if (!run.has_pressure) return kNotKnown;
  const double p1 = run.pressure[0][k] / kPascalPerKgfCm2, p2 = run.pressure[1][k] / kPascalPerKgfCm2;
  if (variable == "p1" || variable == "p2") return variable == "p1" ? p1 : p2;
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

/// Powers of one signal, and what bends where it passes shares of its range.
StandingOut functions_of(const Around& place, Chain chain, const std::string& variable) {
  const Prepared& data = place.predictor->data();
  StandingOut out{.chain = chain, .functions = {}};
  std::vector<double> x(data.rows.size(), kNotKnown);
  double low = 1e300, high = -1e300;
  for (std::size_t i = 0; i < data.rows.size(); ++i) {
    const Row& row = data.rows[i];
    if (row.chain == chain) x[i] = abscissa(data.runs[row.run], row.sample, variable);
    if (!std::isfinite(x[i])) continue;
    low = std::min(low, x[i]);
    high = std::max(high, x[i]);
  }
  const auto add = [&](const std::function<double(double)>& value) {
    Eigen::VectorXd rows = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(data.rows.size()));
    for (std::size_t i = 0; i < data.rows.size(); ++i)
      if (std::isfinite(x[i])) rows[static_cast<Eigen::Index>(i)] = value((x[i] - low) / (high - low));
    weigh(data, *place.weights, rows);
    out.functions.push_back({out.functions.size(), place.project(rows)});
  };
  if (!(high > low)) return out;
  for (const double power : {1.0, 2.0, 3.0, 4.0})
    add([power](double share) { return std::pow(share, power); });
  for (const double bend : {0.2, 0.35, 0.5, 0.65, 0.8})
    add([bend](double share) { return std::max(0.0, share - bend); });
  return out;
}

/// Where only pressures matter: is it one muscle's alone?
void tell_muscle(const Around& place, const GenericFit& fit, double noise_unit,
                 std::set<std::string>& variables) {
  if (fit.chain != Chain::kTorque || variables.empty() ||
      std::any_of(variables.begin(), variables.end(),
                  [](const std::string& v) { return v != "delta_pressure" && v != "mean_pressure"; }))
    return;
  const double needed = (variables.size() > 1 ? kNearlyAll : 1 / kNearlyAll) * fit.gain;
  double gain[2];
  for (const std::size_t muscle : {0U, 1U})
    gain[muscle] =
        fit_generic(place, functions_of(place, fit.chain, muscle == 0 ? "p1" : "p2"), noise_unit).gain;
  const std::size_t better = gain[1] > gain[0] ? 1 : 0;
  if (gain[better] < needed || gain[1 - better] > kNearlyAll * gain[better]) return;
  variables = {better == 0 ? "p1" : "p2"};
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

void add_time(Unknown& unknown) {
  std::vector<std::string>& on = unknown.depends_on;
  if (std::find(on.begin(), on.end(), "time") == on.end())
    on.insert(std::upper_bound(on.begin(), on.end(), "time"), "time");
  std::erase(unknown.independent, "time");
}

std::string signal_that_tells(const Around& place, Chain chain) {
  constexpr double kSome = 0.1;  // of all that is left, noise included
  if (chain != Chain::kTorque && chain != Chain::kMotion) return "";
  const Prepared& data = place.predictor->data();
  double squares = 0;
  for (std::size_t i = 0; i < data.rows.size(); ++i)
    if (const double r = place.residual[static_cast<Eigen::Index>(i)]; data.rows[i].chain == chain)
      squares += r * r;
  std::string best;
  double most = 0, second = 0;
  for (const char* variable : {"angle", "velocity", "delta_pressure", "mean_pressure", "p1", "p2"}) {
    const double gain = fit_generic(place, functions_of(place, chain, variable), 1.0).gain;
    second = std::max(second, std::min(gain, most));
    if (gain <= most) continue;
    most = gain;
    best = variable;
  }
  return most > kSome * squares && second < kNearlyAll * most ? best : "";
}

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
  tell_muscle(place, fit, screen.noise_unit, depends);
  if (depends.size() == 1 && depends.count(signal_of(unknown.variable)) == 0)
    unknown.variable = *depends.begin();
  for (std::size_t c = 0; c < generic.size(); ++c)
    if (generic.chain(c) == chain)
      for (const std::string& v : generic.variables(c))
        if (depends.count(signal_of(v)) == 0) tried.insert(signal_of(v));
  if (depends.count("p1") + depends.count("p2") > 0) {  // which both are made of
    tried.erase("delta_pressure");
    tried.erase("mean_pressure");
  }
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
