#include "isac/record/byte_source.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <system_error>
#include <utility>

#include "isac/core/error.hpp"

namespace isac::record {
namespace {

constexpr std::uint64_t kHashAsideFrom = std::uint64_t{4} << 20U;

[[noreturn]] void refuse(const std::string& file, int error) {
  const Place place{file, 0, 0};
  if (error == ENOENT || error == ENOTDIR) {
    throw Error(ErrorKind::kBadInput, "file_missing", "there is no such file; check the name and the folder",
                place);
  }
  if (error == EISDIR) {
    throw Error(ErrorKind::kBadInput, "file_is_directory",
                "this is a folder, not a file; name a file inside it", place);
  }
  throw Error(
      ErrorKind::kBadInput, "file_unreadable",
      "cannot be read (" + std::generic_category().message(error) + "); check its permissions and the disk",
      place);
}

}  // namespace

ByteSource::ByteSource(std::string name, bool hash, std::size_t piece)
    : name_(std::move(name)), piece_(std::max<std::size_t>(piece, 1)), buffer_(2 * piece_ + kPadding) {
  if (hash) hash_.emplace();
}

ByteSource ByteSource::open(const std::filesystem::path& path, bool hash, std::size_t piece) {
  ByteSource source(path.string(), hash, piece);
  do {
    source.descriptor_ = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  } while (source.descriptor_ < 0 && errno == EINTR);
  if (source.descriptor_ < 0) refuse(source.name_, errno);
  struct stat status {};
  if (::fstat(source.descriptor_, &status) != 0) refuse(source.name_, errno);
  if (S_ISDIR(status.st_mode)) refuse(source.name_, EISDIR);
  if (S_ISREG(status.st_mode)) {
    source.size_ = static_cast<std::uint64_t>(status.st_size);
    ::posix_fadvise(source.descriptor_, 0, 0, POSIX_FADV_SEQUENTIAL);  // advice: failing costs nothing
    if (hash && source.size_ >= kHashAsideFrom) {
      source.hash_.reset();
      source.file_hasher_ = std::make_unique<FileHasher>(source.descriptor_, source.size_);
    }
  }
  return source;
}

ByteSource ByteSource::of_memory(std::string_view bytes, std::string name, bool hash, std::size_t piece) {
  ByteSource source(std::move(name), hash, piece);
  source.memory_ = bytes;
  source.size_ = bytes.size();
  return source;
}

ByteSource::~ByteSource() {
  file_hasher_.reset();  // before the descriptor that it reads from
  if (descriptor_ >= 0) ::close(descriptor_);
}

ByteSource::ByteSource(ByteSource&& other) noexcept
    : name_(std::move(other.name_)),
      descriptor_(std::exchange(other.descriptor_, -1)),
      memory_(other.memory_),
      piece_(other.piece_),
      buffer_(std::move(other.buffer_)),
      begin_(other.begin_),
      end_(other.end_),
      bytes_read_(other.bytes_read_),
      size_(other.size_),
      hash_(std::move(other.hash_)),
      file_hasher_(std::move(other.file_hasher_)) {}

std::size_t ByteSource::read_piece(char* to) {
  if (descriptor_ < 0) {
    const std::size_t count = std::min(piece_, memory_.size());
    std::memcpy(to, memory_.data(), count);
    memory_.remove_prefix(count);
    return count;
  }
  // Pipes and files that do not know their size (/proc) are read to their end.
  const std::uint64_t left = size_ > 0 ? size_ - bytes_read_ : piece_;
  const std::size_t wanted = static_cast<std::size_t>(std::min<std::uint64_t>(piece_, left));
  for (;;) {
    const ssize_t count = ::read(descriptor_, to, wanted);
    if (count >= 0) return static_cast<std::size_t>(count);
    if (errno != EINTR) refuse(name_, errno);
  }
}

bool ByteSource::fill() {
  if (begin_ > 0) {
    std::memmove(buffer_.data(), begin(), end_ - begin_);
    end_ -= begin_;
    begin_ = 0;
  }
  if (buffer_.size() < end_ + piece_ + kPadding)
    buffer_.resize(std::max(2 * buffer_.size(), end_ + piece_ + kPadding));
  const std::size_t count = read_piece(buffer_.data() + end_);
  if (hash_ && count > 0) hash_->update({buffer_.data() + end_, count});
  end_ += count;
  bytes_read_ += count;
  return count > 0;
}

void ByteSource::terminate() noexcept {
  buffer_[end_] = '\n';  // fill() left room: at least kPadding bytes stand behind the end
  ++end_;
}

std::string ByteSource::sha256() {
  if (file_hasher_) return std::exchange(file_hasher_, nullptr)->finish(name_);
  return hash_ ? std::exchange(hash_, std::nullopt)->finish() : std::string();
}

}  // namespace isac::record
