/// @file
/// The rig of the blind generator, and what a run on it is. Angles in rad, pressures in kg/cm2 (kgf), forces in N,
/// torques in N m, times in s: the units of the files that are written, so nothing is converted on the way.
///
/// T = A r² φ + B r Δp − C φ̇³ − D φ̇, Δp = (p2 − p1)/2, T = (F2 − F1) r; T_C ṗ = K_C p_cmd − p; I φ̈ = T.
#pragma once

#include <string>
#include <vector>

#include "random.hpp"

namespace blind {

inline constexpr double kRate = 500.0;           ///< rows per second of a recording
inline constexpr int kEncoderSteps = 8000;       ///< per turn
inline constexpr double kRowTime = 1.0 / kRate;  ///< s

struct Rig {
  double A = -23450.0, B = 174.2, C = 0.0026, D = 0.14;  ///< N/m, N cm2/kg, N m s³, N m s
  double r = 0.019, p0 = 3.0, inertia = 0.0085;          ///< m, kg/cm2, kg m2
  double K_C = 1.0, T_C = 0.17;                          ///< 1, s
  double pull_zero = 30.0, pull_gain = 110.0;            ///< co-contraction (F1 + F2)/2 = zero + gain p_mean
};

/// Base parameters within ±30 % of the seed's (K_C ±3 %), the geometry as it is.
Rig draw_rig(Random& random);

/// What was done in one run: who moves the joint, and the commands, one value per row.
struct RunPlan {
  std::string name, experiment;  ///< `experiment` as in the file's header
  double started = 0.0;          ///< s since the first run of the day
  bool heldout = false;
  bool free = false;                         ///< false: the hand prescribes the angle
  std::vector<double> hand, hand_velocity;   ///< one per row; empty when free
  double release_angle = 0.0;                ///< where a free joint is let go, at rest
  std::vector<double> command_1, command_2;  ///< held for one row
  [[nodiscard]] int rows() const { return static_cast<int>(command_1.size()); }
};

/// What the sensors would say without noise and without steps: one value per row.
struct Signals {
  std::vector<double> angle, p1, p2, F1, F2;
};

/// About fifteen runs of one day, ten minutes in all, five of them held out; no stroke is like another.
std::vector<RunPlan> draw_day(const Rig& rig, Random& random);

/// Another joint: other chain wheel (in 0.1 mm), initial pressure, inertia and valve lag, muscles within ±40 %.
Rig draw_other_rig(Random& random);
/// Seventeen runs by a written protocol, ten minutes in all, five held out: equal strokes, sines, a chirp, tables of levels.
std::vector<RunPlan> draw_protocol_day(const Rig& rig, Random& random);

}  // namespace blind
