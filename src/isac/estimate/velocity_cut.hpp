/// @file
/// The seed's own way to C and D (3.3.2, figs 3.9 and 3.10): points of constant velocity out of the bundle, cut at φ = 0.
///
///   T − A r² φ − B r Δp = −(C φ̇³ + D φ̇) at passages through |φ| ≤ φ_c during which the speed changes by less than a fifth
///
/// One passage is one point (means of speed and torque over the same rows, spikes left out), so that points are nearly independent even under coloured noise; C and
/// D follow by least squares over the points with heteroscedastic (HC3) errors. A cross-check of the main fit, not its replacement.
/// Threads: pure. Errors: none; with fewer than eight passages C and D are not identifiable, with the reason.
#pragma once

#include <Eigen/Core>

#include "isac/estimate/joint_fit.hpp"
#include "isac/estimate/joint_rows.hpp"

namespace isac::estimate {

/// `theta`: linear then nonlinear parameters, SI; C's and D's own parts are left out of what is subtracted.
[[nodiscard]] VelocityCut velocity_cut(const JointRows& rows, const JointTerms& terms,
                                       const Eigen::VectorXd& theta);

}  // namespace isac::estimate
