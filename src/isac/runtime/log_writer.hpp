/// @file
/// The writer thread of a recording: takes rows out of the ring and appends them to the append-only log.
///
/// Columns: time [s], angle [rad], p1 p2 [kg/cm2], F1 F2 [N], p1_cmd p2_cmd [kg/cm2]; raw adds enc*, ai*, ao* [count].
/// Numbers are written to a fixed number of digits behind the point, each finer than a hundredth of a converter's code.
/// Threads: construct and finish() on one thread, push() on the loop's thread; the writer thread is inside.
/// Real time: push() is wait-free and counts what it loses. Errors: a failed write ends the writer; failed() tells the loop,
/// finish() throws what happened (isac::Error, "disk_full" and the like).
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "isac/record/csv_writer.hpp"
#include "isac/runtime/log_row.hpp"
#include "isac/runtime/ring_writer.hpp"

namespace isac::runtime {

class LogWriter {
 public:
  LogWriter(const std::filesystem::path& path, const std::map<std::string, std::string>& metadata,
            const card::Shape& shape, bool raw, std::size_t ring_rows = 8192);

  /// False when the ring is full: the row is lost and counted.
  bool push(const LogRow& row) noexcept { return writer_.push(row); }
  /// Waits for room instead of losing the row; only where time is virtual. False once the writer has failed.
  bool push_waiting(const LogRow& row) noexcept { return writer_.push_waiting(row); }
  [[nodiscard]] bool failed() const noexcept { return writer_.failed(); }
  [[nodiscard]] std::uint64_t dropped() const noexcept { return writer_.dropped(); }

  /// Writes what is left, closes the log, throws what went wrong. Returns the rows written.
  std::uint64_t finish();

 private:
  void append(const LogRow& row);

  record::AppendLog log_;
  card::Shape shape_;
  bool raw_;
  std::vector<double> values_;  ///< one row in the units of the file; the writer thread's own
  RingWriter<LogRow> writer_;   ///< last: its thread uses all of the above
};

/// Columns in the order append() fills them.
[[nodiscard]] std::vector<record::LogColumn> log_columns(const card::Shape& shape, bool raw);

}  // namespace isac::runtime
