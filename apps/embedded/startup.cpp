// Start-up of a Cortex-M4F or M7: vectors, FPU on, .data and .bss, constructors, main. A fault of the core ends the run.
#include <cstdint>

#include "semihosting.hpp"

extern "C" {
extern std::uint32_t isac_data_load, isac_data_begin, isac_data_end, isac_bss_begin, isac_bss_end,
    isac_stack_top;
extern void (*const isac_constructors_begin[])();
extern void (*const isac_constructors_end[])();

int main();

[[noreturn, gnu::used]] void isac_reset() {
  *reinterpret_cast<volatile std::uint32_t*>(0xE000ED88) |= 0xFu << 20;  // CPACR: the FPU
  __asm volatile("dsb\n isb" ::: "memory");
  const std::uint32_t* from = &isac_data_load;
  for (std::uint32_t* to = &isac_data_begin; to < &isac_data_end;) *to++ = *from++;
  for (std::uint32_t* to = &isac_bss_begin; to < &isac_bss_end;) *to++ = 0;
  for (auto constructor = isac_constructors_begin; constructor != isac_constructors_end; ++constructor)
    (*constructor)();
  isac::embedded::exit_with(static_cast<std::uint32_t>(main()));
}

/// On a rig: the pin that holds the valves' supply goes off here. In QEMU there is none.
[[noreturn, gnu::used]] void isac_fault() {
  isac::embedded::exit_with(99);
}

using Vector = void (*)();
}

[[gnu::section(".vectors"), gnu::used]] const Vector isac_vectors[16] = {
    reinterpret_cast<Vector>(&isac_stack_top),
    isac_reset,
    isac_fault,
    isac_fault,
    isac_fault,
    isac_fault,
    isac_fault,
    nullptr,
    nullptr,
    nullptr,
    nullptr,
    isac_fault,
    isac_fault,
    nullptr,
    isac_fault,
    isac_fault};
