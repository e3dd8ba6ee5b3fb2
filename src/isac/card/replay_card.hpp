/// @file
/// A recording as a card: its rows come back as samples, and what is written is held against what was written then.
///
/// Columns: raw codes enc0…5, ai0…7, ao0…11 where the recording has them; else angle, F1, F2, p1, p2, p1_cmd, p2_cmd are
/// converted back by the nominal calibration (calibration.hpp). A missing sample repeats the one before.
/// Clock: that of the recording; it starts at the first row if that is before 0 or later than one second.
/// wait_until(t) skips the rows before t; a row up to a quarter of the median period early counts as reached, so that stamps
/// rounded in the file do not cost a row. After the last row read and wait_until return kEndOfData.
/// Writes: each code is compared with the one recorded in the row last read (ReplayReport).
/// Units: as card.hpp. Real time: as card.hpp. Threads: one drives; vent() may come from another.
/// Errors: construction throws isac::Error (bad input) with the file: what the reader finds, or no channel to replay.
/// Source: docs/formats.md, "Recording". Example: `auto rig = card::open("replay:run.csv");`
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <vector>

#include "isac/card/card.hpp"
#include "isac/series/recording.hpp"

namespace isac::card {

/// Counts that outlive the card.
struct ReplayReport {
  std::atomic<std::uint64_t> rows_given{0};
  std::atomic<std::uint64_t> codes_compared{0};
  std::atomic<std::uint64_t> codes_different{0};
  std::atomic<std::uint64_t> vents{0};
};

class ReplayCard final : public Card {
 public:
  explicit ReplayCard(const series::Recording& recording);
  ~ReplayCard() override;
  ReplayCard(const ReplayCard&) = delete;
  ReplayCard& operator=(const ReplayCard&) = delete;

  [[nodiscard]] Shape shape() const noexcept override { return shape_; }
  Status wait_until(std::int64_t time_ns) noexcept override;
  Status read(Sample& sample) noexcept override;
  Status write(const Command& command) noexcept override;
  Status vent() noexcept override;
  Status outputs(Command& command) const noexcept override;

  [[nodiscard]] std::shared_ptr<const ReplayReport> report() const noexcept { return report_; }

 private:
  static constexpr std::uint32_t kNotRecorded = ~0u;

  void apply_vent() noexcept;

  Shape shape_;
  std::vector<Sample> samples_;
  std::vector<Command> recorded_;  ///< kNotRecorded where the recording is silent
  std::int64_t tolerance_ns_ = 0;
  std::size_t next_ = 0;
  Command outputs_;
  std::atomic<bool> vent_asked_{false};
  std::shared_ptr<ReplayReport> report_;
};

/// Reads the file and makes the card; there is no person.
[[nodiscard]] Opened open_replay(const std::filesystem::path& path);

}  // namespace isac::card
