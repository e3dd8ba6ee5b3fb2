#include "isac/explain/number_doubts.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string_view>
#include <utility>

namespace isac::explain {
namespace {

constexpr double kNoDifference = 2.0, kByItself = 1.645;  // standard errors

/// The pairs of an effect that differs by direction, or none.
std::vector<std::pair<const Estimated*, const Estimated*>> pairs_of(const std::vector<Estimated>& numbers) {
  constexpr std::string_view kUp = "_up", kDown = "_down";
  std::vector<std::pair<const Estimated*, const Estimated*>> pairs;
  for (const Estimated& up : numbers) {
    if (!std::string_view(up.name).ends_with(kUp)) continue;
    const std::string other = up.name.substr(0, up.name.size() - kUp.size()) + std::string(kDown);
    for (const Estimated& down : numbers)
      if (down.name == other) pairs.emplace_back(&up, &down);
  }
  return pairs;
}

bool differ_by_nothing(const Estimated& a, const Estimated& b) {
  return std::abs(a.value - b.value) <
         kNoDifference * std::hypot(a.std_error, b.std_error);  // false without an error
}

/// Stribeck friction whose T_s is as good as T_c.
bool falls_by_nothing(const std::vector<Estimated>& numbers) {
  const auto named = [&](std::string_view name) {
    return std::find_if(numbers.begin(), numbers.end(), [&](const Estimated& e) { return e.name == name; });
  };
  const auto sliding = named("T_c"), rest = named("T_s");
  return sliding != numbers.end() && rest != numbers.end() && differ_by_nothing(*sliding, *rest);
}

}  // namespace

std::vector<std::string> doubts_of_numbers(const models::EffectInfo& effect,
                                           const std::vector<Estimated>& numbers) {
  std::vector<std::string> doubts;
  if (numbers.size() != static_cast<std::size_t>(effect.parameter_count)) return doubts;
  const auto pairs = pairs_of(numbers);
  bool alike = !pairs.empty();
  for (const auto& [up, down] : pairs) alike = alike && differ_by_nothing(*up, *down);
  if (alike)
    doubts.emplace_back("Nothing in it differs by direction beyond its error: it may be something simpler.");
  if (falls_by_nothing(numbers))
    doubts.emplace_back(
        "Its friction falls from rest to speed by no more than its error: it may be something simpler.");
  int amplitudes = 0;
  bool any_error = false;
  for (int i = 0; i < effect.parameter_count; ++i) {
    const double nothing = effect.parameters[i].null_value;
    const Estimated& e = numbers[static_cast<std::size_t>(i)];
    if (!std::isfinite(nothing)) continue;
    ++amplitudes;
    if (!std::isfinite(e.std_error)) continue;
    any_error = true;
    if (std::abs(e.value - nothing / effect.parameters[i].si_per_unit) >= kByItself * e.std_error)
      return doubts;
  }
  if (any_error && amplitudes > 1)
    doubts.emplace_back(
        "None of its numbers is told by itself, only what they make together: it may be something simpler.");
  return doubts;
}

}  // namespace isac::explain
