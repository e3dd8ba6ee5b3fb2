/// @file
/// The firmware's twin on the host: the same sources, the same story, the same table; and tables that are damaged.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <memory>
#include <span>
#include <vector>

#include "../../apps/embedded/simulated_arm.hpp"
#include "isac/core/crc32.hpp"
#include "isac/record/params.hpp"
#include "isac/record/tables.hpp"

namespace isac::test {

/// The packed table of soft_arm.params.toml, as `isac-identify export` writes it.
inline std::vector<std::byte> exported_table() {
  const std::filesystem::path params =
      std::filesystem::path(ISAC_SOURCE_DIR) / "tests/embedded/soft_arm.params.toml";
  return record::make_tables(record::read_params(params)).binary;
}

struct Twin {
  Status status = Status::kOk;
  std::vector<embedded::TickRecord> ticks;
};

inline Twin run_twin(const std::vector<std::byte>& table, int ticks = embedded::kStoryTicks) {
  using namespace embedded;
  auto loop = std::make_unique<ArmLoop>();
  SimulatedArm arm;
  Story story;
  Twin twin;
  twin.status = loop->start(table);
  if (loop->started()) arm.start(*loop);
  for (int k = 0; k < ticks; ++k) {
    Sample sample;
    Wanted wanted;
    story.at(k, arm, sample, wanted);
    const Valves valves = loop->tick(sample, wanted);
    twin.ticks.push_back(record_of(arm, sample, valves));
    if (loop->started()) arm.step(valves.pressure, 1e-9f * static_cast<float>(kPeriodNs));
  }
  return twin;
}

struct DamagedTable {
  const char* what;
  std::vector<std::byte> bytes;
  Status expected;
};

/// Every one must be refused for its own reason: where the damage is not the checksum's, the checksum fits.
inline std::vector<DamagedTable> damaged_tables() {
  const std::vector<std::byte> whole = exported_table();
  const auto sealed = [](std::vector<std::byte> bytes) {
    const std::uint32_t crc = crc32(std::span(bytes).first(bytes.size() - 4));
    for (std::size_t i = 0; i < 4; ++i) bytes[bytes.size() - 4 + i] = static_cast<std::byte>(crc >> (8 * i));
    return bytes;
  };
  const auto with_byte = [&whole](std::size_t at, unsigned char value) {
    std::vector<std::byte> bytes = whole;
    bytes[at] = static_cast<std::byte>(value);
    return bytes;
  };
  const auto with_number = [&](std::size_t at, double value) {
    std::vector<std::byte> bytes = whole;
    const auto bits = std::bit_cast<std::array<std::byte, 8>>(value);
    std::copy(bits.begin(), bits.end(), bytes.begin() + static_cast<std::ptrdiff_t>(at));
    return sealed(bytes);
  };
  models::ParameterTable five;
  EXPECT_EQ(models::load_parameter_table(whole, five), Status::kOk);
  five.joint_count = 5;
  models::ParameterTable without_gain;
  EXPECT_EQ(models::load_parameter_table(whole, without_gain), Status::kOk);
  without_gain.joints[2].present &= ~(1u << static_cast<unsigned>(models::JointField::kTorqueI));
  without_gain.joints[2].value[static_cast<std::size_t>(models::JointField::kTorqueI)] = 0;
  const std::size_t second_joint_b = 56 + 184 + 8 + 8;
  return {
      {"another magic", sealed(with_byte(0, 'X')), Status::kBadMagic},
      {"version 2", sealed(with_byte(8, 2)), Status::kBadVersion},
      {"one bit flipped", with_byte(100, static_cast<unsigned char>(std::to_integer<int>(whole[100]) ^ 1)),
       Status::kBadChecksum},
      {"a checksum of its own",
       with_byte(whole.size() - 1, static_cast<unsigned char>(std::to_integer<int>(whole.back()) ^ 0x80)),
       Status::kBadChecksum},
      {"NaN for B of joint 2", with_number(second_joint_b, std::nan("")), Status::kNotFinite},
      {"infinite m1", with_number(32, HUGE_VAL), Status::kNotFinite},
      {"B beyond float", with_number(second_joint_b, 1e300), Status::kNotFinite},
      {"m2 beyond float", with_number(40, 1e300), Status::kNotFinite},
      {"a length that is not its own", sealed(with_byte(14, 0xFF)), Status::kTruncated},
      {"five joints", record::pack_parameter_table(five), Status::kOutOfRange},
      {"a joint without a gain", record::pack_parameter_table(without_gain), Status::kOutOfRange},
      {"nothing but zeros", std::vector<std::byte>(whole.size()), Status::kBadMagic}};
}

/// Were the valves without pressure and nothing armed, whatever the story asked for?
inline void expect_vented(const std::vector<embedded::TickRecord>& ticks, const char* what) {
  for (std::size_t k = 0; k < ticks.size(); ++k) {
    for (const float p : ticks[k].pressure)
      ASSERT_EQ(std::bit_cast<std::uint32_t>(p), 0u) << what << ", tick " << k;
    ASSERT_EQ(ticks[k].state, 0) << what << ", tick " << k;
  }
}

}  // namespace isac::test
