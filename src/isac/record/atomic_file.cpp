#include "isac/record/atomic_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <system_error>
#include <utility>

#include "isac/core/error.hpp"
#include "isac/record/csv_writer.hpp"

namespace isac::record {
namespace {

constexpr mode_t kNewFileMode = 0666;  // the umask takes away what the user does not want

std::filesystem::path folder_of(const std::filesystem::path& path) {
  const std::filesystem::path folder = path.parent_path();
  return folder.empty() ? std::filesystem::path(".") : folder;
}

// A hidden name beside `path` that no other writer uses.
std::filesystem::path temporary_name(const std::filesystem::path& path) {
  static std::atomic<unsigned> counter{0};
  const std::string tail =
      "." + std::to_string(::getpid()) + "-" + std::to_string(counter.fetch_add(1)) + ".tmp";
  return folder_of(path) / ("." + path.filename().string() + tail);
}

void store_folder(const std::filesystem::path& folder) noexcept {
  const int descriptor = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0)
    return;  // the file itself is stored; only the moment at which its name is on the disk is left open
  ::fsync(descriptor);
  ::close(descriptor);
}

}  // namespace

void refuse_write(const std::string& file, int error) {
  const Place place{file, 0, 0};
  if (error == ENOSPC || error == EDQUOT || error == EFBIG) {
    throw Error(ErrorKind::kBadInput, "disk_full",
                "cannot be written, there is no room left (" + std::generic_category().message(error) +
                    "); free some, or write to another disk",
                place);
  }
  if (error == ENOENT || error == ENOTDIR) {
    throw Error(ErrorKind::kBadInput, "folder_missing",
                "cannot be written, its folder does not exist; make the folder first", place);
  }
  if (error == EISDIR) {
    throw Error(ErrorKind::kBadInput, "file_is_directory",
                "cannot be written, this is a folder; name a file inside it", place);
  }
  throw Error(ErrorKind::kBadInput, "file_unwritable",
              "cannot be written (" + std::generic_category().message(error) +
                  "); check the permissions of the file and its folder",
              place);
}

int write_all(int descriptor, std::string_view bytes, std::size_t& written) noexcept {
  written = 0;
  while (written < bytes.size()) {
    const ssize_t count = ::write(descriptor, bytes.data() + written, bytes.size() - written);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return errno;
    written += static_cast<std::size_t>(count);
  }
  return 0;
}

AtomicFile::AtomicFile(const std::filesystem::path& path) : shown_path_(path.string()), target_(path) {
  std::error_code ignored;
  if (std::filesystem::is_symlink(path, ignored)) target_ = std::filesystem::weakly_canonical(path, ignored);
  struct stat status {};
  const bool exists = ::stat(target_.c_str(), &status) == 0;
  if (exists && S_ISDIR(status.st_mode)) refuse_write(shown_path_, EISDIR);
  in_place_ = exists && !S_ISREG(status.st_mode);
  if (in_place_) {
    open_in_place();
    return;
  }
  if (exists && ::access(target_.c_str(), W_OK) != 0) refuse_write(shown_path_, errno);
  open_temporary();
  if (exists && ::fchmod(descriptor_, status.st_mode & 07777U) != 0) {
    const int error = errno;
    ::close(std::exchange(descriptor_, -1));
    refuse_write(shown_path_, error);
  }
}

void AtomicFile::open_in_place() {
  descriptor_ = ::open(target_.c_str(), O_WRONLY | O_CLOEXEC);
  if (descriptor_ < 0) refuse_write(shown_path_, errno);
}

void AtomicFile::open_temporary() {
  descriptor_ = ::open(folder_of(target_).c_str(), O_TMPFILE | O_WRONLY | O_CLOEXEC, kNewFileMode);
  if (descriptor_ >= 0) return;
  if (errno != EOPNOTSUPP && errno != EISDIR && errno != ENOENT && errno != EINVAL)
    refuse_write(shown_path_, errno);
  std::filesystem::path name = temporary_name(target_);  // this file system has no unnamed files
  descriptor_ = ::open(name.c_str(), O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC, kNewFileMode);
  if (descriptor_ < 0) refuse_write(shown_path_, errno);
  temporary_ = std::move(name);
}

AtomicFile::~AtomicFile() {
  if (descriptor_ >= 0) ::close(descriptor_);
  if (!temporary_.empty()) ::unlink(temporary_.c_str());
}

void AtomicFile::append(std::string_view bytes) {
  std::size_t written = 0;
  if (const int error = write_all(descriptor_, bytes, written)) refuse_write(shown_path_, error);
}

// Gives the unnamed file a hidden name, from which rename() takes it: a link cannot replace a file, a rename can.
void AtomicFile::name_temporary() {
  if (!temporary_.empty()) return;
  std::filesystem::path name = temporary_name(target_);
  const std::string from = "/proc/self/fd/" + std::to_string(descriptor_);
  if (::linkat(AT_FDCWD, from.c_str(), AT_FDCWD, name.c_str(), AT_SYMLINK_FOLLOW) != 0)
    refuse_write(shown_path_, errno);
  temporary_ = std::move(name);
}

void AtomicFile::keep_old_file() const {
  std::error_code error;
  if (!std::filesystem::exists(target_, error)) return;
  const std::filesystem::path backup = target_.string() + ".bak";
  const std::filesystem::path hidden = temporary_name(backup);
  std::filesystem::create_hard_link(target_, hidden, error);
  if (error) std::filesystem::copy_file(target_, hidden, error);  // a file system without hard links
  if (!error) std::filesystem::rename(hidden, backup, error);
  if (error) {
    ::unlink(hidden.c_str());
    refuse_write(backup.string(), error.value());
  }
}

void AtomicFile::commit(bool keep_backup) {
  if (!in_place_) {
    if (::fsync(descriptor_) != 0) refuse_write(shown_path_, errno);
    name_temporary();
  }
  if (::close(std::exchange(descriptor_, -1)) != 0) refuse_write(shown_path_, errno);
  if (in_place_) return;
  if (keep_backup) keep_old_file();
  if (::rename(temporary_.c_str(), target_.c_str()) != 0) refuse_write(shown_path_, errno);
  temporary_.clear();
  store_folder(folder_of(target_));
}

void write_atomically(const std::filesystem::path& path, std::string_view bytes, bool keep_backup) {
  AtomicFile file(path);
  file.append(bytes);
  file.commit(keep_backup);
}

}  // namespace isac::record
