#include "isac/estimate/pcu_pool.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "isac/estimate/step_noise.hpp"

namespace isac::estimate {
namespace {

constexpr double kSignificant = 0.01;

using Member = Estimated PcuStep::*;

std::vector<Estimated> collect(const PcuFit& fit, Member member, const StepDirection* direction) {
  std::vector<Estimated> out;
  for (const PcuStep& s : fit.steps)
    if (!direction || s.direction == *direction) out.push_back(s.*member);
  return out;
}

// Two steps that follow each other share a hold: the level behind the one is the level before the other. The mean over
// the whole hold and the mean over its second half have the variance of the former as their covariance.
std::vector<double> shared_levels(const PcuFit& fit) {
  std::vector<double> out;
  for (std::size_t i = 0; i + 1 < fit.steps.size(); ++i) {
    const PcuStep &a = fit.steps[i], &b = fit.steps[i + 1];
    const double change_a = a.command_to - a.command_from, change_b = b.command_to - b.command_from;
    const double covariance = -a.level_to_error * a.level_to_error / (change_a * change_b);
    out.push_back(a.run == b.run && std::isfinite(covariance) ? covariance : 0.0);
  }
  return out;
}

}  // namespace

Estimated pool(const std::vector<Estimated>& values, const std::vector<double>& with_next,
               const std::string& name, bool& heterogeneous) {
  heterogeneous = false;
  std::vector<const Estimated*> good;
  std::vector<double> covariance;  // of a good one with the next good one, where they are neighbours
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!values[i].identifiable || !(values[i].std_error > 0)) continue;
    const bool neighbour = !good.empty() && good.back() + 1 == &values[i] && i - 1 < with_next.size();
    if (!good.empty()) covariance.push_back(neighbour ? with_next[i - 1] : 0.0);
    good.push_back(&values[i]);
  }
  if (good.empty()) {
    Estimated none;
    none.name = name;
    none.identifiable = false;
    none.reason = values.empty() ? "no step in this direction was recorded" : values.front().reason;
    return none;
  }
  Estimated out = *good.front();
  out.name = name;
  if (good.size() == 1) return out;

  double w = 0, ww = 0, wx = 0;
  for (const Estimated* v : good) {
    const double weight = 1 / (v->std_error * v->std_error);
    w += weight;
    ww += weight * weight;
    wx += weight * v->value;
  }
  const double mean = wx / w, k = static_cast<double>(good.size());
  double q = 0, least_half = 1e300;
  for (const Estimated* v : good) {
    q += std::pow((v->value - mean) / v->std_error, 2);
    least_half = std::min(least_half, 0.5 * (v->ci_high - v->ci_low) / v->std_error);
  }
  heterogeneous = chi_square_tail(q, k - 1) < kSignificant;
  if (!heterogeneous) {
    out.value = mean;
    double variance = w;
    for (std::size_t i = 0; i + 1 < good.size(); ++i)
      variance += 2 * covariance[i] / std::pow(good[i]->std_error * good[i + 1]->std_error, 2);
    out.std_error = std::sqrt(variance) / w;
    // The quantile of the surest step: pooling only adds degrees of freedom.
    const double half = std::clamp(least_half, 1.96, 12.71) * out.std_error;
    out.ci_low = mean - half;
    out.ci_high = mean + half;
    return out;
  }
  const double between = std::max(0.0, (q - (k - 1)) / (w - ww / w));
  double v = 0, vx = 0;
  for (const Estimated* e : good) {
    const double weight = 1 / (e->std_error * e->std_error + between);
    v += weight;
    vx += weight * e->value;
  }
  out.value = vx / v;
  out.std_error = 1 / std::sqrt(v);
  const double half = student_95(k - 1) * out.std_error;
  out.ci_low = out.value - half;
  out.ci_high = out.value + half;
  return out;
}

void pool_steps(PcuFit& fit) {
  const StepDirection fill = StepDirection::kFilling, vent = StepDirection::kVenting;
  const struct {
    const char* name;
    const char* unit;
    Member member;
    const StepDirection* direction;
  } wanted[] = {
      {"K_C", "-", &PcuStep::gain, nullptr},
      {"T_C", "s", &PcuStep::lag, nullptr},
      {"dead_time", "s", &PcuStep::dead_time, nullptr},
      {"K_fill", "-", &PcuStep::gain, &fill},
      {"T_fill", "s", &PcuStep::lag, &fill},
      {"dead_time_fill", "s", &PcuStep::dead_time, &fill},
      {"K_vent", "-", &PcuStep::gain, &vent},
      {"T_vent", "s", &PcuStep::lag, &vent},
      {"dead_time_vent", "s", &PcuStep::dead_time, &vent},
  };
  const std::vector<double> shared = shared_levels(fit);
  for (const auto& want : wanted) {
    bool differ = false;
    // Steps of one direction are no neighbours in a staircase that goes up and down; in one that climbs they are.
    const bool shares = want.member == &PcuStep::gain && !want.direction;
    Estimated value = pool(collect(fit, want.member, want.direction), shares ? shared : std::vector<double>(),
                           want.name, differ);
    value.unit = want.unit;
    if (differ && want.direction)
      fit.warnings.push_back(
          {"steps_differ", fmt::format("{} differs from step to step by more than its errors: it depends on "
                                       "the size or level of the step",
                                       want.name)});
    fit.parameters.push_back(std::move(value));
  }
  const Estimated *a = fit.find("T_fill"), *b = fit.find("T_vent");
  if (a->identifiable && b->identifiable) {
    const double apart = std::abs(a->value - b->value);
    fit.directions_differ = apart > 2.58 * std::hypot(a->std_error, b->std_error);
    if (fit.directions_differ)
      fit.warnings.push_back(
          {"directions_differ", fmt::format("filling takes {:.3g} s, venting {:.3g} s: use T_fill and T_vent "
                                            "instead of the one T_C",
                                            a->value, b->value)});
  }
}

}  // namespace isac::estimate
