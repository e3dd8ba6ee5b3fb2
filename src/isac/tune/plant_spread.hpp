/// @file
/// How well a record knows a plant, and what follows from it: facts with a standard error and an interval.
///
///   V        sandwich over blocks of time (estimate/block_covariance.hpp), and σ² H⁻¹ as if the residuals were white
///   a fact   f(x̂) with the greater of ∇f V ∇f of the two, Student's t with Satterthwaite's degrees of freedom
///   joined   f̂ = (1 − w) f_shifted + w f_bent,  s² = max(s_shifted, s_bent)² + (f_bent − f_shifted)²;  w: Akaike's weight
/// The blocks do not see a misfit that repeats with every cycle; what a freer form would say in its place does.
///
/// Units: each fact's own. Threads: pure. Errors: none; NaN where nothing is known, as of a dead time at its bound.
/// Source: docs/derivations/tuning.md; Burnham and Anderson 2002 (weights).
/// Example: `estimated(derived_facts()[0], problem, solution.x, spread_of(problem, solution.x, LagForm::kLag))`.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <vector>

#include "isac/core/estimated.hpp"
#include "isac/tune/plant_problem.hpp"

namespace isac::tune {

/// Of all of x; zero for what is held.
struct Spread {
  Eigen::MatrixXd sandwich, white;
  Eigen::VectorXd freedom;
};

[[nodiscard]] Spread spread_of(const PlantProblem& problem, const PlantVector& x, LagForm form);

/// What is told of the plant: a name, its unit, its value.
struct Fact {
  const char* name;
  const char* unit;
  std::function<double(const LagPlant&)> of;
};
[[nodiscard]] const std::vector<Fact>& parameter_facts();  ///< K, T_C, T_J, zeta, dead_time
[[nodiscard]] const std::vector<Fact>& derived_facts();    ///< K_crit, T_crit, T_L, T_A, T_L_T_A
[[nodiscard]] const std::vector<Fact>& joint_facts();      ///< joint_T_L, joint_T_A

[[nodiscard]] Estimated estimated(const Fact& fact, const PlantProblem& problem, const PlantVector& x,
                                  const Spread& spread);

/// One fact from two forms; `weight` is that of the bent one.
[[nodiscard]] Estimated joined(const Estimated& shifted, const Estimated& bent, double weight);

}  // namespace isac::tune
