#include "isac/explain/prepared.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <ctime>
#include <map>
#include <utility>

#include "isac/core/error.hpp"
#include "isac/core/units.hpp"
#include "isac/explain/encoder_motion.hpp"
#include "isac/explain/filters.hpp"
#include "isac/series/derive.hpp"
#include "isac/series/differentiate.hpp"
#include "isac/series/statistics.hpp"

namespace isac::explain {
namespace {

constexpr double kRowRate = 125;         // Hz: beyond it the kernel has left nothing
constexpr double kTurningWindow = 0.08;  // s to either side
constexpr double kSlack = 2.0,
                 kCarries = 20.0;  // N: a sensor that carries this much as a rule and reads less hangs slack
constexpr double kRestingKernel = 0.15;  // s, for pressures that rest
// A led joint's direction is untold where fewer encoder steps than these lie within ± the window, for longer than a turn takes; and beside that
// up to kBeside times as many. Of longer stands the first and the last kUntold are.
constexpr double kTellWindow = 0.05, kFewSteps = 2.5, kBeside = 2, kSlowTurn = 0.1, kUntold = 0.5;  // s
constexpr double kMoreThanAFew = 0.03;     // of a run
constexpr double kPressureSettling = 0.4;  // s at the start of a run in which p(0) is still felt

/// Does what reads less than kSlack lie where nothing pulls? A reading that goes on falling below zero is one of a sensor that is pushed.
bool hangs_slack(const std::vector<double>& force) {
  std::vector<double> low;
  std::copy_if(force.begin(), force.end(), std::back_inserter(low), [](double f) { return f < kSlack; });
  return !low.empty() && series::median(low) - series::quantile(low, 0.05) < kSlack;
}

double parse_iso8601(const std::string& text) {
  std::tm tm{};
  double seconds = 0;
  if (std::sscanf(text.c_str(), "%d-%d-%dT%d:%d:%lf", &tm.tm_year, &tm.tm_mon, &tm.tm_mday, &tm.tm_hour,
                  &tm.tm_min, &seconds) != 6)
    return std::nan("");
  tm.tm_year -= 1900;
  tm.tm_mon -= 1;
  return static_cast<double>(timegm(&tm)) + seconds;
}

/// Values on the even grid; short gaps are bridged and marked.
std::vector<double> on_grid(const std::vector<double>& time, const std::vector<double>& x,
                            const std::vector<double>& grid, std::vector<unsigned char>* usable) {
  std::vector<double> out(grid.size(), std::nan(""));
  std::size_t i = 0;
  std::vector<std::size_t> known;
  known.reserve(x.size());
  for (std::size_t k = 0; k < x.size(); ++k)
    if (std::isfinite(x[k])) known.push_back(k);
  if (known.size() < 2) return {};
  const double interval = grid.size() > 1 ? grid[1] - grid[0] : 1;
  for (std::size_t k = 0; k < grid.size(); ++k) {
    const double t = grid[k];
    while (i + 2 < known.size() && time[known[i + 1]] < t) ++i;
    const double t0 = time[known[i]], t1 = time[known[i + 1]];
    const double share = std::clamp((t - t0) / (t1 - t0), 0.0, 1.0);
    out[k] = (1 - share) * x[known[i]] + share * x[known[i + 1]];
    if (usable != nullptr && t1 - t0 > 2.5 * interval) (*usable)[k] = 0;
  }
  return out;
}

const std::vector<double>* values_of(const series::Recording& run, const char* name) {
  const series::Column* column = run.find(name);
  return column == nullptr ? nullptr : &column->values;
}

/// Pressure at the start of a run. A valve that does not answer small errors keeps it for good, so the noise of one reading will not do:
/// p = c₀ + c₁ e^(−t/T) while the command stands still, c₁ only where it is far more than the readings' scatter: slow noise begins anywhere. Up to 20 s
/// are read where the first two are like the others, by the scatter of means of two; else those two, for a leak moves it within the dead band.
double first_pressure(const std::vector<double>& pressure, const std::vector<double>& command,
                      double interval) {
  constexpr double kLongest = 20.0, kFirst = 2.0, kShortest = 0.3, kLag = 0.17;  // s
  constexpr double kFarMore = 5, kUnlike = 3;                                    // deviations
  std::size_t n = 0;
  while (n < pressure.size() && static_cast<double>(n) * interval < kLongest && command[n] == command[0]) ++n;
  if (static_cast<double>(n) * interval < kShortest) return pressure.front();
  const auto first = static_cast<std::size_t>(kFirst / interval);
  if (n < 4 * first) n = std::min(n, first);
  if (n > first) {
    std::vector<double> mean;
    for (std::size_t k = 0; k + first <= n; k += first) {
      double sum = 0;
      for (std::size_t j = k; j < k + first; ++j) sum += pressure[j] - pressure[0];
      mean.push_back(sum / static_cast<double>(first));
    }
    double all = 0, squares = 0;
    const double others = static_cast<double>(mean.size() - 1);
    for (std::size_t b = 1; b < mean.size(); ++b) all += mean[b] / others;
    for (std::size_t b = 1; b < mean.size(); ++b) squares += (mean[b] - all) * (mean[b] - all);
    if (std::abs(mean[0] - all) > kUnlike * std::sqrt(squares / (others - 1))) n = first;
  }
  double s1 = 0, sg = 0, sgg = 0, sp = 0, sgp = 0, spp = 0;
  for (std::size_t k = 0; k < n; ++k) {
    const double g = std::exp(-(static_cast<double>(k) * interval) / kLag), p = pressure[k] - pressure[0];
    s1 += 1, sg += g, sgg += g * g, sp += p, sgp += g * p, spp += p * p;
  }
  const double det = s1 * sgg - sg * sg, c1 = (s1 * sgp - sg * sp) / det, c0 = (sp - c1 * sg) / s1;
  const double scatter = std::sqrt(std::max(0.0, spp - c0 * sp - c1 * sgp) / s1);
  return pressure[0] + (std::abs(c1) > kFarMore * scatter ? c0 + c1 : sp / s1);
}

/// A joint that is led slowly through its turns is, for a while, where nobody can tell whether it goes on, stands or trembles: its dry friction
/// may have either sign. Such moments, up to kUntold from motion, do not count in the torque of a run in which they are more than a few. (Where
/// a joint stands for longer it stays: its creep is seen there.)
void leave_out_slow_turns(PreparedRun& run, double angle_step) {
  const std::vector<double>& angle = run.raw_angle;
  const std::size_t n = angle.size();
  if (!(std::isfinite(angle_step) && angle_step > 0) || n == 0) return;
  const auto samples = [&](double seconds) { return static_cast<std::size_t>(seconds / run.interval); };
  const std::size_t half = samples(kTellWindow), least = samples(kSlowTurn), reach = samples(kUntold);
  const auto steps = [&](std::size_t k) {
    return std::abs(angle[std::min(n - 1, k + half)] - angle[k - std::min(k, half)]) / angle_step;
  };
  std::vector<std::size_t> untold;
  for (std::size_t k = 0; k < n;) {
    if (steps(k) > kFewSteps) {
      ++k;
      continue;
    }
    std::size_t from = k;
    while (k < n && steps(k) <= kFewSteps) ++k;
    std::size_t to = k;
    if (to - from < least) continue;
    while (from > 0 && steps(from - 1) <= kBeside * kFewSteps) --from;
    while (to < n && steps(to) <= kBeside * kFewSteps) ++to;
    for (std::size_t j = from; j < to; ++j)
      if ((from > 0 && j - from < reach) || (to < n && to - j <= reach)) untold.push_back(j);
  }
  if (static_cast<double>(untold.size()) < kMoreThanAFew * static_cast<double>(n)) return;
  for (const std::size_t j : untold) run.loaded[j] = 0;
  run.untold = static_cast<double>(untold.size()) * run.interval;
}

/// Weights of samples 0 … m that make the slope at the first of the parabola through them, per sample.
Eigen::VectorXd slope_at_first(Eigen::Index m) {
  Eigen::MatrixX3d powers(m + 1, 3);
  for (Eigen::Index i = 0; i <= m; ++i) {
    const auto x = static_cast<double>(i);
    powers.row(i) << 1, x, x * x;
  }
  return powers * Eigen::Matrix3d(powers.transpose() * powers).inverse().col(1);
}

/// J Δt/12 at samples at which a command jumps, of a torque whose slope jumps by J there; J is read off 40 ms on both sides.
std::vector<double> bends_of(const PreparedRun& run) {
  constexpr double kJump =
      0.1 * kPascalPerKgfCm2;     // what is less bends less than a hundredth of a row's noise
  constexpr double kSide = 0.04;  // s
  const std::size_t n = run.torque.size();
  std::vector<std::size_t> jumps;
  for (std::size_t k = 1; k < n; ++k)
    if (std::max(std::abs(run.command[0][k] - run.command[0][k - 1]),
                 std::abs(run.command[1][k] - run.command[1][k - 1])) >= kJump)
      jumps.push_back(k);
  const auto side = static_cast<std::size_t>(std::max(5.0, std::round(kSide / run.interval)));
  const Eigen::VectorXd slope = slope_at_first(static_cast<Eigen::Index>(side));
  std::vector<double> bends(n, 0.0);
  for (std::size_t j = 0; j < jumps.size(); ++j) {
    const std::size_t k = jumps[j];
    // What bends twice is not read.
    if (k < side || k + side >= n || (j > 0 && k - jumps[j - 1] <= side) ||
        (j + 1 < jumps.size() && jumps[j + 1] - k <= side))
      continue;
    for (std::size_t i = 0; i <= side; ++i)
      bends[k] += slope[static_cast<Eigen::Index>(i)] * (run.torque[k + i] + run.torque[k - i]) / 12;
  }
  return bends;
}

PreparedRun prepare_run(const series::Recording& recording, const RigFacts& rig,
                        const BaselineModel& baseline, const Smoothing& smoothing) {
  PreparedRun run;
  run.name = recording.source.substr(recording.source.find_last_of('/') + 1);
  run.sha256 = recording.sha256;
  run.experiment = recording.meta("experiment");
  run.is_free = run.experiment == "free" || run.experiment == "closed-loop";
  const std::vector<double>& time = recording.column("time").values;
  if (time.size() < 100) return run;
  const double middle = series::median_interval(time);
  const auto n = static_cast<std::size_t>(std::floor((time.back() - time.front()) / middle + 1.5));
  if (n < 100 || n > 100 * time.size()) return run;
  // A clock that keeps its step within a quarter of it needs no resampling. Where it is read with some scatter, its mean step is better known
  // than its middle one, and φ̈ needs it twice.
  const double mean = (time.back() - time.front()) / static_cast<double>(n - 1);
  bool even = n == time.size();
  for (std::size_t k = 0; even && k < n; ++k)
    even = std::abs(time[k] - time.front() - static_cast<double>(k) * mean) < 0.25 * mean;
  const double dt = even ? mean : middle;
  run.interval = dt;
  run.time.resize(n);
  for (std::size_t k = 0; k < n; ++k)
    run.time[k] = even ? time[k] - time.front() : static_cast<double>(k) * dt;
  std::vector<double> absolute(n);
  for (std::size_t k = 0; k < n; ++k) absolute[k] = even ? time[k] : time.front() + run.time[k];
  run.usable.assign(n, 1);
  const auto take = [&](const char* name) -> std::vector<double> {
    const std::vector<double>* x = values_of(recording, name);
    if (x == nullptr) return {};
    if (even && std::all_of(x->begin(), x->end(), [](double v) { return std::isfinite(v); })) return *x;
    return on_grid(time, *x, absolute, &run.usable);
  };
  run.raw_angle = take(baseline.position.c_str());
  const double sigma = smoothing.torque / dt;
  if (!run.raw_angle.empty()) {
    run.angle = low_pass(run.raw_angle, sigma);
    const std::vector<double> velocity = low_pass_derivative(run.raw_angle, sigma, dt, 1);
    run.velocity = quiet_velocity(run.raw_angle, sigma, dt, rig.angle_step);
    hush_beats(run.raw_angle, dt, rig.angle_step, run.angle, run.velocity);
    run.acceleration = low_pass_derivative(run.raw_angle, sigma, dt, 2);
    run.dry_velocity = dry_velocity(run.raw_angle, velocity, dt, rig.angle_step);
  }
  std::vector<double> p1 = take("p1"), p2 = take("p2");
  if (!p1.empty() && !p2.empty()) {
    run.has_pressure = true;
    run.raw_pressure[0] = std::move(p1);
    run.raw_pressure[1] = std::move(p2);
    for (int i = 0; i < 2; ++i) {
      const std::vector<double>* raw[] = {&run.raw_pressure[i]};
      run.smooth_pressure[i] = low_pass(run.raw_pressure[i], sigma);
      run.pressure[i] =
          quieten(run.raw_pressure[i], run.smooth_pressure[i], sigma, kRestingKernel / dt, white_noise(raw));
    }
  }
  run.command[0] = take("p1_cmd");
  run.command[1] = take("p2_cmd");
  run.has_command = run.has_pressure && !run.command[0].empty() && !run.command[1].empty();
  for (int i = 0; i < 2 && run.has_command; ++i)
    run.first_pressure[i] = first_pressure(run.raw_pressure[i], run.command[i], dt);
  const bool joint = baseline.terms.empty() || baseline.output == "torque";
  if (joint) {
    run.force[0] = take("F1");
    run.force[1] = take("F2");
    if (run.force[0].empty() || run.force[1].empty()) run.force[0] = run.force[1] = {};
    run.common_force = run.force[0];
    for (std::size_t k = 0; k < run.common_force.size(); ++k)
      run.common_force[k] = 0.5 * (run.force[0][k] + run.force[1][k]);
    if (!run.common_force.empty()) run.common_force = low_pass(run.common_force, sigma);
  }
  if (!run.force[0].empty() && std::isfinite(rig.wheel_radius)) {
    run.torque = series::torque_from_forces(run.force[0], run.force[1], rig.wheel_radius);
  } else {
    run.torque = take(baseline.output.c_str());
  }
  run.has_torque = !run.torque.empty() && !run.angle.empty();
  if (run.has_torque) {
    run.smooth_torque = low_pass(run.torque, sigma);
    // A force amplifier of known lag: T = y + T_f ẏ.
    const double lag = std::isfinite(rig.force_lag) && joint ? rig.force_lag : 0.0;
    const auto undo_lag = [&](std::vector<double>& smooth, double width) {
      if (!(lag > 0)) return;
      const std::vector<double> rate = low_pass_derivative(run.torque, width, dt, 1);
      for (std::size_t k = 0; k < smooth.size(); ++k) smooth[k] += lag * rate[k];
    };
    undo_lag(run.smooth_torque, sigma);
    if (run.is_free) {
      run.slow_torque = low_pass(run.torque, smoothing.motion / dt);
      undo_lag(run.slow_torque, smoothing.motion / dt);
      run.slow_acceleration = quiet_acceleration(run.raw_angle, smoothing.motion / dt, dt, rig.angle_step);
      run.swing = quiet_motion(run.raw_angle, sigma, dt, rig.angle_step);
      if (run.has_command) run.slow_torque_error = low_pass(bends_of(run), smoothing.motion / dt);
    }
  }
  // Rows beside gaps and edges see through the kernel what is not there.
  const auto reach = static_cast<std::size_t>(std::ceil(kKernelReach * smoothing.motion / dt));
  std::vector<unsigned char> usable = run.usable;
  for (std::size_t k = 0; k < n; ++k) {
    if (run.usable[k] != 0 && k >= reach && k + reach < n) continue;
    const std::size_t from = run.usable[k] != 0 ? k : k - std::min(k, reach);
    const std::size_t to = run.usable[k] != 0 ? k + 1 : std::min(n, k + reach + 1);
    for (std::size_t i = from; i < to; ++i) usable[i] = 0;
  }
  run.usable = std::move(usable);
  run.loaded = run.usable;
  for (const auto& force : run.force) {
    if (force.empty() || !(series::median(force) > kCarries) || !hangs_slack(force)) continue;
    for (std::size_t k = 0; k < n; ++k) {
      if (force[k] >= kSlack) continue;
      for (std::size_t i = k - std::min(k, reach); i < std::min(n, k + reach + 1); ++i) run.loaded[i] = 0;
    }
  }
  if (!run.is_free) leave_out_slow_turns(run, rig.angle_step);
  return run;
}

void add_rows(Prepared& data) {
  data.rows.clear();
  data.run_begin.assign(1, 0);
  const bool seed = data.baseline.terms.empty();
  // A free joint moves by its own noise: the torque's disturbance stands in the angle too, and a fit of one by the other
  // is biased. Where hand-driven and clamped runs suffice, free runs speak by their balance of motion only.
  double driven = 0, all = 0;
  for (const PreparedRun& run : data.runs) {
    if (!run.has_torque || run.time.empty() || !run.has_pressure) continue;
    all += run.time.back();
    if (!run.is_free) driven += run.time.back();
  }
  const bool driven_enough = seed && !data.with_free_torque && driven >= 0.4 * all;
  for (std::size_t r = 0; r < data.runs.size(); ++r) {
    const PreparedRun& run = data.runs[r];
    const auto stride = static_cast<std::size_t>(data.stride);
    const auto put = [&](Chain chain, bool there, double skip, std::size_t step) {
      if (!there) return;
      const std::vector<unsigned char>& fit =
          chain == Chain::kTorque || chain == Chain::kMotion ? run.loaded : run.usable;
      const bool moving_only =
          chain == Chain::kMotion || (chain == Chain::kTorque && run.is_free && data.with_free_torque);
      for (std::size_t k = 0; k < run.time.size(); k += step)
        // A joint that rests is held by any friction it has: its balance tells nothing there. And it rests anywhere within a step of
        // the encoder, as far off in torque as a zero wanders.
        if (fit[k] != 0 && run.time[k] >= skip && (!moving_only || run.dry_velocity[k] != 0))
          data.rows.push_back({.run = static_cast<unsigned>(r),
                               .sample = static_cast<unsigned>(k),
                               .atom = 0,
                               .block = 0,
                               .chain = chain});
    };
    put(Chain::kTorque, run.has_torque && (!seed || run.has_pressure) && (!run.is_free || !driven_enough), 0,
        stride);
    put(Chain::kPressure1, seed && run.has_command, kPressureSettling, 2 * stride);
    put(Chain::kPressure2, seed && run.has_command, kPressureSettling, 2 * stride);
    put(Chain::kMotion, seed && run.is_free && run.has_torque && std::isfinite(data.rig.inertia), 0, stride);
    data.run_begin.push_back(data.rows.size());
  }
}

}  // namespace

bool Prepared::has(Chain chain) const noexcept {
  return std::any_of(rows.begin(), rows.end(), [&](const Row& row) { return row.chain == chain; });
}

double told_speed(double angle_step) noexcept {
  return std::isfinite(angle_step) ? kBeside * kFewSteps * angle_step / (2 * kTellWindow) : 0.0;
}

double Prepared::untold() const noexcept {
  double seconds = 0;
  for (const PreparedRun& run : runs) seconds += run.untold;
  return seconds;
}

bool can_add_torque_of_free_runs(const Prepared& data) {
  return !data.with_free_torque && data.has(Chain::kMotion) &&
         std::none_of(data.rows.begin(), data.rows.end(), [&](const Row& row) {
           return row.chain == Chain::kTorque && data.runs[row.run].is_free;
         });
}

void add_torque_of_free_runs(Prepared& data) {
  data.with_free_torque = true;
  add_rows(data);
  cut_blocks(data, data.block_seconds);
}

void cut_blocks(Prepared& data, double block_seconds) {
  data.block_seconds = block_seconds;
  data.block_of_atom.clear();
  std::size_t atom = 0, block = 0;
  for (std::size_t r = 0; r + 1 < data.run_begin.size(); ++r) {
    if (data.run_begin[r + 1] == data.run_begin[r]) continue;
    const double duration = data.runs[r].time.empty() ? 0 : data.runs[r].time.back();
    const auto count = [&](double seconds) {
      return std::max<std::size_t>(1, static_cast<std::size_t>(std::lround(duration / seconds)));
    };
    const std::size_t atoms = count(kAtomSeconds), blocks = std::min(atoms, count(block_seconds));
    for (std::size_t i = data.run_begin[r]; i < data.run_begin[r + 1]; ++i) {
      const double share = duration > 0 ? data.runs[r].time[data.rows[i].sample] / duration : 0;
      const std::size_t at =
          std::min(atoms - 1, static_cast<std::size_t>(share * static_cast<double>(atoms)));
      data.rows[i].atom = static_cast<unsigned>(atom + at);
      data.rows[i].block = static_cast<unsigned>(block + at * blocks / atoms);
    }
    for (std::size_t at = 0; at < atoms; ++at)
      data.block_of_atom.push_back(static_cast<unsigned>(block + at * blocks / atoms));
    atom += atoms;
    block += blocks;
  }
  data.atoms = atom;
  data.blocks = block;
}

double HeldOut::first_start() const {
  double first = std::numeric_limits<double>::quiet_NaN();
  for (const series::Recording& run : runs_) first = std::fmin(first, parse_iso8601(run.meta("started")));
  return first;
}

Prepared prepare(std::span<const series::Recording> runs, const RigFacts& rig, const BaselineModel& baseline,
                 double block_seconds, double first_start) {
  Prepared data;
  data.rig = rig;
  data.baseline = baseline;
  std::vector<double> started;
  double rate = 0;
  for (const series::Recording& recording : runs) {
    data.runs.push_back(prepare_run(recording, rig, baseline, data.smoothing));
    started.push_back(parse_iso8601(recording.meta("started")));
    if (data.runs.back().interval > 0) rate = std::max(rate, 1 / data.runs.back().interval);
  }
  double first = std::numeric_limits<double>::infinity();
  for (const double t : started)
    if (std::isfinite(t)) first = std::min(first, t);
  if (std::isfinite(first_start)) first = std::min(first, first_start);
  if (std::isfinite(first)) data.first_start = first;
  for (std::size_t r = 0; r < data.runs.size(); ++r)
    data.runs[r].day_offset = std::isfinite(started[r]) && std::isfinite(first) ? started[r] - first : 0;
  data.stride = std::max(1, static_cast<int>(std::floor(rate / kRowRate + 1e-6)));
  add_rows(data);
  if (data.rows.empty()) {
    throw Error(
        ErrorKind::kAnswerIsNo, "no_usable_data",
        "no run has what a comparison needs: angle with F1 and F2 (or torque) and p1, p2, or p1_cmd, p2_cmd "
        "with p1, p2; record them with isac-log.");
  }
  cut_blocks(data, block_seconds);
  return data;
}

}  // namespace isac::explain
