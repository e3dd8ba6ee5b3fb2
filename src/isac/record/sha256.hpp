/// @file
/// SHA-256 of bytes and files: the name under which an answer remembers the recording it came from.
///
/// Through OpenSSL's EVP interface, which uses the processor's own instructions where there are some.
/// Throws isac::Error (bad input) for a file that cannot be read; std::bad_alloc. Threads: one object per thread.
/// Example: `sha256_hex("abc")` begins with "ba7816bf".
#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

namespace isac::record {

class Sha256 {
 public:
  Sha256();
  ~Sha256();
  Sha256(Sha256&&) noexcept;
  Sha256& operator=(Sha256&&) noexcept;

  void update(std::string_view bytes);
  /// 64 lower-case hexadecimal digits of everything given so far; the object is then spent.
  [[nodiscard]] std::string finish();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

[[nodiscard]] std::string sha256_hex(std::string_view bytes);
[[nodiscard]] std::string sha256_of_file(const std::filesystem::path& path);

}  // namespace isac::record
