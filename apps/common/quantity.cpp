#include "common/quantity.hpp"

#include <cmath>
#include <cstdlib>

#include "isac/core/error.hpp"

namespace isac::apps {

double parse_quantity(const std::string& text, const Dimension& wanted, const std::string& option) {
  const char* si = si_unit_text(wanted);
  const std::string example =
      std::string("a number with its unit, e.g. \"1.5 ") + (si != nullptr ? si : "-") + "\"";
  char* end = nullptr;
  const double number = std::strtod(text.c_str(), &end);
  if (end == text.c_str() || !std::isfinite(number)) {
    throw Error(ErrorKind::kUsage, "quantity", option + " '" + text + "' is not " + example);
  }
  std::string unit(end);
  unit.erase(0, unit.find_first_not_of(' '));
  const auto parsed = parse_unit(unit);
  if (!parsed || !(parsed->dimension == wanted)) {
    throw Error(ErrorKind::kUsage, "quantity_unit",
                option + " '" + text + "' has the unit '" + unit + "'; it takes " + example);
  }
  return number * parsed->scale + parsed->offset;
}

}  // namespace isac::apps
