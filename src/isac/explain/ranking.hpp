/// @file
/// Which of the refitted candidates stands first, which the data cannot rule out, and how belief is shared among them.
///
///   t = Δ/(2 √(c |d|²)),  d the difference of two residuals, Δ that of their losses with 2 c for each surplus parameter
///
/// The best fit stands first, but a simpler effect that it contains stands for it unless it leads clearly, or where its own shape
/// says that it has become the simpler one; among twins (less than 3 sigma of data between them) the one of fewer parameters.
/// Threads: const members may be called from many threads. Errors: none. Source: docs/derivations/explain.md.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "isac/explain/compare.hpp"
#include "isac/explain/floors.hpp"

namespace isac::explain {

/// Belief in all names of a set together. What is missing may be none of the catalogue though one of it fits: 2 of 214 single names on blind
/// datasets, clear and faint, were wrong (docs/explain.md); effects from outside the catalogue are not counted there.
inline constexpr double kSurest = 0.99;
/// What stands first in a set is so much likelier than the noise alone would have it: with the same two or three names in the set, the first was
/// right in 23 of 35 blind datasets, where the noise alone had said 15.
inline constexpr double kFirst = 2;
/// Of what a name closes, in squares of sigma: no equation is truer than that. So little beyond a dry friction makes no general case of it (the
/// encoder tells roughly when a slow motion turns: a friction that falls from rest, 0.0011 from Coulomb's, was Coulomb's; general effects that are
/// there are 0.028 and more from their simple cases, seed 9311, by the oracle), nor a compliance of an added inertia (0.0013 of one that was none; half of
/// what one closes that is there), and no rival without a name takes a name away by it.
inline constexpr double kHardlyAny = 0.005;

/// Dry friction in a power of the mean pressure that is not near none: no general case of one that does not go with it, but another.
[[nodiscard]] bool goes_with_pressure(const Hypothesis& friction, const Values& values);

/// A candidate that was refitted beside what was there already.
struct Trial {
  int hypothesis = -1;
  Values values{};
  Eigen::VectorXd residual;  ///< weighted, all rows; of the refit, with the model's parameters eliminated
  double loss = 0;
  Comparison behind;    ///< of the best trial
  double weight = 0;    ///< share of belief among the trials and what is none of them
  double material = 0;  ///< rms of what it explains over the floor of the chain where it shows most
  bool in_set = false;
};

class Ranking {
 public:
  Ranking(const Prepared& data, const Library& library) : data_(data), library_(library) {}

  /// Friction that jumps with the direction and remembers nothing.
  [[nodiscard]] bool is_dry(const Trial& t) const;
  [[nodiscard]] int parameters_of(const Trial& trial) const;
  [[nodiscard]] std::string id_of(const Trial& trial) const;
  /// Do both enter forces and motion, or pressures? What closes another reading is missing beside the first, and no rival of it.
  [[nodiscard]] bool share_readings(const Trial& a, const Trial& b) const;
  /// A shape at the end of its range is the simpler effect that it turns into there; a width of few steps of the encoder is none, and a
  /// friction that is hardly larger at rest is dry friction.
  [[nodiscard]] bool is_limit_case(int hypothesis, const Values& values) const;
  /// Of the trials behind the first, whose values went on to these: the simpler one that the first is at the end of its range, as near as that
  /// end comes; 0: none.
  [[nodiscard]] std::size_t simple_case_of_limit(const std::vector<Trial>& trials,
                                                 const Values& values) const;
  /// Are there two sensors of one kind, and is what they err by the same?
  [[nodiscard]] bool err_alike(const Trial& trial) const;
  /// Two sensors seldom err by the same. Gains of both forces that do scale a torque as a heavier joint does, zeros of both pressures are off as
  /// a valve's zero is: of a name that needs the coincidence, what needs one cause may be a little behind.
  [[nodiscard]] bool is_one_cause_of_both(const Trial& trial, const Trial& both) const;
  [[nodiscard]] bool is_against_its_name(const Trial& trial) const;
  [[nodiscard]] bool is_likelier_cause(const Trial& trial, const Trial& than) const;
  [[nodiscard]] bool are_two_causes_of_one(const Trial& general, const Trial& simple) const;
  [[nodiscard]] bool are_two_frictions(const Trial& by_pressure, const Trial& plain) const;
  [[nodiscard]] bool is_another_at_this_pressure(const Trial& general, const Trial& simple) const;
  /// Best first; those that cannot be ruled out are marked; general cases of a simpler one in the set are dropped.
  /// `before`: the residual that all of them started from.
  void rank(std::vector<Trial>& trials, const Eigen::VectorXd& before) const;
  /// A single name is to be wrong on less than one day in a hundred: what noise alone puts as far behind once in a hundred days joins the set
  /// that is told (t < 2.33), but for what is a simpler or a general case of one in it.
  void widen(std::vector<Trial>& trials) const;
  /// Each against the first.
  void mark(std::vector<Trial>& trials) const;
  /// Shares of belief among those in the set.
  static void weigh(std::vector<Trial>& trials);

 private:
  const Prepared& data_;
  const Library& library_;
};

}  // namespace isac::explain
