/// @file
/// Writes recordings: a whole file at once (atomically), or row by row into an append-only log.
///
/// Numbers are written so that reading gives the same double back (shortest form). What the reader would refuse (a wrong unit,
/// an infinite value, a name with a line feed) is refused here, before a file exists.
/// The append-only log hands each whole line to the kernel and asks it to store them every `sync_seconds`: after SIGKILL at
/// most the last line is torn, and the reader drops a torn last line of a log that was not closed (a closed log ends with the
/// line `# closed: <ISO time>`). When the disk fills, the part of a line that went out is taken back.
/// Real time: append() makes one system call, and now and then waits for the disk: not for a control loop's own thread.
/// Throws isac::Error with the file's name: bad input (disk_full, folder_missing, file_is_directory, file_unwritable,
/// number_not_finite, columns_unequal, column_unwritable, metadata_unwritable, time_not_increasing, row_length, log_closed,
/// and the unit codes of docs/formats.md), usage (file_exists: a log never overwrites a recording).
/// Threads: one writer per object. Example: `AppendLog log("run.csv", {{"time", "s", 4}, {"angle", "rad"}}, {{"experiment", "free"}});`
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "isac/series/recording.hpp"

namespace isac::record {

/// Temporary file, fsync, rename: the file is either the old one or the whole new one.
void write_recording(const std::filesystem::path& path, const series::Recording& recording);

/// Replaces `path` by `bytes` atomically; keeps the old content as `path.bak` if `keep_backup`.
void write_atomically(const std::filesystem::path& path, std::string_view bytes, bool keep_backup = false);

struct LogColumn {
  std::string name;
  std::string unit;   ///< unit written in the header; values are given in this unit
  int decimals = -1;  ///< digits behind the point, -1 for the shortest exact form
};

class AppendLog {
 public:
  AppendLog(const std::filesystem::path& path, std::vector<LogColumn> columns,
            const std::map<std::string, std::string>& metadata, double sync_seconds = 1.0);
  ~AppendLog();  ///< closes; errors on close are swallowed here, call close() to see them
  AppendLog(const AppendLog&) = delete;
  AppendLog& operator=(const AppendLog&) = delete;

  /// One value per column, in its unit; NaN and infinities are written as missing samples. `time`, as printed, must increase.
  void append(std::span<const double> row);
  void close();
  [[nodiscard]] std::uint64_t rows() const noexcept;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace isac::record
