#include "isac/explain/coordinates.hpp"

#include <algorithm>
#include <cmath>

namespace isac::explain {

void set_value(ModelPoint& model, const Coordinate& c, double value) {
  if (c.rest >= 0) {
    model.rest[static_cast<std::size_t>(c.rest)] = value;
  } else if (c.base >= 0) {
    model.base[static_cast<std::size_t>(c.base)] = value;
  } else {
    model.effects[static_cast<std::size_t>(c.effect)].values[static_cast<std::size_t>(c.component)] = value;
  }
}

Coordinate effect_coordinate(const Active& active, int effect, int component, bool tolerance) {
  const auto k = static_cast<std::size_t>(component);
  const Hypothesis& h = *active.hypothesis;
  Coordinate c;
  c.effect = effect;
  c.component = component;
  c.lower = h.lower[k];
  c.upper = h.upper[k];
  const auto& info = h.info().parameters[component];
  c.scale =
      tolerance ? 0.5 * (c.upper - c.lower) : std::max(std::abs(info.typical), std::abs(active.values[k]));
  if (!(c.scale > 0)) c.scale = 1;
  c.chains = h.chains;
  c.tolerance = tolerance;
  return c;
}

void add_base(const Predictor& predictor, const ModelPoint& model, unsigned chains,
              std::vector<Coordinate>& out) {
  for (std::size_t j = 0; j < predictor.base().size(); ++j) {
    const BaseParameter& b = predictor.base()[j];
    if ((b.chains & chains) == 0) continue;
    Coordinate c;
    c.base = static_cast<int>(j);
    c.lower = b.lower;
    c.upper = b.upper;
    c.scale = std::max(std::abs(b.start), 1e-3 * std::abs(model.base[j]));
    c.chains = b.chains;
    out.push_back(c);
  }
}

void add_rest(const Predictor& predictor, ModelPoint& model, unsigned chains, std::vector<Coordinate>& out) {
  if (predictor.resting_runs().empty() || (chains & bit(Chain::kTorque)) == 0) return;
  model.rest.resize(predictor.data().runs.size(), 0.0);
  for (const std::size_t run : predictor.resting_runs()) {
    Coordinate c;
    c.rest = static_cast<int>(run);
    c.upper = predictor.data().rig.angle_step;
    c.lower = -c.upper;
    c.scale = c.upper;
    c.chains = bit(Chain::kTorque);
    c.tolerance = true;
    out.push_back(c);
  }
}

void add_effects(const ModelPoint& model, std::size_t tolerances, unsigned chains,
                 std::vector<Coordinate>& out) {
  for (std::size_t i = 0; i < model.effects.size(); ++i) {
    const Active& a = model.effects[i];
    if ((a.hypothesis->chains & chains) == 0) continue;
    const bool tolerance = i < tolerances;
    if (tolerance &&
        std::any_of(model.effects.begin() + static_cast<std::ptrdiff_t>(tolerances), model.effects.end(),
                    [&](const Active& other) { return other.hypothesis->effect == a.hypothesis->effect; }))
      continue;
    for (int p = 0; p < a.hypothesis->info().parameter_count; ++p)
      if (tolerance ? p == 0 : a.hypothesis->free[static_cast<std::size_t>(p)])
        out.push_back(effect_coordinate(a, static_cast<int>(i), p, tolerance));
  }
}

}  // namespace isac::explain
