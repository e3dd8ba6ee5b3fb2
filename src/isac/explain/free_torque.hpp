/// @file
/// Is the torque of free runs further off than that of the others?
///
///   q = mean of (T − T_model)² over a run's rows that move,   told: the largest q of free runs > (kFurther · rms of the driven runs)²
///
/// Where hand-driven and clamped runs suffice, a free joint's torque is not fitted (prepared.hpp): its own disturbance stands in its angle. What
/// moves a free joint by disturbance is next to nothing beside what a command moves it by, so that a muscle whose error shows in
/// free runs only (a bladder that lifts off at a pressure no other run falls below) must not stay unseen for that.
/// Shapes: any data, any model of it. Threads: pure. Errors: none; false where there is nothing to compare.
/// Source: docs/derivations/explain.md, "The closed loop's trap".
#pragma once

#include "isac/explain/predict.hpp"

namespace isac::explain {

[[nodiscard]] bool free_torque_is_off(const Predictor& predictor, const ModelPoint& model);

}  // namespace isac::explain
