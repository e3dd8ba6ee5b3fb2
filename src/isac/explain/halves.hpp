/// @file
/// Is an effect of the forces the same in both directions of motion, in both halves of the angle, of the pressures, of the time? One that was taken for
/// what it is like on the whole is seldom like it in both halves.
///
///   d_j = s ∂y_pred/∂q_j   weighted and projected off all that was fitted, the effect's own slopes with it;  s = ±1 by half, 0 in neither
///   g_j = −Σ d_j r,  V_jk = Σ w d_j d_k,  G_jk = Σ d_j d_k      r = y_pred − y, w the noise's density in the row's chain
///   χ² = gᵀ V⁻¹ g on rank V degrees of freedom, told as the sigma of a normal law that is as seldom;  share² = gᵀ G⁻¹ g / Σ x²
///
/// q: the effect's free parameters, each of which may be another in either half; x: all that it does. A share of 0.04 closes what 4 % of the effect would.
/// A half is cut at the median of the rows that the effect changes; what is at rest is in neither direction. A half that holds next to nothing of the
/// effect says nothing. Only rows of forces and of the motion are asked: right names of valves differ between rows near a step of the reference and
/// far from it by far more than noise, and are held against any valve instead (any_valve.hpp). Nor is an effect asked whose states are read off the data.
/// Units: shares, sigma. Threads: uses up to `threads`. Errors: none; empty where nothing is to be asked.
/// Source: a score test of an interaction, Rao 1948; Wilson and Hilferty 1931 for the sigma; docs/derivations/explain.md.
#pragma once

#include <string>
#include <vector>

#include "isac/explain/refine.hpp"

namespace isac::explain {

struct Halves {
  std::string where;  ///< "in one direction of motion and in the other"
  double sigma = 0;   ///< that it differs by; about −1 to 1 where it does not
  double share = 0;   ///< of the effect, that the difference is worth
};

/// By each thing that may differ, the surest first. `place`: around the fit that names it; `effect`: index in its model's effects.
[[nodiscard]] std::vector<Halves> halves_of(const Around& place, std::size_t effect, int threads = 1);

/// By more than a right name's own error, as a share of what it does? Its own equation is right to less than a hundredth.
[[nodiscard]] bool differs_by_half(const Halves& halves, double own_error = 0.01) noexcept;

}  // namespace isac::explain
