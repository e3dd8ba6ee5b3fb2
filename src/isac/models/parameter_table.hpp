/// @file
/// The deployment table: identified parameters as a controller is handed them, packed little-endian with
/// magic, version, length and CRC-32; and the loader that refuses everything else.
///
/// All values are SI and float64 (docs/decisions/0020): A N/m, B N/Pa, C N m s³, D N m s, lengths m,
/// pressures Pa, angles rad, speeds rad/s, times s, masses kg, inertia kg m². A float controller narrows
/// once, at start-up.
///
///   offset  size  field
///        0     8  magic "ISACPRM" and a zero byte
///        8     2  version, 1
///       10     1  number of joints n, 1 … 6
///       11     1  number of effects m, 0 … 16
///       12     4  byte count of the whole table, 32 + 24 + n·184 + m·40 + 4
///       16     4  table flags: bit 0 masses known
///       20    12  zero
///       32    24  masses m1, m2, m3
///       56   184n joints: flags (4 bytes), zero (4 bytes), 22 values in the order of JointField
///        …   40m  effects: FNV-1a hash of the id (4), joint index (1, 0xFF: all), parameter count (1), zero
///        (2), 4 values
///      end     4  CRC-32 of all bytes before
///
/// A value whose flag bit is not set is stored as zero and must not be used.
/// Real time: load is one pass, no heap, no lock, noexcept; not meant for the loop. Threads: pure functions.
/// Errors: Status — kTruncated (length), kBadMagic, kBadVersion, kBadChecksum, kNotFinite (NaN or infinity),
/// kOutOfRange (counts, flags, wheel radius ≤ 0, time constant ≤ 0, an empty box). On refusal `table` is left
/// empty. Source: seed tables 6.1, 6.2; docs/formats.md. Example: `if (ok(load_parameter_table(flash,
/// table))) arm();`
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string_view>

#include "isac/core/crc32.hpp"
#include "isac/core/status.hpp"

namespace isac::models {

inline constexpr int kMaxTableJoints = 6;
inline constexpr int kMaxTableEffects = 16;
inline constexpr int kMaxTableEffectParameters = 4;
inline constexpr std::uint16_t kParameterTableVersion = 1;
inline constexpr std::array<char, 8> kParameterTableMagic = {'I', 'S', 'A', 'C', 'P', 'R', 'M', '\0'};

/// The values of one joint; the enumerator is both the position in the table and the bit in `present`.
enum class JointField : std::uint8_t {
  kA,
  kB,
  kC,
  kD,  // eq 3.10
  kWheelRadius,
  kInitialPressure,
  kInertia,
  kDeltaPressureLow,
  kDeltaPressureHigh,
  kAngleLow,
  kAngleHigh,
  kSpeedLow,
  kSpeedHigh,  // validity box, seed 3.5
  kValveGain,
  kValveLag,
  kValveDeadTime,  // K_C, T_C, dead time
  kPositionP,
  kPositionI,
  kTorqueP,
  kTorqueI,  // cascade: N m/rad, N m/(rad s), Pa/(N m), Pa/(N m s)
  kValveLagFill,
  kValveLagVent,  // T_C apart for filling and venting
  kCount
};
inline constexpr int kJointFields = static_cast<int>(JointField::kCount);

struct JointParameters {
  std::uint32_t present = 0;  ///< bit i: field i is known
  std::array<double, kJointFields> value{};

  [[nodiscard]] constexpr bool has(JointField field) const noexcept {
    return ((present >> static_cast<unsigned>(field)) & 1u) != 0;
  }
  /// The value, or NaN where it is not known.
  [[nodiscard]] constexpr double operator[](JointField field) const noexcept {
    return has(field) ? value[static_cast<std::size_t>(field)] : std::numeric_limits<double>::quiet_NaN();
  }
  constexpr void set(JointField field, double value_si) noexcept {
    present |= 1u << static_cast<unsigned>(field);
    value[static_cast<std::size_t>(field)] = value_si;
  }
  friend constexpr bool operator==(const JointParameters&, const JointParameters&) noexcept = default;
};

inline constexpr std::uint8_t kAllJoints = 0xFF;

/// An effect of models/effects.hpp that was added to the model, by the hash of its id.
struct TableEffect {
  std::uint32_t id_hash = 0;
  std::uint8_t joint = kAllJoints;  ///< index from 0, or kAllJoints
  std::uint8_t parameter_count = 0;
  std::array<double, kMaxTableEffectParameters> parameters{};  ///< SI, in the catalogue's order
  friend constexpr bool operator==(const TableEffect&, const TableEffect&) noexcept = default;
};

struct ParameterTable {
  int joint_count = 0;
  int effect_count = 0;
  bool has_masses = false;
  std::array<double, 3> masses{};
  std::array<JointParameters, kMaxTableJoints> joints{};
  std::array<TableEffect, kMaxTableEffects> effects{};
  friend constexpr bool operator==(const ParameterTable&, const ParameterTable&) noexcept = default;
};

/// FNV-1a, 32 bit: names an effect in four bytes whatever its place in the catalogue.
[[nodiscard]] constexpr std::uint32_t effect_id_hash(std::string_view id) noexcept {
  std::uint32_t hash = 2166136261u;
  for (const char letter : id) hash = (hash ^ static_cast<unsigned char>(letter)) * 16777619u;
  return hash;
}

namespace detail {
inline constexpr std::size_t kHeaderBytes = 32, kMassBytes = 24, kEffectBytes = 40, kChecksumBytes = 4;
inline constexpr std::size_t kJointBytes = 8 + 8 * static_cast<std::size_t>(kJointFields);
static_assert(kJointBytes == 184, "the layout above, and version 1 of the file, say 22 values");

/// Unsigned little-endian integer of `size` bytes at `offset`.
[[nodiscard]] constexpr std::uint64_t read_unsigned(std::span<const std::byte> bytes, std::size_t offset,
                                                    std::size_t size) noexcept {
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < size; ++i)
    value |= std::to_integer<std::uint64_t>(bytes[offset + i]) << (8 * i);
  return value;
}

[[nodiscard]] constexpr double read_double(std::span<const std::byte> bytes, std::size_t offset) noexcept {
  return std::bit_cast<double>(read_unsigned(bytes, offset, 8));
}

/// Finite by the bits alone, so that -ffast-math cannot remove the test.
[[nodiscard]] constexpr bool is_finite(double value) noexcept {
  return (std::bit_cast<std::uint64_t>(value) & 0x7FF0000000000000u) != 0x7FF0000000000000u;
}

[[nodiscard]] constexpr Status check_joint(const JointParameters& joint) noexcept {
  if ((joint.present >> kJointFields) != 0) return Status::kOutOfRange;
  for (int i = 0; i < kJointFields; ++i) {
    const double value = joint.value[static_cast<std::size_t>(i)];
    if (!is_finite(value)) return Status::kNotFinite;
    if (!joint.has(static_cast<JointField>(i)) && value != 0.0) return Status::kOutOfRange;
  }
  using enum JointField;
  for (const JointField positive : {kWheelRadius, kInertia, kValveLag, kValveLagFill, kValveLagVent}) {
    if (joint.has(positive) && !(joint[positive] > 0.0)) return Status::kOutOfRange;
  }
  if (joint.has(kValveDeadTime) && joint[kValveDeadTime] < 0.0) return Status::kOutOfRange;
  constexpr JointField box[][2] = {
      {kDeltaPressureLow, kDeltaPressureHigh}, {kAngleLow, kAngleHigh}, {kSpeedLow, kSpeedHigh}};
  for (const auto& [low, high] : box) {
    if (joint.has(low) && joint.has(high) && !(joint[low] < joint[high])) return Status::kOutOfRange;
  }
  return Status::kOk;
}
}  // namespace detail

/// The same checks that the loader makes on values, for tables made in memory.
[[nodiscard]] constexpr Status check_parameter_table(const ParameterTable& table) noexcept {
  if (table.joint_count < 1 || table.joint_count > kMaxTableJoints) return Status::kOutOfRange;
  if (table.effect_count < 0 || table.effect_count > kMaxTableEffects) return Status::kOutOfRange;
  for (const double mass : table.masses) {
    if (!detail::is_finite(mass)) return Status::kNotFinite;
    if (!table.has_masses && mass != 0.0) return Status::kOutOfRange;
  }
  for (int i = 0; i < table.joint_count; ++i) {
    if (const Status status = detail::check_joint(table.joints[static_cast<std::size_t>(i)]); !ok(status))
      return status;
  }
  for (int i = 0; i < table.effect_count; ++i) {
    const TableEffect& effect = table.effects[static_cast<std::size_t>(i)];
    if (effect.joint != kAllJoints && effect.joint >= table.joint_count) return Status::kOutOfRange;
    if (effect.parameter_count > kMaxTableEffectParameters) return Status::kOutOfRange;
    for (const double parameter : effect.parameters) {
      if (!detail::is_finite(parameter)) return Status::kNotFinite;
    }
  }
  return Status::kOk;
}

/// Bytes that a table of this many joints and effects takes.
[[nodiscard]] constexpr std::size_t parameter_table_bytes(int joints, int effects) noexcept {
  using namespace detail;
  return kHeaderBytes + kMassBytes + static_cast<std::size_t>(joints) * kJointBytes +
         static_cast<std::size_t>(effects) * kEffectBytes + kChecksumBytes;
}

[[nodiscard]] constexpr Status load_parameter_table(std::span<const std::byte> bytes,
                                                    ParameterTable& table) noexcept {
  using namespace detail;
  table = ParameterTable{};
  if (bytes.size() < parameter_table_bytes(1, 0)) return Status::kTruncated;
  for (std::size_t i = 0; i < kParameterTableMagic.size(); ++i) {
    if (bytes[i] != static_cast<std::byte>(kParameterTableMagic[i])) return Status::kBadMagic;
  }
  if (read_unsigned(bytes, 8, 2) != kParameterTableVersion) return Status::kBadVersion;
  if (read_unsigned(bytes, 12, 4) != bytes.size()) return Status::kTruncated;
  const std::size_t end = bytes.size() - kChecksumBytes;
  if (read_unsigned(bytes, end, 4) != crc32(bytes.first(end))) return Status::kBadChecksum;

  ParameterTable loaded;
  loaded.joint_count = static_cast<int>(read_unsigned(bytes, 10, 1));
  loaded.effect_count = static_cast<int>(read_unsigned(bytes, 11, 1));
  if (loaded.joint_count < 1 || loaded.joint_count > kMaxTableJoints ||
      loaded.effect_count > kMaxTableEffects) {
    return Status::kOutOfRange;
  }
  if (bytes.size() != parameter_table_bytes(loaded.joint_count, loaded.effect_count))
    return Status::kTruncated;
  const std::uint64_t flags = read_unsigned(bytes, 16, 4);
  if ((flags & ~std::uint64_t{1}) != 0 || read_unsigned(bytes, 20, 8) != 0 ||
      read_unsigned(bytes, 28, 4) != 0) {
    return Status::kOutOfRange;
  }
  loaded.has_masses = flags != 0;

  std::size_t at = kHeaderBytes;
  for (double& mass : loaded.masses) {
    mass = read_double(bytes, at);
    at += 8;
  }
  for (int i = 0; i < loaded.joint_count; ++i) {
    JointParameters& joint = loaded.joints[static_cast<std::size_t>(i)];
    joint.present = static_cast<std::uint32_t>(read_unsigned(bytes, at, 4));
    if (read_unsigned(bytes, at + 4, 4) != 0) return Status::kOutOfRange;
    at += 8;
    for (double& value : joint.value) {
      value = read_double(bytes, at);
      at += 8;
    }
  }
  for (int i = 0; i < loaded.effect_count; ++i) {
    TableEffect& effect = loaded.effects[static_cast<std::size_t>(i)];
    effect.id_hash = static_cast<std::uint32_t>(read_unsigned(bytes, at, 4));
    effect.joint = static_cast<std::uint8_t>(read_unsigned(bytes, at + 4, 1));
    effect.parameter_count = static_cast<std::uint8_t>(read_unsigned(bytes, at + 5, 1));
    if (read_unsigned(bytes, at + 6, 2) != 0) return Status::kOutOfRange;
    at += 8;
    for (double& parameter : effect.parameters) {
      parameter = read_double(bytes, at);
      at += 8;
    }
  }
  if (const Status status = check_parameter_table(loaded); !ok(status)) return status;
  table = loaded;
  return Status::kOk;
}

}  // namespace isac::models
