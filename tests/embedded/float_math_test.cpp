// The firmware's own sine, cosine and exponential against double, over all they are asked for and at their ends.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

extern "C" {
float sinf(float) noexcept;
float cosf(float) noexcept;
void sincosf(float, float*, float*) noexcept;
float expf(float) noexcept;
}

namespace {

/// Called through a pointer that the compiler cannot see through: its own knowledge of sinf stays outside.
float (*volatile sine)(float) = sinf;
float (*volatile cosine)(float) = cosf;
float (*volatile exponential)(float) = expf;

constexpr double kUlpOfOne = 0x1p-24;  // spacing of floats just below 1

TEST(FloatMath, sine_and_cosine_are_right_to_the_last_places_over_all_angles_of_a_joint) {
  std::mt19937 random(3);
  for (const float range : {0.8f, 6.3f, 100.0f, 8192.0f}) {
    std::uniform_real_distribution<float> angle(-range, range);
    double worst = 0;
    for (int i = 0; i < 200000; ++i) {
      const float x = angle(random);
      worst = std::max(worst, std::abs(static_cast<double>(sine(x)) - std::sin(static_cast<double>(x))));
      worst = std::max(worst, std::abs(static_cast<double>(cosine(x)) - std::cos(static_cast<double>(x))));
    }
    RecordProperty("worst_ulp_to_" + std::to_string(static_cast<int>(range)),
                   std::to_string(worst / kUlpOfOne));
    // Rounding of result (0.5), polynomial and reduction; measured 1.3, the same in all ranges.
    EXPECT_LT(worst, 1.6 * kUlpOfOne) << range;
  }
}

TEST(FloatMath, exponential_is_right_to_two_units_of_its_last_place) {
  std::mt19937 random(4);
  std::uniform_real_distribution<float> power(-87.0f, 88.0f);
  double worst = 0;
  for (int i = 0; i < 500000; ++i) {
    const float x = power(random);
    const double exact = std::exp(static_cast<double>(x));
    const double unit = std::ldexp(1.0, std::ilogb(exact) - 23);
    worst = std::max(worst, std::abs(static_cast<double>(exponential(x)) - exact) / unit);
  }
  RecordProperty("worst_ulp", std::to_string(worst));
  EXPECT_LT(worst, 2.0);
}

TEST(FloatMath, ends_are_exact_and_what_cannot_be_computed_is_no_number) {
  EXPECT_EQ(sine(0.0f), 0.0f);
  EXPECT_EQ(cosine(0.0f), 1.0f);
  EXPECT_EQ(exponential(0.0f), 1.0f);
  for (const float bad :
       {8200.0f, -1e20f, std::numeric_limits<float>::infinity(), std::numeric_limits<float>::quiet_NaN()}) {
    EXPECT_TRUE(std::isnan(sine(bad))) << bad;
    EXPECT_TRUE(std::isnan(cosine(bad))) << bad;
  }
  EXPECT_TRUE(std::isnan(exponential(std::numeric_limits<float>::quiet_NaN())));
  EXPECT_EQ(exponential(-std::numeric_limits<float>::infinity()), 0.0f);
  EXPECT_EQ(exponential(-100.0f), 0.0f);
  EXPECT_EQ(exponential(89.0f), std::numeric_limits<float>::infinity());
  EXPECT_TRUE(std::isfinite(exponential(88.5f)));
}

TEST(FloatMath, both_at_once_are_the_two_apart) {
  for (float x = -10; x < 10; x += 0.01f) {
    float s = 0, c = 0;
    sincosf(x, &s, &c);
    ASSERT_EQ(s, sine(x));
    ASSERT_EQ(c, cosine(x));
  }
}

}  // namespace
