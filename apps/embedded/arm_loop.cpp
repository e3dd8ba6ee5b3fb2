#include "arm_loop.hpp"

#include "isac/control/deployed.hpp"
#include "isac/models/arm/soft_arm.hpp"

namespace isac::embedded {
namespace {

constexpr float kRadiansPerCount = static_cast<float>(2.0 * kPi / kCountsPerTurn);

control::JointWatchSettings<float> watch_settings(const control::JointLimits<float>& limits) noexcept {
  const float widest = -limits.angle_low > limits.angle_high ? -limits.angle_low : limits.angle_high;
  control::JointWatchSettings<float> s;
  s.angle = {.soft = widest, .hard = widest + kPastTheBox};
  s.speed = {.soft = limits.speed, .hard = 2.0f * limits.speed};
  s.following = kFollowing;
  return s;
}

models::Vec3<float> narrow(const models::Vec3<double>& v) noexcept {
  return {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)};
}

/// The chain in float, rounded once.
void narrow(const models::Chain<double, 6>& from, models::Chain<float, 6>& to) noexcept {
  for (std::size_t i = 0; i < to.links.size(); ++i) {
    const models::DhLink<double>& link = from.links[i];
    to.links[i] = {static_cast<float>(link.alpha), static_cast<float>(link.a), static_cast<float>(link.d),
                   static_cast<float>(link.theta_offset)};
  }
  for (std::size_t i = 0; i < to.masses.size(); ++i) {
    const models::PointMass<double>& point = from.masses[i];
    to.masses[i] = {point.link, narrow(point.position), static_cast<float>(point.mass)};
  }
  to.mass_count = from.mass_count;
  to.tool_link = from.tool_link;
  to.tool = narrow(from.tool);
  to.gravity = narrow(from.gravity);
}

}  // namespace

Status ArmLoop::start(std::span<const std::byte> bytes) noexcept {
  if (started_) return Status::kNotPermitted;
  models::ParameterTable table;
  Status status = models::load_parameter_table(bytes, table);
  if (ok(status)) status = take(table);
  started_ = ok(status);
  return status;
}

Status ArmLoop::take(const models::ParameterTable& table) noexcept {
  if (table.joint_count != static_cast<int>(kJoints)) return Status::kOutOfRange;
  for (std::size_t i = 0; i < kJoints; ++i) {
    const int joint = static_cast<int>(i);
    control::JointSettings<float> settings;
    int left_out = 0;
    if (const Status status = control::settings_of(table, joint, settings); !ok(status)) return status;
    if (const Status status = control::feed_forward_of(table, joint, arm_.feed_forward[i], left_out);
        !ok(status))
      return status;
    if (const Status status = arm_.joints[i].configure(settings); !ok(status)) return status;
    left_out_ += left_out;
    watch_[i] = control::JointWatch<float>(watch_settings(settings.limits), joint);
    encoder_[i] = control::EncoderWatch<float>({.modulus = kCounterModulus,
                                                .counts_per_radian = 1.0f / kRadiansPerCount,
                                                .largest_speed = settings.limits.speed},
                                               joint);
  }
  if (table.has_masses) {
    models::SoftArmGeometry<double> geometry;
    geometry.m1 = table.masses[0];
    geometry.m2 = table.masses[1];
    geometry.m3 = table.masses[2];
    narrow(models::soft_arm_chain(geometry), arm_.chain);
    for (const models::PointMass<float>& point : arm_.chain.masses)
      if (!control::finite(point.mass)) return Status::kNotFinite;
  }
  arm_.coupling = models::soft_arm_coupling<float>();
  return Status::kOk;
}

void ArmLoop::sense(const Sample& sample, const Wanted& wanted) noexcept {
  dt_ = 1e-9f * static_cast<float>(has_last_ ? sample.now - last_ns_ : kPeriodNs);
  last_ns_ = sample.now;
  has_last_ = true;
  wanted_ = wanted.joint;

  control::Finding found = supply_.check(sample.supply, sample.answered, 0);
  const auto note = [&found](const control::Finding& here) {
    if (!found.found()) found = here;
  };
  std::uint8_t warnings = 0;
  for (std::size_t i = 0; i < kJoints; ++i) {
    note(encoder_[i].check(sample.count[i], command_[i].delta_pressure, dt_, warnings));
    now_[i].angle = static_cast<float>(encoder_[i].position()) * kRadiansPerCount;
    // A dt that is none leaves the estimate; the machine sees the time itself and vents.
    static_cast<void>(speed_[i].step(now_[i].angle, dt_, now_[i].velocity));
    note(watch_[i].check({.pressure_1 = command_[i].pressure.muscle_1,
                          .pressure_2 = command_[i].pressure.muscle_2,
                          .angle = now_[i].angle,
                          .speed = now_[i].velocity,
                          .desired_angle = wanted_[i].angle,
                          .follows = arm_.joints[i].mode() == control::Mode::kPosition},
                         dt_, warnings));
  }
  machine_.begin({.now = sample.now,
                  .sampled = sample.sampled,
                  .arm = sample.arm && started_,
                  .disarm = sample.disarm,
                  .acknowledge = sample.acknowledge,
                  .finding = found});
  for (std::size_t i = 0; i < kJoints; ++i) {
    const control::Mode mode = machine_.vents() ? control::Mode::kVented : wanted.mode;
    if (!ok(arm_.joints[i].set_mode(mode)))
      machine_.report({.code = control::FaultCode::kCommandNotFinite, .joint = static_cast<std::int8_t>(i)});
  }
}

void ArmLoop::control() noexcept {
  int failed = -1;
  if (!ok(arm_.step(now_, wanted_, dt_, command_, failed)))
    machine_.report(
        {.code = control::FaultCode::kCommandNotFinite, .joint = static_cast<std::int8_t>(failed)});
}

Valves ArmLoop::valves() const noexcept {
  Valves out;
  out.state = machine_.state();
  if (out.state == control::RunState::kFaulted) {
    out.fault = machine_.cause().code;
    out.where = machine_.cause().joint;
  }
  if (machine_.vents()) return out;
  for (std::size_t i = 0; i < kJoints; ++i) {
    out.pressure[2 * i] = command_[i].pressure.muscle_1;
    out.pressure[2 * i + 1] = command_[i].pressure.muscle_2;
    out.limited |= command_[i].limited;
  }
  return out;
}

}  // namespace isac::embedded
