#include "common/dataset.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <system_error>
#include <utility>

#include "isac/core/error.hpp"

namespace isac::apps {
namespace fs = std::filesystem;

namespace {

std::vector<fs::path> csv_files_in(const fs::path& folder) {
  std::vector<fs::path> found;
  std::error_code failure;
  for (const auto& entry : fs::directory_iterator(folder, failure)) {
    if (entry.path().extension() == ".csv" && entry.is_regular_file()) found.push_back(entry.path());
  }
  if (failure) {
    throw Error(ErrorKind::kBadInput, "folder_unreadable",
                "the folder cannot be read (" + failure.message() + "); check its permissions",
                {folder.string(), 0, 0});
  }
  std::sort(found.begin(), found.end());
  return found;
}

}  // namespace

Files find_files(const std::vector<std::string>& arguments, const std::vector<std::string>& heldout,
                 const std::string& rig) {
  Files files;
  files.rig = rig;
  for (const std::string& argument : arguments) {
    std::error_code ignored;
    if (!fs::is_directory(argument, ignored)) {
      files.runs.emplace_back(argument);
      continue;
    }
    const fs::path folder(argument);
    const auto runs = csv_files_in(folder);
    if (runs.empty()) {
      throw Error(ErrorKind::kBadInput, "dataset_empty",
                  "the dataset folder holds no *.csv; name one that does", {argument, 0, 0});
    }
    files.runs.insert(files.runs.end(), runs.begin(), runs.end());
    if (fs::is_directory(folder / "heldout", ignored)) {
      const auto held = csv_files_in(folder / "heldout");
      files.heldout.insert(files.heldout.end(), held.begin(), held.end());
    }
    if (files.rig.empty() && fs::exists(folder / "rig.toml", ignored)) files.rig = folder / "rig.toml";
  }
  for (const std::string& path : heldout) files.heldout.emplace_back(path);
  return files;
}

std::vector<record::ColumnMap> parse_maps(const std::vector<std::string>& maps) {
  std::vector<record::ColumnMap> parsed;
  parsed.reserve(maps.size());
  for (const std::string& map : maps) parsed.push_back(record::parse_column_map(map));
  return parsed;
}

std::vector<series::Recording> read_all(const std::vector<fs::path>& paths,
                                        const record::ReadOptions& options) {
  std::vector<series::Recording> recordings;
  recordings.reserve(paths.size());
  for (const fs::path& path : paths) recordings.push_back(record::read_recording(path, options));
  return recordings;
}

std::vector<std::string> sources_of(const std::vector<series::Recording>& recordings) {
  std::vector<std::string> sources;
  for (const series::Recording& recording : recordings) {
    if (!recording.sha256.empty())
      sources.push_back("sha256:" + recording.sha256 + " " + short_name(recording.source));
  }
  return sources;
}

std::string short_name(const std::string& path) {
  return fs::path(path).filename().string();
}

std::string now_iso8601() {
  const auto now = std::chrono::time_point_cast<std::chrono::seconds>(std::chrono::system_clock::now());
  return fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::chrono::system_clock::to_time_t(now)));
}

}  // namespace isac::apps
