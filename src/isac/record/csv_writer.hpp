/// @file
/// Writes recordings: a whole file at once (atomically), or row by row into an append-only log.
///
/// Numbers are written so that reading gives the same double back (shortest form). The append-only log flushes whole
/// lines and asks the kernel to store them every `sync_seconds`: after SIGKILL at most the last line is torn, and the reader
/// drops a torn last line of a log that was not closed (a closed log ends with the line `# closed: <ISO time>`).
/// Throws isac::Error (bad input, "disk_full" and the like) with the file's name. Threads: one writer per object.
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

  void append(std::span<const double> row);
  void close();
  [[nodiscard]] std::uint64_t rows() const noexcept;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace isac::record
