/// @file
/// Numbers of a table: decimals, shares with their Wilson interval of 95 %, quantiles.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

namespace blind {

inline std::string fixed(double x, int digits) {
  char text[40];
  std::snprintf(text, sizeof text, "%.*f", digits, x);
  return text;
}

struct Interval {
  double low = 0, high = 1;
};

/// Wilson's of 95 %, for hits/count; all of [0, 1] where nothing was counted.
inline Interval wilson_interval(double hits, double count) {
  if (count == 0.0) return {};
  constexpr double z = 1.96;
  const double p = hits / count, wide = 1.0 + z * z / count;
  const double middle = (p + z * z / (2.0 * count)) / wide;
  const double half = z / wide * std::sqrt(p * (1.0 - p) / count + z * z / (4.0 * count * count));
  return {std::max(0.0, middle - half), std::min(1.0, middle + half)};
}

/// "47/50 = 94 % (84 to 98)": with that interval.
inline std::string share(double hits, double count) {
  if (count == 0.0) return "–";
  const Interval wilson = wilson_interval(hits, count);
  return fixed(hits, 0) + "/" + fixed(count, 0) + " = " + fixed(100.0 * hits / count, 1) + " % (" +
         fixed(100.0 * wilson.low, 1) + " to " + fixed(100.0 * wilson.high, 1) + ")";
}

inline double quantile(std::vector<double> x, double q) {
  if (x.empty()) return NAN;
  std::sort(x.begin(), x.end());
  const double at = q * static_cast<double>(x.size() - 1);
  const auto i = static_cast<std::size_t>(at);
  const double next = x[std::min(i + 1, x.size() - 1)];
  return x[i] + (at - static_cast<double>(i)) * (next - x[i]);
}

}  // namespace blind
