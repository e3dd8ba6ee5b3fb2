/// @file
/// An identified number and how far it can be trusted: what every fit returns and every file and report shows.
///
/// Host only. Values are in `unit` as written (the reporting unit of docs/notation.md, e.g. "N cm2/kg" for B), not
/// necessarily SI. Unknown numbers are NaN (JSON writes them as null).
#pragma once

#include <limits>
#include <string>
#include <vector>

namespace isac {

struct Estimated {
  std::string name;  ///< key in answers and files: "A", "T_C", "coulomb_friction"
  std::string unit;  ///< "N/m", "N cm2/kg", "N m s3", "N m s", "s", "-" …
  double value = std::numeric_limits<double>::quiet_NaN();
  double std_error = std::numeric_limits<double>::quiet_NaN();
  double ci_low = std::numeric_limits<double>::quiet_NaN();   ///< 95 % interval
  double ci_high = std::numeric_limits<double>::quiet_NaN();  ///< 95 % interval
  bool identifiable = true;  ///< false: the data cannot tell; value is NaN and `reason` says what to record
  /// When not identifiable one sentence; of a value that stands without an error, why; else empty.
  std::string reason;
};

/// A remark a person must see: `code` is stable for programs, `text` one plain sentence with the mend.
struct Warning {
  std::string code;
  std::string text;
};

using Warnings = std::vector<Warning>;

/// The box in which identified parameters hold, SI; NaN where not known.
struct ValidityBox {
  double delta_pressure_low = std::numeric_limits<double>::quiet_NaN();   ///< Pa
  double delta_pressure_high = std::numeric_limits<double>::quiet_NaN();  ///< Pa
  double angle_low = std::numeric_limits<double>::quiet_NaN();            ///< rad
  double angle_high = std::numeric_limits<double>::quiet_NaN();           ///< rad
  double speed_low = std::numeric_limits<double>::quiet_NaN();            ///< rad/s
  double speed_high = std::numeric_limits<double>::quiet_NaN();           ///< rad/s
};

}  // namespace isac
