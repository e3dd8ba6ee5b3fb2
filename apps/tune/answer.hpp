/// @file
/// What isac-tune answers, as JSON (isac.tune/1, docs/tuning.md). Units stand beside the numbers. Throws: std::bad_alloc only.
#pragma once

#include <string>

#include "isac/tune/plant_fit.hpp"
#include "isac/tune/relay.hpp"
#include "isac/tune/tuning.hpp"
#include "tune/inputs.hpp"
#include "tune/rig_loop.hpp"

namespace isac::apps {

struct TuneAnswer {
  std::string method, rule, log, deployed;
  const TunedJoint* joint = nullptr;     ///< null: nothing could be tuned
  const tune::Tuning* tuning = nullptr;  ///< null: refused before
  const tune::PlantFit* fit = nullptr;   ///< null: no experiment
  const RigRunOutcome* run = nullptr;
  tune::DescribingFunction describing{};  ///< of a relay
  std::string refusal;                    ///< why the old gains stay; empty: new ones
  Warnings warnings;
};

[[nodiscard]] std::string format_tuning(const TuneAnswer& answer);

}  // namespace isac::apps
