/// @file
/// From the words of a call to recordings in memory: dataset folders, files, --map.
///
/// A dataset is a folder: `rig.toml`, `*.csv`, and, if there, `heldout/*.csv`, never used for fitting
/// (docs/formats.md). Throws isac::Error: usage (nothing to read), bad input (what is read cannot be used).
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "isac/record/csv_reader.hpp"
#include "isac/series/recording.hpp"

namespace isac::apps {

/// Files of a call, each folder's in the order of their names.
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

/// "sha256:<digits> name" of every recording that was hashed.
[[nodiscard]] std::vector<std::string> sources_of(const std::vector<series::Recording>& recordings);

/// A file's name without its folder.
[[nodiscard]] std::string short_name(const std::string& path);

/// The present time as ISO 8601 in UTC.
[[nodiscard]] std::string now_iso8601();

}  // namespace isac::apps
