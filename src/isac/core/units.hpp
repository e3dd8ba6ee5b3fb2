/// @file
/// Physical units: a unit is a dimension and the factor (and, for temperatures, the offset) that leads to SI.
///
///   value_SI = value · scale + offset
///
/// Grammar of a unit text: factors joined by `*` or a space, at most one `/` (everything behind it divides),
/// an integer exponent behind a factor with or without `^`: "N m", "Nm", "N*m", "kg m2", "kg m^2", "rad/s",
/// "N s/m", "m/s2". The seed's force-kilogram pressures are words of their own: kg/cm2 = kgf/cm2 = 98066.5
/// Pa, kgf = 9.80665 N, and the model's B in "N cm2/kg" means N per kgf/cm2. `-` and `1` are dimensionless,
/// `%` is 0.01. Angle (rad) and raw counts are dimensions of their own, so that `angle [m]` or `torque [rad]`
/// is an error. Units known: s ms us min h Hz; rad deg turn count; rpm; Pa kPa MPa bar mbar psi atm kg/cm2
/// kgf/cm2; N kN kgf lbf; m cm mm in; kg g; A mA; V mV; K degC; 1 - %. The exponent may also be a superscript
/// (`N cm²/kg`), `·` multiplies too. kg against cm2 (one multiplies, the other divides) is the
/// force-kilogram; kg elsewhere is a mass ("kg m2", "kg cm2"). degC stands alone only, since its zero is not
/// that of K; for differences and rates write K. Scales are quotients of exact integers wherever the
/// definition allows, so each is the nearest double.
///
/// Real time: no heap, no lock, noexcept. Errors: an unknown text gives std::nullopt.
/// Source: docs/formats.md. Example: `parse_unit("kg/cm2")->scale == 98066.5`.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

namespace isac {

/// Exponents of metre, kilogram, second, ampere, radian, count, kelvin.
struct Dimension {
  std::int8_t length = 0, mass = 0, time = 0, current = 0, angle = 0, count = 0, temperature = 0;
  friend constexpr bool operator==(const Dimension&, const Dimension&) noexcept = default;
};

struct Unit {
  Dimension dimension;
  double scale = 1.0;
  double offset = 0.0;
};

/// The unit that `text` names, or nothing.
[[nodiscard]] std::optional<Unit> parse_unit(std::string_view text) noexcept;

namespace dimension {
inline constexpr Dimension kNone{};
inline constexpr Dimension kTime{.time = 1};
inline constexpr Dimension kAngle{.angle = 1};
inline constexpr Dimension kAngularVelocity{.time = -1, .angle = 1};
inline constexpr Dimension kPressure{.length = -1, .mass = 1, .time = -2};
inline constexpr Dimension kForce{.length = 1, .mass = 1, .time = -2};
inline constexpr Dimension kTorque{.length = 2, .mass = 1, .time = -2};
inline constexpr Dimension kLength{.length = 1};
inline constexpr Dimension kMass{.mass = 1};
inline constexpr Dimension kInertia{.length = 2, .mass = 1};
inline constexpr Dimension kCount{.count = 1};
inline constexpr Dimension kCurrent{.current = 1};
inline constexpr Dimension kTemperature{.temperature = 1};
}  // namespace dimension

/// The SI unit text of a dimension that the toolkit names ("Pa", "N m", "rad/s", "-"), or nullptr for others.
[[nodiscard]] const char* si_unit_text(const Dimension& dimension) noexcept;

inline constexpr double kPascalPerKgfCm2 = 98066.5;  ///< 1 kgf/cm² in Pa (exact)
inline constexpr double kNewtonPerKgf = 9.80665;     ///< 1 kgf in N (exact)
inline constexpr double kPi = 3.14159265358979323846;

}  // namespace isac
