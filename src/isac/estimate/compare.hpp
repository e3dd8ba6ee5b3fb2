/// @file
/// Has a parameter changed, or is the difference within its uncertainty?
///
/// For a parameter known before as x₁ ± s₁ and after as x₂ ± s₂ (independent data):
///   t = (x₂ − x₁) / sqrt(s₁² + s₂²),   ν = (s₁² + s₂²)² / (s₁⁴/ν₁ + s₂⁴/ν₂)   (Welch–Satterthwaite),
/// where ν₁ and ν₂ are read off the width of the 95 % intervals (t quantile = half width / s; an interval no
/// wider than the normal one means ν = ∞, the z statistic). p-values are two-sided and corrected over all
/// parameters compared by Holm's step-down rule, which bounds the chance of a single false alarm by `alpha`
/// whatever the dependence between parameters.
///
/// Units: after is converted into before's unit; a unit of another dimension makes the pair not comparable.
/// Threads: pure function. Errors: none; what cannot be compared is said in `sentence`, its numbers are NaN.
/// Source: Welch 1947, Holm 1979. Example: `for (auto& c : compare(old_values, new_values))
/// puts(c.sentence.c_str());`
#pragma once

#include <limits>
#include <span>
#include <string>
#include <vector>

#include "isac/core/estimated.hpp"

namespace isac::estimate {

struct ParameterChange {
  std::string name;
  std::string unit;  ///< of all numbers here
  double before = std::numeric_limits<double>::quiet_NaN();
  double after = std::numeric_limits<double>::quiet_NaN();
  double std_error = std::numeric_limits<double>::quiet_NaN();  ///< of the difference
  double z = std::numeric_limits<double>::quiet_NaN();          ///< the statistic t above
  double freedom = std::numeric_limits<double>::quiet_NaN();    ///< ν, +inf for the normal law
  double p_value = std::numeric_limits<double>::quiet_NaN();    ///< after Holm's correction
  double p_raw = std::numeric_limits<double>::quiet_NaN();      ///< before it
  bool comparable = false;   ///< both values and at least one standard error are known, in one dimension
  bool significant = false;  ///< p_value < alpha
  std::string sentence;      ///< "A rose by 3.1 %, far more than its uncertainty (p = 1e-06)."
};

/// One entry per name in `before` (in that order), then one per name only in `after`.
[[nodiscard]] std::vector<ParameterChange> compare(std::span<const Estimated> before,
                                                   std::span<const Estimated> after, double alpha = 0.05);

}  // namespace isac::estimate
