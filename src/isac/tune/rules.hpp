/// @file
/// Rules for gains: Ziegler and Nichols from the ultimate gain, Chien, Hrones and Reswick from a step, the seed's procedure.
///
///   Ziegler-Nichols (seed 5.1.1)             K_P = c K_crit, T_I = c_I T_crit, T_D = c_D T_crit
///   Chien-Hrones-Reswick (seed 5.1.1)        K_P = c T_A/(K T_L), T_I = c_I T_A (reference) or c_I T_L (disturbance), T_D = c_D T_L
///   K_I = K_P/T_I, K_D = K_P T_D
///   Procedure of the arm (seed 6.3): inner P as high as the sampled torque loop bears with `inner_use` to spare, inner I to
///   10 % of overshoot of the torque at the joint, outer P as high as the modulus margin allows, outer I to 10 % of overshoot.
///
/// Units: whatever K_crit and K are given in (Pa/rad and rad/Pa). Real time: not for the loop. Threads: pure.
/// Errors: none; a latency of 0 gives infinite gains, which no caller lets through. Source: Ziegler and Nichols 1942; Chien, Hrones,
/// Reswick 1952; the numbers printed in the seed are in docs/tuning.md. Example: `ziegler_nichols({1.25, 0.175}, Form::kPid)`.
#pragma once

#include "isac/control/pid.hpp"
#include "isac/models/joint_motion.hpp"
#include "isac/tune/loop.hpp"

namespace isac::tune {

enum class Form { kP, kPi, kPid };
enum class Aim { kReference, kDisturbance };
enum class Overshoot { kNone, kTwentyPercent };

[[nodiscard]] control::PidGains<double> ziegler_nichols(const Ultimate& critical, Form form) noexcept;

/// `plant_gain` is K of the step: output per input at rest.
[[nodiscard]] control::PidGains<double> chien_hrones_reswick(const models::StepShape<double>& step,
                                                             double plant_gain, Form form, Aim aim,
                                                             Overshoot overshoot) noexcept;

enum class Controllability { kEasy, kFair, kHard };
/// T_L/T_A: easy below 0.1, hard above 0.8 (seed 4.2).
[[nodiscard]] Controllability controllability(const models::StepShape<double>& step) noexcept;
[[nodiscard]] const char* describe(Controllability verdict) noexcept;

}  // namespace isac::tune
