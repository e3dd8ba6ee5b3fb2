#include "dataset.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "known_runs.hpp"
#include "plant.hpp"

namespace blind {
namespace {

constexpr double kSeekStep = 5e-4;  // s, of the integrator while a strength is sought

/// A step in time happens between two runs, where hands are on the rig; at least two fitted runs lie on each side.
void snap_to_rest(Shape& shape, const std::vector<RunPlan>& runs) {
  std::vector<double> starts;
  for (const RunPlan& run : runs)
    if (!run.heldout) starts.push_back(run.started);
  std::sort(starts.begin(), starts.end());
  double best = starts[2];
  for (std::size_t i = 2; i + 1 < starts.size(); ++i)
    if (std::abs(starts[i] - shape.at("t")) < std::abs(best - shape.at("t"))) best = starts[i];
  shape["t"] = best - 5.0;
}

}  // namespace

Strength strength_of(const Gap& gap, const Noise& noise, const Rig& rig) {
  const double torque = gap.torque / noise.torque_floor(rig.r),
               pressure = gap.pressure / noise.pressure_floor(),
               balance = gap.balance / noise.balance_floor(rig);
  if (torque >= pressure && torque >= balance) return {torque, "torque"};
  return pressure >= balance ? Strength{pressure, "pressure"} : Strength{balance, "balance"};
}

Hiding hide(const Effect& effect, const Shape& shape, const Dataset& dataset, double ratio) {
  KnownRuns known(dataset.rig, dataset.runs, kSeekStep);
  std::vector<Signals> signals(dataset.runs.size());
  const auto reached = [&](double amplitude) {
    Hidden hidden;
    hidden.seed = dataset.request.seed;
    effect.apply(hidden, amplitude, shape);
    for (std::size_t i = 0; i < signals.size(); ++i)
      if (!dataset.runs[i].heldout) signals[i] = known.simulated(i, hidden);
    const Baseline base = fit_baseline(dataset.rig, dataset.runs, signals);
    return strength_of(gap_of(dataset.rig, base, dataset.runs, signals, false), dataset.noise, dataset.rig);
  };
  Hiding hiding{&effect, effect.typical, shape, 0.0, ""};
  double low = 0.0, low_ratio = 0.0, high = 0.0, high_ratio = 0.0;  // brackets, high 0: none yet
  double a = effect.typical;
  for (int i = 0; i < 24; ++i) {
    const Strength s = reached(a);
    hiding.amplitude = a;
    hiding.ratio = s.ratio;
    hiding.signal = s.signal;
    if (std::abs(s.ratio / ratio - 1.0) < 0.03) break;
    if (s.ratio < ratio) {
      if (a >= effect.largest) break;  // not testable
      low = a;
      low_ratio = s.ratio;
    } else {
      high = a;
      high_ratio = s.ratio;
    }
    if (high == 0.0) {
      a = std::min(effect.largest, a * std::clamp(ratio / std::max(s.ratio, 1e-9), 1.3, 20.0));
    } else if (low == 0.0) {
      a *= std::clamp(ratio / s.ratio, 0.05, 0.9);
    } else {
      // The secant, kept away from the ends of the bracket.
      const double share = (ratio - low_ratio) / (high_ratio - low_ratio);
      a = low + (high - low) * std::clamp(share, i % 3 == 2 ? 0.45 : 0.05, i % 3 == 2 ? 0.55 : 0.95);
    }
  }
  return hiding;
}

Dataset make_dataset(const Request& request) {
  Random master(request.seed * 0x9e3779b97f4a7c15ull + 0x632be59bd9b4e019ull);
  Random of_rig = master.fork(), of_day = master.fork(), of_noise = master.fork(), of_shape = master.fork();
  Dataset d;
  d.request = request;
  if (request.day != "drawn" && request.day != "protocol")
    throw std::invalid_argument("a day is drawn or protocol, not '" + request.day + "'");
  const bool protocol = request.day == "protocol";
  d.rig = protocol ? draw_other_rig(of_rig) : draw_rig(of_rig);
  d.runs = protocol ? draw_protocol_day(d.rig, of_day) : draw_day(d.rig, of_day);
  d.noise = draw_noise(request.noise, d.rig, of_noise, request.recordings);
  for (const std::string& id : request.ids) {
    const Effect& one = effect(id);
    Shape shape = one.draw(of_shape);
    if (shape.contains("t")) snap_to_rest(shape, d.runs);
    Hiding hiding = hide(one, shape, d, request.ratio);
    if (std::abs(hiding.ratio / request.ratio - 1.0) > 0.05) d.not_testable = id;
    hiding.effect->apply(d.hidden, hiding.amplitude, hiding.shape);
    d.hidings.push_back(std::move(hiding));
  }
  d.hidden.seed = request.seed;
  if (!d.not_testable.empty()) return d;
  for (const RunPlan& run : d.runs) d.clean.push_back(simulate(d.rig, run, d.hidden, kWrittenStep));
  d.base = fit_baseline(d.rig, d.runs, d.clean);
  d.gap = gap_of(d.rig, d.base, d.runs, d.clean, false);
  d.heldout_gap = gap_of(d.rig, d.base, d.runs, d.clean, true);
  return d;
}

Gap heldout_noise(const Dataset& d, const std::vector<Signals>& noisy) {
  // What noise adds to the residual of a model that leaves nothing else: the residual of noisy minus that of clean.
  struct Mean {
    double sum = 0, count = 0;
    void add(const std::vector<double>& a, const std::vector<double>& b) {
      for (std::size_t k = 0; k < a.size(); ++k) sum += (a[k] - b[k]) * (a[k] - b[k]);
      count += static_cast<double>(a.size());
    }
    [[nodiscard]] double root() const { return std::sqrt(sum / std::max(1.0, count)); }
  };
  Mean torque, driven, pressure, p1, p2, balance;
  for (std::size_t i = 0; i < d.runs.size(); ++i) {
    if (!d.runs[i].heldout) continue;
    // The velocity's noise depends on who differentiates; the clean angle is taken, so that only the sensors' part counts.
    Signals mixed = noisy[i];
    mixed.angle = d.clean[i].angle;
    const Residuals a = residuals(d.rig, d.base, d.runs[i], mixed),
                    b = residuals(d.rig, d.base, d.runs[i], d.clean[i]);
    torque.add(a.torque, b.torque);
    if (!d.runs[i].free) driven.add(a.torque, b.torque);
    for (Mean* m : {&pressure, &p1}) m->add(a.p1, b.p1);
    for (Mean* m : {&pressure, &p2}) m->add(a.p2, b.p2);
    balance.add(a.balance, b.balance);
  }
  return {torque.root(), pressure.root(), balance.root(), driven.root(), p1.root(), p2.root()};
}

Gap heldout_closes(const Dataset& d, const std::vector<Signals>& noisy) {
  struct Mean {
    double sum = 0, count = 0;
    void add(const std::vector<double>& with, const std::vector<double>& without) {
      for (std::size_t k = 0; k < with.size(); ++k) {
        const double noise = with[k] - without[k];
        sum += with[k] * with[k] - noise * noise;
      }
      count += static_cast<double>(with.size());
    }
    [[nodiscard]] double mean() const { return sum / std::max(1.0, count); }
  };
  Mean torque, driven, pressure, p1, p2, balance;
  for (std::size_t i = 0; i < d.runs.size(); ++i) {
    if (!d.runs[i].heldout) continue;
    Signals forces = d.clean[i], pressures = d.clean[i];
    forces.F1 = noisy[i].F1;
    forces.F2 = noisy[i].F2;
    pressures.p1 = noisy[i].p1;
    pressures.p2 = noisy[i].p2;
    const Residuals clean = residuals(d.rig, d.base, d.runs[i], d.clean[i]),
                    force = residuals(d.rig, d.base, d.runs[i], forces),
                    pressed = residuals(d.rig, d.base, d.runs[i], pressures);
    torque.add(force.torque, clean.torque);
    if (!d.runs[i].free) driven.add(force.torque, clean.torque);
    for (Mean* m : {&pressure, &p1}) m->add(pressed.p1, clean.p1);
    for (Mean* m : {&pressure, &p2}) m->add(pressed.p2, clean.p2);
    balance.add(force.balance, clean.balance);
  }
  return {torque.mean(), pressure.mean(), balance.mean(), driven.mean(), p1.mean(), p2.mean()};
}

}  // namespace blind
