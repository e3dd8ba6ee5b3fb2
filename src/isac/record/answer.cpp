#include "isac/record/answer.hpp"

#include <cmath>
#include <nlohmann/json.hpp>

namespace isac::record {
namespace {

using Json = nlohmann::ordered_json;

Json number(double value) {
  return std::isfinite(value) ? Json(value) : Json(nullptr);
}

/// A count is written as an integer.
Json count(double value) {
  return std::isfinite(value) && value == std::floor(value) && std::abs(value) < 9e15
             ? Json(static_cast<long long>(value))
             : number(value);
}

Json parameter(const Estimated& estimate) {
  Json out;
  out["value"] = number(estimate.value);
  out["unit"] = estimate.unit;
  out["std_error"] = number(estimate.std_error);
  out["ci95"] = {number(estimate.ci_low), number(estimate.ci_high)};
  out["identifiable"] = estimate.identifiable;
  if (!estimate.reason.empty()) out[estimate.identifiable ? "remark" : "reason"] = estimate.reason;
  return out;
}

/// Bytes that are not UTF-8 (a file name, a unit out of a foreign file) become U+FFFD instead of an exception.
std::string dump(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace

Json json_parameters(const std::vector<Estimated>& parameters) {
  Json out = Json::object();
  for (const Estimated& estimate : parameters) out[estimate.name] = parameter(estimate);
  return out;
}

std::string format_answer(const Answer& answer) {
  return format_answer(answer, Json::object());
}

std::string format_answer(const Answer& answer, const Json& extra) {
  Json out;
  out["schema"] = answer.schema;
  out["parameters"] = json_parameters(answer.parameters);
  out["fit"] = {{"rmse", number(answer.fit.rmse)},
                {"unit", answer.fit.unit},
                {"nrmse", number(answer.fit.nrmse)},
                {"samples", count(answer.fit.samples)},
                {"heldout_rmse", number(answer.fit.heldout_rmse)}};
  out["warnings"] = Json::array();
  for (const Warning& warning : answer.warnings)
    out["warnings"].push_back({{"code", warning.code}, {"text", warning.text}});
  for (const auto& [key, value] : extra.items()) out[key] = value;
  return dump(out);
}

std::string format_error(const Error& error) {
  const Place& place = error.place();
  Json out;
  out["error"] = {{"code", error.code()},
                  {"text", error.text()},
                  {"file", place.file.empty() ? Json(nullptr) : Json(place.file)},
                  {"line", place.line > 0 ? Json(place.line) : Json(nullptr)},
                  {"column", place.column > 0 ? Json(place.column) : Json(nullptr)}};
  return dump(out);
}

}  // namespace isac::record
