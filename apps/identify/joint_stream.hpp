/// @file
/// A joint fit of files larger than memory: block by block through record::BlockReader into estimate::StreamingJointFit.
///
/// The pilot comes from the first rows of every file; where these cannot tell all terms, from stretches spread over the files,
/// which reads them once more. Throws isac::Error as its parts do.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "identify/inputs.hpp"
#include "isac/estimate/joint_fit.hpp"
#include "isac/record/csv_reader.hpp"
#include "isac/series/recording.hpp"

namespace isac::apps {

/// From this many bytes on, runs are fitted in one pass without being asked to.
inline constexpr std::uintmax_t kStreamFrom = 400'000'000;

[[nodiscard]] std::uintmax_t bytes_of(const std::vector<std::filesystem::path>& paths);

/// `recordings` gets each file's name and digits, without columns.
[[nodiscard]] estimate::JointFit fit_stream(const std::vector<std::filesystem::path>& paths,
                                            const record::ReadOptions& reading, const JointSignals& signals,
                                            const estimate::JointFitOptions& options,
                                            std::vector<series::Recording>& recordings);

}  // namespace isac::apps
