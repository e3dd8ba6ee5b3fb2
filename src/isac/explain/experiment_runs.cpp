#include "isac/explain/experiment_runs.hpp"

#include <algorithm>
#include <cmath>

#include "isac/core/error.hpp"
#include "isac/core/units.hpp"
#include "isac/explain/encoder_motion.hpp"
#include "isac/explain/predict_parts.hpp"

namespace isac::explain {
namespace {

constexpr double kSlowTone = 0.62, kSlowShare = 0.08;  // of a hand, which never repeats itself exactly
constexpr double kSteepest = (1 - kSlowShare) + kSlowShare * kSlowTone;
constexpr int kSubsteps = 8;                 // of the free joint per sample
constexpr double kOfAngleLimit = 0.9;        // a free joint stays this far inside
constexpr double kSettling = 0.4;            // s, as in the recordings: rows of the pressure begin here
constexpr double kLeastPressure = 29419.95;  // Pa, 0.3 kg/cm2: below it muscles hang loose

/// The torque of a model at one instant, from all that the joint feels.
class Torque {
 public:
  Torque(const Predictor& predictor, const ModelPoint& model) : model_(model) {
    const RigFacts& rig = predictor.data().rig;
    point_.wheel_radius = rig.wheel_radius;
    point_.reference_pressure = rig.initial_pressure;
    for (std::size_t j = 0; j < predictor.base().size(); ++j) {
      const int e = models::find_effect(predictor.base()[j].name);
      if (e < 0) continue;
      terms_.push_back({e, model.base[j]});
      if (predictor.base()[j].name == "A") point_.stiffness = model.base[j];
      if (predictor.base()[j].name == "B") point_.pressure_gain = model.base[j];
      if (predictor.base()[j].name == "C") point_.cubic_damping = model.base[j];
      if (predictor.base()[j].name == "D") point_.damping = model.base[j];
    }
    for (const Active& a : model.effects) {
      const models::EffectInfo& info = a.hypothesis->info();
      if (info.hook == models::Hook::kTorque && info.state_count < 2) states_.push_back({&a, 0.0});
    }
  }

  void move_to(double angle, double velocity, double p1, double p2, double time) {
    point_.angle = angle;
    point_.velocity = velocity;
    point_.delta_pressure = 0.5 * (p2 - p1);
    point_.mean_pressure = 0.5 * (p1 + p2);
    point_.time = time;
  }
  void rest() {
    for (State& s : states_)
      models::effect_rest(s.active->hypothesis->effect, s.active->values.data(), point_, &s.z);
  }
  void step(double dt) {
    for (State& s : states_) {
      double rate = 0;
      models::effect_derivative(s.active->hypothesis->effect, s.active->values.data(), point_, &s.z, &rate);
      s.z += dt * rate;
    }
  }
  /// At the velocity given instead of the point's.
  [[nodiscard]] double at(double velocity) const {
    models::JointPoint<double> x = point_;
    x.velocity = velocity;
    double sum = baseline(velocity);
    for (const State& s : states_)
      sum += models::effect_torque(s.active->hypothesis->effect, s.active->values.data(), x, &s.z);
    return sum;
  }
  [[nodiscard]] double baseline(double velocity) const {
    models::JointPoint<double> x = point_;
    x.velocity = velocity;
    double sum = 0;
    for (const auto& [effect, value] : terms_) sum += models::effect_torque(effect, &value, x);
    return sum;
  }
  /// φ at which the baseline's torque is nothing.
  [[nodiscard]] double resting_angle(double p1, double p2) {
    move_to(0, 0, p1, p2, 0);
    const double here = baseline(0);
    const double stiffness = point_.stiffness * point_.wheel_radius * point_.wheel_radius;
    return stiffness < 0 ? -here / stiffness : 0.0;
  }

 private:
  struct State {
    const Active* active;
    double z;
  };
  const ModelPoint& model_;
  models::JointPoint<double> point_;
  std::vector<std::pair<int, double>> terms_;
  std::vector<State> states_;
};

/// Motion of the free joint: symplectic Euler; where neither direction's torque leads away, dry friction holds it.
bool move_freely(const RigFacts& rig, Torque& torque, double angle_limit, PreparedRun& run) {
  constexpr double kCreeping = 1e-9;  // rad/s: on which side of rest
  const std::size_t n = run.time.size();
  const double dt = run.interval / kSubsteps;
  const auto& p = run.raw_pressure;
  double angle = torque.resting_angle(p[0][0], p[1][0]), velocity = 0;
  torque.move_to(angle, 0, p[0][0], p[1][0], 0);
  torque.rest();
  for (std::size_t k = 0; k < n; ++k) {
    run.angle[k] = angle;
    run.velocity[k] = velocity;
    torque.move_to(angle, velocity, p[0][k], p[1][k], run.time[k]);
    const double up = torque.at(kCreeping), down = torque.at(-kCreeping);
    const bool held = velocity == 0 && up <= 0 && down >= 0;
    run.acceleration[k] = held            ? 0.0
                          : velocity == 0 ? (up > 0 ? up : down) / rig.inertia
                                          : torque.at(velocity) / rig.inertia;
    if (!(std::abs(angle) < angle_limit)) return false;
    for (int i = 0; i < kSubsteps; ++i) {
      torque.move_to(angle, velocity, p[0][k], p[1][k], run.time[k] + i * dt);
      double push = 0;
      if (velocity == 0) {
        const double forward = torque.at(kCreeping), back = torque.at(-kCreeping);
        push = forward > 0 ? forward : (back < 0 ? back : 0.0);
      } else {
        push = torque.at(velocity);
      }
      const double next = velocity + dt * push / rig.inertia;
      velocity = velocity * next < 0 ? 0.0 : next;
      angle += dt * velocity;
      torque.step(dt);
    }
  }
  return true;
}

void move_by_hand(const PlannedRun& planned, double middle, PreparedRun& run) {
  const double a = planned.amplitude_rad, rate = planned.peak_speed_rad_s / (kSteepest * a);
  for (std::size_t k = 0; k < run.time.size(); ++k) {
    const double t = rate * run.time[k], s = kSlowTone * t;
    run.angle[k] = middle + a * ((1 - kSlowShare) * std::sin(t) + kSlowShare * std::sin(s));
    run.velocity[k] = a * rate * ((1 - kSlowShare) * std::cos(t) + kSlowShare * kSlowTone * std::cos(s));
    run.acceleration[k] = -a * rate * rate *
                          ((1 - kSlowShare) * std::sin(t) + kSlowShare * kSlowTone * kSlowTone * std::sin(s));
  }
}

void press(const series::Program& program, double gain, double lag, PreparedRun& run) {
  const std::size_t n = run.time.size();
  const double keep = std::exp(-run.interval / lag);
  for (int i = 0; i < 2; ++i) {
    run.command[i].resize(n);
    run.raw_pressure[i].resize(n);
  }
  for (std::size_t k = 0; k < n; ++k) {
    const series::Pressures u = program.at(run.time[k]);
    run.command[0][k] = u.p1;
    run.command[1][k] = u.p2;
  }
  for (int i = 0; i < 2; ++i) {
    double p = gain * run.command[i][0];
    for (std::size_t k = 0; k < n; ++k) {
      run.raw_pressure[i][k] = p;
      p = gain * run.command[i][k] + keep * (p - gain * run.command[i][k]);
    }
    run.smooth_pressure[i] = run.pressure[i] = run.raw_pressure[i];
  }
}

/// Forces that the sensors would read; false if they cannot.
bool pull(const RigRange& range, Torque& torque, double radius, PreparedRun& run) {
  const std::size_t n = run.time.size();
  for (auto& force : run.force) force.resize(n);
  run.common_force.resize(n);
  double largest = 0, least = range.force_limit;
  for (std::size_t k = 0; k < n; ++k) {
    const double p1 = run.raw_pressure[0][k], p2 = run.raw_pressure[1][k];
    torque.move_to(run.angle[k], run.velocity[k], p1, p2, run.time[k]);
    const double half = 0.5 * torque.baseline(run.velocity[k]) / radius,
                 common = range.common_force(0.5 * (p1 + p2));
    run.common_force[k] = common;
    run.force[0][k] = common - half;
    run.force[1][k] = common + half;
    largest = std::max(largest, common + std::abs(half));
    least = std::min(least, common - std::abs(half));
  }
  return largest <= range.force_limit && least >= range.least_force;
}

/// The encoder as the model has it: a reading that drifts counts on while the bar is clamped.
void read_angle(const ModelPoint& model, PreparedRun& run) {
  for (const Active& a : model.effects) {
    const models::EffectInfo& info = a.hypothesis->info();
    if (info.hook != models::Hook::kReading || info.state_count > 0) continue;
    for (std::size_t k = 0; k < run.time.size(); ++k) {
      models::Readings<double> read;
      read.angle = run.angle[k];
      models::effect_reading(a.hypothesis->effect, a.values.data(), time_of(*a.hypothesis, run, k),
                             static_cast<const double*>(nullptr), read);
      run.angle[k] = read.angle;
    }
  }
}

void add_rows(Prepared& data, const RigRange& range) {
  const PreparedRun& run = data.runs.front();
  const double slowest = run.experiment == "constant-pressure" ? told_speed(data.rig.angle_step) : 0.0;
  const auto put = [&](Chain chain, double from, std::size_t step) {
    for (std::size_t k = 0; k < run.time.size(); k += step)
      if (run.time[k] >= from && (chain != Chain::kTorque || std::abs(run.velocity[k]) >= slowest))
        data.rows.push_back({.run = 0, .sample = static_cast<unsigned>(k), .block = 0, .chain = chain});
  };
  const auto stride = static_cast<std::size_t>(data.stride);
  if (run.has_torque && (!run.is_free || range.free_torque)) put(Chain::kTorque, 0, stride);
  if (run.has_command) {
    put(Chain::kPressure1, kSettling, 2 * stride);
    put(Chain::kPressure2, kSettling, 2 * stride);
  }
  if (run.is_free) put(Chain::kMotion, 0, stride);
  data.run_begin = {0, data.rows.size()};
  data.blocks = 1;
}

}  // namespace

double base_value(const Predictor& predictor, const ModelPoint& model, const char* name, double otherwise) {
  for (std::size_t j = 0; j < predictor.base().size(); ++j)
    if (predictor.base()[j].name == name) return model.base[j];
  return otherwise;
}

double fastest_by_hand(double amplitude) noexcept {
  constexpr double kShortestStroke = 0.15;  // s, from one end to the other
  return kPi * amplitude / kShortestStroke;
}

double least_seconds(const PlannedRun& run) {
  double period = 0;
  if (run.pressure_swing_kgcm2 > 0 && run.waveform != "hold") period = run.pressure_period_s;
  if (run.experiment == "constant-pressure")
    period = std::max(period, 2 * kPi * kSteepest * run.amplitude_rad / run.peak_speed_rad_s);
  return std::max(10.0, 5 * std::ceil(0.2 * period));
}

series::PlanRun plan_run(const PlannedRun& run) {
  // Four digits are what a person would write; "1.7000000000000002 kg/cm2" is not.
  const auto written = [](double value) { return std::round(value * 1e4) / 1e4; };
  const auto pascals = [&](double value) { return written(value) * kPascalPerKgfCm2; };
  return {.experiment = run.experiment,
          .duration = run.seconds,
          .delta_pressure = pascals(run.delta_pressure_kgcm2),
          .mean_pressure = pascals(run.mean_pressure_kgcm2),
          .amplitude = written(run.amplitude_rad),
          .middle = written(run.middle_rad),
          .peak_speed = written(run.peak_speed_rad_s),
          .pressure_swing = pascals(run.pressure_swing_kgcm2),
          .pressure_period = written(run.pressure_period_s),
          .waveform = run.waveform};
}

std::optional<Prepared> would_record(const Predictor& recorded, const ModelPoint& model,
                                     const RigRange& range, const PlannedRun& planned) {
  const Prepared& before = recorded.data();
  constexpr double kTellsWell = 1.5;  // of the speed at which a hand's direction may be untold
  if (planned.experiment == "constant-pressure" &&
      !(planned.peak_speed_rad_s <= std::min(range.speed, fastest_by_hand(planned.amplitude_rad)) &&
        planned.peak_speed_rad_s >= kTellsWell * told_speed(before.rig.angle_step)))
    return std::nullopt;
  series::Program program;
  try {
    program = series::plan_programs({.runs = {plan_run(planned)}}, range.limits, 1).front();
  } catch (const Error&) {  // isac-log would refuse it
    return std::nullopt;
  }
  for (const series::Knot& knot : program.knots)
    if (std::min(knot.p1, knot.p2) < kLeastPressure) return std::nullopt;

  Prepared data;
  data.rig = before.rig;
  data.baseline = before.baseline;
  data.smoothing = before.smoothing;
  data.first_start = before.first_start;
  // Half the row's spacing is enough for what the kernel leaves.
  data.stride = 2;
  PreparedRun run;
  run.name = "planned";
  run.recorded = false;
  run.experiment = planned.experiment;
  run.interval = 0.5 * range.row_spacing;
  run.day_offset = range.day_offset;
  run.is_free = planned.experiment == "free";
  run.has_torque = run.has_pressure = true;
  run.has_command = range.valves;
  const auto n = static_cast<std::size_t>(planned.seconds / run.interval + 1);
  run.time.resize(n);
  for (std::size_t k = 0; k < n; ++k) run.time[k] = static_cast<double>(k) * run.interval;
  run.usable.assign(n, 1);
  press(program, base_value(recorded, model, "K_C", 1.0), base_value(recorded, model, "T_C", 0.17), run);

  Torque torque(recorded, model);
  run.angle.assign(n, 0.0);
  run.velocity.assign(n, 0.0);
  run.acceleration.assign(n, 0.0);
  if (run.is_free) {
    if (!range.moves_freely ||
        !move_freely(before.rig, torque, kOfAngleLimit * range.limits.angle_limit, run))
      return std::nullopt;
  } else if (planned.experiment == "constant-pressure") {
    const double middle = std::isfinite(planned.middle_rad)
                              ? planned.middle_rad
                              : torque.resting_angle(run.raw_pressure[0][0], run.raw_pressure[1][0]);
    if (std::abs(middle) + planned.amplitude_rad > range.angle * 1.2) return std::nullopt;
    move_by_hand(planned, middle, run);
  } else {
    run.angle.assign(
        n, planned.experiment == "pcu-step" || !std::isfinite(planned.middle_rad) ? 0.0 : planned.middle_rad);
  }
  if (range.mean_force > 0 && !pull(range, torque, before.rig.wheel_radius, run)) return std::nullopt;
  read_angle(model, run);
  run.raw_angle = run.angle;
  if (const double step = before.rig.angle_step; std::isfinite(step) && step > 0)
    for (double& angle : run.raw_angle) angle = step * std::round(angle / step);
  run.dry_velocity = dry_velocity(run.raw_angle, run.velocity, run.interval, before.rig.angle_step);
  run.slow_acceleration = run.acceleration;
  if (run.is_free)
    run.swing = {.angle = run.angle, .velocity = run.velocity, .acceleration = run.acceleration, .lead = 0};
  run.torque.assign(n, 0.0);
  run.smooth_torque = run.slow_torque = run.torque;
  data.runs.push_back(std::move(run));
  add_rows(data, range);
  return data;
}

}  // namespace isac::explain
