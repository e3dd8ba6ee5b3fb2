/// @file
/// A session at the rig: plays programs one after the other, each into a log of its own, and judges each as soon as it ends.
///
/// Nothing on disk is touched before the card is open, the folder is writable, no file would be replaced (unless
/// `overwrite`) and there is room for all recordings. A dataset gets a copy of the rig file and a folder heldout.
/// What happens then:
///   end of the program, Ctrl-C   log closed, read back, judged
///   safety limit, card failure   valves vented, log closed, isac::Error (stopped) that names the rows kept
///   log cannot be written        valves vented, file renamed to *.incomplete, isac::Error (bad input)
///   SIGKILL                      whole lines up to the last second are in the file (record/csv_writer.hpp)
///
/// Units: SI. Threads: the caller's thread talks to the observer; a loop thread and a writer thread do the work.
/// Errors: throws isac::Error as above. Source: seed chapter 3, 4.1.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "isac/record/rig.hpp"
#include "isac/runtime/experiment_loop.hpp"
#include "isac/series/sweep_check.hpp"

namespace isac::runtime {

struct SessionOptions {
  std::string card = "sim:";
  record::Rig rig;
  std::filesystem::path rig_file;  ///< copied into a dataset
  std::filesystem::path folder;
  bool dataset = false;  ///< copy the rig file, put held-out runs into heldout/
  std::vector<series::Program> programs;
  double rate = 500;            ///< Hz
  Limits limits;                ///< speed: for a joint that the muscles move
  double hand_speed_limit = 0;  ///< rad/s, while a hand moves it
  bool pace_real = false;
  bool raw = false;
  bool overwrite = false;  ///< an older recording is kept as *.csv.bak
  std::uint64_t seed = 1;
};

struct RecordingOutcome {
  std::filesystem::path file;
  std::string program;
  LoopResult loop;
  std::uint64_t dropped = 0;
  series::SweepVerdict verdict;
};

/// Whoever talks to the person; called on the caller's thread only.
class SessionObserver {
 public:
  virtual ~SessionObserver() = default;
  /// Before a recording; `by_hand` when no simulated person is there to act. False: stop the session.
  virtual bool about_to_record(const series::Program& program, std::size_t index, std::size_t count,
                               bool by_hand) = 0;
  virtual void prompt(const std::string& sentence) = 0;
  /// About twenty times a second.
  virtual void progress(const series::Program& program, const RecordingLive& live) = 0;
  virtual void judged(const RecordingOutcome& outcome) = 0;
};

/// Plays all programs unless `stop` is raised. Recordings that were not begun are not in the result.
[[nodiscard]] std::vector<RecordingOutcome> run_session(const SessionOptions& options,
                                                        SessionObserver& observer,
                                                        const std::atomic<bool>& stop);

}  // namespace isac::runtime
