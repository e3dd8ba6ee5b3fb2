// The binary table and its loader: every damage is refused, what is whole comes back to the bit.
#include "isac/models/parameter_table.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <string_view>
#include <vector>

#include "isac/core/crc32.hpp"
#include "isac/record/tables.hpp"

namespace isac {
namespace {

using models::JointField;
using models::load_parameter_table;
using models::ParameterTable;
using record::pack_parameter_table;

std::vector<std::byte> bytes_of(std::string_view text) {
  std::vector<std::byte> out;
  for (const char letter : text) out.push_back(static_cast<std::byte>(letter));
  return out;
}

ParameterTable random_table(std::mt19937_64& random, int joints, int effects) {
  std::uniform_real_distribution<double> uniform(0.1, 2.0);
  ParameterTable table;
  table.joint_count = joints;
  table.effect_count = effects;
  table.has_masses = random() % 2 == 0;
  if (table.has_masses) table.masses = {uniform(random), uniform(random), uniform(random)};
  for (int i = 0; i < joints; ++i) {
    for (int field = 0; field < models::kJointFields; ++field) {
      if (random() % 4 != 0) table.joints[i].set(static_cast<JointField>(field), uniform(random));
    }
    table.joints[i].set(JointField::kA, -uniform(random) * 1e5);
    table.joints[i].set(JointField::kAngleLow, -1.0);  // boxes that are not empty
    table.joints[i].set(JointField::kSpeedLow, -1.0);
    table.joints[i].set(JointField::kDeltaPressureLow, -1.0);
  }
  for (int i = 0; i < effects; ++i) {
    table.effects[i] = {.id_hash = static_cast<std::uint32_t>(random()),
                        .joint = static_cast<std::uint8_t>(i % joints),
                        .parameter_count = 2,
                        .parameters = {uniform(random), -uniform(random), 0, 0}};
  }
  return table;
}

/// The bytes with a checksum that fits them, so that only the damage itself can be the reason of refusal.
std::vector<std::byte> sealed(std::vector<std::byte> bytes) {
  const std::uint32_t crc = crc32(std::span(bytes).first(bytes.size() - 4));
  for (std::size_t i = 0; i < 4; ++i) bytes[bytes.size() - 4 + i] = static_cast<std::byte>(crc >> (8 * i));
  return bytes;
}

TEST(Crc32, gives_the_check_value_of_the_standard) {
  static_assert(crc32(std::span<const std::byte>{}) == 0);
  EXPECT_EQ(crc32(bytes_of("123456789")), 0xCBF43926u);
  EXPECT_EQ(crc32(bytes_of("The quick brown fox jumps over the lazy dog")), 0x414FA339u);
}

TEST(Crc32, continues_over_pieces) {
  EXPECT_EQ(crc32(bytes_of("56789"), crc32(bytes_of("1234"))), crc32(bytes_of("123456789")));
}

TEST(ParameterTable, effect_hash_is_fnv_1a_of_its_published_vectors) {
  EXPECT_EQ(models::effect_id_hash(""), 0x811C9DC5u);
  EXPECT_EQ(models::effect_id_hash("a"), 0xE40C292Cu);
  EXPECT_EQ(models::effect_id_hash("foobar"), 0xBF9CF968u);
}

TEST(ParameterTable, any_table_comes_back_to_the_bit) {
  std::mt19937_64 random(11);
  for (int joints = 1; joints <= models::kMaxTableJoints; ++joints) {
    for (int effects = 0; effects <= models::kMaxTableEffects; ++effects) {
      const ParameterTable table = random_table(random, joints, effects);
      const auto bytes = pack_parameter_table(table);
      ASSERT_EQ(bytes.size(), models::parameter_table_bytes(joints, effects));
      ParameterTable back;
      ASSERT_EQ(load_parameter_table(bytes, back), Status::kOk);
      ASSERT_EQ(back, table);
    }
  }
}

TEST(ParameterTable, every_single_bit_flip_is_refused) {
  std::mt19937_64 random(12);
  auto bytes = pack_parameter_table(random_table(random, 6, 3));
  ParameterTable table;
  ASSERT_EQ(load_parameter_table(bytes, table), Status::kOk);
  for (std::size_t bit = 0; bit < 8 * bytes.size(); ++bit) {
    bytes[bit / 8] ^= static_cast<std::byte>(1u << (bit % 8));
    ASSERT_NE(load_parameter_table(bytes, table), Status::kOk) << "bit " << bit;
    ASSERT_EQ(table.joint_count, 0) << "a refused table is left empty";
    bytes[bit / 8] ^= static_cast<std::byte>(1u << (bit % 8));
  }
}

TEST(ParameterTable, every_other_length_is_refused) {
  std::mt19937_64 random(13);
  auto bytes = pack_parameter_table(random_table(random, 2, 1));
  ParameterTable table;
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    ASSERT_EQ(load_parameter_table(std::span(bytes).first(size), table), Status::kTruncated) << size;
  }
  bytes.push_back(std::byte{0});
  EXPECT_EQ(load_parameter_table(bytes, table), Status::kTruncated);
}

TEST(ParameterTable, says_which_part_is_wrong) {
  std::mt19937_64 random(14);
  const auto good = pack_parameter_table(random_table(random, 1, 1));
  ParameterTable table;
  const auto damaged = [&](std::size_t at, int value, bool seal) {
    auto bytes = good;
    bytes[at] = static_cast<std::byte>(value);
    return load_parameter_table(seal ? sealed(bytes) : bytes, table);
  };
  EXPECT_EQ(damaged(0, 'i', true), Status::kBadMagic);
  EXPECT_EQ(damaged(8, 2, true), Status::kBadVersion);
  EXPECT_EQ(damaged(9, 1, true), Status::kBadVersion);
  EXPECT_EQ(damaged(12, 0, true), Status::kTruncated);
  EXPECT_EQ(damaged(100, 0x55, false), Status::kBadChecksum);
  EXPECT_EQ(damaged(10, 0, true), Status::kOutOfRange);
  EXPECT_EQ(damaged(10, 7, true), Status::kOutOfRange);
  EXPECT_EQ(damaged(10, 2, true), Status::kTruncated);
  EXPECT_EQ(damaged(11, 17, true), Status::kOutOfRange);
  EXPECT_EQ(damaged(17, 1, true), Status::kOutOfRange) << "an unknown flag";
  EXPECT_EQ(damaged(31, 1, true), Status::kOutOfRange) << "a byte that must be zero";
}

TEST(ParameterTable, refuses_nan_and_infinity_in_every_value) {
  std::mt19937_64 random(15);
  ParameterTable whole = random_table(random, 1, 1);
  whole.has_masses = true;
  for (int field = 0; field < models::kJointFields; ++field) {
    if (!whole.joints[0].has(static_cast<JointField>(field)))
      whole.joints[0].set(static_cast<JointField>(field), 1.5);
  }
  ParameterTable loaded;
  ASSERT_EQ(load_parameter_table(pack_parameter_table(whole), loaded), Status::kOk);
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(),
                           -std::numeric_limits<double>::infinity()}) {
    std::vector<double*> places;
    ParameterTable table = whole;
    for (double& value : table.joints[0].value) places.push_back(&value);
    for (double& value : table.masses) places.push_back(&value);
    for (double& value : table.effects[0].parameters) places.push_back(&value);
    for (double* place : places) {
      const double kept = *place;
      *place = bad;
      EXPECT_EQ(load_parameter_table(pack_parameter_table(table), loaded), Status::kNotFinite);
      *place = kept;
    }
  }
}

TEST(ParameterTable, refuses_values_that_no_joint_can_have) {
  std::mt19937_64 random(16);
  const auto status_with = [&random](JointField field, double value) {
    ParameterTable table = random_table(random, 1, 0), loaded;
    table.joints[0].set(JointField::kAngleHigh, 1.0);
    table.joints[0].set(field, value);
    return load_parameter_table(pack_parameter_table(table), loaded);
  };
  EXPECT_EQ(status_with(JointField::kWheelRadius, 0), Status::kOutOfRange);
  EXPECT_EQ(status_with(JointField::kInertia, -1), Status::kOutOfRange);
  EXPECT_EQ(status_with(JointField::kValveLag, 0), Status::kOutOfRange);
  EXPECT_EQ(status_with(JointField::kValveDeadTime, -0.01), Status::kOutOfRange);
  EXPECT_EQ(status_with(JointField::kValveDeadTime, 0), Status::kOk);
  EXPECT_EQ(status_with(JointField::kAngleLow, 1.0), Status::kOutOfRange) << "an empty box";
}

TEST(ParameterTable, a_value_that_is_not_known_reads_as_nan) {
  models::JointParameters joint;
  EXPECT_TRUE(std::isnan(joint[JointField::kA]));
  joint.set(JointField::kA, -23450);
  EXPECT_EQ(joint[JointField::kA], -23450);
  EXPECT_FALSE(joint.has(JointField::kB));
}

TEST(ParameterTable, random_bytes_behind_a_good_head_and_checksum_never_pass_unchecked) {
  std::mt19937_64 random(17);
  const auto good = pack_parameter_table(random_table(random, 2, 2));
  for (int round = 0; round < 3000; ++round) {
    auto bytes = good;
    for (int change = 0; change < 4; ++change)
      bytes[16 + random() % (bytes.size() - 20)] = static_cast<std::byte>(random());
    ParameterTable table;
    if (ok(load_parameter_table(sealed(bytes), table))) {
      ASSERT_EQ(check_parameter_table(table), Status::kOk);
      ASSERT_EQ(pack_parameter_table(table), sealed(bytes))
          << "what passes is what was written, byte for byte";
    } else {
      ASSERT_EQ(table.joint_count, 0);
    }
  }
}

}  // namespace
}  // namespace isac
