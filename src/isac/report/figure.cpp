#include "isac/report/figure.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <utility>

namespace isac::report {
namespace colour {

const char* category(std::size_t k) noexcept {
  constexpr std::array kSet = {kSecond, kModel, kThird, kFourth, kSixth, kFifth, kMeasured};
  return kSet[k % kSet.size()];
}

std::string ordered(std::size_t k, std::size_t n) {
  // Anchors of the "plasma" map without its pale end.
  constexpr std::array<std::array<double, 3>, 5> kAnchor = {
      {{13, 8, 135}, {106, 0, 168}, {177, 42, 144}, {225, 100, 98}, {245, 155, 40}}};
  const double at = n < 2 ? 0.0 : 4.0 * static_cast<double>(k) / static_cast<double>(n - 1);
  const auto lower = std::min<std::size_t>(3, static_cast<std::size_t>(at));
  const double t = at - static_cast<double>(lower);
  std::array<int, 3> rgb{};
  for (std::size_t c = 0; c < 3; ++c)
    rgb[c] = static_cast<int>(std::lround((1 - t) * kAnchor[lower][c] + t * kAnchor[lower + 1][c]));
  std::array<char, 8> text{};
  std::snprintf(text.data(), text.size(), "#%02x%02x%02x", static_cast<unsigned>(rgb[0]) & 255U,
                static_cast<unsigned>(rgb[1]) & 255U, static_cast<unsigned>(rgb[2]) & 255U);
  return text.data();
}

}  // namespace colour

namespace {

constexpr std::array kShades = {"#c6dbef", "#9ecae1", "#5fa6d1", "#2b7bba", "#08519c"};
constexpr std::size_t kManyPoints = 600;  // beyond it single dots hide each other
constexpr double kCellPixels = 4;
constexpr std::size_t kLongestLoop = 3500;

std::vector<double> copy(std::span<const double> values) {
  return {values.begin(), values.end()};
}

template <typename Visit>
void visit_y(const Curve& curve, Visit visit) {
  if (curve.mark != Mark::kRuns) {
    visit(curve.low);
    visit(curve.high);
  }
  visit(curve.y);
}

template <typename Visit>
void visit_x(const Curve& curve, Visit visit) {
  if (curve.mark == Mark::kRuns) {
    visit(curve.low);
    visit(curve.high);
  }
  visit(curve.x);
}

bool any_finite(const std::vector<double>& values) {
  return std::any_of(values.begin(), values.end(), [](double v) { return std::isfinite(v); });
}

}  // namespace

Curve line(std::string label, std::string colour, std::span<const double> x, std::span<const double> y,
           std::size_t columns) {
  Series small = envelope(x, y, columns);
  return {.label = std::move(label),
          .colour = std::move(colour),
          .x = std::move(small.x),
          .y = std::move(small.y)};
}

Curve steps(std::string label, std::string colour, std::span<const double> x, std::span<const double> y) {
  Curve out = line(std::move(label), std::move(colour), x, y);
  out.mark = Mark::kSteps;
  return out;
}

Curve loop(std::string label, std::string colour, std::span<const double> x, std::span<const double> y) {
  Path small = path(x, y, 0.004, kLongestLoop);
  if (!small.complete) return dots(std::move(label), std::move(colour), x, y);
  Curve out{.label = std::move(label),
            .colour = std::move(colour),
            .x = std::move(small.x),
            .y = std::move(small.y)};
  out.size = 1.1;
  return out;
}

Curve dots(std::string label, std::string colour, std::span<const double> x, std::span<const double> y,
           std::size_t limit, double size) {
  Series small = cloud(x, y, 340, 120, limit);
  Curve out{.label = std::move(label),
            .mark = Mark::kPoints,
            .colour = std::move(colour),
            .x = std::move(small.x),
            .y = std::move(small.y)};
  out.size = size;
  return out;
}

Curve error_bars(std::string label, std::string colour, std::span<const double> x, std::span<const double> y,
                 std::span<const double> half_width) {
  Curve out{.label = std::move(label),
            .mark = Mark::kErrorBars,
            .colour = std::move(colour),
            .x = copy(x),
            .y = copy(y),
            .low = copy(y),
            .high = copy(y)};
  for (std::size_t i = 0; i < out.y.size(); ++i) {
    const double half = std::isfinite(half_width[i]) ? half_width[i] : 0.0;
    out.low[i] -= half;
    out.high[i] += half;
  }
  return out;
}

Curve band(std::string label, std::string colour, std::span<const double> x, std::span<const double> low,
           std::span<const double> high) {
  return {.label = std::move(label),
          .mark = Mark::kBand,
          .colour = std::move(colour),
          .x = copy(x),
          .low = copy(low),
          .high = copy(high)};
}

std::vector<Curve> scatter(std::span<const double> x, std::span<const double> y, double width,
                           double height) {
  return scatter(x, y, range_of(x), range_of(y), width, height);
}

std::string lower_first(std::string text) {
  if (!text.empty() && text.front() >= 'A' && text.front() <= 'Z')
    text.front() = static_cast<char>(text.front() + 32);
  return text;
}

std::vector<Curve> scatter(std::span<const double> x, std::span<const double> y, Range range_x, Range range_y,
                           double width, double height) {
  if (x.size() <= kManyPoints) return {dots("", colour::kSecond, x, y, kManyPoints, 2.6)};
  const auto columns = static_cast<std::size_t>(std::max(8.0, width / kCellPixels));
  const auto rows = static_cast<std::size_t>(std::max(8.0, height / kCellPixels));
  std::vector<Curve> out;
  auto levels = density(x, y, range_x, range_y, columns, rows, kShades.size());
  for (std::size_t k = 0; k < levels.size(); ++k) {
    Curve shade{.mark = Mark::kRuns,
                .colour = kShades[k],
                .y = std::move(levels[k].y),
                .low = std::move(levels[k].left),
                .high = std::move(levels[k].right)};
    shade.size = kCellPixels;
    if (!shade.y.empty()) out.push_back(std::move(shade));
  }
  return out;
}

Range data_range_x(const Panel& panel) {
  std::vector<double> all;
  for (const Curve& curve : panel.curves)
    visit_x(curve, [&](const std::vector<double>& v) { all.insert(all.end(), v.begin(), v.end()); });
  return range_of(all);
}

Range data_range_y(const Panel& panel) {
  std::vector<double> all;
  for (const Curve& curve : panel.curves) {
    visit_y(curve, [&](const std::vector<double>& v) { all.insert(all.end(), v.begin(), v.end()); });
    if (curve.mark == Mark::kBars) all.push_back(0);
  }
  return range_of(all);
}

bool is_empty(const Figure& figure) {
  const auto drawable = [](const Panel& panel) {
    return std::any_of(panel.curves.begin(), panel.curves.end(), [](const Curve& curve) {
      return any_finite(curve.mark == Mark::kBand ? curve.low : curve.y);
    });
  };
  return figure.panels.empty() || !std::all_of(figure.panels.begin(), figure.panels.end(), drawable);
}

}  // namespace isac::report
