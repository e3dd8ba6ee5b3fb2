/// @file
/// Takes spikes out of the output before the parallel filter of joint_rows.hpp could smear them.
///
///   r = y − X θ_pilot,   spike: |r_i − m_i| > max(6 s(r − m), 4 s(r)),   m_i the median of r_{i−3} … r_{i+3}, s robust deviation
///
/// Internal to the room `estimate`. Units: of the regressors and the output. Threads: pure functions. Errors: none.
/// Source: Hampel's identifier; Huber's weights for the pilot.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "isac/estimate/row_columns.hpp"

namespace isac::estimate {

/// A robust fit to some 20 000 rows, good enough to tell a spike from motion. Needs RunColumns::x.
[[nodiscard]] Eigen::VectorXd pilot_fit(const std::vector<RunColumns>& runs, std::size_t terms);

/// Moves the spikes of y onto the median of the pilot's residual; returns how many samples were replaced.
std::size_t remove_output_spikes(const RunColumns& run, const Eigen::VectorXd& pilot, std::vector<double>& y);

}  // namespace isac::estimate
