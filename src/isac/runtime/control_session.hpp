/// @file
/// A supervised run at the rig: card, loop, log and flight recorder in a process of their own, and a watcher that can always
/// close the valves.
///
///   parent   its own handle to the valves, the beat, the flight recorder's memory; writes the flight file and says what happened
///   child    loop thread (SCHED_FIFO where permitted), writer thread, and a main thread for the status line and signals
/// Nothing on disk is touched before the card is open and the settings are accepted. What happens then:
///   end of the motion, SIGINT, SIGTERM, SIGHUP   valves vented, log closed
///   fault                                        valves vented in the same cycle, log closed, flight file written
///   abort, SIGSEGV, SIGKILL, hang                valves vented by the parent, flight file written; the log has whole lines
/// `sim:` and `replay:` run in virtual time, or at the pace of the wall clock; their valves lie in shared memory
/// (shared_valves.hpp). Virtual runs of the same seed and settings give the same recording.
///
/// Units: SI. Threads: call from a program that has not started any. Real time: see control_loop.hpp.
/// Errors: throws isac::Error: what the card, the wiring or the log refuses, and real time that was required and not permitted.
/// Source: docs/faults.md; decisions 0110, 0111. Example: apps/isac_run.cpp.
#pragma once

#include <atomic>
#include <cstddef>
#include <filesystem>
#include <map>
#include <string>

#include "isac/record/rig.hpp"
#include "isac/runtime/control_loop.hpp"
#include "isac/runtime/directors.hpp"
#include "isac/runtime/real_time.hpp"
#include "isac/runtime/run_log.hpp"
#include "isac/runtime/supervisor.hpp"

namespace isac::runtime {

struct ControlRun {
  std::string card = "sim:";
  record::Rig rig;
  int joints = 1;
  ControlSettings settings;
  Motion motion;
  std::filesystem::path
      replayed;                  ///< a recorded run whose wishes are followed and whose commands are compared
  std::filesystem::path log;     ///< empty: none
  std::filesystem::path flight;  ///< written when the run did not end as planned; empty: none
  std::map<std::string, std::string> metadata;
  bool pace_real = false;   ///< simulated and replayed cards at the wall clock's pace
  bool ask_to_arm = false;  ///< a person permits the arming
  bool require_real_time = false;
  int priority = 80;
  BeatLimits beat;
  std::size_t flight_cycles = 4000;
};

/// How the run ended, seen from the parent.
struct ControlOutcome {
  LoopEnd loop;  ///< zeros where the child could not tell any more
  SupervisorEnd supervisor;
  bool told = false;  ///< the child lived to tell
  RealTime real_time;
  bool asked_real_time = false;
  std::uint64_t rows = 0, dropped = 0;
  std::uint8_t warnings = 0;  ///< control::WarningFlag, of the whole run
  std::string diagnosis;      ///< which channel did not answer
  CommandComparison comparison;
  std::uint64_t recorded_rows = 0;
  std::filesystem::path flight;  ///< written, or empty
  [[nodiscard]] bool as_planned() const noexcept;
};

/// Whoever watches; called in the child, outside the loop's thread.
class RunObserver {
 public:
  virtual ~RunObserver() = default;
  /// Once: what was permitted of real time, and what a card wants to be known.
  virtual void started(const RealTime* real_time, const std::vector<std::string>& remarks) = 0;
  /// About twenty times a second.
  virtual void status(const Live& live) = 0;
  /// Asked about twenty times a second until it says yes, where a person must agree to arming. Must not block.
  virtual bool agrees() = 0;
};

[[nodiscard]] ControlOutcome run_control(const ControlRun& run, RunObserver& observer,
                                         const std::atomic<bool>& stop);

/// Is this a card whose time is virtual?
[[nodiscard]] bool is_virtual(const std::string& card);

}  // namespace isac::runtime
