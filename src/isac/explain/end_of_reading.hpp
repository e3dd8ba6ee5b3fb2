/// @file
/// Does an effect act only while a force reading stands at its largest? Then the reading may be clipped there, whatever else fits.
///
///   share = Σ' c²/Σ c²   of the torque's rows, Σ': those in which F1 or F2 ≥ its largest of the day − 8 σ/(√2 r)
///
/// c: what the effect closes; σ: the torque's noise, half of its square either reading's; r: of the wheel; largest: but for two in ten thousand.
///
/// A joint that turns at the end of its range passes the day's largest force in a moment, and an effect that acts near it acts on the way there too.
/// A clipped reading stays: all that is missing of it lies there. Of 108 right names of clear effects none had a share above 0.03, two clipped forces
/// that were told as a slack muscle 0.95 and 0.99.
/// Shapes: one row of `closed` for each row of `data`. Units: N. Threads: pure. Errors: none; 0 where no force was read.
#pragma once

#include <Eigen/Core>

#include "isac/explain/prepared.hpp"

namespace isac::explain {

struct EndOfReading {
  double share = 0;  ///< of what is closed in the torque's rows
  double force = 0;  ///< N, the largest reading
};

[[nodiscard]] EndOfReading acts_at_the_end_of_a_reading(const Prepared& data, const Eigen::VectorXd& closed,
                                                        double torque_noise);

}  // namespace isac::explain
