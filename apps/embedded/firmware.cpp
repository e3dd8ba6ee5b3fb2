// The six-joint controller on a Cortex-M, against the simulated arm: writes every tick, what it cost, and what was refused.
//
// The table is read where a loader has put it (isac_table_begin of the linker script), as a flash page would be. The one
// word of the call names the file for the answer: a RunRecord behind all TickRecords. Exit code 0: the story was told to its end,
// with a table or, valves closed, without one.
#include <span>

#include "arm_loop.hpp"
#include "instruction_counter.hpp"
#include "isac/models/parameter_table.hpp"
#include "semihosting.hpp"
#include "simulated_arm.hpp"

extern "C" {
extern const std::byte isac_table_begin[];
extern const std::byte isac_table_room[];  // an absolute symbol: its address is the number
}

namespace {

using namespace isac::embedded;

constexpr int kRefusedTicks = 1000;

/// The stack below the caller, painted before a call and looked through after it.
class Paint {
 public:
  [[gnu::always_inline]] explicit Paint(std::uint32_t bytes) noexcept
      : top_(stack_pointer()), low_(top_ - bytes) {
    for (std::uint32_t a = low_; a < top_; a += 4) *reinterpret_cast<volatile std::uint32_t*>(a) = kColour;
  }
  [[nodiscard, gnu::always_inline]] std::uint32_t used() const noexcept {
    std::uint32_t a = low_;
    while (a < top_ && *reinterpret_cast<volatile std::uint32_t*>(a) == kColour) a += 4;
    return top_ - a;
  }

 private:
  static constexpr std::uint32_t kColour = 0xA5C35A3C;
  [[gnu::always_inline]] static std::uint32_t stack_pointer() noexcept {
    std::uint32_t sp = 0;
    __asm volatile("mov %0, sp" : "=r"(sp));
    return sp;
  }
  std::uint32_t top_, low_;
};

ArmLoop loop;
SimulatedArm arm;
Story story;

[[gnu::noinline]] std::uint32_t known_loop() noexcept {
  const std::uint32_t before = Counter::now();
  std::uint32_t n = kKnownInstructions / 2;
  __asm volatile("1: subs %0, %0, #1\n bne 1b" : "+r"(n)::"cc");
  return Counter::instructions(before, Counter::now());
}
[[gnu::noinline]] std::uint32_t empty_block() noexcept {
  const std::uint32_t before = Counter::now();
  return Counter::instructions(before, Counter::now());
}

[[gnu::noinline]] std::uint32_t start(RunRecord& run) noexcept {
  // The table says itself how long it is; where that cannot be, the loader sees all there is and says why not.
  const std::uint32_t room = reinterpret_cast<std::uintptr_t>(isac_table_room);
  std::uint32_t length = 0;
  for (unsigned i = 0; i < 4; ++i)
    length |= std::to_integer<std::uint32_t>(isac_table_begin[12 + i]) << (8 * i);
  if (length < isac::models::parameter_table_bytes(1, 0) || length > room) length = room;
  const Paint paint(16 * 1024);
  const isac::Status status = loop.start(std::span(isac_table_begin, length));
  run.start_stack = paint.used();
  return static_cast<std::uint32_t>(status);
}

[[gnu::noinline]] Valves counted_tick(const Sample& sample, const Wanted& wanted, TickRecord& counts,
                                      std::uint32_t& deepest) noexcept {
  const Paint paint(4096);
  const std::uint32_t t0 = Counter::now();
  loop.sense(sample, wanted);
  const std::uint32_t t1 = Counter::now();
  loop.control();
  const std::uint32_t t2 = Counter::now();
  const Valves valves = loop.valves();
  const std::uint32_t t3 = Counter::now();
  if (const std::uint32_t used = paint.used(); used > deepest) deepest = used;
  counts.control_instructions = Counter::instructions(t1, t2);
  counts.tick_instructions = Counter::instructions(t0, t3);
  return valves;
}

}  // namespace

int main() {
  char name[256] = {};
  if (!command_line(name, sizeof name)) return 2;
  const std::int32_t file = open_for_writing(name);
  if (file < 0) return 3;
  Counter::begin();
  RunRecord run{.loop_bytes = sizeof(ArmLoop)};
  run.empty_instructions = empty_block();
  run.known_instructions = known_loop();
  run.status = start(run);
  const bool started = run.status == 0;
  if (started) arm.start(loop);
  for (int k = 0; k < (started ? kStoryTicks : kRefusedTicks); ++k) {
    Sample sample;
    Wanted wanted;
    story.at(k, arm, sample, wanted);
    TickRecord counts;
    const Valves valves = counted_tick(sample, wanted, counts, run.tick_stack);
    TickRecord record = record_of(arm, sample, valves);
    record.control_instructions = counts.control_instructions;
    record.tick_instructions = counts.tick_instructions;
    if (started) arm.step(valves.pressure, 1e-9f * static_cast<float>(kPeriodNs));
    if (!write_bytes(file, &record, sizeof record)) return 4;
    ++run.ticks;
  }
  return write_bytes(file, &run, sizeof run) ? 0 : 4;
}
