#include "isac/series/plan_programs.hpp"

#include <algorithm>
#include <cmath>

#include "isac/core/error.hpp"
#include "isac/series/sweep_check_detail.hpp"

namespace isac::series {
namespace {

using detail::number;

constexpr double kDegreesPerRadian = 180.0 / kPi;
constexpr int kSineKnots = 48;           // per period: chords miss the sine by 0.2 % of the swing
constexpr double kMostPeriods = 10000;   // of a swing in one run
constexpr double kShortestPeriod = 0.1;  // s; a valve's lag is 0.17 s
constexpr double kSettled = 1.5;         // s, of a step that is held long enough to be judged

enum class Swings { kDifference, kMean };

std::string kgf(double pascal) {
  return number("%.4g", pascal / kPascalPerKgfCm2) + " kg/cm2";
}

/// A run with what the rig fills in, and its name for messages.
struct Asked {
  PlanRun run;
  std::string name;
  double mean = 0;
};

[[noreturn]] void refuse(const char* code, const Asked& asked, const std::string& text) {
  throw Error(ErrorKind::kBadInput, code, asked.name + " " + text);
}

void require_pressures(const Asked& asked, Swings swings, const ExcitationOptions& options) {
  const PlanRun& run = asked.run;
  const double difference =
      std::abs(run.delta_pressure) + (swings == Swings::kDifference ? run.pressure_swing : 0.0);
  const double around = swings == Swings::kMean ? run.pressure_swing : 0.0;
  constexpr double kSlack = 1.0 + 1e-9;
  if (!(difference <= options.delta_pressure_limit * kSlack)) {
    refuse("plan_beyond_limit", asked,
           "asks for a pressure difference of " + kgf(difference) + ", beyond the limit of " +
               kgf(options.delta_pressure_limit) + "; ask for less, or change the limit");
  }
  const double high = asked.mean + around + difference, low = asked.mean - around - difference;
  if (!(high <= options.pressure_limit * kSlack)) {
    refuse("plan_beyond_limit", asked,
           "asks for " + kgf(high) + " in a muscle, beyond the limit of " + kgf(options.pressure_limit) +
               "; ask for less, or change the limit");
  }
  if (!(low >= -1e-9 * options.pressure_limit)) {
    refuse("plan_beyond_limit", asked,
           "asks for " + kgf(low) +
               " in a muscle, and none goes below zero; ask for a "
               "higher mean pressure or a smaller difference");
  }
}

void require_angle(const Asked& asked, double farthest, const ExcitationOptions& options) {
  if (farthest < options.angle_limit) return;
  refuse("plan_beyond_limit", asked,
         "leads the bar to " + number("%.4g", farthest) + " rad, not inside the limit of " +
             number("%.4g", options.angle_limit) + " rad; ask for less, or change the limit");
}

void require_swing_time(const Asked& asked) {
  const PlanRun& run = asked.run;
  if (run.pressure_swing > 0 &&
      !(run.pressure_period >= kShortestPeriod && run.duration / run.pressure_period <= kMostPeriods)) {
    refuse("plan_too_long", asked,
           "swings with a period of " + number("%.4g", run.pressure_period) + " s; it must be " +
               number("%.4g", kShortestPeriod) + " s or more, and at most " + number("%.0f", kMostPeriods) +
               " periods long");
  }
  if (!(run.duration > 0 && run.duration <= kLongestPlannedRun)) {
    refuse("plan_too_long", asked,
           "lasts " + number("%.4g", run.duration) + " s; plan runs of more than 0 and at most " +
               number("%.0f", kLongestPlannedRun) + " s");
  }
}

/// The swing in times its height: knots of w(t) at t, for one run.
std::vector<std::pair<double, double>> shape_of(const PlanRun& run) {
  std::vector<std::pair<double, double>> knots = {{0.0, 0.0}};
  if (!(run.pressure_swing > 0) || run.waveform == "hold") return knots;
  const double period = run.pressure_period;
  const auto add = [&](double time, double value) {
    knots.emplace_back(time, value);
    return time < run.duration;
  };
  if (run.waveform == "steps") {
    add(0.25 * period, 0.0);
    double level = 1;
    for (double time = 0.25 * period; time < run.duration; time += 0.5 * period, level = -level) {
      add(time, level);
      add(time + 0.5 * period, level);
    }
    return knots;
  }
  const bool sine = run.waveform == "sine";
  const int per_period = sine ? kSineKnots : 4;
  for (int i = 1;; ++i) {
    const double turn = static_cast<double>(i) / per_period, value = sine         ? std::sin(2 * kPi * turn)
                                                                     : i % 2 == 0 ? 0.0
                                                                     : i % 4 == 1 ? 1.0
                                                                                  : -1.0;
    if (!add(turn * period, value)) return knots;
  }
}

std::vector<Knot> knots_of(const Asked& asked, Swings swings) {
  std::vector<Knot> knots;
  for (const auto& [time, w] : shape_of(asked.run)) {
    const double swing = asked.run.pressure_swing * w;
    const double difference = asked.run.delta_pressure + (swings == Swings::kDifference ? swing : 0.0);
    const double mean = asked.mean + (swings == Swings::kMean ? swing : 0.0);
    knots.push_back({time, std::max(0.0, mean - difference), std::max(0.0, mean + difference)});
  }
  return knots;
}

std::string degrees(double radian) {
  return number("%+.0f", std::round(radian * kDegreesPerRadian) + 0.0);
}

std::string swing_words(const Asked& asked, const char* what) {
  if (!(asked.run.pressure_swing > 0) || asked.run.waveform == "hold") return {};
  return std::string(" The muscles change ") + what + " meanwhile, by up to " +
         kgf(asked.run.pressure_swing) + ".";
}

Stage sweep_by_hand(const Asked& asked, const ExcitationOptions& options) {
  const PlanRun& run = asked.run;
  if (!(run.peak_speed <= options.speed_limit * (1 + 1e-9))) {
    refuse("plan_beyond_limit", asked,
           "asks for " + number("%.4g", run.peak_speed) + " rad/s, beyond the limit of " +
               number("%.4g", options.speed_limit) + " rad/s; ask for less, or change the limit");
  }
  const double middle = std::isfinite(run.middle) ? std::abs(run.middle) : 0.0;
  require_angle(asked, middle + run.amplitude, options);
  Ask ask;
  ask.kind = Ask::Kind::kSweepByHand;
  ask.amplitude = run.amplitude;
  ask.speed = run.peak_speed;
  ask.middle = run.middle;
  const std::string about = std::isfinite(run.middle) ? degrees(run.middle) + " degrees" : "where it rests";
  return {0.0, ask,
          "Move the bar evenly to and fro, " + number("%.0f", run.amplitude * kDegreesPerRadian) +
              " degrees either side of " + about + ", up to " +
              number("%.0f", run.peak_speed * kDegreesPerRadian) + " degrees per second." +
              swing_words(asked, "their mean pressure")};
}

Stage clamp(const Asked& asked, double angle, const char* what, const ExcitationOptions& options) {
  require_angle(asked, std::abs(angle), options);
  Ask ask;
  ask.kind = Ask::Kind::kClamp;
  ask.angle = angle;
  return {0.0, ask,
          "Clamp the bar at " + degrees(angle) + " degrees and keep your hands off it." +
              swing_words(asked, what)};
}

Stage let_go(const Asked& asked) {
  Ask ask;
  ask.kind = Ask::Kind::kRelease;
  return {0.0, ask,
          "Let go of the bar and stand clear: the muscles move it." +
              swing_words(asked, "their pressure difference")};
}

Program program_of(const Asked& asked, const ExcitationOptions& options) {
  const PlanRun& run = asked.run;
  require_swing_time(asked);
  const double angle = std::isfinite(run.middle) ? run.middle : 0.0;
  Program program;
  program.experiment = run.experiment;
  program.duration = run.duration;
  program.expected.experiment = run.experiment;
  program.expected.duration = run.duration;
  program.expected.highest_speed = 2.0 * std::max(options.speed_limit, kFastSpeed);
  Swings swings = Swings::kDifference;
  if (run.experiment == "constant-pressure") {
    swings = Swings::kMean;
    program.stages = {sweep_by_hand(asked, options)};
    program.hand_moves = true;
    program.sweep = run.peak_speed < 2.0 * kSlowSpeed ? "slow" : "fast";
    program.expected.amplitude = run.amplitude;
    program.expected.speed = run.peak_speed;
    program.expected.slow = program.sweep == "slow";
    program.expected.held_delta_pressure = run.delta_pressure;
  } else if (run.experiment == "constant-angle") {
    program.stages = {clamp(asked, angle, "their pressure difference", options)};
    program.expected.clamped = true;
  } else if (run.experiment == "free") {
    program.stages = {let_go(asked)};
  } else if (run.experiment == "pcu-step") {
    swings = Swings::kMean;
    program.stages = {clamp(asked, 0.0, "both pressures", options)};
  } else {
    refuse("plan_experiment", asked,
           "is none of constant-pressure, constant-angle, free and pcu-step; choose one of them");
  }
  program.expected.stepped = run.waveform == "steps" && run.pressure_swing > 0 && !program.hand_moves &&
                             0.5 * run.pressure_period >= kSettled;
  require_pressures(asked, swings, options);
  program.knots = knots_of(asked, swings);
  return program;
}

}  // namespace

std::vector<Program> plan_programs(const Plan& plan, const ExcitationOptions& options, int round) {
  if (plan.runs.empty())
    throw Error(ErrorKind::kBadInput, "plan_empty",
                "the plan has no run; add a [[run]], or call isac-log with an experiment");
  std::vector<Program> programs;
  for (std::size_t i = 0; i < plan.runs.size(); ++i) {
    const std::string index = std::to_string(i + 1);
    Asked asked{.run = plan.runs[i], .name = "run " + index + " ('" + plan.runs[i].experiment + "')"};
    asked.mean = std::isfinite(asked.run.mean_pressure) ? asked.run.mean_pressure : options.initial_pressure;
    programs.push_back(program_of(asked, options));
    programs.back().name = "plan" + std::to_string(round) + "-" + index + "-" + programs.back().experiment;
  }
  return programs;
}

}  // namespace isac::series
