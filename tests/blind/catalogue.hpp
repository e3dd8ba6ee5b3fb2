/// @file
/// Every effect that can be hidden: its id, where it sits, what scales it and what shapes it.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "hidden.hpp"
#include "random.hpp"
#include "rig.hpp"

namespace blind {

using Shape = std::map<std::string, double>;  ///< the shape parameters drawn for one dataset, by name

struct Effect {
  std::string id, subsystem;            ///< muscle, joint, pcu, sensor or rig
  bool catalogued = true;               ///< false: no name of the catalogue is right
  std::vector<std::string> depends_on;  ///< of one that is not catalogued: the right variables
  std::string amplitude, unit;          ///< what is scaled
  double typical, largest;              ///< a first guess; what a rig could plausibly have
  Shape (*draw)(Random& random);        ///< shape parameters in plausible ranges
  void (*apply)(Hidden& hidden, double amplitude, const Shape& shape);
};

/// All of them, the catalogue's first in the order of its table.
const std::vector<Effect>& effects();
/// Throws std::invalid_argument naming an id that does not exist.
const Effect& effect(const std::string& id);

}  // namespace blind
