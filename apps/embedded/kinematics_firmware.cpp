// What kinematics and compensation of the six-joint arm cost a Cortex-M: every calculation counted over poses of the whole workspace.
//
// The one word of the call names the file for the answer: a KinematicsRecord per pose. Exit code 0: written.
#include <cmath>

#include "instruction_counter.hpp"
#include "isac/control/compensation.hpp"
#include "isac/models/arm/soft_arm.hpp"
#include "kinematics_record.hpp"
#include "semihosting.hpp"

namespace {

using namespace isac;
using namespace isac::embedded;
using Angles = models::JointVector<float, 6>;

struct Arm {
  models::SoftArmGeometry<float> geometry{};
  models::Chain<float, 6> chain = models::soft_arm_chain(geometry);
  models::Coupling<float, 6> coupling = models::soft_arm_coupling<float>();
  models::Coupling<float, 6> inverse{};
  models::JointLimits<float> limits{};
};

Arm arm;
Angles theta;

/// Whatever is in memory may have been read and written here.
template <class T>
[[gnu::always_inline]] inline void touch(T& value) noexcept {
  __asm volatile("" : : "r"(&value) : "memory");
}

/// `body` between two readings; what it leaves in `result` is wanted, and nothing computed before is worth keeping.
template <class T, class Body>
[[gnu::noinline]] std::uint32_t counted(T& result, Body body) noexcept {
  touch(theta);
  const std::uint32_t before = Counter::now();
  touch(theta);
  result = body();
  touch(result);
  return Counter::instructions(before, Counter::now());
}

/// Angles all over ±1.2 rad, the same on every machine.
Angles pose(int k) noexcept {
  Angles out{};
  std::uint32_t state = 2654435761u * static_cast<std::uint32_t>(k + 1);
  for (float& angle : out) {
    state = 1664525u * state + 1013904223u;
    angle = 2.4f * (static_cast<float>(state >> 8) / 16777216.0f - 0.5f);
  }
  return out;
}

float distance(const models::Vec3<float>& a, const models::Vec3<float>& b) noexcept {
  const models::Vec3<float> d = a - b;
  return std::sqrt(dot(d, d));
}

KinematicsRecord measure() noexcept {
  KinematicsRecord record;
  std::array<models::Transform<float>, 6> frames;
  models::Vec3<float> hand;
  models::InverseKinematics<float> found;
  Angles torque;
  int nearest = 0;
  record.frames = counted(frames, [] { return models::chain_frames(arm.chain, theta); });
  record.tool = counted(hand, [] { return models::tool_position(arm.chain, theta); });
  record.inverse = counted(found, [&] { return models::soft_arm_inverse(arm.geometry, frames[5], theta); });
  record.nearest =
      counted(nearest, [&] { return models::nearest_solution(found, theta, arm.inverse, arm.limits); });
  record.gravity = counted(torque, [] {
    return control::compensation_torque<float, 6>(arm.chain, arm.coupling, theta, {},
                                                  control::InertiaShare::kNone);
  });
  record.compensation = counted(torque, [] {
    return control::compensation_torque<float, 6>(arm.chain, arm.coupling, theta, theta,
                                                  control::InertiaShare::kFirstJoint);
  });
  record.solutions = static_cast<std::uint32_t>(found.count);
  for (int i = 0; i < found.count; ++i) {
    const auto& solution = found.solutions[static_cast<std::size_t>(i)];
    const float off = distance(models::chain_frames(arm.chain, solution.theta)[5].p, frames[5].p);
    if (off > record.back) record.back = off;
  }
  return record;
}

}  // namespace

int main() {
  char name[256] = {};
  if (!command_line(name, sizeof name)) return 2;
  const std::int32_t file = open_for_writing(name);
  if (file < 0) return 3;
  Counter::begin();
  if (!ok(models::inverse_coupling<float, 6>(arm.coupling, arm.inverse))) return 5;
  for (std::size_t i = 0; i < 6; ++i) {
    arm.limits.lower[i] = -3.1f;
    arm.limits.upper[i] = 3.1f;
  }
  for (int k = 0; k < kKinematicsPoses; ++k) {
    theta = pose(k);
    const KinematicsRecord record = measure();
    if (!write_bytes(file, &record, sizeof record)) return 4;
  }
  return 0;
}
