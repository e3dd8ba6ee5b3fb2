#include "isac/runtime/directors.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "isac/core/error.hpp"
#include "isac/core/units.hpp"
#include "isac/record/csv_reader.hpp"
#include "isac/runtime/run_log.hpp"

namespace isac::runtime {
namespace {

constexpr double kApproachSpeed = 0.5;  // rad/s, of the joint with the longest way to the start pose

std::string joint_column(const char* name, int joint, int joints) {
  return joints == 1 ? std::string(name) : std::string(name) + "_" + std::to_string(joint + 1);
}

[[noreturn]] void refuse_file(const std::string& code, const std::string& text,
                              const std::filesystem::path& file) {
  throw Error(ErrorKind::kBadInput, code, text, {file.string(), 0, 0});
}

std::string degrees(double radian) {
  return std::to_string(std::lround(radian * 180.0 / kPi)) + " degrees";
}

}  // namespace

std::vector<MotionPoint> read_points(const std::filesystem::path& path,
                                     const std::vector<control::JointLimits<double>>& limits) {
  const series::Recording file =
      record::read_recording(path, {.map = {}, .require_time = true, .hash = false});
  const auto& time = file.column("time").values;
  if (time.size() < 2)
    refuse_file("points_too_few", "has fewer than two points; a motion needs at least two", path);
  std::vector<MotionPoint> points(time.size());
  for (std::size_t j = 0; j < limits.size(); ++j) {
    const std::string name = limits.size() == 1 ? "angle" : "phi" + std::to_string(j + 1);
    const auto& angle = file.column(name).values;
    for (std::size_t k = 0; k < points.size(); ++k) {
      const std::string where = "point " + std::to_string(k + 1) + ", " + name + ": ";
      points[k].time = time[k] - time[0];
      points[k].angle[j] = angle[k];
      if (!std::isfinite(angle[k]))
        refuse_file("point_missing", where + "the angle is missing; give every one", path);
      if (angle[k] < limits[j].angle_low || angle[k] > limits[j].angle_high) {
        refuse_file("point_unreachable",
                    where + degrees(angle[k]) + " is outside the joint's " + degrees(limits[j].angle_low) +
                        " to " + degrees(limits[j].angle_high) + "; move the point or set other limits",
                    path);
      }
      if (k == 0) continue;
      const double speed = std::abs(angle[k] - angle[k - 1]) / (time[k] - time[k - 1]);
      if (speed > limits[j].speed) {
        refuse_file("point_too_fast",
                    where + "the joint would have to move at " + std::to_string(speed) +
                        " rad/s and may at " + std::to_string(limits[j].speed) + " rad/s; give it more time",
                    path);
      }
    }
  }
  return points;
}

MotionDirector::MotionDirector(Motion motion, const std::atomic<bool>& permit)
    : motion_(std::move(motion)), permit_(permit) {}

JointAim MotionDirector::aim(double time) const noexcept {
  switch (motion_.kind) {
    case Motion::Kind::kStep:
      return {.angle = motion_.size};
    case Motion::Kind::kSine: {
      const double w = 2.0 * kPi * motion_.frequency, a = motion_.size;
      return {.angle = a * std::sin(w * time),
              .velocity = a * w * std::cos(w * time),
              .acceleration = -a * w * w * std::sin(w * time)};
    }
    case Motion::Kind::kTorque:
      return {.torque = motion_.size};
    case Motion::Kind::kPoints:
    case Motion::Kind::kLine:
      break;
  }
  return {};
}

bool MotionDirector::follow_points(double time, Wanted& wanted) noexcept {
  const auto& points = motion_.points;
  if (approach(points.front().angle, time, wanted)) return true;
  if (time >= motion_.duration) return false;
  while (cursor_ + 2 < points.size() && points[cursor_ + 1].time <= time) ++cursor_;
  const MotionPoint& a = points[cursor_];
  const MotionPoint& b = points[cursor_ + 1];
  const double span = b.time - a.time, share = std::clamp((time - a.time) / span, 0.0, 1.0);
  for (std::size_t j = 0; j < wanted.joint.size(); ++j) {
    wanted.joint[j] = {.angle = a.angle[j] + share * (b.angle[j] - a.angle[j]),
                       .velocity = time > b.time ? 0.0 : (b.angle[j] - a.angle[j]) / span};
  }
  return true;
}

bool MotionDirector::approach(const PerJoint<double>& goal, double& time, Wanted& wanted) const noexcept {
  double furthest = 0;
  for (std::size_t j = 0; j < found_.size(); ++j)
    furthest = std::max(furthest, std::abs(goal[j] - found_[j]));
  // 3 u² − 2 u³ is steepest in its middle, 1.5 times the mean
  const double takes = 1.5 * furthest / kApproachSpeed, u = time / takes;
  if (!(time < takes)) {
    time -= takes;
    return false;
  }
  for (std::size_t j = 0; j < found_.size(); ++j) {
    const double way = goal[j] - found_[j];
    wanted.joint[j] = {.angle = found_[j] + way * u * u * (3 - 2 * u),
                       .velocity = way * 6 * u * (1 - u) / takes,
                       .acceleration = way * 6 * (1 - 2 * u) / (takes * takes)};
  }
  return true;
}

bool MotionDirector::follow_line(double time, Wanted& wanted) noexcept {
  const LinePath& path = *motion_.path;
  if (approach(path.start(), time, wanted)) return true;
  const double along = time - motion_.rest;
  if (along >= path.duration() + motion_.duration) return false;
  const control::LinePoint<double> point = path.at(along);
  for (std::size_t j = 0; j < wanted.joint.size(); ++j) {
    wanted.joint[j] = {
        .angle = point.angle[j], .velocity = point.velocity[j], .acceleration = point.acceleration[j]};
  }
  return true;
}

bool MotionDirector::at(const Moment& now, Wanted& wanted) noexcept {
  wanted.arm = permit_.load(std::memory_order_relaxed) && now.plausible;
  wanted.mode = motion_.kind == Motion::Kind::kTorque ? control::Mode::kTorque : control::Mode::kPosition;
  if (now.phase !=
      Phase::kControl) {  // until the controller takes over, the joints are wanted where they are
    for (std::size_t j = 0; j < wanted.joint.size(); ++j) wanted.joint[j] = {.angle = now.angle[j]};
    found_ = now.angle;
  }
  if (now.phase == Phase::kChecking) return true;
  wanted.arm = true;
  if (now.phase != Phase::kControl) return true;
  if (motion_.kind == Motion::Kind::kLine) return follow_line(now.control_time, wanted);
  if (motion_.kind == Motion::Kind::kPoints) return follow_points(now.control_time, wanted);
  if (now.control_time >= motion_.duration) return false;
  wanted.joint[static_cast<std::size_t>(motion_.joint)] = aim(now.control_time);
  return true;
}

RecordedDirector::RecordedDirector(const series::Recording& run, int joints) {
  const auto values = [&run](const std::string& name) -> const std::vector<double>& {
    return run.column(name).values;
  };
  const auto &time = values("time"), &arm = values("arm"), &mode = values("mode"), &state = values("state"),
             &phase = values("phase"), &answered = values("answered");
  rows_.resize(time.size());
  for (std::size_t k = 0; k < rows_.size(); ++k) {
    rows_[k].time_ns = std::llround(time[k] * 1e9);
    rows_[k].wanted.arm = arm[k] > 0.0;
    rows_[k].wanted.mode = static_cast<control::Mode>(std::clamp(mode[k], 0.0, 3.0));
    // A row that is armed and yet only looks at samples is the one in which the run was over.
    const bool over = answered[k] == 0.0 || (state[k] == static_cast<double>(control::RunState::kArmed) &&
                                             phase[k] == static_cast<double>(Phase::kChecking));
    if (over) {
      rows_.resize(k);
      break;
    }
  }
  for (int j = 0; j < joints; ++j) {
    const auto &angle = values(joint_column("angle_wanted", j, joints)),
               &velocity = values(joint_column("velocity_wanted", j, joints)),
               &acceleration = values(joint_column("acceleration_wanted", j, joints)),
               &torque = values(joint_column("torque_wanted", j, joints));
    for (std::size_t k = 0; k < rows_.size(); ++k) {
      rows_[k].wanted.joint[static_cast<std::size_t>(j)] = {
          .angle = angle[k], .velocity = velocity[k], .acceleration = acceleration[k], .torque = torque[k]};
    }
  }
}

bool RecordedDirector::at(const Moment& now, Wanted& wanted) noexcept {
  while (next_ < rows_.size() && rows_[next_].time_ns < now.time_ns) ++next_;
  if (next_ >= rows_.size()) return false;
  wanted = rows_[next_].wanted;
  return true;
}

}  // namespace isac::runtime
