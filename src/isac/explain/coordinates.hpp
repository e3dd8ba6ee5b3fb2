/// @file
/// The numbers of a model that are fitted: which they are, where they stand, and within which bounds.
///
/// Units: SI; `scale` is the step in which a coordinate is told. Threads: safe on separate arguments. Errors: none.
/// Source: docs/derivations/explain.md.
#pragma once

#include <cstddef>
#include <vector>

#include "isac/explain/predict.hpp"

namespace isac::explain {

/// One fitted number of a model.
struct Coordinate {
  int base = -1;                    ///< index in the baseline, or −1
  int effect = -1, component = -1;  ///< of model.effects, else −1
  int rest = -1;                    ///< run whose resting angle it is, else −1
  double lower = 0, upper = 0, scale = 1;
  unsigned chains = 0;
  bool tolerance = false;
};

void set_value(ModelPoint& model, const Coordinate& c, double value);

/// A parameter of an effect; of a tolerance half its range is the scale.
[[nodiscard]] Coordinate effect_coordinate(const Active& active, int effect, int component, bool tolerance);

/// The baseline's parameters that enter the chains.
void add_base(const Predictor& predictor, const ModelPoint& model, unsigned chains,
              std::vector<Coordinate>& out);
/// Where within a step of the encoder each resting run stands.
void add_rest(const Predictor& predictor, ModelPoint& model, unsigned chains, std::vector<Coordinate>& out);
/// Tolerances and effects of the chains; a tolerance whose effect is in the model itself gives way to it.
void add_effects(const ModelPoint& model, std::size_t tolerances, unsigned chains,
                 std::vector<Coordinate>& out);

}  // namespace isac::explain
