/// @file
/// The runs of a day, simulated with this and that hidden; what the bare rig does is kept, so that a run in which the
/// hidden effect acts through the sensors alone, or not at all, is not simulated again.
#pragma once

#include <vector>

#include "hidden.hpp"
#include "rig.hpp"

namespace blind {

class KnownRuns {
 public:
  /// `rig` and `runs` must outlive it; `step` of the integrator in s.
  KnownRuns(const Rig& rig, const std::vector<RunPlan>& runs, double step)
      : rig_(rig), runs_(runs), step_(step), bare_(runs.size()) {}

  /// To the last bit simulate(rig, runs[i], hidden, step); stands until the next call.
  const Signals& simulated(std::size_t i, const Hidden& hidden);
  /// With nothing hidden; stands. What simulated() returns where `hidden` changes nothing.
  const Signals& bare(std::size_t i);

 private:
  const Rig& rig_;
  const std::vector<RunPlan>& runs_;
  double step_;
  std::vector<Signals> bare_;  ///< of the rig in which nothing is hidden; empty until it is asked for
  Signals changed_;
};

}  // namespace blind
