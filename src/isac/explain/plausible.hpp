/// @file
/// Values at which an effect is not what its name says: it closes a gap, and for the wrong reason.
///
/// An amplitude at the end of its plausible range; a creep faster than any, a chain wheel of hardly any teeth; a Stribeck friction that is less at
/// rest than in motion, or falls off below the speeds that the encoder tells; an asymmetry of nothing, a dependence on nothing; a
/// hysteresis that no motion saturates or that is narrower than three steps of the encoder; a stop in the middle of the motion.
/// Units: SI. Threads: const. Errors: none. Source: docs/derivations/explain.md.
#pragma once

#include <string>

#include "isac/explain/hypothesis.hpp"
#include "isac/explain/prepared.hpp"

namespace isac::explain {

class Plausible {
 public:
  explicit Plausible(const Prepared& data);
  /// What the effect would need, as the end of a sentence "ruled out: …"; empty where nothing speaks against it.
  [[nodiscard]] std::string objection(const Hypothesis& hypothesis, const Values& values) const;

 private:
  double step_ = 0;                        ///< rad of the encoder
  double angle_low_ = 0, angle_high_ = 0;  ///< rad, that the joint reached
};

}  // namespace isac::explain
