/// @file
/// The hand's way along straight pieces, planned whole before anything moves: at rest at every corner.
///
///   start pose → piece 1 → pause → piece 2 → …        each piece a control::LineTrajectory, 2 mm from point to point   seed 6.2
/// A piece goes to a place, or by a way from where the piece before it ended; the hand keeps the turn that it has at the
/// start pose. Where the piece before ended is where its planned joint angles put the hand.
///
/// Units: m, m/s, s, rad. Real time: at() is constant time, no heap, noexcept; planning allocates. Threads: at() is const.
/// Errors: the constructor throws isac::Error (usage) that names the piece, its point, the place, and what is in the way.
/// Source: seed 6.2, figure 6.1. Example: `LinePath path(reach, start, {{true, {0, 0, 0.1}}}, 0.2);`
#pragma once

#include <string>
#include <vector>

#include "isac/control/trajectory.hpp"

namespace isac::runtime {

struct LinePiece {
  bool by = false;  ///< `target` is a way, not a place
  models::Vec3<double> target;
};

class LinePath {
 public:
  static constexpr std::size_t kPoints = 1024;  ///< of a piece: 2 m at 2 mm
  static constexpr double kPause = 0.5;         ///< s at a corner

  LinePath(const control::ArmReach<double>& arm, const models::JointVector<double, 6>& start,
           const std::vector<LinePiece>& pieces, double speed);

  /// s of all pieces and the pauses between them.
  [[nodiscard]] double duration() const noexcept { return duration_; }
  [[nodiscard]] const models::JointVector<double, 6>& start() const noexcept { return start_; }
  /// Desired motion `time` seconds after the start; at rest before it and after the end.
  [[nodiscard]] control::LinePoint<double> at(double time) const noexcept;
  /// Points of all pieces.
  [[nodiscard]] int points() const noexcept { return points_; }

 private:
  struct Leg {
    double begin = 0;  ///< s
    control::LineTrajectory<double, kPoints> line;
  };
  models::JointVector<double, 6> start_;
  std::vector<Leg> legs_;
  double duration_ = 0;
  int points_ = 0;
};

}  // namespace isac::runtime
