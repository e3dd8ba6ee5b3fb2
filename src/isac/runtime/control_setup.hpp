/// @file
/// From parameters and rig to what the control loop is told, and from what it found to a sentence.
///
/// Gains, muscle, wheel, valve unit and validity box come from the table (control/deployed.hpp); limits are the tighter of
/// the table's box and the rig file's [limits]. Around them stand the watches:
///   soft (warning): the rig's limits; of the force 9/10 of it
///   hard (latched): pressure, Δp and angle 1.1 times, speed 1.5 times, the force sensors' capacity as it is
/// because a loop that is allowed to command a limit overshoots it a little.
///
/// Units: SI. Real time: start-up, not the loop. Threads: pure functions.
/// Errors: isac::Error (bad input) with the file and what it lacks. Source: seed 3.5, 6.3, tables 6.1, 6.2.
/// Example: `auto s = control_settings(load_table("params.toml"), rig, 2000);`
#pragma once

#include <filesystem>
#include <string>

#include "isac/control/deployed.hpp"
#include "isac/control/trajectory.hpp"
#include "isac/core/estimated.hpp"
#include "isac/record/arm_file.hpp"
#include "isac/record/rig.hpp"
#include "isac/runtime/control_loop.hpp"

namespace isac::runtime {

struct LoadedTable {
  models::ParameterTable table;
  std::string source;  ///< "params.toml sha256:…"
  Warnings warnings;
};

/// `params.toml`, or the packed binary that isac-identify export writes (told apart by its first bytes).
[[nodiscard]] LoadedTable load_table(const std::filesystem::path& path);

struct SetupWishes {
  double rate = 2000;  ///< Hz, of the inner loop
  control::Structure structure = control::Structure::kModelBased;
  control::PidGains<double> pid{};                ///< of kPid alone: Pa/rad, Pa/(rad s), Pa s/rad
  bool predict_dead_time = false;                 ///< where the table has inertia and a dead time
  double following = 0.35, following_time = 0.5;  ///< rad, s
};

/// Of all joints of the table. `warnings` gets what was left out (effects that cannot be fed forward).
[[nodiscard]] ControlSettings control_settings(const models::ParameterTable& table, const record::Rig& rig,
                                               const SetupWishes& wishes, Warnings& warnings);

/// The gains that the seed ran its PID with after Ziegler and Nichols (5.1): 0.4, 7 and 0.08 kg/cm² per rad, rad s, rad/s.
[[nodiscard]] control::PidGains<double> testbed_pid_gains() noexcept;

/// PI-CMBPI: the arm's chain and coupling, the table's masses where it has them (else the file's), and the narrower limits.
/// The arm must have as many joints as the table.
void compensate_arm(ControlSettings& settings, const record::ArmFile& arm,
                    const models::ParameterTable& table, const std::filesystem::path& arm_file);

/// What a straight line must know. Only for the links of the seed's arm (table 4.1, with lengths of one's own), because only
/// theirs is the inverse known.
[[nodiscard]] control::ArmReach<double> reach_of(const record::ArmFile& arm, const ControlSettings& settings,
                                                 const std::filesystem::path& arm_file);

/// The seed's testbed with the gains of its section 5.3, for a simulated rig without parameters.
[[nodiscard]] ControlSettings testbed_control_settings(const record::Rig& rig, const SetupWishes& wishes);

/// "joint 1: the angle is beyond its limit (1.31 rad, limit 1.30 rad)".
[[nodiscard]] std::string finding_words(const control::Finding& finding);

}  // namespace isac::runtime
