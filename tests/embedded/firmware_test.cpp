// The firmware in qemu-system-arm against its twin on the host: equal to the last bit, what a tick costs, what it refuses.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <fstream>

#include "../system/run_program.hpp"
#include "call_graph.hpp"
#include "twin.hpp"

namespace {

using namespace isac::embedded;
using isac::Status;

struct Core {
  const char* name;   ///< of the firmware
  const char* board;  ///< of QEMU
};

std::filesystem::path built(const std::string& name) {
  return std::filesystem::path(ISAC_MCU_DIR) / "apps/embedded" / name;
}

struct FirmwareRun {
  int exit_code = -1;
  RunRecord run{};
  std::vector<TickRecord> ticks;
};

int shell(const std::string& command) {
  const int status = std::system(command.c_str());
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

class Firmware : public testing::TestWithParam<Core> {
 protected:
  void SetUp() override {
    if (!std::filesystem::exists(elf()))
      GTEST_SKIP() << "the firmware was not cross-built: no arm-none-eabi-g++ (Debian: gcc-arm-none-eabi)";
  }
  [[nodiscard]] static std::filesystem::path elf() {
    return built("isac_firmware_" + std::string(GetParam().name) + ".elf");
  }
  [[nodiscard]] static isac::test::CallGraph calls() {
    return {built("CMakeFiles/isac_firmware_" + std::string(GetParam().name) + ".dir"), "TorqueCall",
            kLibraryStack};
  }
  /// Bytes of stack granted to a function of libc, libm or libgcc; none that is called here recurses or takes an array.
  static constexpr int kLibraryStack = 256;

  /// 256 ns an instruction: 6.4 ticks of the boards' SysTick, so that single instructions are counted.
  [[nodiscard]] static FirmwareRun run(const std::vector<std::byte>& table) {
    const isac::test::ScratchFolder folder;
    std::ofstream(folder / "table.bin", std::ios::binary)
        .write(reinterpret_cast<const char*>(table.data()), static_cast<std::streamsize>(table.size()));
    FirmwareRun out;
    out.exit_code =
        shell("cd '" + folder.path().string() + "' && timeout 120 qemu-system-arm -M " + GetParam().board +
              " -nographic -monitor none -serial none -icount shift=8" +
              " -semihosting-config enable=on,target=native,arg=answer -kernel '" + elf().string() +
              "' -device loader,file=table.bin,addr=0x1F0000,force-raw=on >/dev/null 2>&1");
    const std::string answer = isac::test::read_text(folder / "answer");
    if (answer.size() < sizeof(RunRecord)) return out;
    const std::size_t count = (answer.size() - sizeof(RunRecord)) / sizeof(TickRecord);
    out.ticks.resize(count);
    std::memcpy(static_cast<void*>(out.ticks.data()), answer.data(), count * sizeof(TickRecord));
    std::memcpy(&out.run, answer.data() + count * sizeof(TickRecord), sizeof(RunRecord));
    return out;
  }
};

/// The firmware where there is a machine to run it.
class FirmwareInQemu : public Firmware {
 protected:
  void SetUp() override {
    Firmware::SetUp();
    if (IsSkipped()) return;
    if (shell("command -v qemu-system-arm >/dev/null") != 0)
      GTEST_SKIP() << "qemu-system-arm is not installed (Debian: qemu-system-arm)";
  }
};

TEST_P(FirmwareInQemu, commands_equal_the_hosts_float_run_to_the_last_bit) {
  const auto table = isac::test::exported_table();
  const FirmwareRun firmware = run(table);
  const isac::test::Twin twin = isac::test::run_twin(table);
  ASSERT_EQ(firmware.exit_code, 0);
  ASSERT_EQ(static_cast<Status>(firmware.run.status), Status::kOk);
  ASSERT_EQ(twin.status, Status::kOk);
  ASSERT_EQ(firmware.run.ticks, static_cast<std::uint32_t>(kStoryTicks));
  ASSERT_EQ(firmware.ticks.size(), twin.ticks.size());
  for (std::size_t k = 0; k < twin.ticks.size(); ++k) {
    for (std::size_t i = 0; i < twin.ticks[k].pressure.size(); ++i)
      ASSERT_EQ(std::bit_cast<std::uint32_t>(firmware.ticks[k].pressure[i]),
                std::bit_cast<std::uint32_t>(twin.ticks[k].pressure[i]))
          << "tick " << k << ", valve " << i;
    ASSERT_EQ(std::memcmp(&firmware.ticks[k], &twin.ticks[k], kComparedBytes), 0) << "tick " << k;
  }
}

TEST_P(FirmwareInQemu, the_counter_counts_single_instructions) {
  const FirmwareRun firmware = run(isac::test::exported_table());
  // Two more than the loop's own: its counter is loaded, and compilers may place one instruction around it.
  const std::uint32_t known = firmware.run.known_instructions - firmware.run.empty_instructions;
  EXPECT_GE(known, kKnownInstructions);
  EXPECT_LE(known, kKnownInstructions + 2);
}

TEST_P(FirmwareInQemu, a_tick_of_six_joints_takes_less_than_a_quarter_of_its_period) {
  const FirmwareRun firmware = run(isac::test::exported_table());
  std::vector<std::uint32_t> control, tick, running_control, running_tick;
  bool before = false;  // the tick that arms fills the dead-time buffers
  for (const TickRecord& record : firmware.ticks) {
    const bool armed = record.state == static_cast<int>(isac::control::RunState::kArmed);
    if (armed) {
      control.push_back(record.control_instructions);
      tick.push_back(record.tick_instructions);
    }
    if (armed && before) {
      running_control.push_back(record.control_instructions);
      running_tick.push_back(record.tick_instructions);
    }
    before = armed;
  }
  ASSERT_GT(control.size(), 3000u);
  std::ranges::sort(control);
  std::ranges::sort(tick);
  std::ranges::sort(running_control);
  std::ranges::sort(running_tick);
  const auto say = [](const char* what, const std::vector<std::uint32_t>& v) {
    RecordProperty(what + std::string("_p50"), static_cast<int>(v[v.size() / 2]));
    RecordProperty(what + std::string("_worst"), static_cast<int>(v.back()));
    std::printf("%s: p50 %u, worst %u instructions\n", what, v[v.size() / 2], v.back());
  };
  say("six-joint step", control);
  say("whole tick", tick);
  say("six-joint step, already armed", running_control);
  say("whole tick, already armed", running_tick);
  std::printf("ArmLoop: %u bytes\n", firmware.run.loop_bytes);
  // 2 kHz at 168 MHz leave 84000 cycles. Instructions are not cycles: a Cortex-M4F behind flash wait states may need twice
  // as many. A quarter keeps room for that, the card and the log.
  EXPECT_LT(tick.back(), 84000u / 4);
  EXPECT_GT(control[control.size() / 2], 1000u);  // something was counted
}

TEST_P(FirmwareInQemu, the_stack_stays_within_its_bound) {
  const FirmwareRun firmware = run(isac::test::exported_table());
  isac::test::CallGraph graph = calls();
  // GCC's own figures, along the heaviest path; plus what calling costs the caller: nothing is passed on the stack.
  const int step = std::max({graph.bytes_below("ArmLoop5senseERKNS0_6SampleERKNS0_6WantedE"),
                             graph.bytes_below("ArmLoop7controlEv"), graph.bytes_below("ArmLoop6valvesEv")});
  const int start = graph.bytes_below("ArmLoop5startESt4spanIKSt4byteLj4294967295EE");
  std::printf("tick: painted %u, bound %d; start: painted %u, bound %d bytes; %zu functions; libraries:",
              firmware.run.tick_stack, step, firmware.run.start_stack, start, graph.functions());
  for (const std::string& name : graph.libraries()) std::printf(" %s", name.c_str());
  std::printf("\n");
  EXPECT_GT(firmware.run.tick_stack, 500u);  // the paint was touched
  EXPECT_LE(firmware.run.tick_stack, static_cast<std::uint32_t>(step));
  EXPECT_LE(firmware.run.start_stack, static_cast<std::uint32_t>(start));
  // What docs/how-to/deploy.md states.
  EXPECT_LE(step, 2048);
  EXPECT_LE(start, 6144);
  EXPECT_LE(firmware.run.loop_bytes, 16u * 1024u);
}

TEST_P(FirmwareInQemu, damaged_tables_are_refused_each_for_its_reason_and_the_valves_stay_without_pressure) {
  for (const isac::test::DamagedTable& table : isac::test::damaged_tables()) {
    const FirmwareRun firmware = run(table.bytes);
    EXPECT_EQ(firmware.exit_code, 0) << table.what;
    EXPECT_EQ(static_cast<Status>(firmware.run.status), table.expected) << table.what;
    EXPECT_EQ(firmware.ticks.size(), 1000u) << table.what;
    isac::test::expect_vented(firmware.ticks, table.what);
  }
}

TEST_P(Firmware, holds_no_allocator) {
  const isac::test::ScratchFolder folder;
  ASSERT_EQ(shell("arm-none-eabi-nm '" + elf().string() + "' > '" + folder / "symbols" + "'"), 0);
  const std::string symbols = isac::test::read_text(folder / "symbols");
  EXPECT_NE(symbols.find("ArmLoop"), std::string::npos);
  for (const char* name : {"malloc", "calloc", "realloc", "_sbrk", "_Znwj", "_Znaj", "_ZdlPv", "__cxa_throw"})
    EXPECT_EQ(symbols.find(name), std::string::npos) << name;
}

constexpr Core kCores[] = {{"m4f", "mps2-an386"}, {"m7", "mps2-an500"}};
std::string name_of(const testing::TestParamInfo<Core>& info) {
  return info.param.name;
}
INSTANTIATE_TEST_SUITE_P(Cortex, Firmware, testing::ValuesIn(kCores), name_of);
INSTANTIATE_TEST_SUITE_P(Cortex, FirmwareInQemu, testing::ValuesIn(kCores), name_of);

}  // namespace
