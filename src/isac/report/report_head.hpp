/// @file
/// Head and pressure unit that the smaller reports share. Internal to the report room.
///
/// Units: `pressure_per_pascal` leads from Pa to the shown unit. Threads: pure. Errors: isac::Error (usage).
#pragma once

#include <string>
#include <vector>

#include "isac/report/document.hpp"
#include "isac/report/fit_reports.hpp"

namespace isac::report {

/// A page with the head's title (or `fallback`) and "rig · created" below it.
[[nodiscard]] Document open_page(const ReportHead& head, const std::string& fallback);
void close_page(Document& page, const ReportHead& head);
/// Factor from Pa to the unit named; throws when it is not a unit of pressure.
[[nodiscard]] double pressure_per_pascal(const std::string& unit);
/// The unit that a report shows pressures in.
struct ShownPressure {
  double per_pascal = 1;
  std::string unit;
};
/// Every value times `factor`.
[[nodiscard]] std::vector<double> in_unit(const std::vector<double>& values, double factor);

}  // namespace isac::report
