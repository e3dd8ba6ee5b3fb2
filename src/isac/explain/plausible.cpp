#include "isac/explain/plausible.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string_view>

#include "isac/explain/encoder_motion.hpp"
namespace isac::explain {
namespace {

constexpr double kSameWithin = 0.1;   // of the larger: no asymmetry
constexpr double kMoreAtRest = 1.05;  // of the friction in motion
constexpr double kWidest = 0.25;      // of the angles reached: a loop that motions still go round
constexpr double kOnNothing = 0.1;    // exponent of the mean pressure: no dependence
constexpr double kMiddle = 0.2;       // of the angle reached: no end
constexpr double kNarrowest = 3;      // steps of the encoder
constexpr double kSlowest = 2;        // speeds at which the encoder still tells motion from rest

bool alike(double a, double b) {
  return std::abs(a - b) < kSameWithin * std::max(std::abs(a), std::abs(b));
}

}  // namespace

Plausible::Plausible(const Prepared& data)
    : step_(std::isfinite(data.rig.angle_step) ? data.rig.angle_step : 0) {
  for (const PreparedRun& run : data.runs)
    for (const double angle : run.angle) {
      angle_low_ = std::min(angle_low_, angle);
      angle_high_ = std::max(angle_high_, angle);
    }
}

std::string Plausible::objection(const Hypothesis& h, const Values& v) const {
  const std::string_view form = h.info().id;
  for (int i = 0; i < h.info().parameter_count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const auto& parameter = h.info().parameters[i];
    const double null = parameter.null_value, margin = 1e-6 * (h.upper[k] - h.lower[k]);
    if (!h.free[k]) continue;
    const bool at_end = h.amplitude[k] && ((v[k] <= h.lower[k] + margin && h.lower[k] != null) ||
                                           (v[k] >= h.upper[k] - margin && h.upper[k] != null));
    const bool slow_state = h.info().state_count > 0 && std::string_view(parameter.unit) == "s";
    const bool least =
        !h.amplitude[k] && v[k] <= 1.02 * h.lower[k] && (slow_state || form == "torque_ripple");
    if (at_end || least) return fmt::format("needs {} at the end of its plausible range", parameter.name);
  }
  const auto no_loop = [&](double width) -> std::string {
    if (width < kNarrowest * step_) return "needs a loop that is narrower than the encoder tells";
    if (width > kWidest * (angle_high_ - angle_low_)) return "needs a loop that no motion here goes round";
    return {};
  };
  if (form == "stribeck_friction") {
    if (v[1] <= v[0]) return "needs less friction at rest than in motion";
    if (v[1] < kMoreAtRest * v[0]) return "needs no more friction at rest than in motion";
    if (v[2] < kSlowest * step_ / kSlowestStep)
      return "needs a friction that falls off below the speeds that the encoder tells";
  } else if (form == "pressure_dependent_friction") {
    if (std::abs(v[1]) < kOnNothing) return "needs no dependence on the pressure";
  } else if (form == "hysteresis" || form == "maxwell_slip") {
    return no_loop(v[1]);
  } else if (form == "asymmetric_hysteresis") {
    if (alike(v[0], v[1]) && alike(v[2], v[3])) return "needs both directions alike";
    if (std::max(v[2], v[3]) > kWidest * (angle_high_ - angle_low_)) return no_loop(std::max(v[2], v[3]));
  } else if (form == "end_stop") {
    if (v[1] < kMiddle * angle_high_ || v[2] > kMiddle * angle_low_)
      return "needs a stop in the middle of the motion";
  }
  return {};
}

}  // namespace isac::explain
