#include "plant.hpp"

#include <algorithm>
#include <cmath>

#include "free_joint.hpp"
#include "muscles.hpp"
#include "plant_parts.hpp"
#include "valves.hpp"

namespace blind {
namespace {

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

}  // namespace

void read_sensors(const Hidden& h, const RunPlan& run, Signals& s) {
  if (sensors_are_true(h)) return;
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

Signals simulate(const Rig& rig, const RunPlan& run, const Hidden& hidden, double step) {
  Signals out = move_rig(rig, run, hidden, step);
  read_sensors(hidden, run, out);
  return out;
}

/// Before it is let go, a hand holds the joint where it should start, or as far against its stop as a hand's torque goes. (Thrown off a
/// stiff one from far beyond, it would have left within a sample or two, and no record would show why.)
static double held_against_stop(const Hidden& hidden, double angle) {
  constexpr double kHand = 20.0;  // N m
  if (hidden.stop_stiffness == 0) return angle;
  const double far = hidden.stop_angle + kHand / hidden.stop_stiffness;
  return std::clamp(angle, hidden.stop_side <= 0 ? -far : -10.0, hidden.stop_side >= 0 ? far : 10.0);
}

Signals move_rig(const Rig& rig, const RunPlan& run, const Hidden& hidden, double step) {
  const int rows = run.rows(), per_row = std::max(1, static_cast<int>(std::lround(kRowTime / step)));
  Signals out;
  for (auto* column : {&out.angle, &out.p1, &out.p2, &out.F1, &out.F2})
    column->resize(static_cast<std::size_t>(rows));

  Valves valves(rig, hidden, run);
  const double start = run.free ? held_against_stop(hidden, run.release_angle) : run.hand.front();
  Muscles muscles(rig, hidden, start);
  Joint joint(rig, hidden, muscles, start);
  const bool lagged = hidden.force_lag != 0;
  // By hand, without memory and with plain valves, a row is one exact step.
  const bool exact = !run.free && valves.direct() && !muscles.memory() && !lagged;
  const int parts = exact ? 1 : per_row;
  const double h = kRowTime / parts;
  Lag force_lag;
  double angle = start, speed = 0.0, F1 = 0.0, F2 = 0.0;

  const auto forces = [&](double& f1, double& f2) {
    const double T = run.free ? joint.muscle_torque()
                              : muscles.smooth(angle, speed) -
                                    muscles.dry(angle, speed) * sign_of(muscles.wheel_speed(angle, speed));
    f1 = muscles.pull() - T / (2.0 * rig.r);
    f2 = muscles.pull() + T / (2.0 * rig.r);
  };

  const bool held = valves.direct();
  const auto advance_valves = [&](std::size_t row, double t, double turned) {
    if (held)
      valves.hold(row, h);
    else
      valves.step(row, t, h, turned);
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
    if (exact) {
      valves.hold(row, h);
      continue;
    }
    for (int i = 0; i < parts; ++i) {
      const double t0 = t + i * h, day1 = run.started + t0 + h;
      if (run.free) {
        // Pressures at the middle of the step: second order, as the lag is exact.
        const double a1 = valves.p1(day1 - h), a2 = valves.p2(day1 - h);
        advance_valves(row, t0, joint.speed() * h);
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
        advance_valves(row, t0, ahead - angle);
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
        const double gain = force_lag.of(h, hidden.force_lag);
        F1 += gain * (0.5 * (before_1 + now_1) - F1);
        F2 += gain * (0.5 * (before_2 + now_2) - F2);
      }
    }
  }
  return out;
}

}  // namespace blind
