#include "isac/record/toml_quantity.hpp"

#include <fast_float/fast_float.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <vector>

namespace isac::record {
namespace {

constexpr std::string_view kSpace = " \t";

std::string_view trim(std::string_view text) {
  const std::size_t first = text.find_first_not_of(kSpace);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kSpace) - first + 1);
}

constexpr Dimension minus(Dimension a, const Dimension& b) {
  a.length = static_cast<std::int8_t>(a.length - b.length);
  a.mass = static_cast<std::int8_t>(a.mass - b.mass);
  a.time = static_cast<std::int8_t>(a.time - b.time);
  a.current = static_cast<std::int8_t>(a.current - b.current);
  a.angle = static_cast<std::int8_t>(a.angle - b.angle);
  a.count = static_cast<std::int8_t>(a.count - b.count);
  a.temperature = static_cast<std::int8_t>(a.temperature - b.temperature);
  return a;
}

struct Naming {
  Dimension dimension;
  std::string_view name, units, usual;
};

constexpr std::array<Naming, 15> kNames{{
    {dimension::kNone, "a plain number", "1, - or %", "%"},
    {dimension::kTime, "a time", "s, ms, us, min or h", "s"},
    {{.time = -1}, "a frequency", "Hz", "Hz"},
    {dimension::kAngle, "an angle", "rad, deg or turn", "deg"},
    {dimension::kAngularVelocity, "an angular velocity", "rad/s, deg/s or rpm", "rad/s"},
    {dimension::kPressure, "a pressure", "Pa, kPa, MPa, bar, mbar, psi, atm or kg/cm2", "kg/cm2"},
    {dimension::kForce, "a force", "N, kN, kgf or lbf", "N"},
    {dimension::kTorque, "a torque", "N m or kgf cm", "N m"},
    {dimension::kLength, "a length", "m, cm, mm or in", "mm"},
    {dimension::kMass, "a mass", "kg or g", "kg"},
    {dimension::kInertia, "a moment of inertia", "kg m2 or kg cm2", "kg m2"},
    {dimension::kCount, "a number of counts", "count", "count"},
    {dimension::kCurrent, "a current", "A or mA", "mA"},
    {dimension::kTemperature, "a temperature", "K or degC", "degC"},
    {{.length = 1, .time = -1}, "a speed", "m/s or mm/s", "m/s"},
}};

const Naming* find_name(const Dimension& dimension) noexcept {
  const auto* found = std::ranges::find(kNames, dimension, &Naming::dimension);
  return found == kNames.end() ? nullptr : found;
}

}  // namespace

std::optional<Unit> parse_compound_unit(std::string_view text) noexcept {
  if (const auto unit = parse_unit(text)) return unit;
  const std::size_t slash = text.rfind('/');
  if (slash == std::string_view::npos) return std::nullopt;
  const auto above = parse_unit(trim(text.substr(0, slash)));
  const auto below = parse_unit(trim(text.substr(slash + 1)));
  if (!above || !below || above->offset != 0 || below->offset != 0) return std::nullopt;
  return Unit{.dimension = minus(above->dimension, below->dimension), .scale = above->scale / below->scale};
}

Quantity parse_quantity(std::string_view text) {
  Quantity quantity;
  text = trim(text);
  if (text.starts_with('+')) text.remove_prefix(1);
  double number = 0;
  const auto [end, error] = fast_float::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc() || end == text.data()) {
    quantity.problem = Quantity::Problem::kNoNumber;
    return quantity;
  }
  quantity.unit_text = std::string(trim(text.substr(static_cast<std::size_t>(end - text.data()))));
  const auto unit = parse_compound_unit(quantity.unit_text);
  if (!std::isfinite(number)) {
    quantity.problem = Quantity::Problem::kNotFinite;
  } else if (quantity.unit_text.empty()) {
    quantity.problem = Quantity::Problem::kNoUnit;
  } else if (!unit) {
    quantity.problem = Quantity::Problem::kUnknownUnit;
  } else {
    quantity.unit = *unit;
    quantity.value = number * unit->scale + unit->offset;
    if (!std::isfinite(quantity.value)) quantity.problem = Quantity::Problem::kNotFinite;
  }
  return quantity;
}

std::string_view name_of(const Dimension& dimension) noexcept {
  const Naming* naming = find_name(dimension);
  return naming != nullptr ? naming->name : "a quantity of another kind";
}

std::string_view units_of(const Dimension& dimension) noexcept {
  const Naming* naming = find_name(dimension);
  return naming != nullptr ? naming->units : "SI units";
}

std::string_view usual_unit(const Dimension& dimension) noexcept {
  const Naming* naming = find_name(dimension);
  return naming != nullptr ? naming->usual : "1";
}

std::string exact_number(double value) {
  if (std::isnan(value)) return std::signbit(value) ? "-nan" : "nan";
  if (std::isinf(value)) return value < 0 ? "-inf" : "inf";
  std::array<char, 32> buffer{};
  const auto result = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value);
  std::string text(buffer.data(), result.ptr);
  if (text.find_first_of(".e") == std::string::npos) text += ".0";  // else TOML would read an integer
  return text;
}

std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, replaced});
    }
  }
  return row[b.size()];
}

}  // namespace isac::record
