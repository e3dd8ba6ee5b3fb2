/// @file
/// The little of Arm semihosting that a firmware under a debugger or in QEMU needs: arguments, one file, the end.
///
/// Units: bytes. Real time: stops the core; never inside a tick. Errors: open_file gives −1. Threads: one.
/// Source: Arm, "Semihosting for AArch32 and AArch64". Example: apps/embedded/firmware.cpp.
#pragma once

#include <cstddef>
#include <cstdint>

namespace isac::embedded {

inline std::int32_t semihosting_call(std::uint32_t operation, const void* block) noexcept {
  register std::uint32_t r0 __asm("r0") = operation;
  register const void* r1 __asm("r1") = block;
  __asm volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
  return static_cast<std::int32_t>(r0);
}

/// The words of the call, one text; false when there are none or `size` is too small.
inline bool command_line(char* text, std::size_t size) noexcept {
  struct {
    char* text;
    std::uint32_t size;
  } block = {text, static_cast<std::uint32_t>(size)};
  return semihosting_call(0x15, &block) == 0;
}

inline std::int32_t open_for_writing(const char* name) noexcept {
  std::uint32_t length = 0;
  while (name[length] != '\0') ++length;
  const struct {
    const char* name;
    std::uint32_t mode, length;
  } block = {name, 5, length};  // 5: "wb"
  return semihosting_call(0x01, &block);
}

inline bool write_bytes(std::int32_t file, const void* data, std::size_t size) noexcept {
  const struct {
    std::int32_t file;
    const void* data;
    std::uint32_t size;
  } block = {file, data, static_cast<std::uint32_t>(size)};
  return semihosting_call(0x05, &block) == 0;
}

/// Ends the run; 0 is success for whoever started it.
[[noreturn]] inline void exit_with(std::uint32_t code) noexcept {
  const struct { std::uint32_t reason, code; } block = {0x20026, code};
  static_cast<void>(semihosting_call(0x20, &block));
  for (;;) {
  }
}

}  // namespace isac::embedded
