// A day by a written protocol: strokes all alike, sines and a chirp, levels out of a table, in a fixed order. It is
// poorer than the day in day.cpp, where every stroke is drawn, and its rig is another joint.
#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>

#include "day_parts.hpp"

namespace blind {
namespace {

constexpr double kTwoPi = 2.0 * std::numbers::pi;

/// There and back between ±1 in `period` seconds, every stroke like the last.
Reference equal_strokes(double period) {
  return [period](double t) { return 2.0 / std::numbers::pi * std::asin(std::sin(kTwoPi * t / period)); };
}

Reference sine(double frequency) {
  return [frequency](double t) { return std::sin(kTwoPi * frequency * t); };
}

/// Strokes that get shorter by a step after each turn, for loops within loops.
Reference nested(double period, double seconds) {
  return [period, seconds](double t) {
    const double turns = std::floor(t / period), all = std::max(1.0, std::floor(seconds / period));
    return (1.0 - 0.8 * std::min(1.0, turns / all)) * std::sin(kTwoPi * t / period);
  };
}

/// A sine whose frequency (Hz) grows evenly.
Reference chirp(double from, double to, double seconds) {
  return [from, to, seconds](double t) {
    return std::sin(kTwoPi * (from * t + 0.5 * (to - from) * t * t / seconds));
  };
}

class ProtocolDay {
 public:
  ProtocolDay(const Rig& rig, Random& random) : rig_(rig), random_(random) {}

  std::vector<RunPlan> plan() {
    const double low = rig_.p0 - 0.7, high = rig_.p0 + 0.7, push = random_.uniform(0.4, 0.7);
    const double rest = random_.uniform(10.0, 90.0);
    by_hand(equal_strokes(8.0), 0.0, low, 40.0);
    by_hand(equal_strokes(10.0), 0.0, rig_.p0, 40.0);
    by_hand(sine(0.3), push, rig_.p0 + 0.3, 35.0, true);
    by_hand(sine(random_.uniform(0.6, 0.9)), 0.0, high, 35.0);
    by_hand(nested(5.0, 45.0), -push, rig_.p0, 45.0);
    clamped(0.0, equal_strokes(20.0), rig_.p0, 40.0);
    clamped(-0.3, equal_strokes(9.0), rig_.p0 - 0.4, 30.0, true);
    clamped(0.35, levels({0.0, 1.2, -1.2, 1.2, 0.6, 0.0, -0.6, -1.2, 0.0, 1.2}, 4.0), rig_.p0, 40.0);
    free_moving(levels({0.0, 0.5, -0.5, 0.5, 0.0, 0.25, 0.5, 0.25, 0.0, -0.5, 0.0, 0.5}, 3.0), rig_.p0, 0.0,
                36.0);
    free_moving(multisine(random_, 0.1, 2.0, 6), rig_.p0 + 0.2, 0.0, 40.0, true);
    free_moving(chirp(0.1, 2.5, 40.0), low, 0.0, 40.0);
    free_moving([](double) { return 0.0; }, rig_.p0, 0.6 * random_.sign(), 8.0);
    free_moving([](double) { return 0.0; }, high, 0.5, 8.0);
    steps({1.0, 2.0, 3.0, 4.0, 3.0, 2.0, 1.0, 4.0, 1.0, 2.5, 2.0, 2.5, 3.0, 2.5, 1.0}, 40.0);
    steps({2.0, 3.5, 2.0, 1.5, 4.0, 1.5, 3.0, 2.8, 3.0, 2.0, 0.8, 4.2}, 30.0, true);
    by_hand(equal_strokes(6.0), 0.0, rig_.p0 - 0.2, 35.0, true);
    by_hand(equal_strokes(8.0), 0.0, low, 40.0);  // the first test again
    double clock = 0.0;
    for (std::size_t i = 0; i < runs_.size(); ++i) {
      runs_[i].started = clock;
      runs_[i].name = (i < 9 ? "test_0" : "test_") + std::to_string(i + 1);
      clock += std::ceil(runs_[i].rows() * kRowTime + rest);
    }
    return std::move(runs_);
  }

 private:
  RunPlan& begin(const char* experiment, bool heldout) {
    RunPlan run;
    run.experiment = experiment;
    run.heldout = heldout;
    runs_.push_back(std::move(run));
    return runs_.back();
  }

  void by_hand(const Reference& reference, double delta, double mean, double seconds, bool heldout = false) {
    RunPlan& run = begin("constant-pressure", heldout);
    follow(run, reference, 0.0, 0.8 * reach(rig_, delta, mean), rows_of(seconds));
    for (int k = 0; k < rows_of(seconds); ++k) command(run, delta, mean);
  }

  void clamped(double angle, const Reference& delta, double mean, double seconds, bool heldout = false) {
    RunPlan& run = begin("constant-angle", heldout);
    follow(
        run, [](double) { return 1.0; }, 0.0, angle, rows_of(seconds));
    for (int k = 0; k < rows_of(seconds); ++k) command(run, 1.3 * delta(k * kRowTime), mean);
  }

  /// The angle that the command asks for, 1 being 0.6 rad, or a release of a joint whose muscles are held.
  void free_moving(const Reference& angle, double mean, double released, double seconds,
                   bool heldout = false) {
    RunPlan& run = begin("free", heldout);
    run.free = true;
    run.release_angle = released;
    const double per_angle = std::min(-rig_.A * rig_.r / rig_.B, 1.3 / 0.6);
    if (released == 0.0) run.release_angle = 0.6 * angle(0.0) * per_angle * rig_.B / (-rig_.A * rig_.r);
    for (int k = 0; k < rows_of(seconds); ++k) command(run, 0.6 * per_angle * angle(k * kRowTime), mean);
  }

  void steps(const std::vector<double>& table, double seconds, bool heldout = false) {
    RunPlan& run = begin("pcu-step", heldout);
    follow(
        run, [](double) { return 0.0; }, 0.0, 0.0, rows_of(seconds));
    const double hold = seconds / static_cast<double>(table.size());
    std::vector<double> backwards;
    std::copy(table.rbegin(), table.rend(), std::back_inserter(backwards));
    const Reference one = levels(table, hold), two = levels(backwards, hold);
    command_each(run, one, two, rows_of(seconds));
  }

  const Rig& rig_;
  Random& random_;
  std::vector<RunPlan> runs_;
};

}  // namespace

Rig draw_other_rig(Random& random) {
  Rig rig;
  for (double* value : {&rig.A, &rig.B, &rig.C, &rig.D}) *value *= random.uniform(0.6, 1.4);
  rig.r = std::round(random.uniform(280.0, 500.0)) * 0.5e-4;  // a diameter of whole tenths of a millimetre
  rig.p0 = std::round(random.uniform(2.2, 3.2) * 10.0) / 10.0;
  rig.inertia *= random.log_uniform(0.6, 2.5);
  rig.T_C = random.log_uniform(0.07, 0.3);
  rig.K_C *= random.uniform(0.98, 1.02);
  return rig;
}

std::vector<RunPlan> draw_protocol_day(const Rig& rig, Random& random) {
  return ProtocolDay(rig, random).plan();
}

}  // namespace blind
