/// @file
/// What could be missing: every effect of the catalogue, each with the ways in which it may enter a rig and the shapes from
/// which its search starts.
///
/// A hypothesis is an effect's equation (models/effects.hpp) and a reading of it: whether the force sensors see it, and which
/// clock its time is (of the run or of the day). Several readings of one effect share its id; the best one speaks for it.
/// A shape is a set of values for the parameters that are not amplitudes (width, time constant, onset), at which the response
/// to an amplitude is computed; the grids follow what the data reaches. Tolerances are effects that every rig has in small:
/// half a sample of skew, a valve's clock that runs a sample ahead; they are bounded and never named.
/// Units: SI. Threads: values. Errors: none. Source: docs/effects.md, docs/derivations/explain.md.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "isac/explain/kinship.hpp"
#include "isac/explain/prepared.hpp"
#include "isac/models/effect_hooks.hpp"

namespace isac::explain {

using Values = std::array<double, models::kMaxEffectParameters>;

enum class Clock : unsigned char { kRun, kDay };
enum class SeenBy : unsigned char { kForceSensors, kMotionOnly };

/// Chains as bits.
[[nodiscard]] constexpr unsigned bit(Chain chain) noexcept {
  return 1U << static_cast<unsigned>(chain);
}
inline constexpr unsigned kPressureChains = bit(Chain::kPressure1) | bit(Chain::kPressure2);
inline constexpr unsigned kForceChains = bit(Chain::kTorque) | bit(Chain::kMotion);
inline constexpr unsigned kAllChains = kPressureChains | kForceChains;
/// Forces hang together with the motion, and pressures with one another: what enters the one shows or leaves something in the other.
[[nodiscard]] constexpr unsigned together_with(unsigned chains) noexcept {
  return ((chains & kForceChains) != 0 ? kForceChains : 0U) |
         ((chains & kPressureChains) != 0 ? kPressureChains : 0U);
}

struct Hypothesis {
  int effect = -1;  ///< index in the catalogue
  Clock clock = Clock::kRun;
  SeenBy seen_by = SeenBy::kForceSensors;
  bool dry = false;  ///< its torque jumps with the direction of motion
  bool reads_angle = false, reads_force = false, reads_pressure = false;  ///< sensors that it changes
  bool shifts_force = false;   ///< a force's reading by as much, whatever the force
  unsigned chains = 0;         ///< that it changes
  std::vector<Values> shapes;  ///< starts; amplitudes at their typical values
  Values lower{}, upper{};
  std::array<bool, models::kMaxEffectParameters> free{};  ///< fitted; the others stay as the shape says
  std::array<bool, models::kMaxEffectParameters>
      amplitude{};  ///< the effect is absent with these at their null

  [[nodiscard]] const models::EffectInfo& info() const noexcept {
    return models::effect_catalogue()[static_cast<unsigned>(effect)];
  }
  /// The effect that is named: another form of it speaks under its id.
  [[nodiscard]] std::string id() const {
    return info().reported_as != nullptr ? info().reported_as : info().id;
  }
  [[nodiscard]] int parameters() const noexcept;  ///< how many are free
};

/// An effect in a model, with values.
struct Active {
  const Hypothesis* hypothesis = nullptr;
  Values values{};
  bool as_known_beforehand =
      false;  ///< without states that the data themselves would have to tell: what is tested owes nothing to its noise
};

/// Does a prediction of it read states off the data (where what hangs on a compliance stood when a recording began)?
[[nodiscard]] bool has_fitted_states(const Hypothesis& hypothesis) noexcept;

/// Values at which the effect is absent, shape parameters as given.
[[nodiscard]] Values null_values(const Hypothesis& hypothesis, const Values& shape);

struct Library {
  std::vector<Hypothesis> hypotheses;
  std::vector<Hypothesis> tolerances;
  std::vector<std::string> not_testable;  ///< ids that this data cannot show
};

/// All of the catalogue that the data can speak of, without `excluded` ids (and without what is the baseline's own).
[[nodiscard]] Library make_library(const Prepared& data, const std::vector<std::string>& excluded = {});

/// Makes an effect a tolerance within bounds, or gives one that is there other bounds.
void tolerate(Library& library, const Prepared& data, const std::string& id, double low, double high);

}  // namespace isac::explain
