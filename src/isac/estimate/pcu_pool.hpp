/// @file
/// One number from many steps: weighted by what each step knows, wider where the steps differ by more than that.
///
/// Internal to the room `estimate`. Threads: pure functions. Errors: none.
/// Source: docs/derivations/pcu_fit.md (inverse variances; DerSimonian and Laird where Cochran's Q is significant).
#pragma once

#include <string>
#include <vector>

#include "isac/estimate/pcu_fit.hpp"

namespace isac::estimate {

/// Pools the identifiable ones; refused with the reason of the first when there is none. `heterogeneous` tells whether the
/// values differ by more than their errors. `with_next[i]` is the covariance of the values i and i + 1 (empty: none).
[[nodiscard]] Estimated pool(const std::vector<Estimated>& values, const std::vector<double>& with_next,
                             const std::string& name, bool& heterogeneous);

/// Fills PcuFit::parameters, directions_differ and the warnings about differing steps.
void pool_steps(PcuFit& fit);

}  // namespace isac::estimate
