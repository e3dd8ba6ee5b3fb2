#include "isac/tune/experiment.hpp"

#include <algorithm>
#include <cmath>

namespace isac::tune {

Experiment::Experiment(const ExperimentSettings& settings)
    : settings_(settings), last_command_(settings.centre) {
  // Ticks may come a little faster than said; a record that is full ends the experiment rather than grow.
  const auto rows = static_cast<std::size_t>(1.1 * settings.longest / settings.interval) + 16;
  for (auto* column : {&record_.time, &record_.command, &record_.angle}) column->reserve(rows);
}

double Experiment::step(double time, double angle) noexcept {
  if (finished()) return settings_.centre;
  if (!std::isfinite(time) || !std::isfinite(angle)) {
    fail("the card gave a value that is not a number");
    return settings_.centre;
  }
  const bool first = record_.time.empty();
  if (first) first_time_ = time;
  if (!first && !(time > last_time_)) return last_command_;  // a clock that stands still is no new tick
  last_time_ = time;
  if (record_.time.size() == record_.time.capacity() || time - first_time_ > settings_.longest) {
    fail("it did not come to its end in the time it was given; allow a longer one or excite more");
    return settings_.centre;
  }
  double wanted = 0;
  if (state_ == State::kSettle) settle(time, angle);
  if (state_ == State::kExcite) wanted = excite(time - excite_from_, angle - rest_angle_);
  if (!std::isfinite(wanted)) fail("the experiment lost its numbers");
  if (finished()) wanted = 0;
  last_command_ = settings_.centre + std::clamp(wanted, -settings_.reach, settings_.reach);
  record_.time.push_back(time - first_time_);
  record_.command.push_back(last_command_);
  record_.angle.push_back(angle);
  return last_command_;
}

void Experiment::settle(double time, double angle) noexcept {
  const double since = time - first_time_;
  if (since >= settings_.settle) {
    if (count_ < 2) {
      fail("the card gave too few samples to settle on");
      return;
    }
    rest_angle_ = shift_ + sum_ / count_;
    noise_ = std::sqrt(std::max(0.0, (squares_ - sum_ * sum_ / count_) / (count_ - 1)));
    state_ = State::kExcite;
    excite_from_ = time;
    excite_row_ = record_.time.size();
    return;
  }
  if (since < 0.5 * settings_.settle) return;  // the first half is for coming to rest
  if (count_ == 0) shift_ = angle;
  const double d = angle - shift_;
  sum_ += d;
  squares_ += d * d;
  count_ += 1;
}

ExperimentRecord Experiment::excited() const {
  const std::size_t before = std::min<std::size_t>(excite_row_, 20);  // rows at rest: the offset's
  const auto from = static_cast<std::ptrdiff_t>(excite_row_ - before);
  ExperimentRecord out;
  out.time.assign(record_.time.begin() + from, record_.time.end());
  out.command.assign(record_.command.begin() + from, record_.command.end());
  out.angle.assign(record_.angle.begin() + from, record_.angle.end());
  return out;
}

}  // namespace isac::tune
