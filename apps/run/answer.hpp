/// @file
/// How a run ended: as JSON (isac.run/1, isac.run.latency/1), as sentences, and as an exit code.
#pragma once

#include <string>

#include "isac/core/estimated.hpp"
#include "isac/runtime/control_session.hpp"

namespace isac::apps {

/// 0: ended as planned; 1: a replayed run gave other commands; 4: a fault, or the loop's process died or hung.
[[nodiscard]] int exit_code_of(const runtime::ControlRun& run, const runtime::ControlOutcome& outcome);

[[nodiscard]] std::string format_run(const runtime::ControlRun& run, const runtime::ControlOutcome& outcome,
                                     const std::string& mode, const Warnings& warnings);

/// Lines for a person.
[[nodiscard]] std::string run_words(const runtime::ControlRun& run, const runtime::ControlOutcome& outcome);

struct LatencyRun {
  double seconds = 0, rate = 0;
  runtime::RealTime real_time;
  runtime::Jitter jitter;
};
[[nodiscard]] std::string format_latency(const LatencyRun& run);
[[nodiscard]] std::string latency_words(const LatencyRun& run);

}  // namespace isac::apps
