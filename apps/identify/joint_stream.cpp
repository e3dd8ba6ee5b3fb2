#include "identify/joint_stream.hpp"

#include <algorithm>
#include <string>
#include <system_error>
#include <utility>

#include "isac/estimate/streaming_joint_fit.hpp"

namespace isac::apps {
namespace {

constexpr std::size_t kPilotRows = 65536;
constexpr std::size_t kStretch = 4096;

bool is_step(const series::Recording& block) {
  return block.meta("experiment") == "pcu-step";
}

std::vector<estimate::JointRun> first_rows(const std::vector<std::filesystem::path>& paths,
                                           const record::ReadOptions& reading, const JointSignals& signals) {
  const std::size_t rows = std::max(kStretch, kPilotRows / paths.size());
  std::vector<estimate::JointRun> out;
  for (const auto& path : paths) {
    record::BlockReader reader(path, reading, rows);
    series::Recording block;
    if (reader.next(block) && !is_step(block)) out.push_back(joint_run(block, signals));
  }
  return out;
}

/// Some sixteen stretches over all files: when there are more, every other one goes.
std::vector<estimate::JointRun> spread_rows(const std::vector<std::filesystem::path>& paths,
                                            const record::ReadOptions& reading, const JointSignals& signals) {
  std::vector<estimate::JointRun> out;
  std::size_t stride = 1, count = 0;
  for (const auto& path : paths) {
    record::BlockReader reader(path, reading, kStretch);
    series::Recording block;
    while (reader.next(block)) {
      if (is_step(block)) break;
      if (count++ % stride != 0) continue;
      out.push_back(joint_run(block, signals));
      out.back().name += ", stretch " + std::to_string(count);
      if (out.size() < 32) continue;
      for (std::size_t i = 0; 2 * i < out.size(); ++i) std::swap(out[i], out[2 * i]);
      out.resize(out.size() / 2);
      stride *= 2;
    }
  }
  return out;
}

}  // namespace

std::uintmax_t bytes_of(const std::vector<std::filesystem::path>& paths) {
  std::uintmax_t sum = 0;
  for (const auto& path : paths) {
    std::error_code failure;
    const auto size = std::filesystem::file_size(path, failure);
    if (!failure) sum += size;
  }
  return sum;
}

estimate::JointFit fit_stream(const std::vector<std::filesystem::path>& paths,
                              const record::ReadOptions& reading, const JointSignals& signals,
                              const estimate::JointFitOptions& options,
                              std::vector<series::Recording>& recordings) {
  record::ReadOptions unhashed = reading;
  unhashed.hash = false;
  estimate::StreamingJointFit fit(options, kPilotRows);
  fit.learn(first_rows(paths, unhashed, signals));
  if (!fit.knows_all_terms()) fit.learn(spread_rows(paths, unhashed, signals));
  Warnings left_out;
  for (std::size_t k = 0; k < paths.size(); ++k) {
    record::BlockReader reader(paths[k], reading, kPilotRows);
    series::Recording block;
    bool steps = false;
    while (reader.next(block)) {
      steps = is_step(block) && paths.size() > 1;
      if (steps) break;
      estimate::JointRun run = joint_run(block, signals);
      run.name = std::to_string(k) + " " + run.name;  // two folders may hold files of one name
      fit.add(run);
    }
    if (steps) {
      left_out.push_back(
          {"run_left_out", short_name(block.source) + " holds valve steps: use it with isac-identify pcu."});
      continue;
    }
    block.columns.clear();
    recordings.push_back(std::move(block));
  }
  estimate::JointFit out = fit.finish();
  out.warnings.insert(out.warnings.end(), left_out.begin(), left_out.end());
  return out;
}

}  // namespace isac::apps
