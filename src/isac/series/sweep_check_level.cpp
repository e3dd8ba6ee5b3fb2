#include <cmath>

#include "isac/core/units.hpp"
#include "isac/series/sweep_check_detail.hpp"

namespace isac::series::detail {
namespace {

std::string shown(const std::string& column, double value) {
  if (column[0] == 'F') return number("%.2f", value) + " N";
  if (column[0] == 'p') return number("%.3f", value / kPascalPerKgfCm2) + " kg/cm2";
  return number("%.4f", value) + " rad";
}

double deviation(std::span<const double> values) {
  const double average = mean(values);
  double square = 0.0, count = 0.0;
  for (const double value : values) {
    if (!std::isfinite(value)) continue;
    square += (value - average) * (value - average);
    count += 1.0;
  }
  return std::sqrt(square / std::max(1.0, count - 1.0));
}

/// Both halves show the same, and means over 50 ms (seed E.2.2) do not wander: a weight that swings does both wrong.
void check_rest(Sweep& sweep, const HeldSignal& held, std::span<const double> values) {
  const std::size_t half = values.size() / 2;
  const double drift = mean(values.subspan(half)) - mean(values.first(half));
  const auto window = std::max<std::size_t>(1, static_cast<std::size_t>(std::lround(0.05 / sweep.period)));
  std::vector<double> means;
  for (std::size_t i = 0; i + window <= values.size(); i += window)
    means.push_back(mean(values.subspan(i, window)));
  const double wander = means.size() < 2 ? 0.0 : deviation(means);
  if (!(std::abs(drift) > held.tolerance) && !(wander > 2.0 * held.tolerance)) return;
  sweep.remark("not_at_rest", held.column + " drifted by " + shown(held.column, drift) + " and wandered by " +
                                  shown(held.column, wander) + "; at most " +
                                  shown(held.column, held.tolerance) +
                                  " of drift will do; wait until it rests, and repeat");
}

void check_range(Sweep& sweep, const std::string& column, std::span<const double> values) {
  for (const SensorRange& range : sweep.expected.ranges) {
    if (range.column != column) continue;
    std::size_t at_end = 0;
    for (const double value : values) {
      if (value <= range.low + 0.5 * range.step || value >= range.high - 0.5 * range.step) ++at_end;
    }
    const double share = static_cast<double>(at_end) / static_cast<double>(values.size());
    if (share > 0.01) {
      sweep.remark("level_saturated",
                   column + " stood at an end of its converter's range in " + number("%.0f", 100.0 * share) +
                       " % of the samples; choose a smaller level or gain, or move the zero, and repeat");
    }
  }
}

}  // namespace

void check_level(Sweep& sweep) {
  constexpr double kShortest = 1.0;  // s: twenty averages of 50 ms
  if (sweep.verdict.facts.duration < kShortest - 0.5 * sweep.period) {
    sweep.remark("level_short", "the level was held for " + number("%.2f", sweep.verdict.facts.duration) +
                                    " s; its mean needs 1 s or more: repeat it with a longer --duration");
  }
  for (const HeldSignal& held : sweep.expected.held) {
    const std::span<const double> values(sweep.recording.column(held.column).values);
    sweep.verdict.facts.levels.push_back({held.column, mean(values), deviation(values)});
    check_rest(sweep, held, values);
    check_range(sweep, held.column, values);
  }
}

}  // namespace isac::series::detail
