/// @file
/// The terms of a joint model as a fit sees them: which parameters are linear, their regressors, their names and units.
///
///   output = Σ_k θ_k x_k(point) + f(point, θ_nl);  joint under its muscles: output = T = Σ effect_torque,
///   driven axis (terms contain `inertia`): output = F = −Σ effect_torque + offset, so that F = M a + Fv v + Fc sgn v + offset.
///
/// Units SI inside; `JointParameter` leads to the reporting unit. Threads: const functions are pure. Throws isac::Error
/// (usage) for an unknown term or one that no added torque describes. Source: models/effects.hpp, seed 3.10.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "isac/estimate/joint_fit.hpp"

namespace isac::estimate {

/// One instant, SI.
struct JointState {
  double angle = 0, velocity = 0, acceleration = 0, delta_pressure = 0, mean_pressure = 0, time = 0;
};

/// The quantities that a term can read and that carry measurement noise or may stand still.
enum class Input : int { kAngle, kVelocity, kAcceleration, kDeltaPressure, kMeanPressure };
inline constexpr int kInputs = 5;

struct JointParameter {
  std::string name;        ///< key of the answer: "A", "coulomb_friction", "stribeck_friction.v_s"
  std::string term;        ///< words: "Coulomb friction"
  std::string unit;        ///< reporting unit
  double si_per_unit = 1;  ///< value_SI = value · si_per_unit
  double lower = 0, upper = 0, typical = 0;  ///< SI, plausible range and start
  int effect = -1;
  int index = 0;       ///< which parameter of its effect
  bool shape = false;  ///< bends the term instead of scaling it (an onset, an exponent)
};

class JointTerms {
 public:
  explicit JointTerms(const JointFitOptions& options);

  [[nodiscard]] bool driven() const noexcept { return driven_; }
  [[nodiscard]] std::span<const JointParameter> linear() const noexcept { return linear_; }
  [[nodiscard]] std::span<const JointParameter> nonlinear() const noexcept { return nonlinear_; }
  [[nodiscard]] bool reads(Input input) const noexcept { return reads_[static_cast<int>(input)]; }
  /// Does the k-th linear regressor change with this input?
  [[nodiscard]] bool reads(std::size_t k, Input input) const noexcept {
    return linear_reads_[k][static_cast<std::size_t>(input)];
  }
  [[nodiscard]] bool is_cubic_damping(std::size_t k) const noexcept;
  [[nodiscard]] bool is_viscous_damping(std::size_t k) const noexcept;

  /// Terms that bend the baseline (lever arm) need its A [N/m] and B [N/Pa]; the seed's testbed until told otherwise.
  void set_baseline(double stiffness, double pressure_gain) noexcept {
    stiffness_ = stiffness;
    pressure_gain_ = pressure_gain;
  }

  /// x_k at a state.
  [[nodiscard]] double regressor(std::size_t k, const JointState& state) const noexcept;
  /// Sum of the nonlinear terms and, if `gradient` is not null, its derivatives by the nonlinear parameters.
  [[nodiscard]] double nonlinear_value(const JointState& state, const double* parameters,
                                       double* gradient) const noexcept;

 private:
  std::vector<JointParameter> linear_, nonlinear_;
  std::vector<std::vector<bool>> linear_reads_;
  bool reads_[kInputs] = {};
  bool driven_ = false;
  double wheel_radius_ = 0, reference_pressure_ = 0, stiffness_ = -23450.0, pressure_gain_ = 174.2 / 98066.5;
};

[[nodiscard]] double value_of(const JointState& state, Input input) noexcept;
void set_value(JointState& state, Input input, double value) noexcept;

}  // namespace isac::estimate
