#include "isac/report/parameters.hpp"

#include <cmath>

#include "isac/report/text.hpp"

namespace isac::report {

void add_parameters(Document& page, std::span<const Estimated> parameters, const std::string& caption) {
  Table table{.caption = caption,
              .columns = {{"Parameter"},
                          {"Value", true},
                          {"± standard error", true},
                          {"95 % from", true},
                          {"to", true},
                          {"Unit"},
                          {"Relative error (%)", true}},
              .rows = {},
              .emphasised = {}};
  std::vector<std::string> refused, without_error;
  for (const Estimated& parameter : parameters) {
    if (!parameter.identifiable) {
      table.emphasised.push_back(table.rows.size());
      table.rows.push_back(
          {parameter.name, "not identified", "–", "–", "–", pretty_unit(parameter.unit), "–"});
      refused.push_back(parameter.name + ": " + parameter.reason);
      continue;
    }
    if (!parameter.reason.empty()) without_error.push_back(parameter.name + ": " + parameter.reason);
    const Rounded shown = with_error(parameter.value, parameter.std_error);
    const double relative = 100 * std::abs(parameter.std_error / parameter.value);
    table.rows.push_back({parameter.name, shown.value, shown.error,
                          to_error_digit(parameter.ci_low, parameter.std_error),
                          to_error_digit(parameter.ci_high, parameter.std_error), pretty_unit(parameter.unit),
                          std::isfinite(relative) ? number(relative, 2) : "–"});
  }
  if (table.rows.empty()) return;
  page.table(table);
  page.box(BoxKind::kWarning, "Refused: the runs cannot tell", refused);
  page.box(BoxKind::kNote, "Part of the model, without an error", without_error);
}

std::vector<std::string> warning_texts(const Warnings& warnings) {
  std::vector<std::string> out;
  for (const Warning& warning : warnings) out.push_back(warning.text);
  return out;
}

std::string in_words(const Estimated& parameter) {
  if (!parameter.identifiable || !std::isfinite(parameter.value)) return "not identified";
  const Rounded shown = with_error(parameter.value, parameter.std_error);
  const std::string unit = pretty_unit(parameter.unit);
  return shown.value + (shown.error == "–" ? "" : " ± " + shown.error) + (unit.empty() ? "" : " " + unit) +
         (parameter.reason.empty() ? "" : " (" + parameter.reason + ")");
}

}  // namespace isac::report
