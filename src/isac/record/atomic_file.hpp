/// @file
/// A file that appears whole or not at all, and the one sentence for a file that cannot be written.
///
/// The bytes go into an unnamed file of the same folder (or, where the file system has none, into a hidden one that is
/// removed on failure), are stored, and take the name in one rename. What is no regular file (a pipe, /dev/stdout) is
/// written in place. A symbolic link stays a link: the file behind it is replaced.
/// Throws isac::Error (bad input): disk_full, folder_missing, file_is_directory, file_unwritable. Threads: one per object.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace isac::record {

/// Throws the isac::Error that tells `error` (an errno value) of writing `file`.
[[noreturn]] void refuse_write(const std::string& file, int error);

/// Writes all of `bytes` or returns the errno value; `written` says how many bytes went out.
[[nodiscard]] int write_all(int descriptor, std::string_view bytes, std::size_t& written) noexcept;

class AtomicFile {
 public:
  explicit AtomicFile(const std::filesystem::path& path);
  ~AtomicFile();  ///< without commit() nothing remains
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  void append(std::string_view bytes);
  /// Stores the bytes and gives them the name; the old file becomes `<name>.bak` if `keep_backup`.
  void commit(bool keep_backup = false);

 private:
  void open_in_place();
  void open_temporary();
  void name_temporary();
  void keep_old_file() const;

  std::string shown_path_;           ///< as the caller wrote it
  std::filesystem::path target_;     ///< behind symbolic links
  std::filesystem::path temporary_;  ///< empty while the file has no name
  int descriptor_ = -1;
  bool in_place_ = false;
};

}  // namespace isac::record
