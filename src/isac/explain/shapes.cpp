#include "isac/explain/shapes.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "isac/core/units.hpp"

namespace isac::explain {
namespace {

using models::EffectInfo;
using std::string_view;

}  // namespace

Reach reach_of(const Prepared& data) {
  Reach reach;
  for (const PreparedRun& run : data.runs) {
    if (run.interval > 0) reach.interval = run.interval;
    for (const double v : run.angle) {
      reach.angle_low = std::min(reach.angle_low, v);
      reach.angle_high = std::max(reach.angle_high, v);
      if (!run.is_free) continue;
      reach.free_low = std::min(reach.free_low, v);
      reach.free_high = std::max(reach.free_high, v);
    }
    for (const double w : run.velocity) reach.speed = std::max(reach.speed, std::abs(w));
    for (const auto& p : run.pressure) {
      if (!p.empty()) reach.pressure_lows.push_back(*std::min_element(p.begin(), p.end()));
      for (std::size_t k = 0; k < p.size(); ++k) {
        reach.pressure_high = std::max(reach.pressure_high, p[k]);
        if (k >= 5) reach.rate = std::max(reach.rate, std::abs(p[k] - p[k - 5]) / (5 * run.interval));
      }
    }
    for (const auto& u : run.command)
      for (const double v : u) reach.command_high = std::max(reach.command_high, v);
    for (const auto& f : run.force)
      for (const double v : f) reach.force = std::max(reach.force, v);
    if (!run.time.empty()) {
      reach.run_seconds = std::max(reach.run_seconds, run.time.back());
      reach.day_seconds = std::max(reach.day_seconds, run.day_offset + run.time.back());
    }
  }
  std::sort(reach.pressure_lows.begin(), reach.pressure_lows.end());
  return reach;
}

namespace {

/// Grids of the shape parameters; `at` counts the parameter within its effect.
std::vector<double> grid_of(string_view id, int at, const Reach& r) {
  const double bar = kPascalPerKgfCm2;
  if (id == "stribeck_friction" && at == 2) return {0.03, 0.1, 0.3};
  if (id == "pressure_dependent_friction" && at == 1) return {1.0};
  if (one_of(id, {"hysteresis", "maxwell_slip"}) && at == 1) return {0.01, 0.04, 0.15};
  if (id == "pressure_creep" && at == 1) return {2, 10, 50};
  if (id == "valve_stiction" && at == 0) return {0.01 * bar, 0.05 * bar};
  if (id == "asymmetric_hysteresis" && at >= 2) return {0.04};
  if (id == "creep" && at == 1) return {1, 4, 15, 60, 250};
  if (id == "thermal_drift" && at == 3) return {30, 150, 600, 3000};
  if (id == "series_elasticity" && at == 1) return {5, 7, 10, 14, 20, 28, 40};
  // What rings is found within its width only, 2 d f.
  if (id == "series_elasticity_within" && at == 1)
    return {6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16.5, 18, 20, 22};
  if (one_of(id, {"series_elasticity", "series_elasticity_within"}) && at == 2) return {0.05};
  if (one_of(id, {"backlash", "backlash_of_wheel"}) && at == 0) return {0.003, 0.015};
  if (id == "encoder_play" && at == 0) return {0.001, 0.004};
  if (id == "tension_loss" && at == 1) {
    const double far = std::max(r.angle_high, -r.angle_low);
    return {0.4 * far, 0.65 * far, 0.85 * far};
  }
  if (id == "torque_ripple" && at == 2) {
    std::vector<double> grid;
    const double step = 0.6 * kPi / std::max(0.1, r.angle_high - r.angle_low);
    for (double n = 8.5; n < 70; n += step) grid.push_back(n);
    return grid;
  }
  if (id == "flow_limit" && at == 0) return {0.35 * r.rate, 0.6 * r.rate, 0.85 * r.rate};
  if (id == "force_saturation" && at == 0) return {0.75 * r.force, 0.88 * r.force, 0.97 * r.force};
  if (id == "supply_droop" && at == 0)
    return {0.75 * r.command_high, 0.9 * r.command_high, 1.05 * r.command_high};
  if (id == "supply_droop" && at == 1) return {0.0, 0.3};
  if (id == "supply_droop" && at == 2) return {1.0};
  if (id == "supply_sag" && at == 1) return {0.25, 0.8};
  if (id == "threshold_pressure" && at == 0) {
    // Nothing is seen of it where no pressure falls below: starts just above what the muscles fell to, run by run.
    constexpr std::size_t kStarts = 5;
    std::vector<double> grid;
    for (const double low : r.pressure_lows)
      if (const double start = 1.3 * std::max(0.1 * bar, low);
          grid.empty() || (start > 1.3 * grid.back() && grid.size() < kStarts))
        grid.push_back(start);
    if (grid.empty()) return {};
    grid.push_back(0.4 * grid.front());
    return grid;
  }
  if (id == "dead_time" && at == 0) return {0.006, 0.02};
  if (id == "second_order_lag" && at == 0) return {0.006, 0.03};
  // A response at a long lag holds the curvature of the prediction's noise, which the residual holds too.
  if (id == "sensor_lag" && at == 0) return {0.0005};
  if (id == "valve_deadband" && at == 0) return {0.01 * bar, 0.05 * bar};
  if (id == "valve_hysteresis" && at == 0) return {0.01 * bar, 0.05 * bar};
  if (id == "asymmetric_fill_vent" && at == 0) return {0.9, 1.15};
  return {};
}

}  // namespace

std::vector<Values> shapes_of(const EffectInfo& info, const Reach& reach) {
  std::vector<Values> shapes(1);
  for (int i = 0; i < info.parameter_count; ++i) {
    const auto& parameter = info.parameters[i];
    std::vector<double> grid = grid_of(info.id, i, reach);
    if (grid.empty()) grid = {parameter.typical};
    std::vector<Values> more;
    for (const Values& shape : shapes)
      for (const double value : grid) {
        Values next = shape;
        next[static_cast<std::size_t>(i)] = std::clamp(value, parameter.lower, parameter.upper);
        more.push_back(next);
      }
    shapes = std::move(more);
  }
  return shapes;
}

std::vector<Values> stops(const EffectInfo& info, double low, double high) {
  std::vector<Values> shapes;
  const auto add = [&](double upper, double lower) {
    shapes.push_back({info.parameters[0].typical, upper, lower});
  };
  for (const double share : {0.35, 0.55, 0.75, 0.93}) {
    if (high > 0.05) add(share * high, -3.0);
    if (low < -0.05) add(3.0, share * low);
    if (share > 0.5) add(share * high, share * low);
  }
  if (shapes.empty()) add(0.05, -0.05);
  return shapes;
}

std::vector<Values> slips_between(const EffectInfo& info, const Prepared& data) {
  std::vector<double> starts;
  for (const PreparedRun& run : data.runs) starts.push_back(run.day_offset);
  std::sort(starts.begin(), starts.end());
  starts.erase(std::unique(starts.begin(), starts.end()), starts.end());
  std::vector<Values> shapes;
  for (std::size_t i = 1; i < starts.size(); ++i)
    shapes.push_back({info.parameters[0].typical, starts[i] - 0.5});
  if (shapes.empty()) shapes.push_back({info.parameters[0].typical, 10.0});
  return shapes;
}

}  // namespace isac::explain
