#include "isac/explain/labels.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string_view>

#include "isac/core/units.hpp"

namespace isac::explain {

Label label_of(const Prepared& data, Chain chain) {
  switch (chain) {
    case Chain::kTorque:
      break;
    case Chain::kMotion:
      return {"motion", "N m", 1};
    case Chain::kPressure1:
      return {"p1", "kg/cm2", 1 / kPascalPerKgfCm2};
    case Chain::kPressure2:
      return {"p2", "kg/cm2", 1 / kPascalPerKgfCm2};
  }
  return {data.baseline.output, data.baseline.output_unit, 1};
}

std::string in_words(const Label& label) {
  return label.signal == "motion" ? "balance of the free joint's motion" : label.signal;
}

std::string axis_unit(const std::string& unit, const BaselineModel& baseline) {
  if (baseline.position_unit == "rad") return unit;
  constexpr std::string_view kTorque = "N m", kAngle = "rad";
  if (unit == "kg m2") return "kg";
  std::string text = unit;
  if (text.starts_with(kTorque)) {
    text.replace(0, kTorque.size(), "N");
    // What follows is a power of time where the term grows with a power of speed.
    if (const auto time = text.find(" s"); time != std::string::npos) {
      const std::string power = text.substr(time + 2);
      text += "/m" + power;
    }
  }
  if (const auto at = text.find(kAngle); at != std::string::npos) text.replace(at, kAngle.size(), "m");
  return text;
}

std::string upper_first(std::string text) {
  if (!text.empty() && text[0] >= 'a' && text[0] <= 'z') text[0] = static_cast<char>(text[0] - 'a' + 'A');
  return text;
}

const char* subsystem_name(models::Subsystem where) noexcept {
  switch (where) {
    case models::Subsystem::kMuscle:
      return "muscle";
    case models::Subsystem::kJoint:
      return "joint";
    case models::Subsystem::kPcu:
      return "pcu";
    case models::Subsystem::kSensor:
      return "sensor";
    case models::Subsystem::kRig:
      return "rig";
  }
  return "";
}

std::string rounded(double value, int digits) {
  if (!std::isfinite(value)) return "not known";
  const double size = std::abs(value);
  if (size == 0) return "0";
  const int power = static_cast<int>(std::floor(std::log10(size)));
  if (power < -4 || power > 6) return fmt::format("{:.{}g}", value, digits);
  return fmt::format("{:.{}f}", value, std::max(0, digits - 1 - power));
}

std::string with_error(const std::string& name, double value, double error, const std::string& unit) {
  const std::string tail = unit.empty() || unit == "-" ? "" : " " + unit;
  if (!std::isfinite(error) || error <= 0) return fmt::format("{} = {}{}", name, rounded(value), tail);
  // As many places as the error has with one digit that counts (two where it begins with a one).
  const int power = static_cast<int>(std::floor(std::log10(error)));
  const bool one = error < 1.95 * std::pow(10.0, power);
  const int places = std::max(0, (one ? 1 : 0) - power);
  if (places > 8) return fmt::format("{} = {:.4g} ± {:.1g}{}", name, value, error, tail);
  return fmt::format("{} = {:.{}f} ± {:.{}f}{}", name, value, places, error, places, tail);
}

}  // namespace isac::explain
