#include "isac/series/calibration_programs.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "isac/core/error.hpp"
#include "isac/series/sweep_check_detail.hpp"

namespace isac::series {
namespace {

using detail::number;

constexpr double kLevelSeconds = 4.0;    // 80 of the seed's averages of 50 ms
constexpr double kSettleSeconds = 1.5;   // of a valve, beside the loop's own second: fifteen lags together
constexpr double kForceTolerance = 0.5;  // N: 0.25 % of 200 N
constexpr double kPressureTolerance = 0.01 * kPascalPerKgfCm2;  // 0.2 % of 5 kg/cm²
constexpr double kAngleTolerance = 2.0 * 2.0 * kPi / 8000.0;    // two steps of the encoder

[[noreturn]] void refuse(const char* code, const std::string& text) {
  throw Error(ErrorKind::kUsage, code, text);
}

std::string kgf_text(double pascal, const char* format = "%.4g") {
  return number(format, pascal / kPascalPerKgfCm2);
}

double seconds_of(const ExcitationOptions& options) {
  const double asked = !std::isnan(options.duration) ? options.duration : options.hold;
  if (std::isnan(asked)) return kLevelSeconds;
  if (std::isfinite(asked) && asked > 0.0) return asked;
  refuse("not_positive", "the duration must be a positive number, not " + number("%g", asked));
}

Program level(std::string name, std::string calibration, double seconds, std::vector<HeldSignal> held) {
  Program program;
  program.name = "calibration-" + std::move(name);
  program.experiment = "calibration";
  program.calibration = std::move(calibration);
  program.duration = seconds;
  program.in_codes = true;
  program.knots = {{0.0, 0.0, 0.0}};  // vented
  program.expected.experiment = program.experiment;
  program.expected.duration = seconds;
  program.expected.held = std::move(held);
  return program;
}

Program unloaded(double seconds) {
  Program program =
      level("force_0N", "F1 = 0 N, F2 = 0 N", seconds, {{"F1", kForceTolerance}, {"F2", kForceTolerance}});
  Ask ask;
  ask.kind = Ask::Kind::kRemoveLoad;
  program.stages = {
      {0.0, ask,
       "Take both force sensors off the rig and lay them flat on a board, nothing acting on them."}};
  return program;
}

Program valves_at(double code, double seconds) {
  const std::string shown = number("%.0f", code);
  Program program = level("valve_" + number("%04.0f", code), "p1_cmd = " + shown + ", p2_cmd = " + shown,
                          seconds, {{"p1", kPressureTolerance}, {"p2", kPressureTolerance}});
  Ask ask;
  ask.kind = Ask::Kind::kRemoveLoad;
  program.stages = {
      {0.0, ask,
       "Leave the force sensors off the rig and keep clear: both valves go to code " + shown + " of 4095."}};
  program.lead = {{0.0, code, code}, {kSettleSeconds, code, code}};
  program.knots = {{0.0, code, code}};
  return program;
}

Program weight_on(int sensor, double newton, double seconds) {
  const std::string signal = "F" + std::to_string(sensor), shown = number("%.6g", newton) + " N";
  Program program = level(signal + "_" + number("%.6g", newton) + "N", signal + " = " + shown, seconds,
                          {{signal, kForceTolerance}});
  Ask ask;
  ask.kind = Ask::Kind::kHangWeight;
  ask.load = newton;
  program.stages = {
      {0.0, ask, "Hang the weight of " + shown + " on force sensor " + signal + ", plumb and at rest."}};
  return program;
}

Program supply_at(double pascal, double seconds) {
  const std::string shown = kgf_text(pascal) + " kg/cm2";
  Program program = level("pressure_" + kgf_text(pascal, "%.2f"), "p1 = " + shown + ", p2 = " + shown,
                          seconds, {{"p1", kPressureTolerance}, {"p2", kPressureTolerance}});
  Ask ask;
  ask.kind = Ask::Kind::kConnectSupply;
  ask.pressure = pascal;
  program.stages = {{0.0, ask,
                     pascal > 0.0 ? "Connect both pressure sensors directly to the supply and set its "
                                    "regulator to " +
                                        shown + "."
                                  : "Take both pressure sensors off the muscles and leave them open to the "
                                    "air: 0 kg/cm2."}};
  return program;
}

/// Both muscles stiff; the joint comes from one side and settles at a small pressure difference.
Program middle_from(int index, int side, double delta, double stiff, double excursion, double seconds) {
  Program program =
      level("middle_" + std::to_string(index), side > 0 ? "angle = middle +" : "angle = middle -", seconds,
            {{"angle", kAngleTolerance}});
  const auto knot = [stiff](double time, double difference) {
    return Knot{time, stiff - difference, stiff + difference};
  };
  const double aside = delta + side * excursion;
  program.in_codes = false;
  program.lead = {knot(0.0, aside), knot(1.5, aside), knot(1.5, delta), knot(3.0, delta)};
  program.knots = {knot(0.0, delta)};
  Ask ask;
  ask.kind = Ask::Kind::kRelease;
  program.stages = {
      {0.0, ask,
       (index == 1 ? "Put all sensors back into the rig, let go of the bar and stand clear: both muscles go "
                     "stiff, and the bar comes from the "
                   : "Hands off: once more, from the ") +
           std::string(side > 0 ? "positive" : "negative") + " side."}};
  return program;
}

std::vector<double> weights_of(const ExcitationOptions& options) {
  std::vector<double> weights = options.weights;
  if (weights.empty()) weights = {kSeedWeight};
  for (const double weight : weights) {
    if (std::isfinite(weight) && weight > 0.0 && weight <= options.force_limit) continue;
    refuse("weight_beyond_limit",
           "a weight of " + number("%.6g", weight) + " N must lie above 0 and within the force limit of " +
               number("%.6g", options.force_limit) + " N (0 N is recorded anyway); choose another one");
  }
  return weights;
}

std::vector<double> supplies_of(const ExcitationOptions& options) {
  std::vector<double> supplies = options.supplies;
  if (supplies.empty()) {
    for (const double share : {0.0, 0.25, 0.5, 0.75, 1.0}) supplies.push_back(share * options.pressure_limit);
  }
  for (const double supply : supplies) {
    if (std::isfinite(supply) && supply >= 0.0 && supply <= options.pressure_limit * (1.0 + 1e-9)) continue;
    refuse("supply_beyond_limit", "a supply of " + kgf_text(supply) +
                                      " kg/cm2 must lie between 0 and the pressure limit of " +
                                      kgf_text(options.pressure_limit) + " kg/cm2; choose another level");
  }
  if (supplies.size() < 2) {
    refuse("supply_one_level",
           "a pressure sensor needs two levels of the supply or more; name them like \"0,2.5,5 kg/cm2\"");
  }
  return supplies;
}

}  // namespace

std::vector<Program> calibration_programs(const ExcitationOptions& options) {
  // Code 0 shows the zero trimmer; the line begins above it, for no valve pulls below zero pressure.
  static constexpr std::array<double, 6> kCodes = {0, 410, 1024, 2048, 3072, 4095};
  const double seconds = seconds_of(options);
  const auto weights = weights_of(options), supplies = supplies_of(options);

  std::vector<Program> programs = {unloaded(seconds)};
  for (const double code : kCodes) programs.push_back(valves_at(code, seconds));
  for (const int sensor : {1, 2}) {
    for (const double weight : weights) programs.push_back(weight_on(sensor, weight, seconds));
  }
  for (const double supply : supplies) programs.push_back(supply_at(supply, seconds));

  // Stiff: a quarter of the way from p0 to the limit, where the seed's force sensors still have room.
  const double room = options.pressure_limit - options.initial_pressure;
  const double stiff = options.initial_pressure + 0.25 * room;
  const double excursion = std::min({0.25 * kPascalPerKgfCm2, 0.25 * room, 0.5 * options.delta_pressure_limit,
                                     0.5 * options.initial_pressure});
  int index = 0;
  for (const double share : {0.0, -0.8, 0.8}) {
    for (const int side : {1, -1}) {
      programs.push_back(middle_from(++index, side, share * excursion, stiff, excursion, seconds));
    }
  }
  return programs;
}

}  // namespace isac::series
