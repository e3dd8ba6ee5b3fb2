/// @file
/// The muscle models as the fit sees them: parameters of order one, their start values, and the force with its gradient.
///
/// Internal to the room `estimate`. Units: SI. Threads: const data. Errors: none.
/// Source: models/muscle_geometry.hpp, models/muscle_empirical.hpp (the equations themselves stand only there).
#pragma once

#include <span>
#include <string>
#include <vector>

namespace isac::estimate {

struct MuscleParameter {
  const char* name;
  const char* unit;
  double start;   ///< of the fit's scaled parameter
  double factor;  ///< value in `unit` = scaled parameter · factor
};

struct MuscleModelEntry {
  const char* id;
  const char* name;
  const char* equation;
  std::vector<MuscleParameter> parameters;
  const char* needs_motion;   ///< name of the parameter that only a moving muscle shows, or nullptr
  const char* needs_stretch;  ///< … that only a stretched muscle (ε < 0) shows, or nullptr
  /// Force in N (may be negative) and, if `gradient` is not null, its derivatives by the scaled parameters.
  double (*force)(const double* x, double diameter, double pressure, double contraction, double rate,
                  double* gradient);
};

[[nodiscard]] std::span<const MuscleModelEntry> muscle_catalogue();

}  // namespace isac::estimate
