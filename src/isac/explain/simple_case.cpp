// A general effect held against its own simple case, whatever of the catalogue is looked for: part of the search (search_run.hpp).
#include <fmt/format.h>

#include <string_view>
#include <vector>

#include "isac/explain/labels.hpp"
#include "isac/explain/search_run.hpp"

namespace isac::explain {
namespace {

constexpr double kLeadsBy = 1.5;  // sigma that the general one leads by, as among names (ranking.cpp)

/// Numbers of an effect, held at which it is a simpler one, and what it then does not do.
struct SimpleCase {
  struct Number {
    std::size_t at;
    double value;
  };
  std::vector<Number> held;
  const char* not_told = "";
};

SimpleCase simple_case_of(std::string_view form) {
  // Falls off at once: T_c sgn φ̇ is left, whatever T_s is.
  if (form == "stribeck_friction") return {{{1, 1}, {2, 1e-9}}, "falls from rest to speed"};
  if (form == "pressure_dependent_friction") return {{{1, 0}}, "goes with the mean pressure"};
  if (form == "thermal_drift") return {{{0, 0}, {1, 0}}, "changes the stiffness or the gain"};
  return {};
}

}  // namespace

void Search::hold_against_its_simple_case() {
  for (std::size_t i = 0; i < found_.added.size(); ++i) {
    const std::size_t at = found_.model.tolerances + i;
    const Hypothesis& general = *found_.model.model.effects[at].hypothesis;
    const SimpleCase simple = simple_case_of(general.info().id);
    if (simple.held.empty() || !general.free[simple.held.front().at]) continue;
    Hypothesis held = general;
    std::vector<Active> effects(
        found_.model.model.effects.begin() + static_cast<std::ptrdiff_t>(found_.model.tolerances),
        found_.model.model.effects.end());
    effects[i].hypothesis = &held;
    for (const auto& [number, value] : simple.held) {
      held.free[number] = false;
      effects[i].values[number] = value;
    }
    const Fit fit = refit(predictor_, found_.baseline, effects, found_.weights, kRefitIterations);
    const Comparison behind =
        compare(data_, found_.model.residual, fit.residual, held.parameters() - general.parameters(),
                noise_density(data_, found_.model.residual));
    const double closed =
        (found_.baseline.residual.squaredNorm() - found_.model.residual.squaredNorm()) / behind.unit;
    const bool hardly_more = general.dry &&
                             !goes_with_pressure(general, found_.model.model.effects[at].values) &&
                             behind.separation * behind.separation < kHardlyAny * closed;
    const bool alike = behind.separation < kTwinLimit || hardly_more;
    say(fmt::format("{}: its simple case is {:.1f} sigma behind ({:.1f} sigma of data between them)",
                    general.id(), told_behind(behind), behind.separation));
    if (!alike && behind.t >= kLeadsBy) continue;
    found_.hardly_general.insert(found_.added[i]);
    found_.doubts.push_back(
        fmt::format("That {} {} is not told ({:.1f} sigma of data): it may be something simpler.",
                    general.info().term, simple.not_told, behind.separation));
  }
}

}  // namespace isac::explain
