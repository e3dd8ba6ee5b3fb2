/// @file
/// From the words of a call to the runs that a fit speaks of: dataset folders, --map, --rig, joint runs.
///
/// A dataset is a folder: `rig.toml`, `*.csv`, and, if there, `heldout/*.csv`, never used for fitting
/// (docs/formats.md). Throws isac::Error: usage (nothing to read), bad input (what is read cannot be used).
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "isac/estimate/joint_fit.hpp"
#include "isac/record/csv_reader.hpp"
#include "isac/record/rig.hpp"
#include "isac/series/recording.hpp"

namespace isac::apps {

/// Files of a call, in the order in which the runs were started where the files say so, else by name.
struct Files {
  std::vector<std::filesystem::path> runs;
  std::vector<std::filesystem::path> heldout;
  std::filesystem::path rig;  ///< empty: none named and none found
};

/// Arguments may be files and dataset folders; `heldout` and `rig` add to what the folders hold.
[[nodiscard]] Files find_files(const std::vector<std::string>& arguments,
                               const std::vector<std::string>& heldout, const std::string& rig);

[[nodiscard]] std::vector<record::ColumnMap> parse_maps(const std::vector<std::string>& maps);

/// All recordings, read one after the other; errors name the file.
[[nodiscard]] std::vector<series::Recording> read_all(const std::vector<std::filesystem::path>& paths,
                                                      const record::ReadOptions& options);

/// Which signals of a recording are output and position, and the wheel that turns forces into torque.
struct JointSignals {
  std::string output = "torque";  ///< computed from F1, F2 and the wheel radius where the column is absent
  std::string position = "angle";
  bool needs_pressure = true;  ///< the terms contain one of the pressures
  double wheel_radius = 0;     ///< m
};

[[nodiscard]] estimate::JointRun joint_run(const series::Recording& recording, const JointSignals& signals);

/// "sha256:<digits> name" of every recording that was hashed.
[[nodiscard]] std::vector<std::string> sources_of(const std::vector<series::Recording>& recordings);

/// A file's name without its folder.
[[nodiscard]] std::string short_name(const std::string& path);

/// The present time as ISO 8601 in UTC.
[[nodiscard]] std::string now_iso8601();

}  // namespace isac::apps
