/// @file
/// The words of an isac-run call, and the run they ask for.
#pragma once

#include <string>
#include <vector>

#include "isac/core/estimated.hpp"
#include "isac/runtime/control_session.hpp"

namespace isac::apps {

struct RunWords {
  std::string card = "sim:", rig, params, arm, log, flight, json, pace = "virtual", controller, pid;
  std::string duration, step, sine, frequency = "0.3183 Hz", points, torque = "0 N m", following, heartbeat;
  std::string replayed, speed = "0.2 m/s", start;
  std::vector<std::string> way;  ///< "by 0,0,0.1 m", "to 0.3,0.2,0.4 m"
  double rate = 2000;
  int joint = 1, priority = 80;
  bool yes = false, ask = false, require_rt = false, predictor = false;
};

struct AskedRun {
  runtime::ControlRun run;
  Warnings warnings;
};

/// `mode` is the subcommand: position, trajectory, line, torque, hand, replay.
/// Throws isac::Error: usage for words that exclude each other, bad input for files.
[[nodiscard]] AskedRun asked_run(const RunWords& words, const std::string& mode);

}  // namespace isac::apps
