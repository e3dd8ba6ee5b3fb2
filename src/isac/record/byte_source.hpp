/// @file
/// Bytes of a file (or of memory) in a sliding window, read in large pieces, hashed on the way.
///
/// The window [begin, end) holds what was read and not yet consumed; kPadding readable bytes stand behind `end`, so that a
/// parser may load eight bytes at once anywhere in the window. Memory is bounded by the longest unconsumed stretch plus one
/// piece. A file is read as far as it reached when it was opened, so that a log may go on growing; files from 4 MB on are hashed
/// on a second thread. Throws isac::Error (bad input) with codes file_missing, file_is_directory, file_unreadable,
/// file_changed. Threads: one per object.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "isac/record/file_hasher.hpp"
#include "isac/record/sha256.hpp"

namespace isac::record {

class ByteSource {
 public:
  static constexpr std::size_t kPadding = 64;
  static constexpr std::size_t kPiece = std::size_t{256}
                                        << 10U;  ///< stays in the second-level cache while it is parsed

  [[nodiscard]] static ByteSource open(const std::filesystem::path& path, bool hash,
                                       std::size_t piece = kPiece);
  /// `bytes` must outlive the source.
  [[nodiscard]] static ByteSource of_memory(std::string_view bytes, std::string name, bool hash,
                                            std::size_t piece = kPiece);
  ~ByteSource();
  ByteSource(ByteSource&& other) noexcept;
  ByteSource& operator=(ByteSource&&) = delete;

  [[nodiscard]] const char* begin() const noexcept { return buffer_.data() + begin_; }
  [[nodiscard]] const char* end() const noexcept { return buffer_.data() + end_; }
  [[nodiscard]] std::string_view window() const noexcept { return {begin(), end_ - begin_}; }
  void consume_to(const char* position) noexcept {
    begin_ = static_cast<std::size_t>(position - buffer_.data());
  }

  /// Forgets the bytes of the window behind its beginning `kept`.
  void drop_behind(std::string_view kept) noexcept { end_ = begin_ + kept.size(); }

  /// Reads one more piece behind `end` (pointers into the window become invalid); false at the end of the bytes.
  bool fill();
  /// Puts a line feed behind the last byte; only after fill() said false.
  void terminate() noexcept;

  [[nodiscard]] const std::string& name() const noexcept { return name_; }
  [[nodiscard]] std::uint64_t bytes_read() const noexcept { return bytes_read_; }
  [[nodiscard]] std::uint64_t size() const noexcept { return size_; }  ///< 0 where not known beforehand
  [[nodiscard]] std::string sha256();  ///< of all bytes read; empty if not asked for; once

 private:
  ByteSource(std::string name, bool hash, std::size_t piece);
  std::size_t read_piece(char* to);

  std::string name_;
  int descriptor_ = -1;
  std::string_view memory_;
  std::size_t piece_;
  std::vector<char> buffer_;
  std::size_t begin_ = 0;
  std::size_t end_ = 0;
  std::uint64_t bytes_read_ = 0;
  std::uint64_t size_ = 0;
  std::optional<Sha256> hash_;               ///< of small files and of memory
  std::unique_ptr<FileHasher> file_hasher_;  ///< of large files
};

}  // namespace isac::record
