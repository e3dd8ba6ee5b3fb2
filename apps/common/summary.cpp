#include "common/summary.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace isac::apps {

void print_parameters(const std::vector<Estimated>& parameters) {
  std::size_t width = 20;
  for (const Estimated& p : parameters) width = std::max(width, p.name.size());
  fmt::print("{:<{}} {:>13}  {:>11}  {:<27} {}\n", "parameter", width, "value", "std. error", "95 % interval",
             "unit");
  for (const Estimated& p : parameters) {
    if (p.identifiable) {
      const bool told = std::isfinite(p.std_error) || p.reason.empty();
      fmt::print("{:<{}} {:>13.6g}  {:>11}  {:<27} {}\n", p.name, width, p.value,
                 told ? fmt::format("{:.3g}", p.std_error) : "-",
                 told ? fmt::format("[{:.6g}, {:.6g}]", p.ci_low, p.ci_high) : p.reason, p.unit);
    } else {
      fmt::print("{:<{}} {:>13}  {}\n", p.name, width, "refused", p.reason);
    }
  }
}

void print_warnings(const Warnings& warnings) {
  constexpr std::ptrdiff_t kMost =
      2;  // of one kind; the rest is counted, and stands in the report and the JSON
  for (std::size_t i = 0; i < warnings.size(); ++i) {
    const auto same = [&](const Warning& other) { return other.code == warnings[i].code; };
    const auto here = warnings.begin() + static_cast<std::ptrdiff_t>(i);
    const auto before = std::count_if(warnings.begin(), here, same);
    const auto all = std::count_if(warnings.begin(), warnings.end(), same);
    if (before < kMost) fmt::print("! {}\n", warnings[i].text);
    if (before + 1 == kMost && all > kMost) fmt::print("! … and {} more like it\n", all - kMost);
  }
}

nlohmann::ordered_json json_number(double value) {
  return std::isfinite(value) ? nlohmann::ordered_json(value) : nlohmann::ordered_json(nullptr);
}

}  // namespace isac::apps
