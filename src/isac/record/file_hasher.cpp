#include "isac/record/file_hasher.hpp"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <exception>
#include <vector>

#include "isac/core/error.hpp"
#include "isac/record/sha256.hpp"

namespace isac::record {

FileHasher::FileHasher(int descriptor, std::uint64_t size)
    : thread_([this, descriptor, size] {
        try {
          run(descriptor, size);
        } catch (const std::exception&) {
          result_.clear();  // finish() reports it
        }
      }) {}

FileHasher::~FileHasher() {
  stop_.store(true, std::memory_order_relaxed);
  if (thread_.joinable()) thread_.join();
}

void FileHasher::run(int descriptor, std::uint64_t size) {
  Sha256 hash;
  std::vector<char> piece(std::size_t{256} << 10U);
  std::uint64_t done = 0;
  while (done < size && !stop_.load(std::memory_order_relaxed)) {
    const std::size_t wanted = static_cast<std::size_t>(std::min<std::uint64_t>(piece.size(), size - done));
    const ssize_t count = ::pread(descriptor, piece.data(), wanted, static_cast<off_t>(done));
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return;
    hash.update({piece.data(), static_cast<std::size_t>(count)});
    done += static_cast<std::uint64_t>(count);
  }
  if (done == size) result_ = hash.finish();
}

std::string FileHasher::finish(const std::string& file) {
  thread_.join();
  if (result_.empty()) {
    throw Error(ErrorKind::kBadInput, "file_changed",
                "the file became shorter while it was read; wait until its writer is done", {file, 0, 0});
  }
  return result_;
}

}  // namespace isac::record
