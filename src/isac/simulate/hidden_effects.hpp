/// @file
/// Hidden effects looked up in the catalogue of models/effects.hpp, with their parameters filled in.
///
/// Units: SI. Not for the loop (allocates). Errors: compile_effects throws isac::Error (usage) that names the effect, the
/// number of parameters it takes, or the effects there are.
#pragma once

#include <array>
#include <vector>

#include "isac/models/effects.hpp"
#include "isac/simulate/rig_config.hpp"

namespace isac::simulate {

struct CompiledEffect {
  int index = -1;                            ///< in the catalogue
  const models::EffectInfo* info = nullptr;  ///< of the catalogue, lives as long as the program
  std::array<double, models::kMaxEffectParameters> parameters{};
};

[[nodiscard]] std::vector<CompiledEffect> compile_effects(const std::vector<HiddenEffect>& effects);

}  // namespace isac::simulate
