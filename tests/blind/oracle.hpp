/// @file
/// How far each rival of the catalogue is from the truth in a dataset, in standard deviations of its noise: what nobody
/// can tell apart, however clever.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "dataset.hpp"

namespace blind {

struct Verdict {
  double none = 0;  ///< sigma between the truth and the base model alone
  std::map<std::string, double>
      rivals;  ///< by id; for two hidden effects the nearest that one of them is swapped for
  std::vector<std::string> equals;  ///< rivals below three sigma
};

}  // namespace blind
