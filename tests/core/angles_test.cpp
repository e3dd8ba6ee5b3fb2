#include "isac/core/angles.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

namespace {

using isac::kPi;
using isac::shortest_turn;
using isac::wrap_to_2pi;
using isac::wrap_to_pi;

template <typename T>
class Angles : public ::testing::Test {};
using Scalars = ::testing::Types<float, double>;
TYPED_TEST_SUITE(Angles, Scalars);

TYPED_TEST(Angles, wrapped_stay_inside_their_range_and_on_the_same_point_of_the_circle) {
  using T = TypeParam;
  std::mt19937 random(7);
  std::uniform_real_distribution<double> turns(-1000.0, 1000.0);
  for (int i = 0; i < 100000; ++i) {
    const T x = static_cast<T>(turns(random));
    const T full = wrap_to_2pi(x);
    const T half = wrap_to_pi(x);
    ASSERT_GE(full, T(0));
    ASSERT_LT(full, T(2 * kPi));
    ASSERT_GE(half, -T(kPi));
    ASSERT_LT(half, T(kPi));
    // k turns of T(2π) differ from k turns of 2π by k times the rounding of 2π: up to 160 · eps · 2π here,
    // and x itself is known to eps · 1000; together below 4000 eps.
    const double tolerance = 4000.0 * std::numeric_limits<T>::epsilon();
    ASSERT_NEAR(std::remainder(double(x) - double(full), 2 * kPi), 0.0, tolerance) << x;
    ASSERT_NEAR(std::remainder(double(x) - double(half), 2 * kPi), 0.0, tolerance) << x;
  }
}

TYPED_TEST(Angles, at_the_seams_do_not_jump_out_of_range) {
  using T = TypeParam;
  const T circle = T(2 * kPi);
  const T half = T(kPi);
  EXPECT_EQ(wrap_to_2pi(T(0)), T(0));
  EXPECT_EQ(wrap_to_2pi(circle), T(0));
  EXPECT_EQ(wrap_to_2pi(-circle), T(0));
  for (const T seam : {T(0), half, circle, -half, -circle, T(3) * half, T(1000) * circle}) {
    for (const T x : {seam, std::nextafter(seam, T(1e9)), std::nextafter(seam, T(-1e9))}) {
      EXPECT_TRUE(wrap_to_2pi(x) >= T(0) && wrap_to_2pi(x) < circle) << x;
      EXPECT_TRUE(wrap_to_pi(x) >= -half && wrap_to_pi(x) < half) << x;
    }
  }
  EXPECT_LT(wrap_to_2pi(T(-1e-20)), circle);
  EXPECT_EQ(wrap_to_pi(half), -half);
  EXPECT_EQ(wrap_to_pi(T(0.3)), T(0.3));
}

TYPED_TEST(Angles, take_the_shortest_turn_whatever_the_number_of_turns_between) {
  using T = TypeParam;
  const double tolerance = 64 * std::numeric_limits<T>::epsilon();  // a few roundings of numbers up to 8π
  EXPECT_NEAR(shortest_turn(T(0.1), T(6.2)), 6.1 - 2 * kPi, tolerance);
  EXPECT_NEAR(shortest_turn(T(6.2), T(0.1)), 2 * kPi - 6.1, tolerance);
  EXPECT_NEAR(shortest_turn(T(3.0), T(-3.0)), 2 * kPi - 6.0, tolerance);
  EXPECT_NEAR(shortest_turn(T(-0.5), T(0.25 + 8 * kPi)), 0.75, tolerance);
  EXPECT_EQ(shortest_turn(T(1.5), T(1.5)), T(0));
}

TYPED_TEST(Angles, that_are_not_finite_give_nan) {
  using T = TypeParam;
  for (const T x : {std::numeric_limits<T>::quiet_NaN(), std::numeric_limits<T>::infinity(),
                    -std::numeric_limits<T>::infinity()}) {
    EXPECT_TRUE(std::isnan(wrap_to_2pi(x)));
    EXPECT_TRUE(std::isnan(wrap_to_pi(x)));
    EXPECT_TRUE(std::isnan(shortest_turn(T(0), x)));
  }
}

}  // namespace
