#include <algorithm>
#include <array>
#include <cmath>

#include "isac/core/units.hpp"
#include "isac/series/sweep_check_detail.hpp"

namespace isac::series::detail {
namespace {

/// A counter that lost or won counts steps away from the line its neighbours draw; a moving joint does not,
/// because five samples before and after agree with it: |φ(i+1) − φ(i) − ½(v₋ + v₊) Δt| ≤ 8 counts + ½ v Δt.
void check_encoder(Sweep& sweep) {
  constexpr std::size_t kReach = 5;
  const double step =
      std::isfinite(sweep.expected.encoder_step) ? sweep.expected.encoder_step : 2.0 * kPi / 8000.0;
  const auto& time = sweep.time;
  const auto& angle = sweep.angle;
  int jumps = 0;
  double first = 0.0, largest = 0.0;
  for (std::size_t i = kReach; i + kReach + 1 < angle.size(); ++i) {
    const double interval = time[i + 1] - time[i];
    const double before = (angle[i] - angle[i - kReach]) / (time[i] - time[i - kReach]);
    const double after = (angle[i + 1 + kReach] - angle[i + 1]) / (time[i + 1 + kReach] - time[i + 1]);
    const double moved = angle[i + 1] - angle[i];
    const double innovation = std::abs(moved - 0.5 * (before + after) * interval);
    const double faster = std::max(std::abs(before), std::abs(after));
    const bool too_fast =
        std::abs(moved) > sweep.expected.highest_speed * interval + 2.0 * step;  // NaN: never
    if (!(innovation > 8.0 * step + 0.5 * faster * interval) && !too_fast) continue;
    if (jumps++ == 0) first = time[i + 1];
    largest = std::max(largest, std::abs(moved));
  }
  if (jumps > 0) {
    sweep.remark("encoder_jumped", "the encoder jumped " + std::to_string(jumps) +
                                       (jumps == 1 ? " time" : " times") + ", by up to " +
                                       number("%.3g", largest) + " rad within one sample, first at " +
                                       number("%.2f", first) +
                                       " s; check its cable and coupling, set its middle anew, and repeat");
  }
}

void check_angle_range(Sweep& sweep) {
  const double wanted =
      2.0 * 0.7 * sweep.expected.amplitude;  // a hand turns round a little before the end, sometimes
  const std::vector<double> angle(sweep.angle.begin(), sweep.angle.end());
  const double moved = quantile(angle, 0.995) - quantile(angle, 0.005);
  if (!(moved < wanted)) return;
  sweep.remark("angle_range_small", "the bar moved over " + in_degrees(moved) +
                                        " degrees only, but at least " + in_degrees(wanted) +
                                        " are needed; repeat it from end to end");
}

/// Every eighth of the speed range but the topmost, both ways, must hold a thousandth of the samples.
void check_all_speeds(Sweep& sweep) {
  constexpr int kBins = 8;
  std::array<std::array<std::size_t, kBins>, 2> seen{};
  const double width = sweep.expected.speed / kBins;
  for (const double speed : sweep.speed) {
    if (!std::isfinite(speed)) continue;
    const int bin = static_cast<int>(std::min(std::abs(speed) / width, 1000.0));
    if (bin < kBins) ++seen[speed < 0.0 ? 1 : 0][static_cast<std::size_t>(bin)];
  }
  const double least = 1e-3 * static_cast<double>(sweep.speed.size());
  std::string lacking;
  for (std::size_t way = 0; way < 2; ++way) {
    for (std::size_t bin = 0; bin + 1 < kBins; ++bin) {
      if (static_cast<double>(seen[way][bin]) >= least) continue;
      lacking += (lacking.empty() ? "" : ", ") + number("%.2g", width * static_cast<double>(bin)) + " to " +
                 number("%.2g", width * static_cast<double>(bin + 1)) + (way == 0 ? " forward" : " backward");
    }
  }
  if (lacking.empty()) return;
  sweep.remark("speeds_missing",
               "too few samples at speeds of " + lacking +
                   " rad/s; repeat it and vary the speed from very slow to as fast as you can");
}

void check_speed(Sweep& sweep) {
  const double asked = sweep.expected.speed;
  if (!(asked > 0.0)) return;
  const double forward = sweep.verdict.facts.speed_forward, backward = sweep.verdict.facts.speed_backward;
  if (std::min(forward, backward) < 0.2 * std::max(forward, backward)) {
    sweep.remark("one_direction", "the bar moved at up to " + number("%.2f", forward) +
                                      " rad/s forward but " + number("%.2f", backward) +
                                      " rad/s backward; repeat it with the same speed both ways");
    return;
  }
  if (sweep.expected.all_speeds) {
    check_all_speeds(sweep);
    return;
  }
  // A hand reaches its peak speed only for a moment: three quarters of it, kept for one sample in a hundred.
  const double needed = (sweep.expected.slow ? 0.5 : 0.75) * asked;
  if (std::min(forward, backward) < needed) {
    sweep.remark("speed_too_low", "the speed reached " + number("%.2f", std::min(forward, backward)) +
                                      " of " + number("%.2f", asked) + " rad/s (" +
                                      (forward < backward ? "forward" : "backward") + "); at least " +
                                      number("%.2f", needed) + " rad/s are needed, so repeat it faster");
  }
  // Quasi-static: at 2.5 times 0.1π rad/s the testbed's damping is still 0.11 N m, the accuracy of its torque
  // (seed 3.4).
  const double typical = std::max(quantile(sweep.speed, 0.95), -quantile(sweep.speed, 0.05));
  if (sweep.expected.slow && typical > 2.5 * asked) {
    sweep.remark("speed_too_high", "a slow sweep was asked for at " + number("%.2f", asked) +
                                       " rad/s, but the bar moved at " + number("%.2f", typical) +
                                       " rad/s; repeat it more slowly");
  }
}

void check_clamp(Sweep& sweep) {
  if (!sweep.expected.clamped) return;
  const std::vector<double> angle(sweep.angle.begin(), sweep.angle.end());
  const double moved = quantile(angle, 0.995) - quantile(angle, 0.005);
  constexpr double kPlay =
      0.03;  // rad; A r² φ of the testbed is then 0.25 N m, what a bar gives between clamp and wheel
  if (moved > kPlay) {
    sweep.remark("clamp_slipped", "the clamped bar moved by " + number("%.3f", moved) + " rad, more than " +
                                      number("%.2f", kPlay) + " rad; tighten the clamp and repeat");
  }
}

void check_free_motion(Sweep& sweep) {
  const double moved = sweep.verdict.facts.angle_high - sweep.verdict.facts.angle_low;
  if (moved < sweep.expected.moved_by_muscles) {
    sweep.remark("joint_did_not_move", "the muscles moved the bar by only " + number("%.3f", moved) +
                                           " rad of at least " +
                                           number("%.2f", sweep.expected.moved_by_muscles) +
                                           " rad; take the clamp off, check the air supply, and repeat");
  }
}

void check_poses(Sweep& sweep) {
  std::string lacking;
  for (const double pose : sweep.expected.poses) {
    double held = 0.0;
    for (std::size_t i = 0; i < sweep.angle.size(); ++i) {
      if (std::abs(sweep.angle[i] - pose) < 0.1 && std::abs(sweep.speed[i]) < 0.05) held += sweep.period;
    }
    if (held < 1.0) lacking += (lacking.empty() ? "" : ", ") + in_degrees(pose);
  }
  if (!lacking.empty()) {
    sweep.remark("pose_missing", "the bar was not held still for one second within 6 degrees of " + lacking +
                                     " degrees; repeat it and hold these");
  }
}

}  // namespace

void check_motion(Sweep& sweep) {
  check_encoder(sweep);
  check_angle_range(sweep);
  check_speed(sweep);
  check_clamp(sweep);
  check_free_motion(sweep);
  check_poses(sweep);
}

}  // namespace isac::series::detail
