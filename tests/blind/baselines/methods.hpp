/// @file
/// The baselines B0 to B6, each from a bench to what it says.
///
///   B0 refit only · B1 STLSQ · B2 its ensemble · B3 FROLS with error-reduction ratio · B4 BIC over refits of every effect
///   B5 latent force, then STLSQ · B6 a neural residual (gap only, no name)
///
/// None of them returns a set or says that it does not know, but where nothing is chosen. Threads: pure. Errors: none.
#pragma once

#include <string>
#include <vector>

#include "bench.hpp"

namespace baselines {

struct Said {
  std::string method;
  std::vector<std::string> ids;  ///< chosen effects, largest first
  std::vector<std::string> subsystems;
  std::vector<double> confidence;
  double heldout_before = 0, heldout_after = 0;  ///< rms at the recording's rate
  std::string signal, unit;
  double seconds = 0;
};

[[nodiscard]] std::vector<Said> all_methods(const Bench& bench);

}  // namespace baselines
