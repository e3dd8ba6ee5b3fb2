#include <algorithm>
#include <cmath>

#include "day_parts.hpp"

namespace blind {
namespace {

class Day {
 public:
  Day(const Rig& rig, Random& random) : rig_(rig), random_(random) {}

  std::vector<RunPlan> plan() {
    const double low = 2.2 + random_.uniform(-0.1, 0.2), high = 3.7 + random_.uniform(-0.1, 0.2);
    sweep(0.0, rig_.p0, 0.15, 0.4, 50.0);
    sweep(random_.uniform(0.5, 0.9), rig_.p0, 1.0, 4.5, 40.0);
    bundle(-random_.uniform(0.5, 0.9), high, 45.0);
    bundle(random_.uniform(0.1, 0.4), low, 45.0);
    clamped(random_.uniform(-0.1, 0.1), 45.0);
    clamped(random_.sign() * random_.uniform(0.3, 0.6), 40.0);
    free_moving(1.0, 45.0);
    free_moving(0.7, 35.0);
    release(15.0);
    steps(40.0);
    const std::size_t fitted = runs_.size();
    bundle(random_.uniform(-0.5, -0.2), random_.uniform(2.6, 3.4), 45.0);
    sweep(random_.uniform(-0.9, 0.9), random_.uniform(2.4, 3.6), 0.5, 3.0, 40.0);
    clamped(random_.uniform(-0.4, 0.4), 40.0);
    free_moving(0.85, 45.0);
    steps(35.0);
    for (std::size_t i = fitted; i < runs_.size(); ++i) runs_[i].heldout = true;
    order();
    return std::move(runs_);
  }

 private:
  RunPlan& begin(const char* experiment) {
    RunPlan run;
    run.experiment = experiment;
    runs_.push_back(std::move(run));
    return runs_.back();
  }

  void hand(RunPlan& run, const Reference& reference, double delta, double mean, double share,
            double seconds) {
    follow(run, reference, 0.0, share * reach(rig_, delta, mean), rows_of(seconds));
    for (int k = 0; k < rows_of(seconds); ++k) command(run, delta, mean);
  }

  void sweep(double delta, double mean, double slow, double fast, double seconds) {
    hand(begin("constant-pressure"), triangle(random_, slow, fast, seconds), delta, mean,
         random_.uniform(0.8, 1.0), seconds);
  }

  void bundle(double delta, double mean, double seconds) {
    const Reference slow = triangle(random_, 0.2, 1.5, seconds), fast = multisine(random_, 0.1, 1.4, 6);
    hand(
        begin("constant-pressure"), [slow, fast](double t) { return 0.4 * slow(t) + 0.5 * fast(t); }, delta,
        mean, random_.uniform(0.85, 1.0), seconds);
  }

  std::vector<double> drawn_levels(double low, double high, int count) {
    std::vector<double> values;
    for (int i = 0; i < count; ++i) values.push_back(random_.uniform(low, high));
    return values;
  }

  void clamped(double angle, double seconds) {
    RunPlan& run = begin("constant-angle");
    follow(
        run, [](double) { return 1.0; }, 0.0, angle, rows_of(seconds));
    const Reference wave = multisine(random_, 0.08, 1.0, 5);
    const Reference stair = levels(drawn_levels(-1.7, 1.7, 20), random_.uniform(1.6, 2.4));
    const Reference means = levels(drawn_levels(2.0, 3.6, 8), seconds / 7.0);
    for (int k = 0; k < rows_of(seconds); ++k) {
      const double t = k * kRowTime;
      command(run, t < 0.5 * seconds ? 1.8 * wave(t) : stair(t - 0.5 * seconds), means(t));
    }
  }

  void free_moving(double size, double seconds) {
    RunPlan& run = begin("free");
    run.free = true;
    const Reference wave = multisine(random_, 0.1, 3.0, 7);
    const Reference stair = levels(drawn_levels(-1.6, 1.6, 16), random_.uniform(1.4, 2.0));
    const Reference means = levels(drawn_levels(2.3, 3.5, 5), seconds / 4.0);
    const double at_rest = -rig_.B * rig_.r * size * (wave(0.0) * 1.5) / (rig_.A * rig_.r * rig_.r);
    run.release_angle = at_rest + random_.sign() * random_.uniform(0.3, 0.6);
    for (int k = 0; k < rows_of(seconds); ++k) {
      const double t = k * kRowTime;
      command(run, size * (t < 0.6 * seconds ? 1.5 * wave(t) : stair(t - 0.6 * seconds)), means(t));
    }
  }

  void release(double seconds) {
    RunPlan& run = begin("free");
    run.free = true;
    run.release_angle = random_.sign() * random_.uniform(0.7, 0.95);
    const double mean = random_.uniform(2.4, 3.6);
    const Reference stair = levels(drawn_levels(-1.0, 1.0, 4), 5.0);
    for (int k = 0; k < rows_of(seconds); ++k)
      command(run, k * kRowTime < 5.0 ? 0.0 : stair(k * kRowTime - 5.0), mean);
  }

  void steps(double seconds) {
    RunPlan& run = begin("pcu-step");
    follow(
        run, [](double) { return 1.0; }, 0.0, random_.uniform(-0.05, 0.05), rows_of(seconds));
    const double hold = random_.uniform(1.4, 1.8);
    const auto count = static_cast<int>(seconds / hold) + 1;
    std::vector<double> first, second;
    for (int i = 0; i < count; ++i) {
      // Small and large ones, to low and to high levels, one valve at a time or both.
      const double size = i % 3 == 0 ? random_.uniform(0.1, 0.4) : random_.uniform(0.8, 3.5);
      const auto step = [&](const std::vector<double>& past) {
        const double from = past.empty() ? 3.0 : past.back();
        const double up = from + size, down = from - size;
        const bool rise = up <= 4.9 && (down < 0.15 || random_.uniform() < 0.5);
        return rise ? up : std::max(0.15, down);
      };
      const int which = random_.index(3);
      first.push_back(which == 1 && i > 0 ? first.back() : step(first));
      second.push_back(which == 2 && i > 0 ? second.back() : step(second));
    }
    const Reference one = levels(first, hold), two = levels(second, hold);
    command_each(run, one, two, rows_of(seconds));
  }

  /// The order in which the runs were recorded is drawn; between two runs the rig rests 20 to 60 s.
  void order() {
    for (std::size_t i = runs_.size() - 1; i > 0; --i)
      std::swap(runs_[i], runs_[static_cast<std::size_t>(random_.index(static_cast<int>(i) + 1))]);
    double clock = 0.0;
    for (std::size_t i = 0; i < runs_.size(); ++i) {
      runs_[i].started = clock;
      runs_[i].name = (i < 9 ? "run_0" : "run_") + std::to_string(i + 1);
      clock += std::ceil(runs_[i].rows() * kRowTime + random_.uniform(20.0, 60.0));
    }
  }

  const Rig& rig_;
  Random& random_;
  std::vector<RunPlan> runs_;
};

}  // namespace

Rig draw_rig(Random& random) {
  Rig rig;
  for (double* value : {&rig.A, &rig.B, &rig.C, &rig.D, &rig.inertia, &rig.T_C})
    *value *= random.uniform(0.7, 1.3);
  rig.K_C *= random.uniform(0.97, 1.03);
  return rig;
}

std::vector<RunPlan> draw_day(const Rig& rig, Random& random) {
  return Day(rig, random).plan();
}

}  // namespace blind
