/// @file
/// From rig.toml and params.toml to the joint that is tuned: model, what is uncertain about it, and the gains it has.
///
/// Throws isac::Error: bad input (a file cannot be used), answer is no (the file lacks what the method needs, with what to do).
#pragma once

#include <optional>
#include <string>

#include "isac/core/estimated.hpp"
#include "isac/record/params.hpp"
#include "isac/record/rig.hpp"
#include "isac/tune/assess.hpp"
#include "isac/tune/plant_fit.hpp"

namespace isac::apps {

struct TunedJoint {
  tune::JointModel model;
  std::array<double, tune::kDrawnParameters> relative_errors{};  ///< standard, of the identified values
  std::optional<tune::Gains> gains;                              ///< as they stand in the file
  std::string label;                                             ///< of the joint's section
  Warnings warnings;
};

/// `path` may be empty or missing when `needed` is false: then only the rig speaks. `label` empty: the first joint.
[[nodiscard]] std::optional<TunedJoint> read_joint(const std::string& path, const std::string& label,
                                                   const record::Rig& rig);

/// The same of a plant that an experiment found; C and p0 from `known`, where there is one.
[[nodiscard]] TunedJoint joint_of(const tune::PlantFit& fit, const record::Rig& rig,
                                  const std::optional<TunedJoint>& known);

/// `[gains]` for params.toml, in the units of docs/formats.md.
[[nodiscard]] std::vector<Estimated> gains_section(const tune::Gains& gains);

}  // namespace isac::apps
