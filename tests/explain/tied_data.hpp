/// @file
/// Recordings of planned runs made without the toolkit's model: torque law, valve unit and motion written out and integrated
/// at 10 kHz, sensors with noise and encoder steps. For tests that record what isac-explain asks for.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "isac/core/units.hpp"
#include "isac/explain/explanation.hpp"
#include "isac/explain/prepared.hpp"
#include "isac/series/recording.hpp"

namespace isac::test {

/// Truth in SI; effects are absent at nothing.
struct TiedRig {
  double A = -23450, B = 174.2 / kPascalPerKgfCm2, C = 0.0026, D = 0.14, radius = 0.019, inertia = 0.0085;
  double p0 = 3 * kPascalPerKgfCm2, K_C = 1, T_C = 0.17, common = 120;  // N at p0: both muscles stay taut
  double pretension = 0;  // N at no pressure; without it a force's gain says what an asymmetry says
  double dry = 0, load_exponent = 0;  // N m, and its power of p_mean/p0
  double dry_share = 1;               // of half seconds in which it is there at all, which no catalogue has
  double bearing = 0, skew = 0;  // N m of friction that no force sensor sees; s that the angle is read late
  double offset = 0, asymmetry = 0;       // N m at p0 whatever the pressure, and in proportion to it
  double dead_time = 0, second_lag = 0;   // s
  double encoder_play = 0;                // rad, half of it, between joint and encoder
  double encoder_drift = 0;               // rad/s from eight o'clock on
  double encoder_slip = 0, slip_at = 0;   // rad, s after eight o'clock
  double force_drift = 0;                 // N/s of muscle 2's sensor from eight o'clock on
  double leak[2] = {0, 0}, deadband = 0;  // 1/s of each muscle; Pa of a valve that does not answer less
  double angle_damping = 0;           // N m s/rad3: a damping that grows with φ², which no catalogue has
  double bent_by = 0, bent_from = 0;  // share of its gain that muscle 2 loses above a pressure, Pa
  double spring = 0,
         relaxes_in =
             0.3;  // N m/rad that lets go with a time constant, s: a hysteresis that depends on the rate
  double warming = 0,
         warms_in = 8;   // N m s/rad of dry friction in proportion to the speed of the last seconds
  double hunting = 0;    // Pa by which the valves swing of themselves, at 2.5 Hz
  double threshold = 0;  // Pa that lift a bladder off
  double force_lag = 0, force_most = 1e9;  // s of the amplifiers, N at which they clip
  bool pushes = true;                      // a muscle that would push is read so; else it hangs slack
  double stop_at = 0, stop = 0;            // rad, N m/rad of stops on both sides that no force sensor sees
  double known_inertia = 0;                // kg m2 that is believed; 0: the true one
  double zero_wander = 0;  // N m, of the force sensors: from run to run, and with a memory of 100 s within
  double far_inertia = 0, far_hertz = 15, far_damping = 0.05;  // kg m2 of the inertia, behind a compliance
  double force_noise = 0.3, pressure_noise = 0.004 * kPascalPerKgfCm2;

  [[nodiscard]] explain::RigFacts facts() const {
    explain::RigFacts f;
    f.wheel_radius = radius;
    f.initial_pressure = p0;
    f.inertia = known_inertia > 0 ? known_inertia : inertia;
    f.angle_step = 6.283185307179586 / 8000;
    f.force_noise = force_noise;
    f.pressure_noise = pressure_noise;
    return f;
  }
};

namespace detail {

/// The swing of a plan in times its height (docs/formats.md, isac.plan/1).
inline double swing_at(const explain::PlannedRun& run, double t) {
  if (!(run.pressure_swing_kgcm2 > 0) || run.waveform == "hold" || t <= 0) return 0;
  const double turn = t / run.pressure_period_s;
  if (run.waveform == "sine") return std::sin(6.283185307179586 * turn);
  if (run.waveform == "steps") {
    if (turn < 0.25) return 0;
    return std::fmod(turn - 0.25, 1.0) < 0.5 ? 1 : -1;
  }
  const double u = std::fmod(turn, 1.0);
  return u < 0.25 ? 4 * u : u < 0.75 ? 2 - 4 * u : 4 * u - 4;
}

}  // namespace detail

/// One planned run on that rig. `number` seeds its noise and the hand's phases, and places it in the day.
inline series::Recording record(const TiedRig& rig, const explain::PlannedRun& run, std::uint32_t number) {
  std::mt19937 random(1000 + number);
  std::normal_distribution<double> gauss;
  std::uniform_real_distribution<double> uniform(0, 6.283185307179586);
  constexpr double kStep = 1e-4;
  constexpr int kPerSample = 20;
  const double mean =
      std::isfinite(run.mean_pressure_kgcm2) ? run.mean_pressure_kgcm2 * kPascalPerKgfCm2 : rig.p0;
  const bool both = run.experiment == "constant-pressure" || run.experiment == "pcu-step";
  const auto command = [&](double t, int i) {
    const double s = detail::swing_at(run, t) * run.pressure_swing_kgcm2 * kPascalPerKgfCm2;
    const double difference = run.delta_pressure_kgcm2 * kPascalPerKgfCm2 + (both ? 0.0 : s);
    return mean + (both ? s : 0.0) + (i == 0 ? -difference : difference);
  };
  // A card holds what it was given until the next sample.
  const auto held = [](double t) { return kStep * kPerSample * std::floor(t / (kStep * kPerSample) + 1e-6); };
  double q[2], p[2];
  for (int i = 0; i < 2; ++i) p[i] = rig.K_C * (q[i] = command(-1, i));
  const double stiffness = rig.A * rig.radius * rig.radius;
  const double rest = -rig.B * rig.radius * 0.5 * (p[1] - p[0]) / stiffness;
  const double middle = std::isfinite(run.middle_rad)                                       ? run.middle_rad
                        : run.experiment == "constant-pressure" || run.experiment == "free" ? rest
                                                                                            : 0.0;
  const bool hand = run.experiment == "constant-pressure", free = run.experiment == "free";
  const double share[3] = {0.8, 0.12, 0.08}, tone[3] = {1.0, 0.414, 1.618};
  double phase[3], steepest = 0;
  for (int i = 0; i < 3; ++i) {
    phase[i] = uniform(random);
    steepest += share[i] * tone[i];
  }
  const double omega = hand ? run.peak_speed_rad_s / (run.amplitude_rad * steepest) : 0;
  double force[2] = {0, 0};
  double angle = middle, velocity = 0, shaft = middle, far_angle = middle, far_velocity = 0;
  double dry = rig.dry, stretched = 0, warmth = 0;
  std::vector<double> shafts;
  const auto late = static_cast<std::size_t>(std::lround(rig.skew / kStep));
  const auto torque = [&](double w) {
    const auto pulling = [&](double pressure) { return std::max(0.0, pressure - rig.threshold); };
    const double bent = rig.bent_by > 0 ? rig.bent_by * std::max(0.0, p[1] - rig.bent_from) : 0.0;
    const double dp = 0.5 * (pulling(p[1]) - bent - pulling(p[0])), pm = 0.5 * (p[0] + p[1]);
    const double sign = w > 0 ? 1 : w < 0 ? -1 : 0;
    return stiffness * angle + rig.B * rig.radius * dp - rig.C * w * w * w -
           (rig.D + rig.angle_damping * angle * angle) * w -
           dry * std::pow(pm / rig.p0, rig.load_exponent) * sign + rig.offset + rig.asymmetry * pm / rig.p0 -
           rig.spring * stretched - rig.warming * warmth * sign;
  };
  series::Recording out;
  out.source = "run" + std::to_string(number) + ".csv";
  out.metadata["experiment"] = run.experiment;
  char started[40];
  std::snprintf(started, sizeof started, "2026-11-20T%02u:%02u:00Z", 8 + number / 30, 2 * (number % 30));
  out.metadata["started"] = started;
  const double since_eight = 60 * (60 * (number / 30) + 2 * (number % 30));
  double zero = rig.zero_wander > 0 ? rig.zero_wander * gauss(random) : 0;
  const char* names[] = {"time", "angle", "p1", "p2", "p1_cmd", "p2_cmd", "F1", "F2"};
  const char* units[] = {"s", "rad", "Pa", "Pa", "Pa", "Pa", "N", "N"};
  for (int c = 0; c < 8; ++c) out.columns.push_back({names[c], units[c], {}});
  const double encoder = 6.283185307179586 / 8000;
  const long samples = std::lround(run.seconds * 500);
  for (long k = 0; k <= samples * kPerSample; ++k) {
    const double t = static_cast<double>(k) * kStep;
    if (hand) {
      angle = middle;
      velocity = 0;
      for (int i = 0; i < 3; ++i) {
        angle += run.amplitude_rad * share[i] * std::sin(omega * tone[i] * t + phase[i]);
        velocity += run.amplitude_rad * share[i] * omega * tone[i] * std::cos(omega * tone[i] * t + phase[i]);
      }
    }
    if (rig.dry_share < 1 && k % 5000 == 0)
      dry = uniform(random) < 6.283185307179586 * rig.dry_share ? rig.dry : 0;
    stretched += kStep * (velocity - stretched / rig.relaxes_in);
    warmth += kStep * (std::abs(velocity) - warmth) / rig.warms_in;
    shaft = std::clamp(shaft, angle - rig.encoder_play, angle + rig.encoder_play);
    if (late > 0) shafts.push_back(shaft);
    const double seen = late == 0 ? shaft : shafts[shafts.size() > late ? shafts.size() - 1 - late : 0];
    const double carried = torque(velocity),
                 both_pull = rig.pretension + rig.common * 0.5 * (p[0] + p[1]) / rig.p0;
    for (int i = 0; i < 2; ++i) {
      const double now = both_pull + (i == 0 ? -0.5 : 0.5) * carried / rig.radius;
      force[i] += k == 0 || !(rig.force_lag > 0) ? now - force[i]
                                                 : -std::expm1(-kStep / rig.force_lag) * (now - force[i]);
    }
    if (k % kPerSample == 0 && k < samples * kPerSample) {
      if (rig.zero_wander > 0)
        zero += -zero * 2e-5 + rig.zero_wander * std::sqrt(4e-5) * gauss(random);  // 500 Hz, 100 s
      const auto read = [&](int i) {
        const double zeros =
            (i == 0 ? -0.5 : 0.5) * zero / rig.radius + (i == 1 ? rig.force_drift * (since_eight + t) : 0);
        const double pull = rig.pushes ? force[i] : std::max(0.0, force[i]);
        return std::min(rig.force_most, pull + zeros + rig.force_noise * gauss(random));
      };
      const double row[8] = {t,
                             encoder * std::round((seen + rig.encoder_drift * (since_eight + t) +
                                                   (since_eight + t >= rig.slip_at ? rig.encoder_slip : 0)) /
                                                  encoder),
                             p[0] + rig.pressure_noise * gauss(random),
                             p[1] + rig.pressure_noise * gauss(random),
                             command(t, 0),
                             command(t, 1),
                             read(0),
                             read(1)};
      for (std::size_t c = 0; c < 8; ++c) out.columns[c].values.push_back(row[c]);
    }
    for (int i = 0; i < 2; ++i) {
      const double u = command(held(t - rig.dead_time), i) +
                       (rig.hunting > 0 ? rig.hunting * std::sin(5 * 3.141592653589793 * t + phase[0]) : 0.0);
      if (rig.second_lag > 0) {
        q[i] += kStep / rig.second_lag * (u - q[i]);
      } else {
        q[i] = u;
      }
      const double asked = rig.K_C * q[i] - p[i];
      const double heard = std::copysign(std::max(0.0, std::abs(asked) - rig.deadband), asked);
      p[i] += kStep * (heard / rig.T_C - rig.leak[i] * p[i]);
    }
    double near_inertia = rig.inertia, pulled = 0;
    if (free && rig.far_inertia > 0) {
      const double w = 6.283185307179586 * rig.far_hertz;
      near_inertia -= rig.far_inertia;
      pulled = rig.far_inertia *
               (w * w * (angle - far_angle) + 2 * rig.far_damping * w * (velocity - far_velocity));
      far_velocity += kStep * pulled / rig.far_inertia;
      far_angle += kStep * far_velocity;
    }
    if (free) {  // dry friction holds the joint where no torque overcomes it
      const double past = rig.stop_at > 0 ? angle - std::clamp(angle, -rig.stop_at, rig.stop_at) : 0;
      const auto driven = [&](double w) {
        return torque(w) - (w > 0 ? rig.bearing : w < 0 ? -rig.bearing : 0.0) - rig.stop * past;
      };
      const double push = driven(velocity != 0 ? velocity : torque(0) > 0 ? 1e-12 : -1e-12);
      const bool stuck = velocity == 0 && push * torque(0) <= 0;
      const double next = stuck ? 0 : velocity + kStep * (push - pulled) / near_inertia;
      velocity = velocity * next < 0 ? 0 : next;
      angle += kStep * velocity;
    }
  }
  return out;
}

inline explain::PlannedRun by_hand(double seconds, double amplitude, double speed, double difference = 0) {
  return {.experiment = "constant-pressure",
          .seconds = seconds,
          .delta_pressure_kgcm2 = difference,
          .mean_pressure_kgcm2 = 3,
          .amplitude_rad = amplitude,
          .peak_speed_rad_s = speed,
          .waveform = "hold"};
}

/// Both valves step about their mean.
inline explain::PlannedRun valve_steps(double seconds, double mean) {
  return {.experiment = "pcu-step",
          .seconds = seconds,
          .mean_pressure_kgcm2 = mean,
          .pressure_swing_kgcm2 = 1.2,
          .pressure_period_s = 4,
          .waveform = "steps"};
}

inline explain::PlannedRun clamped(double seconds, double angle, double swing, double period,
                                   const char* waveform = "triangle") {
  return {.experiment = "constant-angle",
          .seconds = seconds,
          .mean_pressure_kgcm2 = 3,
          .middle_rad = angle,
          .pressure_swing_kgcm2 = swing,
          .pressure_period_s = period,
          .waveform = waveform};
}

inline explain::PlannedRun free_in_steps(double seconds, double period, double swing) {
  return {.experiment = "free",
          .seconds = seconds,
          .mean_pressure_kgcm2 = 3,
          .pressure_swing_kgcm2 = swing,
          .pressure_period_s = period,
          .waveform = "steps"};
}

inline std::vector<series::Recording> record_all(const TiedRig& rig,
                                                 const std::vector<explain::PlannedRun>& runs,
                                                 std::uint32_t first = 1) {
  std::vector<series::Recording> out;
  for (const auto& run : runs) out.push_back(record(rig, run, first++));
  return out;
}

}  // namespace isac::test
