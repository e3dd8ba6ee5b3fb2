#include "isac/simulate/arm_plant.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "isac/core/error.hpp"
#include "isac/models/effects_memory.hpp"
#include "isac/models/scalar.hpp"
#include "isac/models/valve_unit.hpp"

namespace isac::simulate {

namespace {

using models::cross;
using models::Vec3;
using Frames = std::array<models::Transform<double>, kArmJoints>;
using Matrix = models::Coupling<double, 6>;

[[noreturn]] void refuse(const std::string& what) {
  throw Error(ErrorKind::kUsage, "arm_plant", what);
}

/// Acceleration J̇ θ̇ of points fixed to the links, for θ̈ = 0, handed down from link to link.
struct LinkMotion {
  Vec3<double> spin, spin_rate, origin_acceleration;
};

std::array<LinkMotion, kArmJoints> link_motions(const Frames& frames, const ArmVector& theta_rate) noexcept {
  std::array<LinkMotion, kArmJoints> motion{};
  LinkMotion before;
  Vec3<double> origin{};
  for (std::size_t i = 0; i < kArmJoints; ++i) {
    LinkMotion& m = motion[i];
    const Vec3<double> arm = frames[i].p - origin;  // fixed to the link before
    const Vec3<double> turn = theta_rate[i] * frames[i].z_axis();
    m.origin_acceleration = before.origin_acceleration + cross(before.spin_rate, arm) +
                            cross(before.spin, cross(before.spin, arm));
    m.spin_rate = before.spin_rate + cross(before.spin, turn);
    m.spin = before.spin + turn;
    origin = frames[i].p;
    before = m;
  }
  return motion;
}

/// M(θ), and the torque that the arm's own weight, motion and the push put on its joints: τ_g − h + Jᵀ f.
struct Dynamics {
  Matrix mass{};
  ArmVector torque{};
};

Dynamics dynamics(const models::Chain<double, 6>& chain, const ArmVector& theta, const ArmVector& theta_rate,
                  const Vec3<double>& push) noexcept {
  const Frames frames = models::chain_frames(chain, theta);
  const auto motion = link_motions(frames, theta_rate);
  Dynamics d;
  for (int k = 0; k < chain.mass_count; ++k) {
    const models::PointMass<double>& point = chain.masses[static_cast<std::size_t>(k)];
    const auto link = static_cast<std::size_t>(point.link);
    const auto columns = models::point_jacobian<double, 6>(frames, point.link, point.position);
    const Vec3<double> arm = frames[link].apply(point.position) - frames[link].p;
    const Vec3<double> drift = motion[link].origin_acceleration + cross(motion[link].spin_rate, arm) +
                               cross(motion[link].spin, cross(motion[link].spin, arm));
    const Vec3<double> force = point.mass * (chain.gravity - drift);
    for (std::size_t i = 0; i <= link; ++i) {
      d.torque[i] += dot(columns[i], force);
      for (std::size_t j = 0; j <= i; ++j) d.mass[i][j] += point.mass * dot(columns[i], columns[j]);
    }
  }
  for (std::size_t i = 0; i < kArmJoints; ++i)
    for (std::size_t j = i + 1; j < kArmJoints; ++j) d.mass[i][j] = d.mass[j][i];
  if (push.x != 0 || push.y != 0 || push.z != 0) {
    const auto columns = models::point_jacobian<double, 6>(frames, chain.tool_link, chain.tool);
    for (std::size_t i = 0; i < kArmJoints; ++i) d.torque[i] += dot(columns[i], push);
  }
  return d;
}

/// Kᵀ M K.
Matrix through_coupling(const Matrix& mass, const Matrix& k) noexcept {
  Matrix half{}, out{};
  for (std::size_t i = 0; i < kArmJoints; ++i)
    for (std::size_t j = 0; j < kArmJoints; ++j)
      for (std::size_t l = 0; l < kArmJoints; ++l) half[i][j] += mass[i][l] * k[l][j];
  for (std::size_t i = 0; i < kArmJoints; ++i)
    for (std::size_t j = 0; j < kArmJoints; ++j)
      for (std::size_t l = 0; l < kArmJoints; ++l) out[i][j] += k[l][i] * half[l][j];
  return out;
}

/// x of m x = b, m symmetric and positive, by m = L Lᵀ.
ArmVector solve(Matrix m, ArmVector b) noexcept {
  for (std::size_t j = 0; j < kArmJoints; ++j) {
    for (std::size_t k = 0; k < j; ++k) m[j][j] -= m[j][k] * m[j][k];
    m[j][j] = std::sqrt(m[j][j]);
    for (std::size_t i = j + 1; i < kArmJoints; ++i) {
      for (std::size_t k = 0; k < j; ++k) m[i][j] -= m[i][k] * m[j][k];
      m[i][j] /= m[j][j];
    }
  }
  for (std::size_t i = 0; i < kArmJoints; ++i) {
    for (std::size_t k = 0; k < i; ++k) b[i] -= m[i][k] * b[k];
    b[i] /= m[i][i];
  }
  for (std::size_t i = kArmJoints; i-- > 0;) {
    for (std::size_t k = i + 1; k < kArmJoints; ++k) b[i] -= m[k][i] * b[k];
    b[i] /= m[i][i];
  }
  return b;
}

void check(const ArmPlantConfig& config) {
  if (!(config.step > 0) || !(config.touch_stiffness > 0) || !(config.touch_damping >= 0))
    refuse("an arm's step and touch stiffness must be above 0.");
  if (!(config.load >= 0) || config.chain.mass_count < 0 || config.chain.mass_count >= models::kMaxMasses)
    refuse("an arm carries a load of 0 kg or more, and at most 7 masses besides.");
  for (std::size_t i = 0; i < kArmJoints; ++i) {
    const ArmJointConfig& j = config.joints[i];
    const std::string name = "joint " + std::to_string(i + 1);
    const models::JointCoefficients<double>& q = j.muscle;
    if (!std::isfinite(q.A) || !std::isfinite(q.C) || !std::isfinite(q.D) || !(q.B > 0) ||
        !(j.wheel_radius > 0))
      refuse(name + " needs finite A, C, D, B above 0 and a wheel radius above 0.");
    if (!std::isfinite(j.pull) || !std::isfinite(j.pull_stiffness))
      refuse(name + " needs finite torques of what pulls on it.");
    if (!(j.inertia > 0) || !(j.friction >= 0) || !(j.friction_angle > 0) || !(j.play >= 0))
      refuse(name + " needs an inertia and a friction angle above 0, friction and play of 0 or more.");
    for (const ValveUnit& v : j.valve)
      if (!(v.gain > 0) || !(v.fill_lag >= 0) || !(v.vent_lag >= 0) || !(v.dead_time >= 0) ||
          !std::isfinite(v.offset))
        refuse(name + " needs valve units with a gain above 0 and lags and dead time of 0 or more.");
  }
}

}  // namespace

ArmPlant::ArmPlant(const ArmPlantConfig& config) : config_(config) {
  check(config);
  models::Chain<double, 6>& chain = config_.chain;
  chain.masses[static_cast<std::size_t>(chain.mass_count++)] = {chain.tool_link, chain.tool, config.load};
  for (std::size_t i = 0; i < kArmJoints; ++i)
    for (std::size_t m = 0; m < 2; ++m) {
      const double steps = std::round(config.joints[i].valve[m].dead_time / config.step);
      tubes_[i][m].delayed.assign(static_cast<std::size_t>(steps), 0.0);
    }
  rest_at({}, 3 * kPascalPerKgfCm2);
}

void ArmPlant::rest_at(const ArmVector& angle, double mean_pressure) noexcept {
  x_ = {};
  x_.angle = x_.wheel_angle = angle;
  const ArmVector gravity = models::multiply_transposed<double, 6>(
      config_.coupling,
      models::gravity_torque(config_.chain, models::multiply<double, 6>(config_.coupling, angle)));
  for (std::size_t i = 0; i < kArmJoints; ++i) {
    const ArmJointConfig& joint = config_.joints[i];
    const double borne = gravity[i] + joint.pull - joint.pull_stiffness * angle[i];
    // The slack lies on the side to which the joint is pulled.
    if (joint.play > 0)
      x_.wheel_angle[i] -= models::sgn(borne) * joint.play + borne / config_.touch_stiffness;
    double delta = 0;
    static_cast<void>(models::delta_pressure_for_torque<double>(
        joint.muscle, joint.wheel_radius, -borne, joint.play > 0 ? x_.wheel_angle[i] : angle[i], 0.0, delta));
    pressure_[i] = models::split_pressure(mean_pressure, delta);
    const std::array<double, 2> p = {pressure_[i].muscle_1, pressure_[i].muscle_2};
    std::array<double, 2> u{};
    for (std::size_t m = 0; m < 2; ++m) {
      u[m] = (p[m] - joint.valve[m].offset) / joint.valve[m].gain;
      std::fill(tubes_[i][m].delayed.begin(), tubes_[i][m].delayed.end(), u[m]);
    }
    commanded_[i] = {u[0], u[1]};
  }
}

void ArmPlant::set_velocity(const ArmVector& velocity) noexcept {
  x_.velocity = x_.wheel_velocity = velocity;
}

void ArmPlant::hold(bool held) noexcept {
  held_ = held;
  set_velocity({});
}

ArmVector ArmPlant::delta_pressure() const noexcept {
  ArmVector delta;
  for (std::size_t i = 0; i < kArmJoints; ++i) delta[i] = models::delta_pressure_of(pressure_[i]);
  return delta;
}

/// Δp at the begin, the middle and the end of one step of constant commands.
void ArmPlant::advance_valves(ArmVector& before, ArmVector& middle, ArmVector& after) noexcept {
  before = delta_pressure();
  for (std::size_t i = 0; i < kArmJoints; ++i) {
    std::array<double, 2> u = {commanded_[i].muscle_1, commanded_[i].muscle_2};
    std::array<double, 2> p = {pressure_[i].muscle_1, pressure_[i].muscle_2}, half{};
    for (std::size_t m = 0; m < 2; ++m) {
      Tube& tube = tubes_[i][m];
      if (!tube.delayed.empty()) {
        std::swap(u[m], tube.delayed[tube.next]);
        tube.next = tube.next + 1 == tube.delayed.size() ? 0 : tube.next + 1;
      }
      const ValveUnit& valve = config_.joints[i].valve[m];
      const double target = valve.gain * u[m] + valve.offset;
      const models::ValveUnit<double> lag{.gain = 1.0,
                                          .lag = target > p[m] ? valve.fill_lag : valve.vent_lag};
      half[m] = models::valve_step(lag, p[m], target, 0.5 * config_.step);
      p[m] = models::valve_step(lag, p[m], target, config_.step);
    }
    pressure_[i] = {p[0], p[1]};
    middle[i] = (half[1] - half[0]) / 2;
  }
  after = delta_pressure();
}

double ArmPlant::torque_of(std::size_t i, const State& x, double delta_pressure) const noexcept {
  const ArmJointConfig& joint = config_.joints[i];
  const bool slack = joint.play > 0;
  const double torque =
      models::joint_torque(joint.muscle, joint.wheel_radius, slack ? x.wheel_angle[i] : x.angle[i],
                           delta_pressure, slack ? x.wheel_velocity[i] : x.velocity[i]);
  return torque - joint.friction * x.friction[i];
}

double ArmPlant::touch_torque(std::size_t i, const State& x) const noexcept {
  const double over = models::dead_zone(x.wheel_angle[i] - x.angle[i], config_.joints[i].play);
  if (over == 0) return 0;
  const double torque =
      config_.touch_stiffness * over + config_.touch_damping * (x.wheel_velocity[i] - x.velocity[i]);
  return torque * over > 0 ? torque : 0;  // the chain's teeth do not stick
}

ArmPlant::State ArmPlant::rate(const State& x, const ArmVector& delta_pressure) const noexcept {
  State d;
  if (held_) return d;
  const ArmVector theta = models::multiply<double, 6>(config_.coupling, x.angle);
  const ArmVector theta_rate = models::multiply<double, 6>(config_.coupling, x.velocity);
  const Dynamics arm = dynamics(config_.chain, theta, theta_rate, push_);
  Matrix mass = through_coupling(arm.mass, config_.coupling);
  ArmVector torque = models::multiply_transposed<double, 6>(config_.coupling, arm.torque);
  for (std::size_t i = 0; i < kArmJoints; ++i) {
    const ArmJointConfig& joint = config_.joints[i];
    const bool slack = joint.play > 0;
    const double muscles = torque_of(i, x, delta_pressure[i]);
    mass[i][i] += joint.inertia;
    torque[i] += joint.pull - joint.pull_stiffness * x.angle[i];
    if (slack) {
      const double touch = touch_torque(i, x);
      d.wheel_angle[i] = x.wheel_velocity[i];
      d.wheel_velocity[i] = (muscles - touch) / joint.inertia;
      torque[i] += touch;
    } else {
      torque[i] += muscles;
    }
    if (joint.friction == 0) continue;
    const double dahl[] = {joint.friction, joint.friction_angle};
    const models::JointPoint<double> point{.velocity = slack ? x.wheel_velocity[i] : x.velocity[i]};
    models::effect::Hysteresis::derivative<double>(dahl, point, &x.friction[i], &d.friction[i]);
  }
  d.angle = x.velocity;
  d.velocity = solve(mass, torque);
  return d;
}

Status ArmPlant::run(double seconds) noexcept {
  const auto shifted = [](const State& x, const State& d, double h) {
    State y = x;
    for (std::size_t i = 0; i < kArmJoints; ++i) {
      y.angle[i] += h * d.angle[i];
      y.velocity[i] += h * d.velocity[i];
      y.friction[i] += h * d.friction[i];
      y.wheel_angle[i] += h * d.wheel_angle[i];
      y.wheel_velocity[i] += h * d.wheel_velocity[i];
    }
    return y;
  };
  const double h = config_.step;
  for (long long n = std::llround(seconds / h); n > 0; --n) {
    ArmVector before{}, middle{}, after{};
    advance_valves(before, middle, after);
    const State k1 = rate(x_, before), k2 = rate(shifted(x_, k1, h / 2), middle);
    const State k3 = rate(shifted(x_, k2, h / 2), middle), k4 = rate(shifted(x_, k3, h), after);
    x_ = shifted(shifted(shifted(shifted(x_, k1, h / 6), k2, h / 3), k3, h / 3), k4, h / 6);
    ++steps_;
    for (std::size_t i = 0; i < kArmJoints; ++i)
      if (!std::isfinite(x_.velocity[i]) || !std::isfinite(x_.angle[i])) return Status::kDeviceError;
  }
  return Status::kOk;
}

ArmVector ArmPlant::muscle_torque() const noexcept {
  ArmVector torque;
  const ArmVector delta = delta_pressure();
  for (std::size_t i = 0; i < kArmJoints; ++i) torque[i] = torque_of(i, x_, delta[i]);
  return torque;
}

models::Vec3<double> ArmPlant::tool() const noexcept {
  return models::tool_position(config_.chain, models::multiply<double, 6>(config_.coupling, x_.angle));
}

ArmEnergy ArmPlant::energy() const noexcept {
  ArmEnergy e;
  const ArmVector theta = models::multiply<double, 6>(config_.coupling, x_.angle);
  const Matrix mass = through_coupling(models::mass_matrix(config_.chain, theta), config_.coupling);
  const Frames frames = models::chain_frames(config_.chain, theta);
  for (int k = 0; k < config_.chain.mass_count; ++k) {
    const auto& m = config_.chain.masses[static_cast<std::size_t>(k)];
    e.height -=
        m.mass * dot(config_.chain.gravity, frames[static_cast<std::size_t>(m.link)].apply(m.position));
  }
  const ArmVector delta = delta_pressure();
  for (std::size_t i = 0; i < kArmJoints; ++i) {
    const ArmJointConfig& joint = config_.joints[i];
    const double r = joint.wheel_radius;
    for (std::size_t j = 0; j < kArmJoints; ++j)
      e.kinetic += 0.5 * x_.velocity[i] * mass[i][j] * x_.velocity[j];
    e.kinetic += 0.5 * joint.inertia * x_.velocity[i] * x_.velocity[i];
    double turn = x_.angle[i];
    if (joint.play > 0) {
      turn = x_.wheel_angle[i];
      e.kinetic += 0.5 * joint.inertia * x_.wheel_velocity[i] * x_.wheel_velocity[i];
      const double over = models::dead_zone(turn - x_.angle[i], joint.play);
      e.touch += 0.5 * config_.touch_stiffness * over * over;
    }
    e.height += (0.5 * joint.pull_stiffness * x_.angle[i] - joint.pull) * x_.angle[i];
    e.muscles -= 0.5 * joint.muscle.A * r * r * turn * turn + joint.muscle.B * r * delta[i] * turn;
  }
  return e;
}

}  // namespace isac::simulate
