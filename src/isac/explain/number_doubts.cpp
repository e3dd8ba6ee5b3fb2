#include "isac/explain/number_doubts.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string_view>
#include <utility>

namespace isac::explain {
namespace {

constexpr double kNoDifference = 2.0, kByItself = 1.645;  // standard errors
constexpr double kKnownWell = 0.15;                       // of the other number

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

const Estimated* number_named(const std::vector<Estimated>& numbers, std::string_view name) {
  const auto found =
      std::find_if(numbers.begin(), numbers.end(), [&](const Estimated& e) { return e.name == name; });
  return found != numbers.end() ? &*found : nullptr;
}

/// Stribeck friction whose T_s is as good as T_c.
bool falls_by_nothing(const std::vector<Estimated>& numbers) {
  const Estimated *sliding = number_named(numbers, "T_c"), *rest = number_named(numbers, "T_s");
  return sliding != nullptr && rest != nullptr && differ_by_nothing(*sliding, *rest);
}

/// A mass that hangs beside the axis, level with it, though its G_sin is known well: about its middle the joint feels a constant torque.
bool turns_with_nothing(const std::vector<Estimated>& numbers) {
  const Estimated *with_angle = number_named(numbers, "G_sin"), *constant = number_named(numbers, "G_cos");
  return with_angle != nullptr && constant != nullptr &&
         std::abs(with_angle->value) < kByItself * with_angle->std_error &&
         with_angle->std_error < kKnownWell * std::abs(constant->value);
}

/// A warm-up in which neither the stiffness nor the gain is told to change, and a constant torque is: a zero that drifts looks like it.
bool warms_nothing_up(const std::vector<Estimated>& numbers) {
  const Estimated *stiffness = number_named(numbers, "a"), *gain = number_named(numbers, "b"),
                  *constant = number_named(numbers, "T_0");
  return stiffness != nullptr && gain != nullptr && constant != nullptr &&
         std::abs(constant->value) >= kByItself * constant->std_error &&
         std::abs(stiffness->value) < kByItself * stiffness->std_error &&
         std::abs(gain->value) < kByItself * gain->std_error;
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
  if (turns_with_nothing(numbers))
    doubts.emplace_back(
        "It turns with the angle by no more than its error: a constant torque, or two that nearly cancel in "
        "the force readings, would look like it.");
  if (warms_nothing_up(numbers))
    doubts.emplace_back(
        "Neither stiffness nor gain is told to change with it, only a constant torque: a zero that drifts "
        "looks like it.");
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
