/// @file
/// The base model, fitted and held against signals: A, B, C, D by least squares on the torque of all runs, K_C and T_C
/// on both pressures, and the balance torque − I φ̈ of the free runs, in which nothing is left to fit.
///
/// φ̈ is the second difference over ±50 ms, which is the mean of φ̈ under a triangle of ±50 ms; so the torque it is held
/// against is averaged under the same triangle, and nothing but noise is lost.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "rig.hpp"

namespace blind {

struct Baseline {
  double A = 0, B = 0, C = 0, D = 0, K_C = 0, T_C = 0;
};

/// What the base model leaves over, one value per row; balance is empty unless the joint is free.
struct Residuals {
  std::vector<double> torque, balance, p1, p2;
};

/// Root mean squares over runs.
struct Gap {
  double torque = 0, pressure = 0, balance = 0;
  double driven = 0;      ///< torque of the runs in which the joint is led or clamped
  double p1 = 0, p2 = 0;  ///< pressure, one by one
};

/// Standard deviation of φ̈ (rad/s²) for a white error of the angle.
double acceleration_noise(double angle_sd);

/// φ̇ by the five-point rule.
std::vector<double> velocity_of(const std::vector<double>& angle);

/// The mean under the triangle of ±50 ms; what it does not reach at both ends is left out, so the result is shorter.
std::vector<double> triangle_mean(const std::vector<double>& x);

/// `runs[i]` gave `signals[i]`; held-out runs are left out of the fit.
Baseline fit_baseline(const Rig& rig, const std::vector<RunPlan>& runs, const std::vector<Signals>& signals);

Residuals residuals(const Rig& rig, const Baseline& base, const RunPlan& run, const Signals& signals);
/// Its two parts: torque and balance alone, and one pressure.
Residuals torque_residuals(const Rig& rig, const Baseline& base, const RunPlan& run, const Signals& signals);
std::vector<double> pressure_residual(const Baseline& base, const std::vector<double>& command,
                                      const std::vector<double>& pressure);

/// Over the runs whose `heldout` is as asked.
Gap gap_of(const Rig& rig, const Baseline& base, const std::vector<RunPlan>& runs,
           const std::vector<Signals>& signals, bool heldout);

/// Pressure of a valve K_C = 1 with the lag T_C, at rest under the first command.
std::vector<double> unit_lag(const std::vector<double>& command, double T_C);

}  // namespace blind
