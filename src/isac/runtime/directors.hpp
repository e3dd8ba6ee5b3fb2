/// @file
/// Who says what is wanted: a motion (step, sine, points of a file), a torque, or what a recording wanted.
///
///   step   φ_d = height from the moment the controller takes over
///   sine   φ_d = amplitude sin(2π f t), with its speed and acceleration for the feed-forward
///   points φ_d straight between the rows of a CSV (angle, or phi1 … phi6), all checked before anything moves: within the
///          joints' limits, and no faster than their speed limit (seed 6.2 checks its trajectory likewise)
///   line   the hand along straight pieces (line_path.hpp), after a rest at its start pose
///          Before points and lines all joints go smoothly to where they begin, the longest way at 0.5 rad/s at most.
///   torque T_d constant; 0 is leading by hand (seed 6.3)
/// The desired angle that the controller sees starts at the joint's own and runs to these no faster than its speed limit.
///
/// Units: SI. Real time: at() is constant time (points: a cursor that moves on), no heap, noexcept. Threads: the loop's.
/// Errors: read_points throws isac::Error (bad input) with file and row. Source: seed 5.1, 6.2, 6.3.
#pragma once

#include <atomic>
#include <cstddef>
#include <filesystem>
#include <memory>
#include <vector>

#include "isac/runtime/control_loop.hpp"
#include "isac/runtime/line_path.hpp"
#include "isac/series/recording.hpp"

namespace isac::runtime {

struct MotionPoint {
  double time = 0;  ///< s
  PerJoint<double> angle{};
};

struct Motion {
  enum class Kind { kStep, kSine, kPoints, kLine, kTorque } kind = Kind::kStep;
  double size = 0;       ///< rad or N m: height, amplitude, torque
  double frequency = 0;  ///< Hz, of a sine
  double duration = 5;   ///< s under control
  int joint = 0;         ///< the others hold the angle they were found at, or 0 N m
  std::vector<MotionPoint> points;
  std::shared_ptr<const LinePath> path{};  ///< of a line; its `duration` is what follows the end of the path
  double rest = 2;                         ///< s at the start pose
};

/// Rows of a CSV with `time` and `angle`, or `phi1` … of all joints. `limits` has one entry per joint.
[[nodiscard]] std::vector<MotionPoint> read_points(const std::filesystem::path& path,
                                                   const std::vector<control::JointLimits<double>>& limits);

/// Plays a motion: arms once the samples are plausible and `permit` is raised.
class MotionDirector final : public Director {
 public:
  /// `permit` must outlive the director; where nobody need be asked it is true from the start.
  MotionDirector(Motion motion, const std::atomic<bool>& permit);
  [[nodiscard]] bool at(const Moment& now, Wanted& wanted) noexcept override;

 private:
  [[nodiscard]] JointAim aim(double time) const noexcept;
  /// False: over.
  [[nodiscard]] bool follow_points(double time, Wanted& wanted) noexcept;
  [[nodiscard]] bool follow_line(double time, Wanted& wanted) noexcept;
  /// True while the joints are still led to `goal`; then `time` is what has passed since they are there.
  [[nodiscard]] bool approach(const PerJoint<double>& goal, double& time, Wanted& wanted) const noexcept;

  Motion motion_;
  const std::atomic<bool>& permit_;
  std::size_t cursor_ = 0;
  PerJoint<double> found_{};  ///< rad, where the controller found the joints
};

/// Wants what the recording of a run wanted, row by row (columns of run_log.hpp).
class RecordedDirector final : public Director {
 public:
  /// Throws isac::Error (bad input) for a recording that no run has written.
  RecordedDirector(const series::Recording& run, int joints);
  [[nodiscard]] bool at(const Moment& now, Wanted& wanted) noexcept override;

 private:
  struct Row {
    std::int64_t time_ns = 0;
    Wanted wanted;
  };
  std::vector<Row> rows_;
  std::size_t next_ = 0;
};

}  // namespace isac::runtime
