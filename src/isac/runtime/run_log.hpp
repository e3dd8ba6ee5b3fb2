/// @file
/// A run as rows of CSV (`# experiment: closed-loop`): what is needed to look at it, to fit it, and to replay it bit for bit.
///
/// Columns of one joint: time [s] (to the nanosecond), angle, velocity, p1 p2 F1 F2 where measured, p1_cmd p2_cmd [Pa] as the
/// controller gave them, angle_wanted velocity_wanted acceleration_wanted torque_wanted, torque_model torque_asked [N m];
/// of several joints: phi1 …, and the others with _1 …; then phase state mode arm answered limited warnings fault [1]
/// (enumerators of cycle_row.hpp and control/) and the codes enc* ai* ao* [count]. Numbers are the shortest that read back to
/// the same double.
/// The flight recorder's file has the same columns: the last cycles before the end.
///
/// Units: as written. Real time: not for the loop. Threads: one. Errors: as record/csv_writer.hpp.
/// Source: docs/formats.md, "Recording". Example: `RunLog log(path, wiring, metadata); log.append(row);`
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "isac/record/csv_writer.hpp"
#include "isac/runtime/cycle_row.hpp"
#include "isac/runtime/joint_wiring.hpp"
#include "isac/series/recording.hpp"

namespace isac::runtime {

class RunLog {
 public:
  RunLog(const std::filesystem::path& path, const JointWiring& wiring,
         const std::map<std::string, std::string>& metadata);
  /// A row whose time stands still (a stale sample) is left out: time increases in a recording.
  void append(const CycleRow& row);
  void close() { log_.close(); }
  [[nodiscard]] std::uint64_t rows() const noexcept { return log_.rows(); }

 private:
  JointWiring wiring_;
  std::vector<double> values_;
  std::int64_t last_ns_ = -1;
  record::AppendLog log_;
};

/// Commands of a replayed run, row by row, against those of the recording.
struct CommandComparison {
  std::uint64_t rows = 0, different = 0;
  double largest = 0;          ///< Pa
  double first_different = 0;  ///< s; only where `different` is above 0
};

/// `rows` are the replay's, `run` is the recording; rows are matched by their time.
class CommandComparer {
 public:
  CommandComparer(const series::Recording& run, int joints);
  /// No heap: may be called in the loop.
  void compare(const CycleRow& row) noexcept;
  [[nodiscard]] const CommandComparison& result() const noexcept { return result_; }
  [[nodiscard]] std::size_t recorded_rows() const noexcept { return times_.size(); }

 private:
  std::vector<std::int64_t> times_;
  std::vector<PerJoint<std::array<double, 2>>> commands_;
  int joints_;
  std::size_t next_ = 0;
  CommandComparison result_;
};

}  // namespace isac::runtime
