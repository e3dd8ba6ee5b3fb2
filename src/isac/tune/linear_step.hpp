/// @file
/// The third-order lag in time, exactly: answers to a command that holds between samples, and the tangent of its step.
///
///   x' = A x + b u(t − L); between two samples the delayed command changes at most once, so two matrix exponentials are exact
///   means over n rows: Σ_i φ(t_k+i) = R_n x_k + Σ_j c_j u_k+j,  x_k+n = Φ_n x_k + Σ_j Γ_j u_k+j; what does not depend on x is one product of matrices
///   T_L = L + t_i − y(t_i)/ẏ(t_i),  T_A = K/ẏ(t_i),  t_i where ẏ of the unit step is greatest                  seed 4.2, figure 4.4
///
/// Units: SI; commands in Pa, angles in rad. Real time: not for the loop. Threads: pure.
/// Errors: an answer that is not finite for impossible plants (times ≤ 0). Source: docs/derivations/tuning.md.
/// Example: `step_shape(plant).latency`.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "isac/models/joint_motion.hpp"
#include "isac/tune/plant.hpp"

namespace isac::tune {

/// φ at every sample of a command on an even grid, from rest at command[0]; φ(t_0) = 0. command[k] acts from t_k + L on.
/// L < 0, which a derivative at L = 0 asks for, is the smooth continuation: the command is looked up ahead, and held after its end.
[[nodiscard]] std::vector<double> simulate(const LagPlant& plant, double interval,
                                           std::span<const double> command);

/// The same into a buffer of the command's size: no allocation but the first time.
void simulate_into(const LagPlant& plant, double interval, std::span<const double> command,
                   std::vector<double>& angle);

/// The mean of the same over every `rows` samples, as many as are whole; several times faster than taking it afterwards.
void simulate_means_into(const LagPlant& plant, double interval, std::span<const double> command,
                         std::size_t rows, std::vector<double>& mean);

[[nodiscard]] models::StepShape<double> step_shape(const LagPlant& plant);
/// The same of the joint alone, pressure to angle, without valve unit and dead time; works for every damping.
[[nodiscard]] models::StepShape<double> joint_step_shape(const LagPlant& plant);

}  // namespace isac::tune
