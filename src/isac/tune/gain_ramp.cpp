#include "isac/tune/gain_ramp.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace isac::tune {
namespace {

constexpr double kNearEnough =
    -0.35;  // per period: the root is then 5 to 10 % away in gain, and the regression short
constexpr double kTurnNoiseFactor = 5;  // turning points count when they stand out this far
constexpr double kAgree = 0.25;  // the regression extrapolates over a few per cent of gain, but under noise
constexpr double kClear = 3;     // half swings over the threshold, so that noise does not hold them up
constexpr int kFewestTurns = 5;  // four half swings: two ratios

}  // namespace

GainRamp::GainRamp(const ExperimentSettings& settings, const GainRampSettings& ramp)
    : Experiment(settings), ramp_(ramp), gain_(ramp.first_gain), reference_(-ramp.kick) {}

double GainRamp::threshold() const noexcept {
  return std::max(kTurnNoiseFactor * noise(), 0.02 * ramp_.kick);
}

void GainRamp::begin_level(double time, double gain) noexcept {
  gain_ = gain;
  reference_ = -reference_;
  began_ = time;
  turns_ = 0;
  direction_ = reference_ > 0 ? 1 : -1;
  extreme_ = -direction_ * std::numeric_limits<double>::infinity();
  extreme_time_ = time;
}

/// A turning point is taken once the angle has come back from it by the threshold.
void GainRamp::watch(double time, double x) noexcept {
  if (direction_ * (x - extreme_) > 0) {
    extreme_ = x;
    extreme_time_ = time;
  } else if (direction_ * (extreme_ - x) > threshold() && turns_ < kMostTurns) {
    turn_[static_cast<std::size_t>(turns_)] = extreme_;
    turn_time_[static_cast<std::size_t>(turns_++)] = extreme_time_;
    direction_ = -direction_;
    extreme_ = x;
    extreme_time_ = time;
  }
}

double GainRamp::excite(double time, double angle) noexcept {
  if (!started_) {
    started_ = true;
    begin_level(time, ramp_.first_gain);
  }
  watch(time, angle);
  // Nothing turned for two of the last periods: the swing has died.
  const double quiet = turns_ >= 2 ? 4 * (turn_time_[static_cast<std::size_t>(turns_ - 1)] -
                                          turn_time_[static_cast<std::size_t>(turns_ - 2)])
                                   : ramp_.hold;
  const double last = turns_ > 0 ? turn_time_[static_cast<std::size_t>(turns_ - 1)] : began_;
  const bool enough = turns_ > std::min(ramp_.swings, kMostTurns - 1);
  if (enough || time - began_ > ramp_.hold || (turns_ >= 2 && time - last > quiet)) {
    end_level();
    if (finished()) return 0;
    begin_level(time, gain_);
  }
  return gain_ * (reference_ - angle);
}

void GainRamp::end_level() noexcept {
  RampLevel level{.gain = gain_};
  if (turns_ >= kFewestTurns) {
    // Half swings x_n between turning points; the first turn still carries the kick's own transient.
    double sum = 0;
    int ratios = 0;
    for (int n = 1; n + 3 < turns_; ++n) {
      const auto at = static_cast<std::size_t>(n);
      const double now = std::abs(turn_[at + 1] - turn_[at]), later = std::abs(turn_[at + 3] - turn_[at + 2]);
      if (!(std::min(now, later) > kClear * threshold())) continue;
      sum += std::log(later / now);
      ++ratios;
    }
    const auto end = static_cast<std::size_t>(turns_ - 1);
    level.period = 2 * (turn_time_[end] - turn_time_[1]) / (turns_ - 2);
    if (ratios > 0) level.growth = sum / ratios;
  }
  levels_[static_cast<std::size_t>(count_++)] = level;
  const std::optional<Ultimate> root = regressed();
  if (level.growth > kNearEnough && root) {
    finish();
    return;
  }
  if (count_ == kMostLevels) {
    fail(
        "the gain was changed twenty-four times and the joint never swung evenly; begin at another gain, or "
        "kick "
        "more");
    return;
  }
  if (level.growth > kNearEnough) {
    gain_ *= 0.85;  // the first that could be measured is near already: one more, below it
  } else {
    gain_ *= std::isfinite(level.growth) ? std::sqrt(ramp_.factor) : ramp_.factor;
    if (root && root->gain > level.gain)
      gain_ = std::min(gain_, level.gain + 0.6 * (root->gain - level.gain));
  }
}

std::optional<Ultimate> GainRamp::regressed() const noexcept {
  // The two levels nearest to the root: g(K) bends.
  const RampLevel *a = nullptr, *b = nullptr;
  for (int i = 0; i < count_; ++i) {
    const RampLevel& level = levels_[static_cast<std::size_t>(i)];
    if (!std::isfinite(level.growth)) continue;
    if (b == nullptr || std::abs(level.growth) < std::abs(b->growth)) {
      a = b;
      b = &level;
    } else if (a == nullptr || std::abs(level.growth) < std::abs(a->growth)) {
      a = &level;
    }
  }
  if (a == nullptr || !((b->growth - a->growth) * (b->gain - a->gain) > 0)) return {};
  const double share = -b->growth / (b->growth - a->growth);
  return Ultimate{b->gain + share * (b->gain - a->gain), b->period + share * (b->period - a->period)};
}

std::string second_opinion(const GainRamp& ramp, const Ultimate& fitted) {
  const std::optional<Ultimate> root = ramp.regressed();
  if (!root) return "no two levels of gain could be compared";
  const double gain = root->gain / fitted.gain - 1, period = root->period / fitted.period - 1;
  if (std::abs(gain) < kAgree && std::abs(period) < kAgree) return {};
  return fmt::format(
      "the growth of the swings and the plant fitted to them disagree by {:.0f} % in K_crit and {:.0f} % in "
      "T_crit; friction or a "
      "joint of another kind may be the cause",
      100 * gain, 100 * period);
}

}  // namespace isac::tune
