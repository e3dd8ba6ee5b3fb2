/// @file
/// Counts instructions on a Cortex-M in QEMU, one by one (decision 0131).
///
/// Units: instructions; up to 2.6 million between two readings. Real time: two words of a register. Threads: one.
/// Errors: none. Example: apps/embedded/firmware.cpp.
#pragma once

#include <cstdint>

namespace isac::embedded {

/// Instructions by SysTick: with `-icount shift=8` an instruction is 256 ns, which are 6.4 ticks of 25 MHz.
class Counter {
 public:
  static void begin() noexcept {
    at(0xE000E014) = 0xFFFFFF;
    at(0xE000E018) = 0;
    at(0xE000E010) = 5;
  }
  static std::uint32_t now() noexcept { return at(0xE000E018); }
  static std::uint32_t instructions(std::uint32_t before, std::uint32_t after) noexcept {
    return (((before - after) & 0xFFFFFF) * 10 + 32) / 64;
  }

 private:
  static volatile std::uint32_t& at(std::uint32_t address) noexcept {
    return *reinterpret_cast<volatile std::uint32_t*>(address);
  }
};

}  // namespace isac::embedded
