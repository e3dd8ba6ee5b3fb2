#include "isac/core/units.hpp"

#include <cstddef>

namespace isac {
namespace {

// A unit's scale is kept as numerator / denominator, both exact in a double wherever the definition allows,
// so that products such as kgf/cm2 = 980665·10⁴/10⁵ come out correctly rounded: 98066.5, not 98066.49999.
struct Word {
  std::string_view text;
  Dimension dimension;
  double numerator;
  double denominator;
  double offset = 0.0;
};

constexpr Dimension kVoltage{.length = 2, .mass = 1, .time = -3, .current = -1};
constexpr Dimension kFrequency{.time = -1};

constexpr Word kWords[] = {
    {"s", dimension::kTime, 1, 1},
    {"ms", dimension::kTime, 1, 1e3},
    {"us", dimension::kTime, 1, 1e6},
    {"min", dimension::kTime, 60, 1},
    {"h", dimension::kTime, 3600, 1},
    {"Hz", kFrequency, 1, 1},
    {"rad", dimension::kAngle, 1, 1},
    {"deg", dimension::kAngle, kPi, 180},
    {"turn", dimension::kAngle, 2 * kPi, 1},
    {"rpm", dimension::kAngularVelocity, kPi, 30},
    {"count", dimension::kCount, 1, 1},
    {"Pa", dimension::kPressure, 1, 1},
    {"kPa", dimension::kPressure, 1e3, 1},
    {"MPa", dimension::kPressure, 1e6, 1},
    {"bar", dimension::kPressure, 1e5, 1},
    {"mbar", dimension::kPressure, 1e2, 1},
    {"atm", dimension::kPressure, 101325, 1},
    // psi = lbf/in2 = 4.4482216152605 N / (0.0254 m)², both factors exact by definition.
    {"psi", dimension::kPressure, 44482216152605.0, 6451600000.0},
    {"N", dimension::kForce, 1, 1},
    {"kN", dimension::kForce, 1e3, 1},
    {"kgf", dimension::kForce, 980665, 1e5},
    {"lbf", dimension::kForce, 44482216152605.0, 1e13},
    {"Nm", dimension::kTorque, 1, 1},
    {"m", dimension::kLength, 1, 1},
    {"cm", dimension::kLength, 1, 1e2},
    {"mm", dimension::kLength, 1, 1e3},
    {"in", dimension::kLength, 254, 1e4},
    {"kg", dimension::kMass, 1, 1},
    {"g", dimension::kMass, 1, 1e3},
    {"A", dimension::kCurrent, 1, 1},
    {"mA", dimension::kCurrent, 1, 1e3},
    {"V", kVoltage, 1, 1},
    {"mV", kVoltage, 1, 1e3},
    {"K", dimension::kTemperature, 1, 1},
    {"degC", dimension::kTemperature, 1, 1, 273.15},
    {"1", dimension::kNone, 1, 1},
    {"%", dimension::kNone, 1, 1e2},
};

constexpr int kLargestExponent = 9;

const Word* find_word(std::string_view text) noexcept {
  for (const Word& word : kWords) {
    if (word.text == text) return &word;
  }
  return nullptr;
}

bool is_letter(char c) noexcept {
  return (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z');
}
bool is_digit(char c) noexcept {
  return c >= '0' && c <= '9';
}

struct Factor {
  const Word* word = nullptr;
  int exponent = 1;
};

// What has been multiplied so far; exponents as int so that no int8 can overflow on the way.
struct Product {
  int length = 0, mass = 0, time = 0, current = 0, angle = 0, count = 0, temperature = 0;
  double numerator = 1.0;
  double denominator = 1.0;

  void multiply(const Word& word, int exponent) noexcept {
    length += word.dimension.length * exponent;
    mass += word.dimension.mass * exponent;
    time += word.dimension.time * exponent;
    current += word.dimension.current * exponent;
    angle += word.dimension.angle * exponent;
    count += word.dimension.count * exponent;
    temperature += word.dimension.temperature * exponent;
    const bool divides = exponent < 0;
    for (int i = divides ? -exponent : exponent; i > 0; --i) {
      numerator *= divides ? word.denominator : word.numerator;
      denominator *= divides ? word.numerator : word.denominator;
    }
  }

  [[nodiscard]] std::optional<Unit> unit() const noexcept {
    for (int exponent : {length, mass, time, current, angle, count, temperature}) {
      if (exponent < -127 || exponent > 127) return std::nullopt;
    }
    const double scale = numerator / denominator;
    if (!(scale > 1e-60 && scale < 1e60)) return std::nullopt;  // no physical unit; also stops 0 and infinity
    const auto narrow = [](int exponent) { return static_cast<std::int8_t>(exponent); };
    return Unit{.dimension = {.length = narrow(length),
                              .mass = narrow(mass),
                              .time = narrow(time),
                              .current = narrow(current),
                              .angle = narrow(angle),
                              .count = narrow(count),
                              .temperature = narrow(temperature)},
                .scale = scale,
                .offset = 0.0};
  }
};

class Parser {
 public:
  explicit Parser(std::string_view text) noexcept : p_(text.data()), end_(text.data() + text.size()) {}

  std::optional<Unit> parse() noexcept {
    bool divided = false;
    for (;;) {
      skip_spaces();
      Factor factor;
      if (!read_factor(factor)) return std::nullopt;
      if (divided) factor.exponent = -factor.exponent;
      if (size_ == kMostFactors) return std::nullopt;
      factors_[size_++] = factor;
      const bool space = skip_spaces();
      if (p_ == end_) return multiply_all();
      if (*p_ == '/') {
        if (divided) return std::nullopt;  // "a/b/c" is ambiguous; "a/b c" is not
        divided = true;
        ++p_;
      } else if (*p_ == '*') {
        ++p_;
      } else if (middle_dot()) {
        p_ += 2;
      } else if (!space) {
        return std::nullopt;
      }
    }
  }

 private:
  static constexpr std::size_t kMostFactors = 12;

  bool skip_spaces() noexcept {
    const char* begin = p_;
    while (p_ != end_ && *p_ == ' ') ++p_;
    return p_ != begin;
  }

  // "·" and the superscripts "²", "³" are two bytes in UTF-8, the first of them 0xC2.
  [[nodiscard]] bool two_bytes(unsigned char second) const noexcept {
    return end_ - p_ >= 2 && static_cast<unsigned char>(p_[0]) == 0xC2 &&
           static_cast<unsigned char>(p_[1]) == second;
  }
  [[nodiscard]] bool middle_dot() const noexcept { return two_bytes(0xB7); }

  bool read_factor(Factor& factor) noexcept {
    const char* begin = p_;
    const bool bare =
        p_ != end_ && (*p_ == '1' || *p_ == '%');  // these two take no exponent: "12" is no unit
    if (bare) {
      ++p_;
    } else {
      while (p_ != end_ && is_letter(*p_)) ++p_;
    }
    factor.word = find_word({begin, static_cast<std::size_t>(p_ - begin)});
    return factor.word != nullptr && (bare || read_exponent(factor));
  }

  bool read_exponent(Factor& factor) noexcept {
    if (two_bytes(0xB2) || two_bytes(0xB3)) {
      factor.exponent = two_bytes(0xB2) ? 2 : 3;
      p_ += 2;
      return true;
    }
    const bool caret = p_ != end_ && *p_ == '^';
    if (caret) ++p_;
    const bool minus = p_ != end_ && *p_ == '-';
    if (minus) ++p_;
    if (p_ == end_ || !is_digit(*p_)) return !caret && !minus;
    factor.exponent = *p_++ - '0';
    if (factor.exponent == 0 || (p_ != end_ && is_digit(*p_))) return false;
    static_assert(kLargestExponent == 9);  // one digit
    if (minus) factor.exponent = -factor.exponent;
    return true;
  }

  // kg against cm2 (one multiplies, the other divides) is the seed's kilogram of force: kg/cm2, N cm2/kg.
  [[nodiscard]] bool kilogram_is_force() const noexcept {
    int kg = 0;
    int cm = 0;
    for (std::size_t i = 0; i < size_; ++i) {
      if (factors_[i].word->text == "kg") kg += factors_[i].exponent;
      if (factors_[i].word->text == "cm") cm += factors_[i].exponent;
    }
    return (kg == 1 && cm == -2) || (kg == -1 && cm == 2);
  }

  std::optional<Unit> multiply_all() noexcept {
    const bool force = kilogram_is_force();
    Product product;
    for (std::size_t i = 0; i < size_; ++i) {
      const Word& word = *factors_[i].word;
      if (word.offset != 0.0 && (size_ > 1 || factors_[i].exponent != 1))
        return std::nullopt;  // "degC/s": write K/s
      product.multiply(force && word.text == "kg" ? *find_word("kgf") : word, factors_[i].exponent);
    }
    std::optional<Unit> unit = product.unit();
    if (unit) unit->offset = factors_[0].word->offset;
    return unit;
  }

  const char* p_;
  const char* end_;
  Factor factors_[kMostFactors];
  std::size_t size_ = 0;
};

struct NamedDimension {
  Dimension dimension;
  const char* text;
};

constexpr NamedDimension kSiTexts[] = {
    {dimension::kNone, "-"},
    {dimension::kTime, "s"},
    {dimension::kAngle, "rad"},
    {dimension::kAngularVelocity, "rad/s"},
    {{.time = -2, .angle = 1}, "rad/s2"},
    {dimension::kPressure, "Pa"},
    {{.length = -1, .mass = 1, .time = -3}, "Pa/s"},
    {dimension::kForce, "N"},
    {dimension::kTorque, "N m"},
    {dimension::kLength, "m"},
    {{.length = 1, .time = -1}, "m/s"},
    {{.length = 1, .time = -2}, "m/s2"},
    {{.length = 2}, "m2"},
    {{.length = 3}, "m3"},
    {dimension::kMass, "kg"},
    {dimension::kInertia, "kg m2"},
    {dimension::kCount, "count"},
    {{.time = -1, .count = 1}, "count/s"},
    {dimension::kCurrent, "A"},
    {kVoltage, "V"},
    {dimension::kTemperature, "K"},
    {kFrequency, "1/s"},
    {{.mass = 1, .time = -2}, "N/m"},
    {{.mass = 1, .time = -1}, "N s/m"},
    {{.length = 2, .mass = 1, .time = -1}, "N m s"},
    {{.length = 2, .mass = 1, .time = 1}, "N m s3"},
    {{.length = 2, .mass = 1, .time = -2, .angle = -1}, "N m/rad"},
    {{.length = 2, .mass = 1, .time = -1, .angle = -1}, "N m s/rad"},
};

}  // namespace

std::optional<Unit> parse_unit(std::string_view text) noexcept {
  while (!text.empty() && text.front() == ' ') text.remove_prefix(1);
  while (!text.empty() && text.back() == ' ') text.remove_suffix(1);
  if (text == "-") return Unit{};
  return Parser(text).parse();
}

const char* si_unit_text(const Dimension& dimension) noexcept {
  for (const NamedDimension& named : kSiTexts) {
    if (named.dimension == dimension) return named.text;
  }
  return nullptr;
}

}  // namespace isac
