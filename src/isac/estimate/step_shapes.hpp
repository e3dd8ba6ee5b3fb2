/// @file
/// Is a step response first order, and if not, which shape is it? Sizes first, significance second.
///
/// Shapes over x = s − L > 0, with the levels p_a, p_a + G:
///   second order   g = 1 − (T e^(−x/T) − T2 e^(−x/T2))/(T − T2)
///   flow limited   g = (1 − f)/T x  up to x_f = f T/(1 − f), then 1 − (1 − f) e^(−(x − x_f)/T)
///   two rates      g = 1 − (1 − f) e^(−x/T) − f e^(−x/T2)
/// Internal to the room `estimate`. Units: SI. Threads: pure functions. Errors: none.
/// Source: docs/derivations/pcu_fit.md; ids flow_limit, second_order_lag of docs/effects.md.
#pragma once

#include "isac/estimate/step_fit.hpp"

namespace isac::estimate {

/// g(x) of a shape, 0 at x ≤ 0, 1 at infinity. `second` is T2 or unused, `share` is f or unused.
[[nodiscard]] double step_shape(StepShape shape, double x, double lag, double second, double share) noexcept;

/// Fits the shape to condensed data; onset not before `earliest`.
[[nodiscard]] StepShapeFit fit_shape(StepShape shape, const StepData& data, const StepFit& first_order,
                                     double earliest);

[[nodiscard]] StepAdequacy judge_step(const StepData& data, const StepFit& fit, double earliest,
                                      double tolerance);

}  // namespace isac::estimate
