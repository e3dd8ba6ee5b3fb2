#include "isac/record/column_catalogue.hpp"

namespace isac::record {
namespace {

constexpr KnownColumn kTime{dimension::kTime, "s, ms, us or min"};
constexpr KnownColumn kAngle{dimension::kAngle, "rad, deg or turn"};
constexpr KnownColumn kVelocity{dimension::kAngularVelocity, "rad/s, deg/s or rpm"};
constexpr KnownColumn kPressure{dimension::kPressure, "Pa, kPa, MPa, bar, mbar, psi, atm or kg/cm2"};
constexpr KnownColumn kForce{dimension::kForce, "N, kN, kgf or lbf"};
constexpr KnownColumn kTorque{dimension::kTorque, "N m, Nm or kgf cm"};
constexpr KnownColumn kCount{dimension::kCount, "count"};
constexpr KnownColumn kContraction{dimension::kNone, "- or %"};
constexpr KnownColumn kTemperature{dimension::kTemperature, "degC or K"};

struct Named {
  std::string_view name;
  KnownColumn column;
};

constexpr Named kNamed[] = {
    {"time", kTime},
    {"angle", kAngle},
    {"velocity", kVelocity},
    {"p1", kPressure},
    {"p2", kPressure},
    {"p1_cmd", kPressure},
    {"p2_cmd", kPressure},
    {"pressure", kPressure},
    {"p_supply", kPressure},
    {"F1", kForce},
    {"F2", kForce},
    {"force", kForce},
    {"torque", kTorque},
    {"contraction", kContraction},
    {"temperature", kTemperature},
};

struct Family {
  std::string_view stem;
  int first;
  int last;
  KnownColumn column;
};

constexpr Family kFamilies[] = {
    {"theta", 1, 6, kAngle}, {"phi", 1, 6, kAngle}, {"tau", 1, 6, kTorque},
    {"enc", 0, 5, kCount},   {"ai", 0, 7, kCount},  {"ao", 0, 11, kCount},
};

// The number that `digits` writes without a leading zero, or -1.
int family_index(std::string_view digits) noexcept {
  if (digits.empty() || digits.size() > 2 || (digits.size() == 2 && digits[0] == '0')) return -1;
  int index = 0;
  for (char c : digits) {
    if (c < '0' || c > '9') return -1;
    index = 10 * index + (c - '0');
  }
  return index;
}

void append_power(std::string& text, const char* base, int exponent) {
  if (exponent == 0) return;
  if (!text.empty()) text += ' ';
  text += base;
  if (exponent != 1) text += std::to_string(exponent);
}

}  // namespace

std::optional<KnownColumn> find_known_column(std::string_view name) noexcept {
  for (const Named& known : kNamed) {
    if (known.name == name) return known.column;
  }
  for (const Family& family : kFamilies) {
    if (!name.starts_with(family.stem)) continue;
    const int index = family_index({name.data() + family.stem.size(), name.size() - family.stem.size()});
    if (index >= family.first && index <= family.last) return family.column;
  }
  return std::nullopt;
}

std::string si_text(const Dimension& dimension) {
  if (const char* text = si_unit_text(dimension)) return text;
  std::string text;
  append_power(text, "m", dimension.length);
  append_power(text, "kg", dimension.mass);
  append_power(text, "s", dimension.time);
  append_power(text, "A", dimension.current);
  append_power(text, "rad", dimension.angle);
  append_power(text, "count", dimension.count);
  append_power(text, "K", dimension.temperature);
  return text;
}

}  // namespace isac::record
