#include "plant.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace blind {
namespace {

constexpr double kTwoPi = 2.0 * std::numbers::pi;

double sign_of(double x) {
  return x > 0.0 ? 1.0 : x < 0.0 ? -1.0 : 0.0;
}
double above(double x) {
  return x > 0.0 ? x : 0.0;
}

/// Play: the follower stays within ±half of the leader.
double follow_play(double follower, double leader, double half) {
  return std::clamp(follower, leader - half, leader + half);
}

// -------------------------------------------------------------------------------------------- valve units

class Valves {
 public:
  Valves(const Rig& rig, const Hidden& h, const RunPlan& run) : rig_(rig), h_(h), run_(run) {
    direct_ = h.dead_time == 0 && h.second_lag == 0 && h.vent_ratio == 0 && h.slowness == 0 &&
              h.deadband == 0 && h.droop == 0 && h.pump == 0 && h.leak_1 == 0 && h.leak_2 == 0 &&
              h.valve_play == 0;
    for (int i = 0; i < 2; ++i) {
      unit_[i].command = command(i, 0.0, kRowTime);
      unit_[i].lagged = unit_[i].command;
      unit_[i].pressure = target(unit_[i].command);
    }
    if (!direct_)  // at rest under the first command, whatever is hidden
      for (int k = 0; k < 4000; ++k) step(0.0, 1e-3, 0.0);
  }

  [[nodiscard]] bool direct() const { return direct_; }

  /// 1 − e^(−h/T), kept as long as h stays.
  struct Lag {
    double time = 0.0, step = 0.0, share = 0.0;
    double of(double h, double T) {
      if (h != step || T != time) {
        step = h;
        time = T;
        share = 1.0 - std::exp(-h / T);
      }
      return share;
    }
  };

  /// From t to t + h; `turned` is how far the joint turned in it.
  void step(double t, double h, double turned) {
    const double sag = h_.droop * flow_;
    double filling = 0.0;
    for (int i = 0; i < 2; ++i) {
      Unit& u = unit_[i];
      double demand = command(i, t - h_.dead_time, h);
      if (h_.valve_play != 0) demand = u.command = follow_play(u.command, demand, h_.valve_play);
      if (h_.second_lag != 0) demand = advance(u.lagged, second_.of(h, h_.second_lag), demand);
      const double error = target(demand) * (1.0 - sag) - u.pressure;
      double change =
          error * (error < 0.0 ? vent_.of(h, rig_.T_C * (1.0 + h_.vent_ratio)) : fill_.of(h, rig_.T_C));
      if (h_.deadband != 0 && std::abs(error) < h_.deadband) change = 0.0;
      if (h_.slowness != 0) change = std::clamp(change, -h / h_.slowness, h / h_.slowness);
      filling += above(change);
      change -= (i == 0 ? h_.leak_1 : h_.leak_2) * h * u.pressure;
      change += (i == 0 ? -h_.pump : h_.pump) * turned;
      u.pressure += change;
    }
    if (h_.droop != 0) flow_ += (1.0 - std::exp(-h / h_.droop_time)) * (filling / h - flow_);
  }

  [[nodiscard]] double p1(double day) const {
    return unit_[0].pressure + h_.crosstalk * unit_[1].pressure + hunting(day, 0.0);
  }
  [[nodiscard]] double p2(double day) const { return unit_[1].pressure + hunting(day, 1.7); }

 private:
  struct Unit {
    double command = 0.0, lagged = 0.0, pressure = 0.0;
  };

  /// The lag moves on; what follows it sees the middle of the step.
  static double advance(double& state, double share, double input) {
    const double before = state;
    state += share * (input - state);
    return 0.5 * (before + state);
  }
  [[nodiscard]] double target(double demand) const { return rig_.K_C * demand + h_.valve_offset; }
  [[nodiscard]] double hunting(double day, double phase) const {
    if (h_.hunting == 0) return 0.0;
    return h_.hunting * std::sin(kTwoPi * h_.hunting_frequency * day + h_.hunting_phase + phase);
  }
  /// The mean command from t to t + h; it changes at rows only.
  [[nodiscard]] double command(int i, double t, double h) const {
    const auto& u = i == 0 ? run_.command_1 : run_.command_2;
    const auto held = [&](double row) {
      return u[static_cast<std::size_t>(std::clamp(row, 0.0, run_.rows() - 1.0))];
    };
    constexpr double kTiny = 1e-6;  // of a row: time is a sum of steps
    const double from = t * kRate, to = (t + h) * kRate, row = std::floor(to - kTiny);
    if (from + kTiny >= row) return held(row);
    return ((row - from) * held(std::floor(from + kTiny)) + (to - row) * held(row)) / (to - from);
  }

  const Rig& rig_;
  const Hidden& h_;
  const RunPlan& run_;
  Unit unit_[2];
  Lag fill_, vent_, second_;
  double flow_ = 0.0;
  bool direct_ = true;
};

// -------------------------------------------------------------------------------------------- muscles

/// The pair with its memory. `at` looks ahead within a step without moving the memory; `settle` moves it.
class Muscles {
 public:
  Muscles(const Rig& rig, const Hidden& h, double angle) : rig_(rig), h_(h), wheel_(angle), rest_(angle) {
    memory_ = h.hysteresis != 0 || h.asym_up != 0 || h.creep != 0 || h.maxwell != 0 || h.heat_friction != 0 ||
              h.play != 0;
  }

  [[nodiscard]] bool memory() const { return memory_; }

  void clock(double day) {
    day_ = day;
    const double warm = 1.0 - std::exp(-day / h_.warm_time);
    A_ = rig_.A * (1.0 + h_.warm_A * warm) * (day >= h_.wear_time ? 1.0 - h_.wear : 1.0);
    B_ = rig_.B * (1.0 + h_.warm_B * warm);
    gripped_ = false;
    if (h_.sticking != 0) {
      const auto window = static_cast<std::uint64_t>(day / h_.sticking_window);
      if (window != window_) gripped_drawn_ = Random(h_.seed + window).uniform() < h_.sticking_share;
      window_ = window;
      gripped_ = gripped_drawn_;
    }
  }

  void pressures(double p1, double p2) {
    p1_ = p1;
    p2_ = p2;
  }

  [[nodiscard]] double wheel(double angle) const {
    return h_.play != 0 ? follow_play(wheel_, angle, h_.play) : angle;
  }
  [[nodiscard]] double wheel_speed(double angle, double speed) const {
    if (h_.play == 0) return speed;
    const double gap = angle - wheel_;
    return std::abs(gap) >= h_.play * (1.0 - 1e-12) && gap * speed > 0.0 ? speed : 0.0;
  }

  [[nodiscard]] double pull() const {
    return rig_.pull_zero + rig_.pull_gain * 0.5 * (effective(p1_) + effective(p2_));
  }

  /// All but dry friction, at a joint angle and speed (N m).
  [[nodiscard]] double smooth(double angle, double speed) const {
    const double phi = wheel(angle), w = wheel_speed(angle, speed);
    const double p1 = effective(p1_);
    double p2 = effective(p2_);
    if (h_.bent_gain != 0) p2 -= h_.bent_gain * above(p2 - h_.bent_pressure);
    const double delta = 0.5 * (p2 - p1), mean = 0.5 * (p1_ + p2_);
    const double r = rig_.r * (1.0 + h_.lever * phi * phi);
    double T = A_ * r * r * phi + B_ * r * delta - (rig_.C + h_.cubic_damping) * w * w * w -
               (rig_.D + h_.linear_damping) * w;
    T += h_.torque_offset + h_.asymmetry * rig_.r * mean;
    T -= h_.cubic_stiffness * phi * phi * phi;
    T += h_.mean_stiffness * rig_.A * rig_.r * rig_.r * phi * (mean / rig_.p0 - 1.0);
    T += h_.quadratic * delta * rig_.r * rig_.r * rig_.r * phi * phi;
    T -= h_.slack_share * rig_.A * rig_.r * rig_.r * above(std::abs(phi) - h_.slack_angle) * sign_of(phi);
    if (h_.ripple != 0) T += h_.ripple * std::sin(h_.ripple_teeth * phi + h_.ripple_phase);
    T -= h_.mean_damping * w * (mean - rig_.p0);
    T += h_.cubic_pressure * delta * delta * delta;
    if (h_.periodic != 0)
      T += h_.periodic * std::sin(kTwoPi * h_.periodic_frequency * day_ + h_.periodic_phase);
    T += h_.odd_pressure_angle * rig_.r * delta * std::abs(phi) * phi;
    if (h_.root_damping != 0) T -= h_.root_damping * std::sqrt(std::abs(w)) * sign_of(w);
    T -= h_.angle_damping * w * phi * phi;
    if (h_.step_stiffness != 0)
      T -= h_.step_stiffness *
           (std::clamp(phi, h_.step_from, h_.step_to) - std::clamp(0.0, h_.step_from, h_.step_to));
    if (!memory_) return T;
    const double moved = phi - wheel_;
    if (h_.hysteresis != 0) T -= h_.hysteresis * dahl(moved);
    if (h_.asym_up != 0) T -= asymmetric(moved);
    T -= h_.creep * (phi - rest_);
    T -= spring_ + h_.maxwell * moved;
    return T;
  }

  /// Magnitude of the dry friction when sliding at this speed (N m).
  [[nodiscard]] double dry(double angle, double speed) const {
    double f = h_.coulomb + h_.stribeck_slide;
    if (h_.stribeck_extra != 0) {
      const double ratio = speed / h_.stribeck_speed;
      f += h_.stribeck_extra * std::exp(-ratio * ratio);
    }
    if (h_.loaded != 0) f += h_.loaded * std::pow(above(0.5 * (p1_ + p2_)) / rig_.p0, h_.loaded_power);
    f += h_.angle_friction * std::abs(angle) + h_.heat_friction * heat_;
    return gripped_ ? f + h_.sticking : f;
  }

  /// The step is done: the joint stands at `angle`.
  void settle(double angle, double speed, double h) {
    if (!memory_) return;
    const double phi = wheel(angle), moved = phi - wheel_;
    if (h_.hysteresis != 0) bristle_ = dahl(moved);
    if (h_.asym_up != 0) force_ = asymmetric(moved);
    wheel_ = phi;
    if (h_.creep != 0) rest_ += (1.0 - std::exp(-h / h_.creep_time)) * (phi - rest_);
    if (h_.maxwell != 0) spring_ = (spring_ + h_.maxwell * moved) * std::exp(-h / h_.maxwell_time);
    if (h_.heat_friction != 0) heat_ += (1.0 - std::exp(-h / h_.heat_time)) * (std::abs(speed) - heat_);
  }

 private:
  [[nodiscard]] double effective(double p) const { return h_.threshold != 0 ? above(p - h_.threshold) : p; }

  // dz/dφ = (1 − z s)/φ_s, s = sgn φ̇, has the solution z = s + (z0 − s) e^(−|Δφ|/φ_s).
  [[nodiscard]] double dahl(double moved) const {
    const double s = sign_of(moved);
    return s == 0.0 ? bristle_ : s + (bristle_ - s) * std::exp(-std::abs(moved) / h_.hysteresis_reach);
  }
  [[nodiscard]] double asymmetric(double moved) const {
    if (moved == 0.0) return force_;
    const double end = moved > 0.0 ? h_.asym_up : -h_.asym_down;
    const double reach = moved > 0.0 ? h_.asym_reach_up : h_.asym_reach_down;
    return end + (force_ - end) * std::exp(-std::abs(moved) / reach);
  }

  const Rig& rig_;
  const Hidden& h_;
  double p1_ = 0, p2_ = 0, A_ = 0, B_ = 0, day_ = 0;
  double wheel_, rest_, bristle_ = 0, force_ = 0, spring_ = 0, heat_ = 0;
  std::uint64_t window_ = ~std::uint64_t{0};
  bool memory_ = false, gripped_ = false, gripped_drawn_ = false;
};

// -------------------------------------------------------------------------------------------- free joint

/// I φ̈ = torque of the muscles and what else acts on the joint.
class Joint {
 public:
  Joint(const Rig& rig, const Hidden& h, const Muscles& muscles, double angle)
      : h_(h), muscles_(muscles), angle_(angle), far_angle_(angle) {
    inertia_ = rig.inertia + h.added_inertia;
    if (h.compliance != 0) {
      far_inertia_ = inertia_ * h.second_share;
      inertia_ -= far_inertia_;
      stiffness_ = 1.0 / h.compliance;
      const double reduced = inertia_ * far_inertia_ / (inertia_ + far_inertia_);
      damping_ = 2.0 * h.second_damping * std::sqrt(stiffness_ * reduced);
    }
  }

  [[nodiscard]] double angle() const { return angle_; }
  [[nodiscard]] double speed() const { return speed_; }

  /// What the muscles give now, dry friction with it: when it sticks, that which holds.
  [[nodiscard]] double muscle_torque() const {
    const double smooth = muscles_.smooth(angle_, speed_), held = muscles_.dry(angle_, speed_);
    if (speed_ != 0.0) return smooth - held * sign_of(muscles_.wheel_speed(angle_, speed_));
    const double all = smooth + others(angle_, 0.0, far_angle_, far_speed_), limit = held + h_.bearing;
    if (limit == 0.0) return smooth;
    return smooth - held / limit * std::clamp(all, -limit, limit);
  }

  void advance(double h) {
    // At most a few events in a step; each goes on with what is left of it.
    for (int events = 0; h > 0.0 && events < 4; ++events) {
      double direction = sign_of(speed_);
      const double dry_now = muscles_.dry(angle_, 0.0) + h_.bearing;
      if (direction == 0.0) {
        const double drive = muscles_.smooth(angle_, 0.0) + others(angle_, 0.0, far_angle_, far_speed_);
        if (std::abs(drive) <= dry_now) {
          if (h_.compliance == 0) return;  // it sticks
          far_step(h);
          return;
        }
        direction = sign_of(drive);
      }
      const State before{angle_, speed_, far_angle_, far_speed_};
      const State after = runge_kutta(before, h, direction);
      if (dry_now == 0.0 || after.w * direction >= 0.0) {
        set(after);
        return;
      }
      // It stops within the step: go to that moment, at rest, and look again.
      const double share = before.w / (before.w - after.w);
      State stopped = runge_kutta(before, share * h, direction);
      stopped.w = 0.0;
      set(stopped);
      h *= 1.0 - share;
      if (share == 0.0) return;
    }
  }

 private:
  struct State {
    double phi, w, far_phi, far_w;
  };

  [[nodiscard]] double others(double phi, double w, double far_phi, double far_w) const {
    double T = -h_.quadratic_damping * w * std::abs(w);
    if (h_.gravity != 0) T -= h_.gravity * std::sin(phi + h_.gravity_angle);
    if (h_.stop_stiffness != 0) {
      if (h_.stop_side >= 0) T -= h_.stop_stiffness * above(phi - h_.stop_angle);
      if (h_.stop_side <= 0) T += h_.stop_stiffness * above(-phi - h_.stop_angle);
    }
    if (h_.compliance != 0) T -= stiffness_ * (phi - far_phi) + damping_ * (w - far_w);
    return T;
  }

  [[nodiscard]] State slope(const State& s, double direction) const {
    double T = muscles_.smooth(s.phi, s.w) + others(s.phi, s.w, s.far_phi, s.far_w);
    T -= direction * (muscles_.dry(s.phi, s.w) + h_.bearing);
    State d{s.w, T / inertia_, 0.0, 0.0};
    if (h_.compliance != 0) {
      d.far_phi = s.far_w;
      d.far_w = (stiffness_ * (s.phi - s.far_phi) + damping_ * (s.w - s.far_w)) / far_inertia_;
    }
    return d;
  }

  static State moved(const State& s, const State& d, double h) {
    return {s.phi + h * d.phi, s.w + h * d.w, s.far_phi + h * d.far_phi, s.far_w + h * d.far_w};
  }

  [[nodiscard]] State runge_kutta(const State& s, double h, double direction) const {
    const State a = slope(s, direction), b = slope(moved(s, a, 0.5 * h), direction);
    const State c = slope(moved(s, b, 0.5 * h), direction), d = slope(moved(s, c, h), direction);
    const auto mean = [](double k1, double k2, double k3, double k4) {
      return (k1 + 2.0 * (k2 + k3) + k4) / 6.0;
    };
    return moved(s,
                 {mean(a.phi, b.phi, c.phi, d.phi), mean(a.w, b.w, c.w, d.w),
                  mean(a.far_phi, b.far_phi, c.far_phi, d.far_phi), mean(a.far_w, b.far_w, c.far_w, d.far_w)},
                 h);
  }

  /// The wheel sticks; what hangs on the spring swings on (semi-implicit, it is exact enough for a moment of sticking).
  void far_step(double h) {
    far_speed_ += h * (stiffness_ * (angle_ - far_angle_) - damping_ * far_speed_) / far_inertia_;
    far_angle_ += h * far_speed_;
  }

  void set(const State& s) {
    angle_ = s.phi;
    speed_ = s.w;
    far_angle_ = s.far_phi;
    far_speed_ = s.far_w;
  }

  const Hidden& h_;
  const Muscles& muscles_;
  double inertia_ = 1, far_inertia_ = 0, stiffness_ = 0, damping_ = 0;
  double angle_, speed_ = 0, far_angle_, far_speed_ = 0;
};

// -------------------------------------------------------------------------------------------- sensors

/// The angle `skew` seconds ago, by the cubic through four rows.
double earlier(const std::vector<double>& angle, std::size_t k, double skew) {
  const double at = static_cast<double>(k) - skew * kRate;
  if (at <= 0.0) return angle.front();
  const auto i = static_cast<std::size_t>(at);
  const double x = at - static_cast<double>(i);
  const auto y = [&](std::ptrdiff_t j) {
    const auto last = static_cast<std::ptrdiff_t>(angle.size()) - 1;
    return angle[static_cast<std::size_t>(
        std::clamp<std::ptrdiff_t>(static_cast<std::ptrdiff_t>(i) + j, 0, last))];
  };
  return -x * (x - 1) * (x - 2) / 6 * y(-1) + (x + 1) * (x - 1) * (x - 2) / 2 * y(0) -
         (x + 1) * x * (x - 2) / 2 * y(1) + (x + 1) * x * (x - 1) / 6 * y(2);
}

void sense(const Hidden& h, const RunPlan& run, Signals& s) {
  const std::size_t rows = s.angle.size();
  if (h.skew != 0) {
    const std::vector<double> true_angle = s.angle;
    for (std::size_t k = 0; k < rows; ++k) s.angle[k] = earlier(true_angle, k, h.skew);
  }
  Random spikes(h.seed ^ static_cast<std::uint64_t>(run.started * 977.0 + 13.0));
  double follower = s.angle.empty() ? 0.0 : s.angle.front();
  for (std::size_t k = 0; k < rows; ++k) {
    const double day = run.started + static_cast<double>(k) * kRowTime;
    if (h.encoder_play != 0) s.angle[k] = follower = follow_play(follower, s.angle[k], h.encoder_play);
    s.angle[k] = s.angle[k] * (1.0 + h.encoder_gain) + h.encoder_offset + h.encoder_drift * day;
    if (h.slip != 0 && day >= h.slip_time) s.angle[k] += h.slip;
    s.p1[k] = s.p1[k] * (1.0 + h.pressure_gain_1) + h.pressure_offset_1;
    s.p2[k] = s.p2[k] * (1.0 + h.pressure_gain_2) + h.pressure_offset_2;
    s.F1[k] = s.F1[k] * (1.0 + h.force_gain_1) + h.force_offset_1 + h.force_drift_1 * day;
    s.F2[k] = s.F2[k] * (1.0 + h.force_gain_2) + h.force_offset_2 + h.force_drift_2 * day;
    if (h.hum != 0) {
      s.F1[k] += h.hum * std::sin(kTwoPi * h.hum_frequency * day + h.hum_phase_1);
      s.F2[k] += h.hum * std::sin(kTwoPi * h.hum_frequency * day + h.hum_phase_2);
    }
    if (h.spikes != 0) {
      if (spikes.uniform() < h.spike_share) s.F1[k] += h.spikes * spikes.sign() * spikes.uniform(0.5, 1.5);
      if (spikes.uniform() < h.spike_share) s.F2[k] += h.spikes * spikes.sign() * spikes.uniform(0.5, 1.5);
    }
    if (h.clip != 0) {
      s.F1[k] = std::min(s.F1[k], h.clip);
      s.F2[k] = std::min(s.F2[k], h.clip);
    }
  }
}

}  // namespace

Signals simulate(const Rig& rig, const RunPlan& run, const Hidden& hidden, double step) {
  const int rows = run.rows(), per_row = std::max(1, static_cast<int>(std::lround(kRowTime / step)));
  Signals out;
  for (auto* column : {&out.angle, &out.p1, &out.p2, &out.F1, &out.F2})
    column->resize(static_cast<std::size_t>(rows));

  Valves valves(rig, hidden, run);
  const double start = run.free ? run.release_angle : run.hand.front();
  Muscles muscles(rig, hidden, start);
  Joint joint(rig, hidden, muscles, start);
  const bool lagged = hidden.force_lag != 0;
  // By hand, without memory and with plain valves, a row is one exact step.
  const int parts = run.free || !valves.direct() || muscles.memory() || lagged ? per_row : 1;
  const double h = kRowTime / parts;
  double angle = start, speed = 0.0, F1 = 0.0, F2 = 0.0;

  const auto forces = [&](double& f1, double& f2) {
    const double T = run.free ? joint.muscle_torque()
                              : muscles.smooth(angle, speed) -
                                    muscles.dry(angle, speed) * sign_of(muscles.wheel_speed(angle, speed));
    f1 = muscles.pull() - T / (2.0 * rig.r);
    f2 = muscles.pull() + T / (2.0 * rig.r);
  };

  for (int k = 0; k < rows; ++k) {
    const auto row = static_cast<std::size_t>(k);
    const double t = k * kRowTime, day = run.started + t;
    muscles.clock(day);
    muscles.pressures(valves.p1(day), valves.p2(day));
    if (!run.free) {
      angle = run.hand[row];
      speed = run.hand_velocity[row];
    }
    double now_1 = 0.0, now_2 = 0.0;
    forces(now_1, now_2);
    if (k == 0 || !lagged) {
      F1 = now_1;
      F2 = now_2;
    }
    out.angle[row] = run.free ? joint.angle() : angle;
    out.p1[row] = valves.p1(day);
    out.p2[row] = valves.p2(day);
    out.F1[row] = F1;
    out.F2[row] = F2;

    const std::size_t next = std::min(row + 1, static_cast<std::size_t>(rows) - 1);
    for (int i = 0; i < parts; ++i) {
      const double t0 = t + i * h, day1 = run.started + t0 + h;
      if (run.free) {
        // Pressures at the middle of the step: second order, as the lag is exact.
        const double a1 = valves.p1(day1 - h), a2 = valves.p2(day1 - h);
        valves.step(t0, h, joint.speed() * h);
        const double b1 = valves.p1(day1), b2 = valves.p2(day1);
        muscles.clock(day1 - 0.5 * h);
        muscles.pressures(0.5 * (a1 + b1), 0.5 * (a2 + b2));
        joint.advance(h);
        muscles.settle(joint.angle(), joint.speed(), h);
        muscles.pressures(b1, b2);
      } else {
        // The hand between two rows: the cubic through both angles and velocities.
        const double x = (i + 1.0) / parts, y = 1.0 - x;
        const double v0 = run.hand_velocity[row] * kRowTime, v1 = run.hand_velocity[next] * kRowTime;
        const double from = run.hand[row], to = run.hand[next];
        const double ahead =
            from * (1 + 2 * x) * y * y + v0 * x * y * y + to * x * x * (3 - 2 * x) - v1 * x * x * y;
        valves.step(t0, h, ahead - angle);
        angle = ahead;
        speed = ((to - from) * 6 * x * y + v0 * y * (1 - 3 * x) + v1 * x * (3 * x - 2)) * kRate;
        muscles.settle(angle, speed, h);
        if (lagged) {
          muscles.clock(day1);
          muscles.pressures(valves.p1(day1), valves.p2(day1));
        }
      }
      if (lagged) {
        const double before_1 = now_1, before_2 = now_2;
        forces(now_1, now_2);
        const double gain = 1.0 - std::exp(-h / hidden.force_lag);
        F1 += gain * (0.5 * (before_1 + now_1) - F1);
        F2 += gain * (0.5 * (before_2 + now_2) - F2);
      }
    }
  }
  sense(hidden, run, out);
  return out;
}

}  // namespace blind
