/// @file
/// Holds an arm in planned poses, one after another, each approached from below and from above, and writes down where it stood.
///
///   Δp_i = (−A r² φ_i − τ_φ,i(φ))/(B r) + c_i      what carries spring and known weight, and a correction c
///   on the way            c follows ∫ (φ_wanted − φ) dt, with the time constant kCorrection
///   on the last stretch   φ_wanted turns by `side` towards the pose, on every joint from the same side; then c grows only
///                         forwards until the pose is reached: friction has the sign of the approach, in full
///   at the pose           commands stand still; after 9 T_C the angles are averaged
///
/// Friction has the other sign from the other side, so that it cancels in the mean of both (estimate/mass_fit.hpp). A pose nearer to a
/// limit than it can be approached from is moved inwards, and that is said; one at which a joint's Δp is at its limit is left out, and that is said.
/// Every row stands up to 0.3 deg beside the plan, each elsewhere: steps of the encoders then average out like noise, and
/// `# angle_resolution` tells isac-identify masses how large they are.
/// Columns: time [s], pose [1], approach [1], phi1 … [deg], dp1 … [kg/cm2]; a row per pose and side.
/// Units: SI. Real time: a loop of `rate` Hz on the caller's thread; between two poses a row is written. Threads: one.
/// Errors: throws isac::Error: bad input (arm without actuators, output that cannot be written), stopped (limit, card); every
/// way out vents. Source: seed 6.4; docs/arm.md. Example: tests/runtime/pose_session_test.cpp.
#pragma once

#include <atomic>
#include <filesystem>
#include <string>
#include <vector>

#include "isac/core/units.hpp"
#include "isac/record/arm_file.hpp"

namespace isac::runtime {

using ArmAngles = models::JointVector<double, 6>;

struct PoseSessionOptions {
  std::string card;
  record::ArmFile arm;
  std::vector<ArmAngles> theta;                          ///< rad, the poses
  std::filesystem::path file;                            ///< poses.csv to write
  double rate = 200;                                     ///< Hz
  double mean_pressure = 3.0 * kPascalPerKgfCm2;         ///< Pa
  double delta_pressure_limit = 2.0 * kPascalPerKgfCm2;  ///< Pa
  double speed_limit = 2.0 * kPi;                        ///< rad/s, of any joint
  double side = 6.0 * kPi / 180;                         ///< rad, the last stretch
  bool overwrite = false;                                ///< an older recording is kept as *.bak
};

struct HeldPose {
  long pose = 0;     ///< from 1
  int approach = 0;  ///< +1 from below, −1 from above
  ArmAngles phi{}, delta_pressure{};
  double drift = 0;     ///< rad, largest change of any joint while it was averaged
  double distance = 0;  ///< rad, largest of any joint from the planned angle
  int farthest = 0;     ///< that joint, from 0
  bool at_rest = false;
  int saturated = -1;  ///< joint whose Δp stood at its limit: what its friction does is not known; −1: none
};

class PoseObserver {
 public:
  virtual ~PoseObserver() = default;
  virtual void note(const std::string& sentence) = 0;
  virtual void held(const HeldPose& pose, std::size_t done, std::size_t count) = 0;
};

struct PoseSessionResult {
  std::vector<HeldPose> rows;  ///< those left out too
  bool complete = false;       ///< false: `stop` was raised before the last pose
};

[[nodiscard]] PoseSessionResult hold_poses(const PoseSessionOptions& options, PoseObserver& observer,
                                           const std::atomic<bool>& stop);

}  // namespace isac::runtime
