// From tables and rig to the loop's settings: what is taken, what is narrowed, what is refused; and six joints at once.
#include "isac/runtime/control_setup.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "control_bench.hpp"
#include "isac/core/error.hpp"
#include "isac/core/units.hpp"
#include "isac/record/tables.hpp"

namespace isac::test {
namespace {

namespace fs = std::filesystem;
using models::JointField;

/// The testbed's joint `count` times, with the gains of the seed's 5.3.
models::ParameterTable table_of(int count) {
  models::ParameterTable table;
  table.joint_count = count;
  for (int k = 0; k < count; ++k) {
    auto& joint = table.joints[static_cast<std::size_t>(k)];
    using enum JointField;
    const std::pair<JointField, double> values[] = {{kA, -23450},
                                                    {kB, 174.2 / kPascalPerKgfCm2},
                                                    {kC, 0.0026},
                                                    {kD, 0.14},
                                                    {kWheelRadius, 0.019},
                                                    {kInitialPressure, 3 * kPascalPerKgfCm2},
                                                    {kInertia, 0.0085},
                                                    {kPositionP, 4},
                                                    {kPositionI, 8},
                                                    {kTorqueP, 0.1 * kPascalPerKgfCm2},
                                                    {kTorqueI, 10 * kPascalPerKgfCm2}};
    for (const auto& [field, value] : values) joint.set(field, value);
  }
  return table;
}

TEST(ControlSetup, limits_are_the_tighter_of_table_and_rig) {
  models::ParameterTable table = table_of(1);
  table.joints[0].set(JointField::kAngleLow, -0.5);
  table.joints[0].set(JointField::kAngleHigh, 2.0);
  table.joints[0].set(JointField::kSpeedHigh, 3.0);
  record::Rig rig;
  rig.limits.angle = 0.9;
  rig.limits.delta_pressure = 1.5 * kPascalPerKgfCm2;
  Warnings warnings;
  const auto settings = runtime::control_settings(table, rig, {}, warnings);
  const auto& limits = settings.joint[0].limits;
  EXPECT_EQ(limits.angle_low, -0.5);
  EXPECT_EQ(limits.angle_high, 0.9);
  EXPECT_EQ(limits.speed, 3.0);
  EXPECT_EQ(limits.delta_pressure, 1.5 * kPascalPerKgfCm2);
  EXPECT_EQ(settings.watch[0].angle.soft, 0.9);
  EXPECT_DOUBLE_EQ(settings.watch[0].angle.hard, 0.99);
  EXPECT_EQ(settings.watch[0].force.hard, rig.limits.force);  // a sensor's capacity has no margin
  EXPECT_EQ(settings.fault.period, 500'000);
  EXPECT_TRUE(warnings.empty());
}

TEST(ControlSetup, effects_go_to_the_feed_forward_and_the_others_are_told) {
  models::ParameterTable table = table_of(1);
  table.effect_count = 2;
  table.effects[0] = {models::effect_id_hash("coulomb_friction"), models::kAllJoints, 1, {0.2}};
  table.effects[1] = {models::effect_id_hash("end_stop"), models::kAllJoints, 2, {1.0, 100.0}};
  Warnings warnings;
  const auto settings = runtime::control_settings(table, {}, {}, warnings);
  EXPECT_EQ(settings.feed_forward[0].size(), 1);
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_EQ(warnings[0].code, "effects_not_fed_forward");
}

TEST(ControlSetup, table_without_gains_is_refused_with_what_it_lacks) {
  models::ParameterTable table = table_of(2);
  table.joints[1] = {};
  Warnings warnings;
  try {
    static_cast<void>(runtime::control_settings(table, {}, {}, warnings));
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), "parameters_incomplete");
    EXPECT_NE(error.text().find("joint 2 "), std::string::npos);
    EXPECT_NE(error.text().find("gains"), std::string::npos);
  }
}

TEST(ControlSetup, packed_table_gives_the_same_table_and_a_changed_byte_is_refused) {
  std::string pattern = (fs::temp_directory_path() / "isac-setup-XXXXXX").string();
  const fs::path folder = mkdtemp(pattern.data());
  const auto bytes = record::pack_parameter_table(table_of(6));
  const auto write = [&](const char* name, const std::vector<std::byte>& content) {
    std::ofstream(folder / name, std::ios::binary)
        .write(reinterpret_cast<const char*>(content.data()), static_cast<std::streamsize>(content.size()));
    return folder / name;
  };
  const auto loaded = runtime::load_table(write("good.bin", bytes));
  EXPECT_TRUE(loaded.table == table_of(6));
  EXPECT_EQ(loaded.source.rfind("good.bin sha256:", 0), 0u);
  for (std::size_t at = 8; at < bytes.size(); at += 101) {
    auto changed = bytes;
    changed[at] ^= std::byte{0x40};
    EXPECT_THROW(static_cast<void>(runtime::load_table(write("bad.bin", changed))), Error) << at;
  }
  fs::remove_all(folder);
}

TEST(ControlSetup, every_fault_has_its_words) {
  for (int code = 1; code <= static_cast<int>(control::FaultCode::kOperator); ++code) {
    const control::Finding finding{
        .code = static_cast<control::FaultCode>(code), .joint = 1, .value = 2, .limit = 1};
    const std::string words = runtime::finding_words(finding);
    EXPECT_NE(words.find(describe(finding.code)), std::string::npos);
    EXPECT_TRUE(words.starts_with("joint 2: ") || words.starts_with("channel 1: ")) << words;
  }
}

/// Six joints that follow the difference of their valves, as tests/comedi/isac_rig.c has it.
class ArmCard final : public card::Card {
 public:
  [[nodiscard]] card::Shape shape() const noexcept override {
    return {.encoders = 6, .inputs = 0, .outputs = 12};
  }
  Status wait_until(std::int64_t time_ns) noexcept override {
    now = std::max(now, time_ns);
    return Status::kOk;
  }
  Status read(card::Sample& sample) noexcept override {
    sample = {};
    sample.time_ns = now++;
    for (std::size_t k = 0; k < 6; ++k) {
      const double wanted =
          0.25 * (static_cast<double>(held.output[2 * k + 1]) - static_cast<double>(held.output[2 * k]));
      position[k] += (wanted - position[k]) / 128;
      sample.encoder[k] = static_cast<std::uint32_t>(std::lround(position[k])) & 0xFFFFFFu;
    }
    return Status::kOk;
  }
  Status write(const card::Command& command) noexcept override {
    held = command;
    return Status::kOk;
  }
  Status vent() noexcept override {
    held = {};
    return Status::kOk;
  }
  card::Command held;
  std::array<double, 6> position{};
  std::int64_t now = 0;
};

TEST(ControlSetup, six_joints_run_in_one_loop_and_only_the_one_that_is_asked_moves) {
  Warnings warnings;
  runtime::ControlSettings settings = runtime::control_settings(table_of(6), {}, {}, warnings);
  settings.run_up = 0.01;
  ArmCard card;
  runtime::ControlLoop loop(card, runtime::wire_joints({}, card.shape(), 6), settings);
  ASSERT_EQ(loop.configure(), Status::kOk);
  const std::atomic<bool> permit{true}, stop{false};
  runtime::MotionDirector director({.kind = runtime::Motion::Kind::kStep,
                                    .size = 0.2,
                                    .duration = 3,
                                    .joint = 4,
                                    .points = {},
                                    .path = {}},
                                   permit);
  std::array<double, 6> most{};
  struct Watch final : runtime::CycleSink {
    explicit Watch(std::array<double, 6>& m) : most(m) {}
    bool take(const runtime::CycleRow& row) noexcept override {
      for (std::size_t k = 0; k < 6; ++k) most[k] = std::max(most[k], std::abs(row.joint[k].angle));
      return true;
    }
    std::array<double, 6>& most;
  } watch(most);
  const runtime::LoopEnd end = loop.run(director, stop, nullptr, &watch);
  EXPECT_EQ(end.why, runtime::LoopEnd::Why::kDone);
  for (std::size_t k = 0; k < 6; ++k) {
    if (k == 4)
      EXPECT_GT(most[k], 0.1);
    else
      EXPECT_EQ(most[k], 0.0) << k;
  }
  EXPECT_EQ(card.held.output, card::Command{}.output);
}

}  // namespace
}  // namespace isac::test
