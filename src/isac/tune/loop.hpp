/// @file
/// Linear loops with dead time: frequency response, stability, and the four margins.
///
///   L(s) = Σ N_k(s) e^(−τ_k s) / Σ D_k(s) e^(−τ_k s),  opened where the command goes to the valves
///   closed loop stable ⇔ F = Σ D_k e^… + Σ N_k e^… has no zero right of the axis ⇔ the argument of
///   F(jω)/(jω + ω_0)^n turns by 0 in all from ω = 0 to ∞                                   Mikhailov, retarded F of order n
///   gain margins   1/|L| at L < 0 (phase ±π): the least above 1, the greatest below 1 (a loop may also fail at too little gain)
///   phase margin   π + arg L at |L| = 1, the least of all crossings; delay margin (phase margin, of 0 … 2π)/ω, the least
///   modulus margin min |1 + L|: the distance from −1, which bounds the others: gain ≥ 1/(1 − m), phase ≥ 2 asin(m/2)
///
/// Crossings are found on a grid that is refined until the argument turns by less than 0.2 rad between neighbours, then by
/// bisection. Sampling enters as delay: half an interval of each loop (docs/derivations/tuning.md; tested against the sampled loop).
/// Units: SI, rad/s. Real time: not for the loop (allocates). Threads: pure functions. Errors: none; NaN in, "not stable" out.
/// Source: seed 5.1.3, 5.3.3; Åström and Murray, Feedback Systems, ch. 10. Example: `margins(pid_loop(joint, gains)).modulus`.
#pragma once

#include <complex>
#include <limits>
#include <optional>
#include <vector>

#include "isac/control/joint_settings.hpp"
#include "isac/tune/plant.hpp"

namespace isac::tune {

/// a_0 s^n + … + a_n, e^(−delay s) behind it.
struct DelayedPolynomial {
  std::vector<double> coefficients;
  double delay = 0;  ///< s
};

struct Loop {
  std::vector<DelayedPolynomial> numerator,
      denominator;  ///< the highest power stands in denominator[0], without delay
};

[[nodiscard]] std::vector<double> multiply(const std::vector<double>& p, const std::vector<double>& q);

struct Gains {
  control::Structure structure = control::Structure::kModelBased;
  control::ModelPressure model_pressure = control::ModelPressure::kCommanded;
  control::PidGains<double> position{}, torque{};
};

/// Δp → φ.
[[nodiscard]] Loop plant_loop(const LagPlant& plant);
[[nodiscard]] Loop plant_loop(const JointModel& joint);
/// The loop of these gains, opened at the valves' command. `believed`: what the controller takes the joint for (limits and C do
/// not enter).
[[nodiscard]] Loop control_loop(const JointModel& joint, const Gains& gains, const Sampling& sampling,
                                const JointModel& believed);
[[nodiscard]] inline Loop control_loop(const JointModel& joint, const Gains& gains,
                                       const Sampling& sampling = {}) {
  return control_loop(joint, gains, sampling, joint);
}
/// A P controller of 1 N m/rad around the closed torque loop, opened at the torque asked for.
[[nodiscard]] Loop outer_loop(const JointModel& joint, const Gains& gains, const Sampling& sampling = {});

[[nodiscard]] std::complex<double> response(const Loop& loop, double omega);
[[nodiscard]] bool is_stable(const Loop& loop);

struct Margins {
  bool stable = false;
  double gain = std::numeric_limits<double>::infinity();   ///< factor that the gain may rise by
  double gain_down = 0;                                    ///< factor that it may fall to
  double phase = std::numeric_limits<double>::infinity();  ///< rad
  double delay = std::numeric_limits<double>::infinity();  ///< s
  double modulus = 0;
  double phase_crossover = std::numeric_limits<double>::quiet_NaN();  ///< rad/s, of the gain margin
  double gain_crossover = std::numeric_limits<double>::quiet_NaN();   ///< rad/s, of the phase margin
};

[[nodiscard]] Margins margins(const Loop& loop);

struct Ultimate {
  double gain = 0;    ///< K_crit, in units of 1/L
  double period = 0;  ///< s, T_crit
};

/// The least gain at which k L oscillates for ever; nothing if no gain does.
[[nodiscard]] std::optional<Ultimate> ultimate(const Loop& loop);

struct FrequencyPoint {
  double omega = 0;  ///< rad/s
  std::complex<double> value;
};
/// L on a refined grid over all frequencies that matter, for drawing.
[[nodiscard]] std::vector<FrequencyPoint> trace_response(const Loop& loop);

}  // namespace isac::tune
