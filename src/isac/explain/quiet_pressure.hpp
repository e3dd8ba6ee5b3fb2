/// @file
/// A pressure sensor's noise is not a pressure: what of a reading the torque feels.
///
///   e_i = p_i − p̂_i(u_i),   e_i = G_i + r_i,   p̃_i = p̂_i + G_i + Σ_b λ_b r_i,b
///   T = A r² φ + B r (Δp̂ + ΔG + Σ_b λ_b Δr_b) − …      λ_b from this regression, 0 ≤ λ_b ≤ 1
///
/// p̂: the valve's first-order lag of the command; G: what smooth functions of command, motion and time make of the rest, so all
/// that a valve or a sensor does by rule; r: what remains, in three bands (faster than 0.15 s, slower than 1 s, between). A band that the
/// torque follows is pressure (λ = 1), one that it does not follow is the sensor's noise (λ = 0), which would enter the torque with
/// B r as large as the force's own. A run's mean of r stays in, for G may be off where nothing was fitted; its error, which no scatter within the
/// run shows, is PreparedRun::mean_pressure_error. Nor does any show that of the valves' fitted lag, with which p̂ is off in all runs alike:
///
///   PreparedRun::lag_pressure_error = Σ_b (1 − λ_b) [δT_C ∂p̂/∂T_C]_b of (p2 − p1)/2,   δT_C = √Σ_blocks (Σ s e)²/Σ s²,  s = ∂p̂/∂T_C beside ∂p̂/∂K_C
///
/// Where the torque cannot tell, the reading stands as it is (prior of λ: 1 ± 0.5).
/// Units: SI. Threads: values. Errors: none; without commands or torque nothing is changed.
/// Source: docs/derivations/explain.md; errors in variables: Fuller, Measurement Error Models, 1987, 1.2.
#pragma once

#include <Eigen/Core>
#include <array>

#include "isac/explain/fit.hpp"

namespace isac::explain {

class QuietPressure {
 public:
  static constexpr int kBands = 3;

  QuietPressure() = default;
  /// Learns it on the runs that are fitted, and changes their pressures (PreparedRun::pressure). `known`: a model of the valves that is
  /// better than their lag alone; its effects' hypotheses must outlive the result.
  static QuietPressure learn(Prepared& data, const ModelPoint* known = nullptr, int threads = 1);
  /// Changes the pressures of other runs of the same rig.
  void apply(Prepared& data) const;
  [[nodiscard]] const std::array<double, kBands>& felt() const noexcept { return felt_; }

 private:
  struct Parts;
  [[nodiscard]] std::vector<Parts> parts_of(const Prepared& data, int threads) const;
  void apply(Prepared& data, const std::vector<Parts>& parts) const;
  [[nodiscard]] double error_of_mean(const Parts& parts, const PreparedRun& run) const;

  ModelPoint model_;            ///< of the rough fit: K_C, T_C
  Eigen::VectorXd by_rule_[2];  ///< coefficients of G
  std::array<double, kBands> felt_{1, 1, 1};
  double lag_error_ = 0;  ///< s, one deviation of T_C
  bool known_ = false;
};

}  // namespace isac::explain
