// Pressures simulated from their commands, with the effects of the valve unit.
#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>

#include "isac/explain/predict_parts.hpp"

namespace isac::explain {

using models::Hook;
using models::Subsystem;

namespace {

/// An effect that is in the loop, with its states. `Effect`: models::AnyValveEffect, or models::ValveEffect<E> where the compiler knows which.
template <class Effect>
struct Placed {
  Effect effect;
  const double* q;
  double z[models::kMaxEffectStates];
  // Slope of a state's rate over its step, and what a step makes of it: most states decay by a constant, and what is known already need not be waited for.
  double slope[models::kMaxEffectStates] = {}, grows[models::kMaxEffectStates] = {};
};

/// T_C ṗ = K_C u − p and what effects make of it, from the commands as they arrive, by the midpoint rule.
struct Valves {
  double gain, lag, interval;
  const std::vector<double> (&arrived)[2];
  const std::vector<double>* velocity;  ///< nullptr: the joint's motion is not known
  bool smooth_states;                   ///< some state follows a rate: half the step, and states within it
};

/// Steps over a run; `put(k, state)` takes the pressures at each sample.
template <class Effects, class Put>
void follow(const Valves& valves, Effects& effects, double (&state)[2], const Put& put) {
  constexpr double kNudge = 1.0;       // Pa
  constexpr double kSameSlope = 1e-9;  // relative: differences of rates round as much
  const double rate = 1 / valves.lag, gain = valves.gain;
  models::ValvePoint<double> x;
  x.lag = valves.lag;
  std::size_t up_to_last_state = effects.size();  // what comes after it moves no state
  while (up_to_last_state > 0 && effects[up_to_last_state - 1].effect.state_count() == 0) --up_to_last_state;
  const bool any_states = up_to_last_state > 0;
  const auto rates = [&](const double(&u0)[2], const double(&p)[2], double velocity, double(&v)[2],
                         double move) {
    double u[2] = {gain * u0[0], gain * u0[1]};
    x.pressure[0] = p[0];
    x.pressure[1] = p[1];
    x.velocity = velocity;
    for (auto& e : effects) {
      x.command[0] = u[0];
      x.command[1] = u[1];
      e.effect.command(e.q, x, e.z, u);
    }
    for (int i = 0; i < 2; ++i) v[i] = (u[i] - p[i]) * rate;
    for (const auto& e : effects) e.effect.pressure_rate(e.q, x, e.z, v);
    if (!(move > 0)) return;
    double again[2] = {gain * u0[0], gain * u0[1]};
    for (std::size_t j = 0; j < up_to_last_state; ++j) {
      auto& e = effects[j];
      x.command[0] = again[0];
      x.command[1] = again[1];
      const int count = e.effect.state_count();
      double f[2] = {}, g[2] = {};
      if (count > 0) {
        double nudged[2] = {e.z[0] + kNudge, e.z[1] + kNudge};
        e.effect.derivative(e.q, x, u, v, e.z, f);
        e.effect.derivative(e.q, x, u, v, nudged, g);
      }
      if (j + 1 < up_to_last_state) e.effect.command(e.q, x, e.z, again);
      for (int i = 0; i < count; ++i) {
        const double slope = (g[i] - f[i]) / kNudge * move;
        if (!(std::abs(slope - e.slope[i]) <= kSameSlope * std::abs(slope)) || e.grows[i] == 0) {
          e.slope[i] = slope;
          e.grows[i] = growth(slope);
        }
        e.z[i] += move * f[i] * e.grows[i];
      }
    }
  };
  const std::size_t n = valves.arrived[0].size();
  for (std::size_t k = 0; k < n; ++k) {
    put(k, state);
    if (k + 1 == n) break;
    const double u[2] = {valves.arrived[0][k], valves.arrived[1][k]};
    if (any_states) {
      // States that only step (play) see the command as the effects before them leave it.
      double chain[2] = {gain * u[0], gain * u[1]};
      x.pressure[0] = state[0];
      x.pressure[1] = state[1];
      for (auto& e : effects) {
        x.command[0] = chain[0];
        x.command[1] = chain[1];
        e.effect.step(e.q, x, e.z);
        e.effect.command(e.q, x, e.z, chain);
      }
    }
    const double w =
        valves.velocity != nullptr ? 0.5 * ((*valves.velocity)[k] + (*valves.velocity)[k + 1]) : 0.0;
    // States move by half a step before its second half.
    const int substeps = valves.smooth_states ? 2 : 1;
    const double h = valves.interval / substeps, move = valves.smooth_states ? 0.5 * h : 0.0;
    for (int sub = 0; sub < substeps; ++sub) {
      double v[2], middle[2];
      rates(u, state, w, v, move);
      for (int i = 0; i < 2; ++i) middle[i] = state[i] + 0.5 * h * v[i];
      rates(u, middle, w, v, move);
      for (int i = 0; i < 2; ++i) state[i] += h * v[i];
    }
  }
}

}  // namespace

void Predictor::pressures_of(const ModelPoint& model, const PreparedRun& run, const Inputs& in,
                             std::vector<double> (&p)[2]) const {
  const std::size_t n = run.time.size();
  const double dt = run.interval;
  const double gain = model.base[static_cast<std::size_t>(gain_)],
               lag = model.base[static_cast<std::size_t>(lag_)];
  std::vector<Placed<models::AnyValveEffect>> effects;
  bool smooth_states = false;
  std::vector<const Active*> outlets;  // what both units' own pressures make of those in the muscles
  double delay = 0;
  for (const Active& a : model.effects) {
    if (is_null(a)) continue;
    const auto& info = a.hypothesis->info();
    if (info.hook == Hook::kDelay && info.where == Subsystem::kPcu) {
      delay += models::effect_delay(a.hypothesis->effect, a.values.data());
    } else if (info.hook == Hook::kCommand || info.hook == Hook::kPressureRate) {
      effects.push_back({{a.hypothesis->effect}, a.values.data(), {}});
      smooth_states =
          smooth_states || (info.state_count > 0 && info.id != std::string_view("valve_hysteresis"));
    } else if (info.hook == Hook::kOutletPressure) {
      outlets.push_back(&a);
    }
  }
  const auto at_the_outlet = [&](const double(&own)[2], double(&there)[2]) {
    for (int i = 0; i < 2; ++i) there[i] = own[i];
    for (const Active* a : outlets)
      models::effect_outlet_pressure(a->hypothesis->effect, a->values.data(), there);
  };
  // The commands as they arrive, between two samples where a delay ends there.
  const auto last = static_cast<std::ptrdiff_t>(n) - 1;
  const double shift = delay / dt, part = shift - std::floor(shift);
  const auto whole = static_cast<std::ptrdiff_t>(std::floor(shift));
  thread_local std::vector<double> arrived[2];
  for (int i = 0; i < 2; ++i) {
    arrived[i].resize(n);
    const double* u = run.command[i].data();
    double* there = arrived[i].data();
    const auto between = [&](std::ptrdiff_t k, std::ptrdiff_t newer, std::ptrdiff_t older) {
      there[k] = (1 - part) * u[newer] + part * u[older];
    };
    const std::ptrdiff_t first_inside = std::clamp<std::ptrdiff_t>(whole + 1, 0, last + 1),
                         end_inside = std::clamp<std::ptrdiff_t>(last + 1 + whole, first_inside, last + 1);
    const auto at_an_end = [&](std::ptrdiff_t k) {
      between(k, std::clamp<std::ptrdiff_t>(k - whole, 0, last),
              std::clamp<std::ptrdiff_t>(k - whole - 1, 0, last));
    };
    for (std::ptrdiff_t k = 0; k < first_inside; ++k) at_an_end(k);
    for (std::ptrdiff_t k = first_inside; k < end_inside; ++k) between(k, k - whole, k - whole - 1);
    for (std::ptrdiff_t k = end_inside; k <= last; ++k) at_an_end(k);
  }
  p[0].resize(n);
  p[1].resize(n);
  double state[2];  // what a sensor's model makes of its first reading, at the first reading's best value
  for (int i = 0; i < 2; ++i) state[i] = run.first_pressure[i] + in.first_pressure[i] - run.pressure[i][0];
  if (!outlets.empty()) {  // the units' own that make these
    const double first[2] = {state[0], state[1]};
    for (int round = 0; round < 8; ++round) {
      double there[2];
      at_the_outlet(state, there);
      for (int i = 0; i < 2; ++i) state[i] += first[i] - there[i];
    }
  }
  const auto put = [&](std::size_t k, const double(&own)[2]) {
    double there[2] = {own[0], own[1]};
    if (!outlets.empty()) at_the_outlet(own, there);
    p[0][k] = there[0];
    p[1][k] = there[1];
  };
  if (effects.empty()) {
    // The same steps for the first-order lag alone: p + h (1 − h/2) (K_C u − p), h = Δt/T_C.
    const double h = dt / lag, take = h * (1 - 0.5 * h), keep = 1 - take;
    for (std::size_t k = 0; k < n; ++k) {
      put(k, state);
      for (int i = 0; i < 2; ++i) state[i] = keep * state[i] + take * gain * arrived[i][k];
    }
    return;
  }
  {
    models::ValvePoint<double> x;
    x.lag = lag;
    double u[2] = {gain * arrived[0][0], gain * arrived[1][0]};
    for (int i = 0; i < 2; ++i) x.pressure[i] = state[i];
    for (auto& e : effects) {
      x.command[0] = u[0];
      x.command[1] = u[1];
      models::effect_valve_rest(e.effect.effect, e.q, x, e.z);
      models::effect_command(e.effect.effect, e.q, x, e.z, u);
    }
  }
  const Valves valves{.gain = gain,
                      .lag = lag,
                      .interval = dt,
                      .arrived = arrived,
                      .velocity = run.velocity.empty() ? nullptr : in.velocity,
                      .smooth_states = smooth_states};
  if (effects.size() > 1) {
    follow(valves, effects, state, put);
    return;
  }
  models::visit_valve_effect(effects[0].effect.effect, [&](auto effect) {
    std::array<Placed<decltype(effect)>, 1> one{{{effect, effects[0].q, {effects[0].z[0], effects[0].z[1]}}}};
    follow(valves, one, state, put);
  });
}

}  // namespace isac::explain
