#include "isac/report/report_head.hpp"

#include <algorithm>

#include "isac/core/error.hpp"
#include "isac/core/units.hpp"

namespace isac::report {

Document open_page(const ReportHead& head, const std::string& fallback) {
  std::string subtitle = head.rig;
  if (!head.created.empty()) subtitle += (subtitle.empty() ? "" : " · ") + head.created;
  return {head.title.empty() ? fallback : head.title, subtitle};
}

void close_page(Document& page, const ReportHead& head) {
  if (!head.command.empty()) page.paragraph("Made by: " + head.command);
}

double pressure_per_pascal(const std::string& unit) {
  const auto pressure = parse_unit(unit);
  if (!pressure || !(pressure->dimension == dimension::kPressure))
    throw Error(ErrorKind::kUsage, "unit_wrong",
                "\"" + unit + "\" is not a unit of pressure; use kg/cm2, bar, kPa or Pa");
  return 1 / pressure->scale;
}

std::vector<double> in_unit(const std::vector<double>& values, double factor) {
  std::vector<double> out(values.size());
  std::transform(values.begin(), values.end(), out.begin(), [factor](double v) { return v * factor; });
  return out;
}

}  // namespace isac::report
