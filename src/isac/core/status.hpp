/// @file
/// What a freestanding function says back: one small code, never an exception.
///
/// Real time: constant time, no heap, no lock; safe from any thread.
/// Errors: none; `Status` *is* the error channel of the freestanding rooms (core, models, control).
/// Source: house rule "freestanding code is noexcept and returns a status".
#pragma once

#include <cstdint>

namespace isac {

enum class Status : std::uint8_t {
  kOk = 0,
  kNotFinite,     ///< an input or result is NaN or infinite
  kOutOfRange,    ///< an input lies outside the range in which the equation is defined
  kBadMagic,      ///< a table does not begin with its magic number
  kBadVersion,    ///< a table has a version this code does not read
  kBadChecksum,   ///< a table's CRC-32 differs from its content
  kTruncated,     ///< a table or message is shorter than it says
  kEndOfData,     ///< a replayed source has nothing more to give
  kDeviceError,   ///< a card did not answer, or answered with nonsense
  kNotPermitted,  ///< the operation is refused in this state
};

[[nodiscard]] constexpr bool ok(Status status) noexcept {
  return status == Status::kOk;
}

/// A short lower-case phrase for messages, e.g. "checksum differs".
[[nodiscard]] constexpr const char* describe(Status status) noexcept {
  switch (status) {
    case Status::kOk:
      return "ok";
    case Status::kNotFinite:
      return "a value is not finite";
    case Status::kOutOfRange:
      return "a value is out of range";
    case Status::kBadMagic:
      return "the magic number is wrong";
    case Status::kBadVersion:
      return "the version is not supported";
    case Status::kBadChecksum:
      return "the checksum differs";
    case Status::kTruncated:
      return "the data end too early";
    case Status::kEndOfData:
      return "the data have ended";
    case Status::kDeviceError:
      return "the device failed";
    case Status::kNotPermitted:
      return "the operation is refused in this state";
  }
  return "unknown status";
}

}  // namespace isac
