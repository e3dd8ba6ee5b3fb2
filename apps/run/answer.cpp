#include "run/answer.hpp"

#include <fmt/format.h>

#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>

#include "isac/runtime/control_setup.hpp"

namespace isac::apps {
namespace {

using Json = nlohmann::ordered_json;
using runtime::ControlOutcome;
using runtime::ControlRun;
using runtime::LoopEnd;
using runtime::SupervisorEnd;

Json number_or_null(double value) {
  return std::isfinite(value) ? Json(value) : Json(nullptr);
}

/// The word of "ended", stable for programs.
const char* end_word(const ControlOutcome& outcome) {
  if (outcome.supervisor.why == SupervisorEnd::Why::kHung) return "hung";
  if (!outcome.told) return "died";
  switch (outcome.loop.why) {
    case LoopEnd::Why::kDone:
      return "done";
    case LoopEnd::Why::kStopped:
      return "stopped";
    case LoopEnd::Why::kFault:
      return "fault";
    case LoopEnd::Why::kCardEnded:
      return "card_ended";
    case LoopEnd::Why::kImplausible:
      return "implausible";
    case LoopEnd::Why::kSink:
      return "log_failed";
  }
  return "unknown";
}

std::string end_sentence(const ControlRun& run, const ControlOutcome& outcome) {
  const double silent_ms = 1e-6 * static_cast<double>(outcome.supervisor.silent_ns);
  if (outcome.supervisor.why == SupervisorEnd::Why::kHung) {
    return fmt::format(
        "the loop hung; the supervisor closed the valves {:.1f} ms after its last beat and ended it",
        silent_ms);
  }
  if (!outcome.told) {
    const int signal = outcome.supervisor.signal;
    return fmt::format(
        "the loop's process died ({}); the supervisor closed the valves {:.1f} ms after its last beat",
        signal != 0 ? strsignal(signal) : "it ended without a word", silent_ms);
  }
  const double seconds = 1e-9 * static_cast<double>(outcome.loop.ended_ns);
  switch (outcome.loop.why) {
    case LoopEnd::Why::kDone:
      return "the motion has been played to its end; the valves are closed";
    case LoopEnd::Why::kStopped:
      return fmt::format("stopped at {:.3f} s; the valves are closed", seconds);
    case LoopEnd::Why::kCardEnded:
      return "the recording has nothing more";
    case LoopEnd::Why::kFault:
      return fmt::format("fault at {:.3f} s: {}{}; the valves are closed", seconds,
                         runtime::finding_words(outcome.loop.cause),
                         outcome.diagnosis.empty() ? "" : " (" + outcome.diagnosis + ")");
    case LoopEnd::Why::kImplausible:
      return fmt::format("not armed, because the samples are not plausible: {}; the valves were never opened",
                         runtime::finding_words(outcome.loop.cause));
    case LoopEnd::Why::kSink:
      return "the log could not be written; the valves are closed";
  }
  static_cast<void>(run);
  return {};
}

/// What the watches noticed that stopped nothing; late cycles are counted elsewhere.
Warnings noticed(const ControlOutcome& outcome) {
  Warnings all;
  if ((outcome.warnings & control::kEncoderFrozen) != 0)
    all.push_back(
        {"encoder_frozen", "an encoder stood still while the pressures moved; check its plug and coupling"});
  if ((outcome.warnings & control::kNearLimit) != 0)
    all.push_back({"near_limit",
                   "a limit of the rig was passed, though not so far or so long that it stopped the run"});
  return all;
}

}  // namespace

int exit_code_of(const ControlRun& run, const ControlOutcome& outcome) {
  if (!outcome.as_planned()) return 4;
  const bool compared = !run.replayed.empty();
  const bool equal = outcome.comparison.different == 0 && outcome.comparison.rows > 0 &&
                     outcome.comparison.rows == outcome.recorded_rows;
  return compared && !equal ? 1 : 0;
}

std::string format_run(const ControlRun& run, const ControlOutcome& outcome, const std::string& mode,
                       const Warnings& warnings) {
  Json answer = {
      {"schema", "isac.run/1"},
      {"mode", mode},
      {"card", run.card},
      {"ended", end_word(outcome)},
      {"text", end_sentence(run, outcome)},
      {"fault", nullptr},
      {"duration", {{"value", 1e-9 * static_cast<double>(outcome.loop.ended_ns)}, {"unit", "s"}}},
      {"cycles", outcome.loop.cycles},
      {"late", outcome.loop.late},
      {"skipped_periods", outcome.loop.skipped},
      {"longest_late", {{"value", 1e-9 * static_cast<double>(outcome.loop.longest_late_ns)}, {"unit", "s"}}},
      {"log", run.log.empty() ? Json(nullptr) : Json(run.log.string())},
      {"rows", outcome.rows},
      {"dropped", outcome.dropped},
      {"flight", outcome.flight.empty() ? Json(nullptr) : Json(outcome.flight.string())}};
  const control::Finding& cause = outcome.loop.cause;
  if (outcome.told && !outcome.as_planned() && cause.found()) {
    answer["fault"] = {{"text", runtime::finding_words(cause)},
                       {"code", static_cast<int>(cause.code)},
                       {"joint_or_channel", cause.joint},
                       {"value", number_or_null(static_cast<double>(cause.value))},
                       {"limit", number_or_null(static_cast<double>(cause.limit))},
                       {"diagnosis", outcome.diagnosis.empty() ? Json(nullptr) : Json(outcome.diagnosis)}};
  }
  if (outcome.asked_real_time) {
    answer["real_time"] = {{"fifo", outcome.real_time.fifo},
                           {"memory_locked", outcome.real_time.locked},
                           {"text", outcome.real_time.words()}};
  } else {
    answer["real_time"] = nullptr;
  }
  answer["supervisor"] = {
      {"signal", outcome.supervisor.signal},
      {"silent", {{"value", 1e-9 * static_cast<double>(outcome.supervisor.silent_ns)}, {"unit", "s"}}},
      {"vented", ok(outcome.supervisor.vent)}};
  if (!run.replayed.empty()) {
    answer["replay"] = {{"recorded_rows", outcome.recorded_rows},
                        {"compared", outcome.comparison.rows},
                        {"different", outcome.comparison.different},
                        {"largest", {{"value", outcome.comparison.largest}, {"unit", "Pa"}}}};
  }
  answer["warnings"] = Json::array();
  Warnings all = warnings;
  for (Warning& warning : noticed(outcome)) all.push_back(std::move(warning));
  for (const Warning& warning : all)
    answer["warnings"].push_back({{"code", warning.code}, {"text", warning.text}});
  return answer.dump(2);
}

std::string run_words(const ControlRun& run, const ControlOutcome& outcome) {
  std::string text = end_sentence(run, outcome) + ".\n";
  if (outcome.told) {
    text += fmt::format("{} cycles, {} late, {} periods skipped, longest {:.3f} ms behind its time.\n",
                        outcome.loop.cycles, outcome.loop.late, outcome.loop.skipped,
                        1e-6 * static_cast<double>(outcome.loop.longest_late_ns));
  }
  if (!run.log.empty() && outcome.told)
    text += fmt::format("{} rows in {}{}.\n", outcome.rows, run.log.string(),
                        outcome.dropped > 0 ? fmt::format(", {} lost", outcome.dropped) : "");
  for (const Warning& warning : noticed(outcome)) text += "Warning: " + warning.text + ".\n";
  if (!outcome.flight.empty()) text += fmt::format("The last cycles are in {}.\n", outcome.flight.string());
  if (!run.replayed.empty()) {
    const runtime::CommandComparison& same = outcome.comparison;
    text +=
        same.different == 0
            ? fmt::format("{} of {} recorded commands compared, all equal to the last bit.\n", same.rows,
                          outcome.recorded_rows)
            : fmt::format(
                  "{} of {} commands differ, by up to {:.6g} Pa, the first at {:.4f} s: other parameters, "
                  "settings or program than then.\n",
                  same.different, same.rows, same.largest, same.first_different);
  }
  return text;
}

namespace {
constexpr struct {
  const char* name;
  double share;
} kQuantiles[] = {{"p50", 0.5},     {"p90", 0.9},       {"p99", 0.99},
                  {"p99.9", 0.999}, {"p99.99", 0.9999}, {"max", 1.0}};
}  // namespace

std::string format_latency(const LatencyRun& run) {
  Json late = Json::object();
  for (const auto& one : kQuantiles) late[one.name] = number_or_null(run.jitter.quantile(one.share));
  const Json answer = {{"schema", "isac.run.latency/1"},
                       {"rate", {{"value", run.rate}, {"unit", "Hz"}}},
                       {"wake_ups", run.jitter.late.size()},
                       {"lateness_us", late},
                       {"later_than_a_period", run.jitter.missed},
                       {"skipped_periods", run.jitter.skipped},
                       {"real_time",
                        {{"fifo", run.real_time.fifo},
                         {"memory_locked", run.real_time.locked},
                         {"text", run.real_time.words()}}}};
  return answer.dump(2);
}

std::string latency_words(const LatencyRun& run) {
  std::string head = fmt::format("{:>10}", "wake-ups"), row = fmt::format("{:>10}", run.jitter.late.size());
  for (const auto& one : kQuantiles) {
    head += fmt::format("{:>10}", one.name);
    row += fmt::format("{:>10.1f}", run.jitter.quantile(one.share));
  }
  return fmt::format("Wake-up lateness at {:g} Hz for {:g} s, in us ({}):\n{}{:>12}{:>10}\n{}{:>12}{:>10}\n",
                     run.rate, run.seconds, run.real_time.words(), head, "> 1 period", "skipped", row,
                     run.jitter.missed, run.jitter.skipped);
}

}  // namespace isac::apps
