#include "isac/estimate/joint_verdict.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "isac/core/units.hpp"
#include "isac/series/statistics.hpp"

namespace isac::estimate {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

std::vector<double> sampled(const std::vector<double>& values, bool sizes) {
  const std::size_t stride = std::max<std::size_t>(1, values.size() / 100000);
  std::vector<double> out;
  for (std::size_t i = 0; i < values.size(); i += stride)
    out.push_back(sizes ? std::abs(values[i]) : values[i]);
  return out;
}

/// What the data reached and what the model is to hold for.
struct Reach {
  double data[kInputs] = {};       ///< 99.5 % of |input|, noise taken off
  double operating[kInputs] = {};  ///< 0: no rule
  bool rule = false;
};

Reach reach_of(const JointRows& rows, const JointTerms& terms, const JointFitOptions& options) {
  Reach out;
  out.rule = !terms.driven() && options.position_unit == "rad";
  for (int z = 0; z < kInputs; ++z) {
    const double size = rows.size() > 0 ? series::quantile(sampled(rows.input[z], true), 0.995) : 0.0;
    double noise = 0;
    for (const RunRows& run : rows.runs) noise = std::max(noise, run.noise.raw[z]);
    out.data[z] = std::sqrt(
        std::max(0.0, size * size - 2.81 * 2.81 * noise * noise));  // 2.81 σ: the same share of noise
  }
  if (out.rule) {
    out.operating[static_cast<int>(Input::kAngle)] = options.operating.angle;
    out.operating[static_cast<int>(Input::kVelocity)] = options.operating.speed;
    out.operating[static_cast<int>(Input::kDeltaPressure)] = options.operating.delta_pressure;
  }
  return out;
}

JointState edge_of(const Reach& reach) {
  JointState state;
  for (int z = 0; z < kInputs; ++z)
    set_value(state, static_cast<Input>(z), std::max(reach.data[z], reach.operating[z]));
  return state;
}

std::string quantity(Input input, double value, bool linear_axis) {
  switch (input) {
    case Input::kAngle:
      return linear_axis ? fmt::format("{:.3g} m", value) : fmt::format("{:.3g} rad", value);
    case Input::kVelocity:
      return linear_axis ? fmt::format("{:.3g} m/s", value) : fmt::format("{:.3g} rad/s", value);
    case Input::kAcceleration:
      return linear_axis ? fmt::format("{:.3g} m/s2", value) : fmt::format("{:.3g} rad/s2", value);
    case Input::kDeltaPressure:
      return fmt::format("{:.3g} kg/cm2", value / kPascalPerKgfCm2);
    case Input::kMeanPressure:
      return fmt::format("{:.3g} kg/cm2", value / kPascalPerKgfCm2);
  }
  return {};
}

const char* words(Input input) {
  switch (input) {
    case Input::kAngle:
      return "angle";
    case Input::kVelocity:
      return "speed";
    case Input::kAcceleration:
      return "acceleration";
    case Input::kDeltaPressure:
      return "pressure difference";
    case Input::kMeanPressure:
      return "mean pressure";
  }
  return "";
}

/// The sweep that would mend it.
std::string mend(Input input, const JointFitOptions& options) {
  switch (input) {
    case Input::kAngle:
      return options.position_unit == "m"
                 ? "record a run that moves through the whole stroke"
                 : fmt::format("record a slow sweep at constant pressure over ±{:.2g} rad",
                               options.operating.angle);
    case Input::kVelocity:
      return options.position_unit == "m" ? "record a run with several speeds in both directions"
                                          : fmt::format(
                                                "record a fast sweep or a bundle: constant pressure, moved "
                                                "by hand in both directions at speeds up to {:.3g} rad/s",
                                                options.operating.speed);
    case Input::kAcceleration:
      return "record a run with hard reversals";
    case Input::kDeltaPressure:
      return "record slow sweeps at several pressure differences (-1, 0, +1 kg/cm2) or a clamped run with "
             "the pressure swept";
    case Input::kMeanPressure:
      return "record runs at another mean pressure";
  }
  return {};
}

/// The input that the k-th parameter mainly follows: the one that, taken to zero, takes the term away.
Input main_input(const JointTerms& terms, std::size_t k, const JointState& edge) {
  const double full = std::abs(terms.regressor(k, edge));
  for (const Input input :
       {Input::kVelocity, Input::kAcceleration, Input::kDeltaPressure, Input::kMeanPressure, Input::kAngle}) {
    if (!terms.reads(k, input)) continue;
    JointState still = edge;
    set_value(still, input, 0.0);
    if (std::abs(terms.regressor(k, still)) < 0.5 * full) return input;
  }
  return Input::kAngle;
}

/// Empty if the k-th term's inputs came near enough to the operating range, else why not.
std::string unexcited(const JointTerms& terms, std::size_t k, const Reach& reach,
                      const JointFitOptions& options) {
  if (!reach.rule) return {};
  const JointState edge = edge_of(reach);
  const double full = std::abs(terms.regressor(k, edge));
  for (const Input input : {Input::kVelocity, Input::kDeltaPressure, Input::kAngle}) {
    const int z = static_cast<int>(input);
    if (!terms.reads(k, input) || !(reach.operating[z] > 0)) continue;
    const double share = input == Input::kVelocity ? kSpeedShare : kReachShare;
    if (reach.data[z] >= share * reach.operating[z]) continue;
    JointState little = edge;
    set_value(little, input, share * value_of(edge, input));
    if (std::abs(terms.regressor(k, little)) > 0.5 * full)
      continue;  // the term does not fade with this input
    return fmt::format(
        "the {} reaches only {}, below {} ({:.0f} % of the {} that the model is to hold for){}; {}",
        words(input), quantity(input, reach.data[z], false),
        quantity(input, share * reach.operating[z], false), 100 * share,
        quantity(input, reach.operating[z], false),
        input == Input::kVelocity ? ", and so slowly damping cannot be told from friction and hysteresis"
                                  : "",
        mend(input, options));
  }
  return {};
}

}  // namespace

std::vector<double> correlations(const std::vector<Estimated>& parameters, const std::vector<int>& order,
                                 const JointCore& core) {
  const std::size_t n = order.size();
  std::vector<double> out(n * n, std::nan(""));
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < n; ++j)
      if (parameters[i].identifiable && parameters[j].identifiable)
        out[i * n + j] = core.covariance(order[i], order[j]) /
                         std::sqrt(core.covariance(order[i], order[i]) * core.covariance(order[j], order[j]));
  return out;
}

ValidityBox validity_box(const JointRows& rows) {
  ValidityBox box;
  if (rows.size() == 0) return box;
  const auto range = [&](Input input, double& low, double& high) {
    const std::vector<double> some = sampled(rows.input[static_cast<int>(input)], false);
    low = series::quantile(some, 0.001);
    high = series::quantile(some, 0.999);
  };
  range(Input::kDeltaPressure, box.delta_pressure_low, box.delta_pressure_high);
  range(Input::kAngle, box.angle_low, box.angle_high);
  range(Input::kVelocity, box.speed_low, box.speed_high);
  return box;
}

std::vector<Estimated> judge_parameters(const JointRows& rows, const JointTerms& terms, const JointCore& core,
                                        const JointFitOptions& options, std::vector<int>& order) {
  const Reach reach = reach_of(rows, terms, options);
  const JointState edge = edge_of(reach);
  const bool linear_axis = options.position_unit == "m";
  const std::vector<double> outputs = sampled(rows.output, false);
  const double range = 0.5 * (series::quantile(outputs, 0.995) - series::quantile(outputs, 0.005));
  const std::size_t linear = terms.linear().size();
  const std::size_t total = linear + terms.nonlinear().size();
  std::vector<Estimated> all(total);
  const auto parameter = [&](std::size_t k) -> const JointParameter& {
    return k < linear ? terms.linear()[k] : terms.nonlinear()[k - linear];
  };
  for (std::size_t k = 0; k < total; ++k) {
    const JointParameter& p = parameter(k);
    const auto i = static_cast<Eigen::Index>(k);
    Estimated& e = all[k];
    e.name = p.name;
    e.unit = p.unit;
    const double value = core.theta[i], error = std::sqrt(core.covariance(i, i));
    const double limit = series::student_t_limit(0.95, core.degrees_of_freedom[i]);
    const Input input = k < linear ? main_input(terms, k, edge) : Input::kVelocity;
    const std::string repair = mend(input, options);
    if (k < linear) e.reason = unexcited(terms, k, reach, options);
    if (e.reason.empty() && core.rank.fault[k] == Rank::Fault::kStill)
      e.reason =
          fmt::format("the {} never moves away from zero or was not recorded; {}", words(input), repair);
    if (e.reason.empty() && core.rank.fault[k] == Rank::Fault::kNoiseOnly)
      e.reason = fmt::format("what changes of the {} in these runs is noise of the sensor; {}", words(input),
                             repair);
    if (e.reason.empty() && core.rank.fault[k] == Rank::Fault::kCombination) {
      std::string partners;
      for (const int partner : core.rank.partners[k]) {
        const std::string& name = parameter(static_cast<std::size_t>(partner)).name;
        if (partners.find(name) == std::string::npos) partners += (partners.empty() ? "" : ", ") + name;
      }
      e.reason =
          fmt::format("in these runs only a combination of {} and {} shows; {}", p.name, partners, repair);
    }
    if (e.reason.empty()) {
      const double half = limit * error;
      double effect = kNan;
      if (k < linear) {
        const std::vector<double> regressor = sampled(rows.plain[k], true);
        const double seen = series::quantile(regressor, 0.995);
        effect = half * std::max(seen, reach.rule ? std::abs(terms.regressor(k, edge)) : 0.0);
      } else if (!p.shape) {
        effect = half;  // these parameters are torques themselves
      }
      const bool known = half <= kRelativeWidth * std::abs(value) || effect <= kMatteringShare * range;
      if (!known || !std::isfinite(half)) {
        std::string why = "its 95 % interval";
        if (std::isfinite(half))
          why += fmt::format(", {:.3g} ± {:.2g} {}, is too wide to be of use", value / p.si_per_unit,
                             half / p.si_per_unit, p.unit);
        else
          why += " cannot be computed";
        // The combination with its strongest partner is what the data do know.
        int partner = -1;
        double strongest = 0.9;
        for (std::size_t other = 0; other < total; ++other) {
          const auto j = static_cast<Eigen::Index>(other);
          const double rho = core.covariance(i, j) / (error * std::sqrt(core.covariance(j, j)));
          if (other != k && std::abs(rho) > strongest) {
            strongest = std::abs(rho);
            partner = static_cast<int>(other);
          }
        }
        if (partner >= 0) {
          const JointParameter& q = parameter(static_cast<std::size_t>(partner));
          const double factor = -core.covariance(i, partner) / core.covariance(partner, partner) *
                                q.si_per_unit / p.si_per_unit;
          why += fmt::format(" (only {} {} {:.3g} {} shows, variance inflation {:.3g})", p.name,
                             factor < 0 ? "-" : "+", std::abs(factor), q.name, core.inflation[i]);
        } else if (core.degrees_of_freedom[i] < 3) {
          why += fmt::format(" (it rests on one or two moments of the record, {:.1f} degrees of freedom)",
                             core.degrees_of_freedom[i]);
        }
        e.reason = why + "; " + repair;
      }
    }
    if (e.reason.empty()) {
      e.value = value / p.si_per_unit;
      e.std_error = error / std::abs(p.si_per_unit);
      e.ci_low = e.value - limit * e.std_error;
      e.ci_high = e.value + limit * e.std_error;
    } else {
      e.identifiable = false;
      e.reason = fmt::format("{} cannot be told: {}.", e.name, e.reason);
    }
  }
  (void)linear_axis;
  // Back into the order in which the caller named the terms.
  std::vector<Estimated> out;
  order.clear();
  for (const std::string& term : options.terms)
    for (std::size_t k = 0; k < total; ++k)
      if (parameter(k).name == term || parameter(k).name.rfind(term + ".", 0) == 0) {
        out.push_back(all[k]);
        order.push_back(static_cast<int>(k));
      }
  return out;
}

void add_warnings(const JointRows& rows, const JointTerms& terms, const JointCore& core,
                  const JointFitOptions& options, JointFit& fit) {
  const auto warn = [&](const char* code, std::string text) {
    fit.warnings.push_back({code, std::move(text)});
  };
  const bool pair = !terms.driven() && options.position_unit == "rad";
  if (pair) {
    const double angle = std::max(-fit.box.angle_low, fit.box.angle_high);
    if (angle > 1.01 * options.operating.angle)
      warn("angle_beyond_range", fmt::format("The angle reaches {:.3g} rad; beyond {:.3g} rad one muscle "
                                             "loses its tension and the model bends: leave those "
                                             "rows out or keep the sweep inside.",
                                             angle, options.operating.angle));
    const double pressure = std::max(-fit.box.delta_pressure_low, fit.box.delta_pressure_high);
    if (pressure > 1.01 * options.operating.delta_pressure)
      warn("pressure_beyond_range",
           fmt::format("The pressure difference reaches {:.3g} kg/cm2; the model is accurate to {:.3g} "
                       "kg/cm2: keep the sweep inside.",
                       pressure / kPascalPerKgfCm2, options.operating.delta_pressure / kPascalPerKgfCm2));
    const double mean =
        rows.size() > 0 ? series::median(sampled(rows.input[static_cast<int>(Input::kMeanPressure)], false))
                        : 0.0;
    if (mean > 0 && std::abs(mean - options.reference_pressure) > 0.1 * options.reference_pressure)
      warn("initial_pressure",
           fmt::format("The mean pressure is {:.3g} kg/cm2, not the {:.3g} kg/cm2 of the rig file: stiffness "
                       "follows the mean pressure, so "
                       "A holds only there; record at the pressure of use or correct initial_pressure.",
                       mean / kPascalPerKgfCm2, options.reference_pressure / kPascalPerKgfCm2));
    const std::vector<double> dp = sampled(rows.input[static_cast<int>(Input::kDeltaPressure)], false);
    const double spread = 0.5 * (series::quantile(dp, 0.995) - series::quantile(dp, 0.005)),
                 level = std::abs(series::median(dp));
    for (const Estimated& e : fit.parameters)
      if ((e.name == "B" || e.name == "pressure") && e.identifiable && spread < 0.1 * level)
        warn("pressure_level_only",
             "B rests on one constant pressure difference: an offset of the force sensors would be taken for "
             "it; "
             "record a run at another pressure difference.");
  }
  for (const Estimated& e : fit.parameters) {
    if (!e.identifiable) continue;
    const bool positive = e.ci_low > 0, negative = e.ci_high < 0;
    if ((e.name == "A" && positive) || (e.name == "B" && negative))
      warn("sign", fmt::format("{} has the sign of a joint that drives itself: F1 and F2, p1 and p2 or the "
                               "encoder's direction may be swapped; check the map of signals.",
                               e.name));
    if ((e.name == "C" || e.name == "D") && negative)
      warn("sign",
           fmt::format("{} is negative: damping that gives energy. A slow force amplifier or signals "
                       "recorded at different times look like this; check sensor lag and time stamps.",
                       e.name));
  }
  for (std::size_t k = 0; k < terms.nonlinear().size(); ++k) {
    const JointParameter& p = terms.nonlinear()[k];
    const double value = core.theta[static_cast<Eigen::Index>(terms.linear().size() + k)];
    if (value <= p.lower || value >= p.upper)
      warn("at_bound", fmt::format("{} ended at the edge of its plausible range ({:.3g} {}): the data ask "
                                   "for another shape of term.",
                                   p.name, value / p.si_per_unit, p.unit));
  }
  if (!core.converged)
    warn("not_converged", "The solver stopped before the answer settled (" + core.report +
                              "); take the numbers with care or drop a term.");
  if (core.blocks.size() < 12 || core.blocks_cut_short)
    warn("few_blocks", fmt::format("The noise remembers {:.2g} s and the runs give {} blocks of {:.2g} s: "
                                   "the intervals rest on little; record longer.",
                                   core.correlation_seconds, core.blocks.size(), core.block_seconds));
  if (rows.size() > 0 &&
      static_cast<double>(core.outliers + rows.cleaned) > 0.05 * static_cast<double>(rows.size()))
    warn("outliers", fmt::format("{:.1f} % of the rows are outliers: look for spikes or for motion that the "
                                 "model does not describe in the residual over time.",
                                 100.0 * static_cast<double>(core.outliers + rows.cleaned) /
                                     static_cast<double>(rows.size())));
  if (static_cast<double>(rows.size()) < 0.5 * static_cast<double>(rows.seen))
    warn("rows_lost", fmt::format("Only {} of {} rows could be used: missing samples or gaps cut the record "
                                  "into pieces; check the logger.",
                                  rows.size(), rows.seen));
}

}  // namespace isac::estimate
