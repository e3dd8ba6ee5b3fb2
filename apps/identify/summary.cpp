#include "identify/summary.hpp"

#include <fmt/format.h>

#include <cmath>

namespace isac::apps {

void print_parameters(const std::vector<Estimated>& parameters) {
  fmt::print("{:<20} {:>13}  {:>11}  {:<27} {}\n", "parameter", "value", "std. error", "95 % interval",
             "unit");
  for (const Estimated& p : parameters) {
    if (p.identifiable) {
      fmt::print("{:<20} {:>13.6g}  {:>11.3g}  {:<27} {}\n", p.name, p.value, p.std_error,
                 fmt::format("[{:.6g}, {:.6g}]", p.ci_low, p.ci_high), p.unit);
    } else {
      fmt::print("{:<20} {:>13}  {}\n", p.name, "refused", p.reason);
    }
  }
}

void print_warnings(const Warnings& warnings) {
  for (const Warning& warning : warnings) fmt::print("! {}\n", warning.text);
}

nlohmann::ordered_json json_number(double value) {
  return std::isfinite(value) ? nlohmann::ordered_json(value) : nlohmann::ordered_json(nullptr);
}

}  // namespace isac::apps
