// sinf, cosf, sincosf and expf in single precision, one source for the firmware and for the host's run of it.
//
// newlib's and glibc's differ in last bits (docs/decisions/0130), so that neither can be what both compute. These are
// linked before libm's and take their place. Method: Cody-Waite reduction, minimax polynomials (Cephes, S. Moshier).
// Error: sine and cosine at most 1.6 units in the last place of 1 over ±8192 rad, exponential 2 of its own
// (tests/embedded/float_math_test.cpp). Beyond ±8192 rad, and for what is no number, sine and cosine are NaN, which every
// controller refuses. Results of expf below the smallest normal number are 0. No heap, no state, no branch on errno.
#include <bit>
#include <cstdint>

namespace {

constexpr float kLargestAngle = 8192.0f;  // rad: the multiples of the first part of π/2 stay exact
constexpr float kToInteger = 0x1.8p23f;   // added and taken away, rounds to the nearest integer
constexpr float kHalfPi1 = 1.5703125f;    // 8 bits
constexpr float kHalfPi2 = 4.837512969970703125e-4f;
constexpr float kHalfPi3 = 7.54978995489188216e-8f;

float not_a_number() noexcept {
  return std::bit_cast<float>(0x7FC00000u);
}

/// |x| ≤ π/4.
float short_sine(float x) noexcept {
  const float z = x * x;
  return ((-1.9515295891e-4f * z + 8.3321608736e-3f) * z - 1.6666654611e-1f) * z * x + x;
}
float short_cosine(float x) noexcept {
  const float z = x * x;
  return ((2.443315711809948e-5f * z - 1.388731625493765e-3f) * z + 4.166664568298827e-2f) * z * z -
         0.5f * z + 1.0f;
}

struct Quadrant {
  float rest;
  std::uint32_t number;
};

Quadrant reduce(float x) noexcept {
  const float n = (x * 6.3661977236758134e-1f + kToInteger) - kToInteger;
  return {((x - n * kHalfPi1) - n * kHalfPi2) - n * kHalfPi3,
          static_cast<std::uint32_t>(static_cast<std::int32_t>(n))};
}

bool within(float x) noexcept {
  return x >= -kLargestAngle && x <= kLargestAngle;
}

/// Sine of the angle plus `quarters` quarter turns.
float wave(const Quadrant& q, std::uint32_t quarters) noexcept {
  const std::uint32_t at = q.number + quarters;
  const float size = (at & 1u) != 0 ? short_cosine(q.rest) : short_sine(q.rest);
  return (at & 2u) != 0 ? -size : size;
}

}  // namespace

extern "C" {

float sinf(float x) noexcept;
float cosf(float x) noexcept;
void sincosf(float x, float* sine, float* cosine) noexcept;
float expf(float x) noexcept;

float sinf(float x) noexcept {
  return within(x) ? wave(reduce(x), 0) : not_a_number();
}

float cosf(float x) noexcept {
  return within(x) ? wave(reduce(x), 1) : not_a_number();
}

/// What the host's compiler makes of a sine and a cosine of one angle.
void sincosf(float x, float* sine, float* cosine) noexcept {
  *sine = sinf(x);
  *cosine = cosf(x);
}

float expf(float x) noexcept {
  if (!(x == x)) return x;
  if (x > 88.7f) return std::bit_cast<float>(0x7F800000u);
  if (x < -87.3f) return 0.0f;
  const float n = (x * 1.44269504088896341f + kToInteger) - kToInteger;
  const float r = (x - n * 0.693359375f) + n * 2.12194440054690583e-4f;
  float y = 1.9875691500e-4f;
  y = y * r + 1.3981999507e-3f;
  y = y * r + 8.3334519073e-3f;
  y = y * r + 4.1665795894e-2f;
  y = y * r + 1.6666665459e-1f;
  y = y * r + 5.0000001201e-1f;
  y = y * r * r + r + 1.0f;
  // Two factors: 2^n alone leaves the range at n = 128, where the result need not.
  const std::int32_t half = static_cast<std::int32_t>(n) / 2, other = static_cast<std::int32_t>(n) - half;
  const auto power = [](std::int32_t e) {
    return std::bit_cast<float>(static_cast<std::uint32_t>(e + 127) << 23);
  };
  return y * power(half) * power(other);
}

}  // extern "C"
