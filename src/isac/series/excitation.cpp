#include "isac/series/excitation.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <random>

#include "isac/core/error.hpp"
#include "isac/series/calibration_programs.hpp"

namespace isac::series {
namespace {

constexpr double kDegreesPerRadian = 180.0 / kPi;
constexpr double kLongest = 86400.0;  // s

std::string number(const char* format, double value) {
  std::array<char, 64> text{};
  std::snprintf(text.data(), text.size(), format, value);
  return text.data();
}

std::string in_kgf(double pascal) {
  return number("%.4g", pascal / kPascalPerKgfCm2) + " kg/cm2";
}

/// A level in a file name, never "-0.00".
std::string level_tag(double pascal) {
  const double level = std::round(pascal / kPascalPerKgfCm2 * 100.0) / 100.0;
  return "_dp" + number("%+.2f", level == 0.0 ? 0.0 : level);
}

std::string angle_tag(double radian) {
  const double degrees = std::round(radian * kDegreesPerRadian);
  return "_" + number("%+.0f", degrees == 0.0 ? 0.0 : degrees) + "deg";
}

[[noreturn]] void refuse(const char* code, const std::string& text) {
  throw Error(ErrorKind::kUsage, code, text);
}

/// |Δp| that limits and initial pressure leave room for.
double delta_pressure_room(const ExcitationOptions& options) {
  return std::min({options.delta_pressure_limit, options.initial_pressure,
                   options.pressure_limit - options.initial_pressure});
}

void require_delta_pressure(double level, const ExcitationOptions& options) {
  const double room = delta_pressure_room(options);
  if (std::isfinite(level) && std::abs(level) <= room * (1.0 + 1e-9)) return;
  refuse("delta_pressure_beyond_limit", "a pressure difference of " + in_kgf(level) + " is beyond the " +
                                            in_kgf(room) + " that the limits and the initial pressure of " +
                                            in_kgf(options.initial_pressure) +
                                            " leave room for; ask for less, or change the limits");
}

void require_angle(double angle, const ExcitationOptions& options, const char* what) {
  if (std::isfinite(angle) && std::abs(angle) < options.angle_limit) return;
  refuse("angle_beyond_limit", std::string(what) + " of " + number("%.4g", angle) +
                                   " rad is not inside the limit of " + number("%.4g", options.angle_limit) +
                                   " rad; ask for less, or change the limit");
}

double positive_or(double asked, double fallback, const char* what) {
  if (std::isnan(asked)) return fallback;
  if (std::isfinite(asked) && asked > 0.0) return asked;
  refuse("not_positive", std::string(what) + " must be a positive number, not " + number("%g", asked));
}

Knot knot_at(double time, double delta_pressure, const ExcitationOptions& options) {
  return {time, options.initial_pressure - delta_pressure, options.initial_pressure + delta_pressure};
}

SweepExpectation common_expectation(const ExcitationOptions& options, std::string experiment,
                                    double duration) {
  SweepExpectation expected;
  expected.experiment = std::move(experiment);
  expected.duration = duration;
  expected.highest_speed = 2.0 * std::max(options.speed_limit, kFastSpeed);
  return expected;
}

enum class Sweep { kSlow, kFast, kBundle, kAsked };

std::string sweep_prompt(Sweep sweep, double amplitude, double speed, double duration) {
  const std::string range =
      number("%.0f", amplitude * kDegreesPerRadian) + " degrees either side of where it rests";
  switch (sweep) {
    case Sweep::kBundle:
      return "Move the bar through its range, " + range + ", for " + number("%.0f", duration) +
             " s: at every speed from very slow to as fast as you can, changing the speed every few sweeps.";
    case Sweep::kFast:
      return "Move the bar back and forth as fast as you can, " + range + ", both ways up to " +
             number("%.0f", speed * kDegreesPerRadian) + " degrees per second.";
    default:
      return "Move the bar slowly and evenly from one end to the other and back, " + range +
             ", one way in about " + number("%.1f", 2.0 * amplitude / speed) + " s.";
  }
}

Program constant_pressure(double level, Sweep sweep, double default_duration,
                          const ExcitationOptions& options) {
  require_delta_pressure(level, options);
  const double amplitude =
      positive_or(options.amplitude, 0.3 * options.angle_limit, "the amplitude of the sweep");
  require_angle(amplitude, options, "a sweep");
  double speed = std::min(kFastSpeed, options.speed_limit);
  if (sweep == Sweep::kSlow) speed = std::min(kSlowSpeed, options.speed_limit);
  if (sweep == Sweep::kAsked || (sweep == Sweep::kBundle && !std::isnan(options.speed))) {
    speed = positive_or(options.speed, speed, "the speed");
    if (speed > options.speed_limit) {
      refuse("speed_beyond_limit", "a speed of " + number("%.4g", speed) + " rad/s is beyond the limit of " +
                                       number("%.4g", options.speed_limit) +
                                       " rad/s; ask for less, or change the limit");
    }
  }
  const double duration = positive_or(options.duration, default_duration, "the duration");
  const bool slow = speed < 2.0 * kSlowSpeed;
  const Sweep prompt = sweep == Sweep::kAsked ? (slow ? Sweep::kSlow : Sweep::kFast) : sweep;

  Program program;
  program.experiment = "constant-pressure";
  program.sweep = sweep == Sweep::kBundle ? "bundle" : slow ? "slow" : "fast";
  program.name = program.experiment + "-" + program.sweep + level_tag(level);
  program.duration = duration;
  program.hand_moves = true;
  program.stages = {{0.0,
                     {Ask::Kind::kSweepByHand, amplitude, speed, sweep == Sweep::kBundle, 0.0},
                     sweep_prompt(prompt, amplitude, speed, duration)}};
  program.knots = {knot_at(0.0, level, options)};
  program.expected = common_expectation(options, program.experiment, duration);
  program.expected.amplitude = amplitude;
  program.expected.speed = speed;
  program.expected.all_speeds = sweep == Sweep::kBundle;
  program.expected.slow = slow && sweep != Sweep::kBundle;
  program.expected.held_delta_pressure = level;
  return program;
}

/// Levels at equal times from `start` on; returns the time at which the last hold ends.
double append_steps(std::vector<Knot>& knots, const std::vector<double>& levels, double start, double hold,
                    const ExcitationOptions& options) {
  double time = start;
  for (const double level : levels) {
    knots.push_back(knot_at(time, level, options));
    time += hold;
    knots.push_back(knot_at(time, level, options));
  }
  return time;
}

/// Asked levels, or half and full of the room, both signs; then back to zero.
std::vector<double> step_levels(const ExcitationOptions& options, double share) {
  std::vector<double> levels = options.delta_pressures;
  if (levels.empty()) {
    const double top = share * delta_pressure_room(options);
    levels = {0.5 * top, -0.5 * top, top, -top};
  }
  for (const double level : levels) require_delta_pressure(level, options);
  levels.push_back(0.0);
  return levels;
}

double largest(const std::vector<double>& levels) {
  double top = 0.0;
  for (const double level : levels) top = std::max(top, std::abs(level));
  return top;
}

/// Seed 3.4: clamped joint; a slow triangle in Δp, then steps.
Program constant_angle(double angle, double default_duration, const ExcitationOptions& options) {
  require_angle(angle, options, "a clamp angle");
  const std::vector<double> levels = step_levels(options, 0.45);
  const double top = largest(levels);
  const double duration = positive_or(options.duration, default_duration, "the duration");

  Program program;
  program.experiment = "constant-angle";
  program.name = program.experiment + angle_tag(angle);
  program.duration = duration;
  program.stages = {{0.0,
                     {Ask::Kind::kClamp, 0.0, 0.0, false, angle},
                     "Clamp the bar at " + number("%+.0f", angle * kDegreesPerRadian) +
                         " degrees and keep your hands off it: the muscles pull against the clamp."}};
  // Baseline 5 %, two triangles 45 %, steps 50 % of the time.
  const double baseline = 0.05 * duration, quarter = 0.45 * duration / 8.0;
  program.knots = {knot_at(0.0, 0.0, options), knot_at(baseline, 0.0, options)};
  for (int k = 1; k <= 8; ++k) {
    static constexpr std::array<double, 4> kTriangle = {0.0, 1.0, 0.0, -1.0};
    program.knots.push_back(
        knot_at(baseline + k * quarter, top * kTriangle[static_cast<std::size_t>(k % 4)], options));
  }
  const double steps_from = baseline + 8.0 * quarter;
  append_steps(program.knots, levels, steps_from,
               (duration - steps_from) / static_cast<double>(levels.size()), options);
  program.expected = common_expectation(options, program.experiment, duration);
  program.expected.clamped = true;
  program.expected.stepped = true;
  return program;
}

/// Tones on the harmonics of `length`, 0.1 to 3 Hz in geometric steps, random phases, scaled so that the peak
/// is `peak`.
std::vector<Tone> multisine(double length, double peak, std::uint64_t seed) {
  constexpr int kTones = 12;
  constexpr double kLowest = 0.1, kHighest = 3.0;
  std::mt19937_64 random(seed);
  std::vector<Tone> tones;
  long last_harmonic = 0;
  for (int i = 0; i < kTones; ++i) {
    const double wanted = kLowest * std::pow(kHighest / kLowest, i / (kTones - 1.0));
    const long harmonic = std::max(last_harmonic + 1, std::lround(wanted * length));
    last_harmonic = harmonic;
    // The upper 53 bits as a fraction: the same phases with every standard library.
    const double fraction = static_cast<double>(random() >> 11) * 0x1.0p-53;
    tones.push_back({static_cast<double>(harmonic) / length, 1.0, 2.0 * kPi * fraction});
  }
  double highest = 0.0;
  const double step = 1.0 / (64.0 * tones.back().frequency);  // peak found to cos(π/64): 0.1 %
  for (double time = 0.0; time < length; time += step) {
    double sum = 0.0;
    for (const Tone& tone : tones) sum += std::sin(2.0 * kPi * tone.frequency * time + tone.phase);
    highest = std::max(highest, std::abs(sum));
  }
  for (Tone& tone : tones) tone.amplitude = peak / (highest * 1.002);
  return tones;
}

Program free_joint(double default_duration, const ExcitationOptions& options) {
  const std::vector<double> levels = step_levels(options, 0.75);
  const double duration = positive_or(options.duration, default_duration, "the duration");
  Program program;
  program.experiment = "free";
  program.name = program.experiment;
  program.duration = duration;
  program.stages = {{0.0,
                     {Ask::Kind::kRelease, 0.0, 0.0, false, 0.0},
                     "Take the clamp off, let go of the bar and stand clear: the muscles move it."}};
  const double baseline = 0.05 * duration;
  program.knots = {knot_at(0.0, 0.0, options), knot_at(baseline, 0.0, options)};
  const double hold = 0.45 * duration / static_cast<double>(levels.size());
  program.tones_from = append_steps(program.knots, levels, baseline, hold, options);
  program.tones_to = duration;
  program.tones = multisine(duration - program.tones_from, largest(levels), options.seed);
  program.expected = common_expectation(options, program.experiment, duration);
  program.expected.moved_by_muscles = 0.1;
  return program;
}

/// Seed 4.1: both valves step together, so that Δp stays zero; every step starts from a held baseline.
Program valve_steps(const ExcitationOptions& options) {
  std::vector<double> heights = options.heights;
  if (heights.empty()) {
    const double top = 0.8 * options.pressure_limit, base = options.base_pressure;
    for (const double share : {1.0 / 3.0, 2.0 / 3.0, 1.0}) heights.push_back(base + share * (top - base));
  }
  for (const double height : heights) {
    if (std::isfinite(height) && height >= 0.0 && height <= options.pressure_limit &&
        height != options.base_pressure) {
      continue;
    }
    refuse("step_beyond_limit", "a valve step to " + in_kgf(height) +
                                    " must lie between 0 and the pressure limit of " +
                                    in_kgf(options.pressure_limit) + " and differ from the baseline of " +
                                    in_kgf(options.base_pressure) + "; choose another height");
  }
  if (!(options.base_pressure >= 0.0 && options.base_pressure <= options.pressure_limit)) {
    refuse("baseline_beyond_limit", "the baseline of " + in_kgf(options.base_pressure) +
                                        " must lie between 0 and the pressure limit of " +
                                        in_kgf(options.pressure_limit));
  }
  const double holds = 2.0 * static_cast<double>(heights.size()) + 1.0;
  const double hold = std::isnan(options.duration)
                          ? positive_or(options.hold, 2.0, "the hold time")
                          : positive_or(options.duration, 0.0, "the duration") / holds;
  Program program;
  program.experiment = "pcu-step";
  program.name = program.experiment;
  program.duration = hold * holds;
  program.stages = {{0.0,
                     {Ask::Kind::kClamp, 0.0, 0.0, false, 0.0},
                     "Clamp the bar at its middle and keep your hands off it: both valves step together."}};
  double time = 0.0;
  const auto hold_at = [&](double pressure) {
    program.knots.push_back({time, pressure, pressure});
    time += hold;
    program.knots.push_back({time, pressure, pressure});
  };
  hold_at(options.base_pressure);
  for (const double height : heights) {
    hold_at(height);
    hold_at(options.base_pressure);
  }
  program.expected = common_expectation(options, program.experiment, program.duration);
  program.expected.stepped = true;
  return program;
}

Program pose_holds(const ExcitationOptions& options) {
  std::vector<double> angles = options.angles;
  if (angles.empty()) {
    for (const double share : {0.0, 0.1, 0.2, 0.3, -0.1, -0.2, -0.3})
      angles.push_back(share * options.angle_limit);
  }
  for (const double angle : angles) require_angle(angle, options, "a pose");
  const double level = options.delta_pressures.empty() ? 0.0 : options.delta_pressures.front();
  require_delta_pressure(level, options);
  const double count = static_cast<double>(angles.size());
  const double hold = std::isnan(options.duration)
                          ? positive_or(options.hold, 5.0, "the hold time")
                          : positive_or(options.duration, 0.0, "the duration") / count;
  Program program;
  program.experiment = "pose";
  program.name = program.experiment;
  program.duration = hold * count;
  program.hand_moves = true;
  for (std::size_t i = 0; i < angles.size(); ++i) {
    program.stages.push_back({hold * static_cast<double>(i),
                              {Ask::Kind::kPose, 0.0, 0.0, false, angles[i]},
                              "Bring the bar to " + number("%+.0f", angles[i] * kDegreesPerRadian) +
                                  " degrees and hold it still for " + number("%.0f", hold) + " s (pose " +
                                  std::to_string(i + 1) + " of " + std::to_string(angles.size()) + ")."});
  }
  program.knots = {knot_at(0.0, level, options)};
  program.expected = common_expectation(options, program.experiment, program.duration);
  program.expected.poses = angles;
  return program;
}

void append_constant_pressure(std::vector<Program>& programs, const std::vector<double>& levels,
                              const ExcitationOptions& options) {
  if (!std::isnan(options.speed)) {
    for (const double level : levels) {
      programs.push_back(constant_pressure(level, Sweep::kAsked, options.speed < 1.0 ? 40.0 : 20.0, options));
    }
    return;
  }
  if (options.slow) {
    for (const double level : levels)
      programs.push_back(constant_pressure(level, Sweep::kSlow, 40.0, options));
  }
  if (options.fast) {
    for (const double level : levels)
      programs.push_back(constant_pressure(level, Sweep::kFast, 20.0, options));
  }
}

/// Chapter 3 of the seed, whole, and runs at other levels that no fit ever sees.
std::vector<Program> testbed_bundle(ExcitationOptions options) {
  const double room = delta_pressure_room(options);
  options.speed = std::numeric_limits<double>::quiet_NaN();
  options.delta_pressures.clear();
  options.heights.clear();
  std::vector<Program> programs;
  for (const double share : {-0.75, -0.5, -0.25, 0.0, 0.25, 0.5, 0.75}) {
    programs.push_back(constant_pressure(share * room, Sweep::kSlow, 40.0, options));
  }
  for (const double share : {-0.5, 0.0, 0.5}) {
    programs.push_back(constant_pressure(share * room, Sweep::kFast, 20.0, options));
  }
  programs.push_back(constant_pressure(0.0, Sweep::kBundle, 300.0, options));
  programs.push_back(constant_angle(0.0, 40.0, options));
  options.delta_pressures = {0.125 * room, -0.125 * room, 0.25 * room,
                             -0.25 * room};  // away from the middle: less force left
  for (const double share : {-0.125, 0.125}) {
    programs.push_back(constant_angle(share * options.angle_limit, 40.0, options));
  }
  options.delta_pressures.clear();
  programs.push_back(valve_steps(options));
  programs.push_back(free_joint(60.0, options));
  const std::size_t first_heldout = programs.size();
  programs.push_back(constant_pressure(-0.375 * room, Sweep::kSlow, 40.0, options));
  programs.push_back(constant_pressure(0.375 * room, Sweep::kFast, 20.0, options));
  ++options.seed;  // another multisine than the one fitted
  programs.push_back(free_joint(30.0, options));
  for (std::size_t i = first_heldout; i < programs.size(); ++i) programs[i].heldout = true;
  return programs;
}

}  // namespace

std::vector<Program> make_programs(std::string_view experiment, const ExcitationOptions& options) {
  if (!(options.initial_pressure > 0.0 && options.pressure_limit > 0.0 &&
        options.delta_pressure_limit > 0.0 && options.angle_limit > 0.0 && options.speed_limit > 0.0)) {
    refuse("limits_nonsense", "the initial pressure and every limit must be positive numbers");
  }
  if (options.initial_pressure >= options.pressure_limit) {
    refuse("limits_nonsense", "the initial pressure of " + in_kgf(options.initial_pressure) +
                                  " is not below the pressure limit of " + in_kgf(options.pressure_limit));
  }
  for (const double seconds : {options.duration, options.hold}) {  // before anything grows with them
    if (!(seconds > kLongest)) continue;
    refuse("too_long", "a recording of " + number("%.6g", seconds) + " s is longer than a day (" +
                           number("%.0f", kLongest) + " s); ask for a shorter one");
  }
  std::vector<Program> programs;
  std::vector<double> levels = options.delta_pressures;
  if (levels.empty()) levels = {0.0};
  if (experiment == "constant-pressure") {
    append_constant_pressure(programs, levels, options);
  } else if (experiment == "bundle") {
    for (const double level : levels)
      programs.push_back(constant_pressure(level, Sweep::kBundle, 300.0, options));
  } else if (experiment == "constant-angle") {
    std::vector<double> angles = options.angles;
    if (angles.empty()) angles = {0.0};
    for (const double angle : angles) programs.push_back(constant_angle(angle, 40.0, options));
  } else if (experiment == "free") {
    programs.push_back(free_joint(60.0, options));
  } else if (experiment == "pcu-step") {
    programs.push_back(valve_steps(options));
  } else if (experiment == "pose") {
    programs.push_back(pose_holds(options));
  } else if (experiment == "calibrate") {
    programs = calibration_programs(options);
  } else if (experiment == "testbed-bundle" || experiment == "all") {
    programs = testbed_bundle(options);
  } else {
    std::string known;
    for (const ExperimentInfo& info : experiments())
      known += (known.empty() ? "" : ", ") + std::string(info.name);
    refuse("experiment_unknown",
           "there is no experiment '" + std::string(experiment) + "'; choose one of " + known);
  }
  for (std::size_t i = 0; i < programs.size(); ++i) {  // two levels that round to one file name
    for (std::size_t j = i + 1; j < programs.size(); ++j) {
      if (programs[i].name == programs[j].name && programs[i].heldout == programs[j].heldout) {
        refuse("level_twice",
               "the same recording '" + programs[i].name + "' is asked for twice; leave one of them out");
      }
    }
  }
  return programs;
}

}  // namespace isac::series
