/// @file
/// `rig.toml` (`isac.rig/1`): what a person knows about the rig before anything is fitted.
///
/// Every dimensional value is a string with its unit ("38 mm"); a bare number, an unknown key or a wrong dimension is an
/// error with line and column. All sections but `[joint]` may be missing. Values here are SI; NaN means "not given".
/// Sections: [joint] [encoder] [sensors] [limits] [card] [[calibration]]; example in docs/formats.md.
/// Threads: pure functions. Throws isac::Error (bad input). Source: docs/formats.md; seed 3.5, E.2, E.3.
/// Example: `auto rig = isac::record::read_rig("rig.toml");`
#pragma once

#include <array>
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

namespace isac::record {

inline constexpr double kNotGiven = std::numeric_limits<double>::quiet_NaN();

struct RigJoint {
  double wheel_radius = kNotGiven;      ///< m; half of `chain_wheel_diameter`
  double initial_pressure = kNotGiven;  ///< Pa; p0
  double inertia = kNotGiven;           ///< kg m²
};

struct RigEncoder {
  double steps_per_turn = 8000;
  int middle_count = 0;  ///< `middle = "1234 count"`
};

struct RigSensors {                   // standard deviations
  double force_noise = kNotGiven;     ///< N
  double pressure_noise = kNotGiven;  ///< Pa
  double angle_noise = kNotGiven;     ///< rad, beyond the encoder's steps
  double torque_noise = kNotGiven;    ///< N m, for rigs that measure torque itself
  double force_lag = kNotGiven;       ///< s, time constant of the force amplifiers
};

struct RigLimits {                        // safety limits, seed 3.5 and 6.3
  double delta_pressure = 2.0 * 98066.5;  ///< Pa, |Δp|
  double pressure = 5.0 * 98066.5;        ///< Pa, of either muscle
  double angle = 1.1780972450961724;      ///< rad, 3/8 π
  double speed = 6.283185307179586;       ///< rad/s
  double force = 200.0;                   ///< N, sensor capacity
};

/// One linear channel: physical = (count − offset) · gain.
struct RigChannel {
  std::string signal;   ///< "F1", "p2", "p1_cmd"
  std::string channel;  ///< "ai0", "ao1"
  double offset = 0;    ///< count
  double gain = 1;      ///< SI unit per count
};

/// Which card the rig hangs on, and how fast it is sampled where the call does not say.
struct RigCard {
  std::string device;              ///< "sim:", "replay:FILE", "comedi:/dev/comedi0"; empty: the call says
  double sample_rate = kNotGiven;  ///< Hz
};

struct Rig {
  std::string name;
  RigJoint joint;
  RigEncoder encoder;
  RigSensors sensors;
  RigLimits limits;
  RigCard card;
  std::vector<RigChannel> calibration;  ///< empty: the simulated rig's defaults
};

[[nodiscard]] Rig read_rig(const std::filesystem::path& path);
[[nodiscard]] Rig parse_rig(const std::string& text, const std::string& file_name);
/// The text of a `rig.toml` that parse_rig reads back to the same values.
[[nodiscard]] std::string format_rig(const Rig& rig);

}  // namespace isac::record
