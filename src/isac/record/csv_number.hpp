/// @file
/// The fast path of the CSV reader: a plain decimal such as "-12.3456" read eight bytes at a time, exactly.
///
/// The digits before and behind the decimal sign are gathered into one integer m with f digits behind the sign, and
///   value = m / 10^f,   m ≤ 2^53, f ≤ 16:
/// both operands are exact doubles, and one IEEE division rounds once, so the result is the nearest double (Clinger 1990).
/// Everything else (exponents, more digits, "nan", spaces) is left to the slow path, which calls fast_float.
///
/// Real time: no heap, noexcept. The caller guarantees 32 readable bytes behind `p`, as ByteSource does.
#pragma once

#include <bit>
#include <cstdint>
#include <cstring>

#if defined(__SSE2__)
#include <emmintrin.h>
#endif

namespace isac::record {

namespace csv_number_detail {

inline constexpr double kPowersOfTen[] = {1e0, 1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7, 1e8,
                                          1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16};
inline constexpr std::uint64_t kWholePowersOfTen[] = {1,      10,      100,      1000,     10000,
                                                      100000, 1000000, 10000000, 100000000};

/// Eight bytes with the first one lowest, each digit turned into its value.
inline std::uint64_t load_digits(const char* p) noexcept {
  std::uint64_t bytes = 0;
  std::memcpy(&bytes, p, sizeof bytes);
  if constexpr (std::endian::native == std::endian::big) bytes = __builtin_bswap64(bytes);
  return bytes ^ 0x3030303030303030U;
}

/// The top bit of the first byte that is no digit (bits above it may be anything); 0 if all eight are digits.
inline std::uint64_t first_non_digit(std::uint64_t digits) noexcept {
  return ((digits + 0x7676767676767676U) | digits) & 0x8080808080808080U;
}

/// The number that eight digit values write; missing leading digits are zero bytes at the low end.
inline std::uint64_t eight_digits(std::uint64_t digits) noexcept {
  digits = digits * 10 + (digits >> 8U);  // pairs in every second byte
  return (((digits & 0x000000FF000000FFU) * 0x000F424000000064U) +
          (((digits >> 16U) & 0x000000FF000000FFU) * 0x0000271000000001U)) >>
         32U;
}

}  // namespace csv_number_detail

/// The distance from `p` to the first `separator` or line feed among the next 16 bytes, or 16.
///
/// The next cell starts behind it whatever the number looks like, so that the processor can begin with that cell while
/// it still works on this one: this distance is the only thing the cells of a row wait for.
inline unsigned cell_length(const char* p, char separator) noexcept {
#if defined(__SSE2__)
  const __m128i bytes = _mm_loadu_si128(reinterpret_cast<const __m128i*>(p));
  const __m128i ends = _mm_or_si128(_mm_cmpeq_epi8(bytes, _mm_set1_epi8(separator)),
                                    _mm_cmpeq_epi8(bytes, _mm_set1_epi8('\n')));
  return static_cast<unsigned>(std::countr_zero(static_cast<unsigned>(_mm_movemask_epi8(ends)) | 0x10000U));
#else
  unsigned length = 0;
  while (length < 16 && p[length] != separator && p[length] != '\n') ++length;
  return length;
#endif
}

/// Reads the `length` bytes at `p` as a decimal of at most eight digits with a decimal sign in between; false if they are
/// anything else. The sign is squeezed out by taking the bytes before it from one load and those behind it from a load one
/// byte further on, so that one conversion serves both sides.
inline bool read_short_decimal(const char* p, unsigned length, char decimal_sign, double& value) noexcept {
  using namespace csv_number_detail;
  const bool negative = *p == '-';
  p += negative ? 1 : 0;
  const unsigned count = length - (negative ? 2U : 1U);  // digits; wraps for an empty cell
  if (count - 1U > 7U) return false;

  const std::uint64_t digits = load_digits(p);
  const std::uint64_t stop = first_non_digit(digits);
  const std::uint64_t lowest = stop & (~stop + 1U);
  const std::uint64_t before_sign = (lowest >> 7U) - 1U;  // all bytes before the first that is no digit
  const auto whole_count = static_cast<unsigned>(std::countr_zero(stop)) >> 3U;
  const std::uint64_t squeezed = ((digits & before_sign) | (load_digits(p + 1) & ~before_sign))
                                 << (64U - 8U * count);
  if (whole_count > count || p[whole_count] != decimal_sign || first_non_digit(squeezed) != 0) return false;
  const double magnitude = static_cast<double>(static_cast<std::int64_t>(eight_digits(squeezed))) /
                           kPowersOfTen[count - whole_count];
  value = negative ? -magnitude : magnitude;
  return true;
}

/// Reads a plain decimal at `p` into `value` and returns the first byte behind it, or nullptr if it is not plain.
inline const char* read_plain_decimal(const char* p, char decimal_sign, double& value) noexcept {
  using namespace csv_number_detail;
  const bool negative = *p == '-';
  p += negative ? 1 : 0;

  std::uint64_t digits = load_digits(p);
  std::uint64_t stop = first_non_digit(digits);
  const auto whole_count = static_cast<unsigned>(std::countr_zero(stop)) >> 3U;
  if (whole_count - 1U > 6U) return nullptr;  // none, or eight and more
  std::uint64_t mantissa = eight_digits(digits << (64U - 8U * whole_count));
  p += whole_count;

  double magnitude = static_cast<double>(static_cast<std::int64_t>(mantissa));
  if (*p == decimal_sign) {
    ++p;
    digits = load_digits(p);
    stop = first_non_digit(digits);
    auto count = static_cast<unsigned>(std::countr_zero(stop)) >> 3U;  // 8 if all are digits
    if (count == 0) return nullptr;
    mantissa = mantissa * kWholePowersOfTen[count] + eight_digits(digits << (64U - 8U * count));
    p += count;
    if (count == 8) [[unlikely]] {
      digits = load_digits(p);
      stop = first_non_digit(digits);
      const auto more = static_cast<unsigned>(std::countr_zero(stop)) >> 3U;
      if (more == 8 || mantissa > 90'000'000U * kWholePowersOfTen[8] / kWholePowersOfTen[more])
        return nullptr;
      if (more > 0) mantissa = mantissa * kWholePowersOfTen[more] + eight_digits(digits << (64U - 8U * more));
      p += more;
      count += more;
    }
    magnitude = static_cast<double>(static_cast<std::int64_t>(mantissa)) / kPowersOfTen[count];
  }
  value = negative ? -magnitude : magnitude;
  return p;
}

}  // namespace isac::record
