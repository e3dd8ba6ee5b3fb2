// Pressures simulated from their commands, with the effects of the valve unit.
#include <algorithm>
#include <cmath>
#include <string_view>

#include "isac/explain/predict_parts.hpp"

namespace isac::explain {

using models::Hook;
using models::Subsystem;

void Predictor::pressures_of(const ModelPoint& model, const PreparedRun& run, const Inputs& in,
                             std::vector<double> (&p)[2]) const {
  const std::size_t n = run.time.size();
  const double dt = run.interval;
  const double gain = model.base[static_cast<std::size_t>(gain_)],
               lag = model.base[static_cast<std::size_t>(lag_)];
  struct Placed {
    const Active* active;
    double z[models::kMaxEffectStates];
  };
  std::vector<Placed> effects;
  std::vector<const Active*> outlets;  // what both units' own pressures make of those in the muscles
  double delay = 0;
  for (const Active& a : model.effects) {
    const auto& info = a.hypothesis->info();
    if (info.hook == Hook::kDelay && info.where == Subsystem::kPcu) {
      delay += models::effect_delay(a.hypothesis->effect, a.values.data());
    } else if (info.hook == Hook::kCommand || info.hook == Hook::kPressureRate) {
      effects.push_back({&a, {}});
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
    for (std::ptrdiff_t k = 0; k <= last; ++k) {
      const double older = u[std::clamp<std::ptrdiff_t>(k - whole - 1, 0, last)],
                   newer = u[std::clamp<std::ptrdiff_t>(k - whole, 0, last)];
      arrived[i][static_cast<std::size_t>(k)] = (1 - part) * newer + part * older;
    }
  }
  std::size_t up_to_last_state = effects.size();  // what comes after it moves no state
  while (up_to_last_state > 0 && effects[up_to_last_state - 1].active->hypothesis->info().state_count == 0)
    --up_to_last_state;
  constexpr double kNudge = 1.0;  // Pa
  const double rate = 1 / lag;
  models::ValvePoint<double> x;
  x.lag = lag;
  const auto rates = [&](const double(&u0)[2], const double(&state)[2], double velocity, double(&v)[2],
                         double move) {
    double u[2] = {gain * u0[0], gain * u0[1]};
    x.pressure[0] = state[0];
    x.pressure[1] = state[1];
    x.velocity = velocity;
    for (Placed& e : effects) {
      x.command[0] = u[0];
      x.command[1] = u[1];
      models::effect_command(e.active->hypothesis->effect, e.active->values.data(), x, e.z, u);
    }
    for (int i = 0; i < 2; ++i) v[i] = (u[i] - state[i]) * rate;
    for (const Placed& e : effects)
      models::effect_pressure_rate(e.active->hypothesis->effect, e.active->values.data(), x, e.z, v);
    if (!(move > 0)) return;
    double again[2] = {gain * u0[0], gain * u0[1]};
    for (std::size_t j = 0; j < up_to_last_state; ++j) {
      Placed& e = effects[j];
      x.command[0] = again[0];
      x.command[1] = again[1];
      const int effect = e.active->hypothesis->effect;
      const double* q = e.active->values.data();
      const int count = e.active->hypothesis->info().state_count;
      double f[2] = {}, g[2] = {};
      if (count > 0) {
        double nudged[2] = {e.z[0] + kNudge, e.z[1] + kNudge};
        models::effect_valve_derivative(effect, q, x, u, v, e.z, f);
        models::effect_valve_derivative(effect, q, x, u, v, nudged, g);
      }
      if (j + 1 < up_to_last_state) models::effect_command(effect, q, x, e.z, again);
      for (int i = 0; i < count; ++i) {
        const double slope = (g[i] - f[i]) / kNudge * move;
        e.z[i] += move * f[i] * growth(slope);
      }
    }
  };
  p[0].resize(n);
  p[1].resize(n);
  double state[2];  // what a sensor's model makes of its first reading, at the first reading's best value
  for (int i = 0; i < 2; ++i) state[i] = run.first_pressure[i] + (*in.pressure[i])[0] - run.pressure[i][0];
  if (!outlets.empty()) {  // the units' own that make these
    const double first[2] = {state[0], state[1]};
    for (int round = 0; round < 8; ++round) {
      double there[2];
      at_the_outlet(state, there);
      for (int i = 0; i < 2; ++i) state[i] += first[i] - there[i];
    }
  }
  const auto put = [&](std::size_t k) {
    double there[2];
    at_the_outlet(state, there);
    p[0][k] = there[0];
    p[1][k] = there[1];
  };
  {
    const double u0[2] = {arrived[0][0], arrived[1][0]};
    double u[2] = {gain * u0[0], gain * u0[1]};
    for (int i = 0; i < 2; ++i) x.pressure[i] = state[i];
    for (Placed& e : effects) {
      x.command[0] = u[0];
      x.command[1] = u[1];
      models::effect_valve_rest(e.active->hypothesis->effect, e.active->values.data(), x, e.z);
      models::effect_command(e.active->hypothesis->effect, e.active->values.data(), x, e.z, u);
    }
  }
  const bool moves = !run.velocity.empty();
  const bool with_states = std::any_of(effects.begin(), effects.end(), [](const Placed& e) {
    return e.active->hypothesis->info().state_count > 0 &&
           e.active->hypothesis->info().id != std::string_view("valve_hysteresis");
  });
  const int substeps = with_states ? 2 : 1;
  const bool any_states = std::any_of(effects.begin(), effects.end(), [](const Placed& e) {
    return e.active->hypothesis->info().state_count > 0;
  });
  if (effects.empty()) {
    // The same steps for the first-order lag alone, bit for bit.
    for (std::size_t k = 0; k < n; ++k) {
      put(k);
      for (int i = 0; i < 2; ++i) {
        const double u = gain * arrived[i][k], middle = state[i] + 0.5 * dt * ((u - state[i]) * rate);
        state[i] += dt * ((u - middle) * rate);
      }
    }
    return;
  }
  for (std::size_t k = 0; k < n; ++k) {
    put(k);
    if (k + 1 == n) break;
    const double u[2] = {arrived[0][k], arrived[1][k]};
    if (any_states) {
      // States that only step (play) see the command as the effects before them leave it.
      double chain[2] = {gain * u[0], gain * u[1]};
      x.pressure[0] = state[0];
      x.pressure[1] = state[1];
      for (Placed& e : effects) {
        x.command[0] = chain[0];
        x.command[1] = chain[1];
        models::effect_valve_step(e.active->hypothesis->effect, e.active->values.data(), x, e.z);
        models::effect_command(e.active->hypothesis->effect, e.active->values.data(), x, e.z, chain);
      }
    }
    const double w = moves ? 0.5 * ((*in.velocity)[k] + (*in.velocity)[k + 1]) : 0.0;
    // Midpoint rule; states move by half a step before its second half.
    const double h = dt / substeps;
    for (int sub = 0; sub < substeps; ++sub) {
      double v[2], middle[2];
      rates(u, state, w, v, with_states ? 0.5 * h : 0.0);
      for (int i = 0; i < 2; ++i) middle[i] = state[i] + 0.5 * h * v[i];
      rates(u, middle, w, v, with_states ? 0.5 * h : 0.0);
      for (int i = 0; i < 2; ++i) state[i] += h * v[i];
    }
  }
}

}  // namespace isac::explain
