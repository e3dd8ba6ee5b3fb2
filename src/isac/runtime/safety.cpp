#include "isac/runtime/safety.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "isac/core/error.hpp"
#include "isac/core/units.hpp"

namespace isac::runtime {

bool SafetyMonitor::check(double time, const Physical& now) noexcept {
  if (fault_.kind != Fault::Kind::kNone) return false;
  if (has_last_ && time > last_time_) {
    const double interval = time - last_time_;
    speed_ += ((now.angle - last_angle_) / interval - speed_) * interval / (kSpeedFilter + interval);
  }
  last_time_ = time;
  last_angle_ = now.angle;
  has_last_ = true;

  struct Check {
    Fault::Kind kind;
    double value, limit;
  };
  const std::array<Check, kChecks> checks = {{
      {Fault::Kind::kPressure, std::max(now.p1, now.p2), limits_.pressure},
      {Fault::Kind::kDeltaPressure, std::abs(0.5 * (now.p2 - now.p1)), limits_.delta_pressure},
      {Fault::Kind::kAngle, std::abs(now.angle), limits_.angle},
      {Fault::Kind::kSpeed, std::abs(speed_), limits_.speed},
      {Fault::Kind::kForce, std::max(std::abs(now.F1), std::abs(now.F2)), limits_.force},
  }};
  if (!std::isfinite(now.angle + now.p1 + now.p2 + now.F1 + now.F2 + speed_)) {
    fault_ = {Fault::Kind::kNotFinite, 0.0, 0.0, time};
    return false;
  }
  for (std::size_t i = 0; i < kChecks; ++i) {
    if (!(checks[i].value > checks[i].limit)) {
      since_[i] = kNever;
      continue;
    }
    since_[i] = std::min(since_[i], time);
    if (time - since_[i] >= limits_.persistence) {
      fault_ = {checks[i].kind, checks[i].value, checks[i].limit, time};
      return false;
    }
  }
  return true;
}

void check_limits(const Limits& limits) {
  struct Named {
    const char* name;
    double value;
  };
  for (const Named& limit : {Named{"--limit-pressure", limits.pressure},
                             {"--limit-delta-pressure", limits.delta_pressure},
                             {"--limit-angle", limits.angle},
                             {"--limit-speed", limits.speed},
                             {"--limit-force", limits.force}}) {
    if (std::isfinite(limit.value) && limit.value > 0.0) continue;
    throw Error(
        ErrorKind::kUsage, "limit_nonsense",
        fmt::format("the safety limit {} (or its value in the rig file) must be a positive number, not {:g}",
                    limit.name, limit.value));
  }
}

std::string describe(const Fault& fault) {
  constexpr double kDegrees = 180.0 / kPi;
  switch (fault.kind) {
    case Fault::Kind::kNone:
      return "no limit was exceeded";
    case Fault::Kind::kNotFinite:
      return fmt::format("a sensor gave no number at {:.2f} s; check the calibration", fault.time);
    case Fault::Kind::kPressure:
      return fmt::format(
          "a muscle's pressure of {:.2f} kg/cm2 exceeded the limit of {:.2f} kg/cm2 at {:.2f} s; ask for "
          "less "
          "pressure, or raise --limit-pressure if the muscles can take it",
          fault.value / kPascalPerKgfCm2, fault.limit / kPascalPerKgfCm2, fault.time);
    case Fault::Kind::kDeltaPressure:
      return fmt::format(
          "the pressure difference of {:.2f} kg/cm2 exceeded the limit of {:.2f} kg/cm2 at {:.2f} s; ask for "
          "smaller steps, or raise --limit-delta-pressure",
          fault.value / kPascalPerKgfCm2, fault.limit / kPascalPerKgfCm2, fault.time);
    case Fault::Kind::kAngle:
      return fmt::format(
          "the angle of {:.2f} rad ({:.0f} degrees) exceeded the limit of {:.2f} rad at {:.2f} s; move less "
          "far, "
          "or raise --limit-angle",
          fault.value, fault.value * kDegrees, fault.limit, fault.time);
    case Fault::Kind::kSpeed:
      return fmt::format(
          "the speed of {:.2f} rad/s exceeded the limit of {:.2f} rad/s at {:.2f} s; move more slowly, or "
          "raise "
          "--limit-speed",
          fault.value, fault.limit, fault.time);
    case Fault::Kind::kForce:
      return fmt::format(
          "a muscle's force of {:.1f} N exceeded the limit of {:.1f} N at {:.2f} s; use less pressure or "
          "move "
          "less far, or raise --limit-force if the sensors can take it",
          fault.value, fault.limit, fault.time);
  }
  return "an unknown limit was exceeded";
}

}  // namespace isac::runtime
