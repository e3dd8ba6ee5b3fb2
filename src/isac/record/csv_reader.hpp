/// @file
/// The one door for recordings: CSV as in docs/formats.md, whole or block by block.
///
/// Reads `# key: value` lines, a header of `name [unit]`, then numbers; comma, semicolon or tab, decimal comma where the
/// separator is not a comma; empty cell or `nan` is a missing sample; time must strictly increase (quoted header names are
/// understood). Every column with a unit is converted to SI; a known name with a wrong or missing unit is an error.
/// `ColumnMap` reads a foreign file without editing it (`--map angle="Joint Pos (deg)":deg`).
/// Cost: one pass; BlockReader's memory does not grow with the file (docs/performance.md has the figures).
/// Throws isac::Error (bad input) with file, line, column (characters, from 1), what was found and what would do; the codes
/// stand in docs/formats.md. Threads: readers of different files may run side by side.
/// Example: `auto run = isac::record::read_recording("slow.csv");`
#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "isac/series/recording.hpp"

namespace isac::record {

struct ColumnMap {
  std::string name;    ///< canonical name to give
  std::string header;  ///< header text in the file, without its [unit] part
  std::string unit;    ///< unit of the file's numbers
};

/// Parses `angle="Joint Pos (deg)":deg` or `angle=Pos:deg`; without `:unit` the header's own unit holds.
/// Throws isac::Error (usage).
[[nodiscard]] ColumnMap parse_column_map(std::string_view text);

struct ReadOptions {
  std::vector<ColumnMap> map;
  bool require_time = true;  ///< a recording without `time` is an error
  bool hash = true;          ///< compute the SHA-256 of the bytes
};

/// The whole file as one recording.
[[nodiscard]] series::Recording read_recording(const std::filesystem::path& path,
                                               const ReadOptions& options = {});

/// The same from bytes in memory; `file_name` is for messages.
[[nodiscard]] series::Recording parse_recording(std::string_view bytes, const std::string& file_name,
                                                const ReadOptions& options = {});

/// The same file in blocks of at most `block_rows` rows; memory is bounded by the block.
class BlockReader {
 public:
  explicit BlockReader(const std::filesystem::path& path, const ReadOptions& options = {},
                       std::size_t block_rows = 65536);
  ~BlockReader();
  BlockReader(BlockReader&&) noexcept;
  BlockReader& operator=(BlockReader&&) noexcept;

  /// Reads `bytes`, which must outlive the reader, in pieces of `piece` bytes.
  [[nodiscard]] static BlockReader of_bytes(std::string_view bytes, std::string name,
                                            const ReadOptions& options = {}, std::size_t block_rows = 65536,
                                            std::size_t piece = 262144);

  /// Fills `block` (columns keep their capacity) and returns true, or returns false at the end of the file: then `block`
  /// has no rows but the SHA-256 of the whole file, and the metadata with what stood behind the rows.
  bool next(series::Recording& block);

 private:
  struct State;
  explicit BlockReader(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace isac::record
