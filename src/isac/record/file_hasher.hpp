/// @file
/// SHA-256 of an open file on a thread of its own, while another thread parses the same bytes.
///
/// Reads with its own offset (pread), so that the two do not disturb each other; worth it for files of some megabytes, since
/// hashing takes about as long as parsing. Threads: constructor, finish and destructor belong to one thread.
/// Throws std::system_error if no thread can be started; finish() throws isac::Error (bad input): file_changed.
#pragma once

#include <atomic>
#include <cstdint>
#include <string>
#include <thread>

namespace isac::record {

class FileHasher {
 public:
  /// Hashes the first `size` bytes of `descriptor`, which must stay open until finish() or the destructor returns.
  FileHasher(int descriptor, std::uint64_t size);
  ~FileHasher();
  FileHasher(const FileHasher&) = delete;
  FileHasher& operator=(const FileHasher&) = delete;

  /// The hash, once; `file` is for the message if the file shrank meanwhile.
  [[nodiscard]] std::string finish(const std::string& file);

 private:
  void run(int descriptor, std::uint64_t size);

  std::atomic<bool> stop_{false};
  std::string result_;  ///< written by the thread, read after join
  std::thread thread_;  ///< last: starts when everything else stands
};

}  // namespace isac::record
