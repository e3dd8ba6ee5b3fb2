/// @file
/// Answers of the programs as JSON (docs/formats.md): numbers are numbers, null where not known.
///
/// Throws: std::bad_alloc only. Example: `fmt::print("{}\n", isac::record::format_answer(answer));`
#pragma once

#include <limits>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "isac/core/error.hpp"
#include "isac/core/estimated.hpp"

namespace isac::record {

struct FitSummary {
  double rmse = std::numeric_limits<double>::quiet_NaN();
  std::string unit;
  double nrmse = std::numeric_limits<double>::quiet_NaN();  ///< rmse over the range of the output
  double samples = 0;
  double heldout_rmse = std::numeric_limits<double>::quiet_NaN();
};

struct Answer {
  std::string schema;  ///< "isac.joint/1"
  std::vector<Estimated> parameters;
  FitSummary fit;
  Warnings warnings;
};

/// {"schema":…,"parameters":{"A":{"value":…,"unit":…,"std_error":…,"ci95":[…],"identifiable":true},…},"fit":{…},
/// "warnings":[…]} and whatever `extra` (an object) adds at the end.
[[nodiscard]] std::string format_answer(const Answer& answer);
[[nodiscard]] std::string format_answer(const Answer& answer, const nlohmann::ordered_json& extra);

/// {"A":{"value":…,"unit":…,"std_error":…,"ci95":[…],"identifiable":true},…}, as under "parameters".
[[nodiscard]] nlohmann::ordered_json json_parameters(const std::vector<Estimated>& parameters);

/// {"error":{"code":…,"text":…,"file":…,"line":…,"column":…}}; unknown places are null.
[[nodiscard]] std::string format_error(const Error& error);

}  // namespace isac::record
