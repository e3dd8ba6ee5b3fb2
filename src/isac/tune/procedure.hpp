/// @file
/// The cascade's gains without a search: the seed's procedure for the arm (I2, 6.3), and Ziegler-Nichols on the position loop.
///
///   inner P   B r (K_Pτ + K_Iτ h/2) = 0.4: of the sampled loop's border of 1 (control/stability.hpp); the arm's joints used 0.39 to 0.43
///   inner I   modelled torque's time constant (1 + a)/(B r K_Iτ) = one interval of the outer loop ("a fast reaching of the desired
///             value, before the position controller sends a new one"), less if its overshoot would reach 10 %
///   outer P   half of K_crit of the position loop around the closed torque loop, less until the simulated step overshoots 5 % at most
///   outer I   raised until the simulated step overshoots 10 %, or to 2/s of the outer P
///   limits    as they stand in the model (± 2 kg/cm²)
/// Chien-Hrones-Reswick has no answer for the position loop of PI-MBPI: its torque loop takes the spring away, and a joint that
/// does not come to rest has no T_A. That is why "none of the common tuning methods seemed to work" (5.3.1).
///
/// Units: SI. Threads: pure. Errors: nothing where the position loop has no ultimate gain. Source: seed 5.3.1, 6.3.
/// Example: `tune_by_procedure(joint)->position.proportional`.
#pragma once

#include <optional>

#include "isac/tune/closed_loop.hpp"
#include "isac/tune/loop.hpp"

namespace isac::tune {

/// K_Pτ and K_Iτ as above; `torque` of the result only.
[[nodiscard]] control::PidGains<double> inner_gains(const JointModel& joint,
                                                    const Sampling& sampling = {}) noexcept;

/// `keep_inner`: the torque loop's gains are these and stay.
[[nodiscard]] std::optional<Gains> tune_by_procedure(const JointModel& joint,
                                                     const ClosedLoopOptions& options = {},
                                                     const control::PidGains<double>* keep_inner = nullptr);

/// Position loop PI by Ziegler-Nichols around the torque loop of these inner gains.
[[nodiscard]] std::optional<Gains> tune_outer_by_ziegler_nichols(const JointModel& joint,
                                                                 const control::PidGains<double>& inner,
                                                                 const Sampling& sampling = {});

}  // namespace isac::tune
