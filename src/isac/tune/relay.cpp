#include "isac/tune/relay.hpp"

#include <algorithm>
#include <cmath>

#include "isac/core/units.hpp"

namespace isac::tune {
namespace {

constexpr double kNoiseFactor = 4;  // ε over the scatter: a switch by noise alone once in 30 000 samples
constexpr double kEven = 0.08;      // two periods in a row differ by less
constexpr double kMostBias = 0.6;   // of the amplitude: the relay must still be able to pull back

}  // namespace

RelayExperiment::RelayExperiment(const ExperimentSettings& settings, const RelaySettings& relay)
    : Experiment(settings), relay_(relay) {}

double RelayExperiment::excite(double time, double angle) noexcept {
  const double e = angle - relay_.offset;
  if (!started_) {
    started_ = true;
    const double chosen = std::isfinite(relay_.hysteresis) ? relay_.hysteresis : kNoiseFactor * noise();
    hysteresis_ = std::max(chosen, relay_.least_hysteresis);
    went_up_ = time;
    up_ = true;
    low_ = high_ = e;
  }
  low_ = std::min(low_, e);
  high_ = std::max(high_, e);
  if (up_ && e > hysteresis_) {
    up_ = false;
    went_down_ = time;
  } else if (!up_ && e < -hysteresis_) {
    end_cycle(time);
    up_ = true;
    went_up_ = time;
    low_ = high_ = e;
  }
  return bias_ + (up_ ? relay_.amplitude : -relay_.amplitude);
}

void RelayExperiment::end_cycle(double time) noexcept {
  const double up = went_down_ - went_up_, down = time - went_down_, period = up + down;
  ++cycles_;
  const double swing = 0.5 * (high_ - low_);
  const double tilt = (up - down) / period;
  const bool even = cycles_ > 1 && std::abs(period - last_period_) < kEven * period && std::abs(tilt) < 0.2;
  last_period_ = period;
  even_ = even ? even_ + 1 : 0;
  const double share = even_ > 0 ? 1.0 / even_ : 1.0;
  period_ += share * (period - period_);
  swing_ += share * (swing - swing_);
  if (relay_.compensate_bias && even_ < relay_.cycles) {
    const double most = kMostBias * relay_.amplitude;
    bias_ = std::clamp(bias_ + 0.5 * relay_.amplitude * tilt, -most, most);
  }
  if (even_ >= relay_.cycles)
    finish();
  else if (cycles_ >= relay_.longest_cycles)
    fail(
        "the relay's cycles did not become even; friction or a load that changes may be the cause, or noise: "
        "raise the amplitude");
}

DescribingFunction RelayExperiment::describing_function() const noexcept {
  if (even_ == 0) return {};
  const double inside = swing_ * swing_ - hysteresis_ * hysteresis_;
  if (!(inside > 0)) return {};
  return {.gain = 4 * relay_.amplitude / (kPi * std::sqrt(inside)), .period = period_, .amplitude = swing_};
}

}  // namespace isac::tune
