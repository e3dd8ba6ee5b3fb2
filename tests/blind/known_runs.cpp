#include "known_runs.hpp"

#include "plant.hpp"

namespace blind {

const Signals& KnownRuns::bare(std::size_t i) {
  if (bare_[i].angle.empty()) bare_[i] = simulate(rig_, runs_[i], Hidden{}, step_);
  return bare_[i];
}

const Signals& KnownRuns::simulated(std::size_t i, const Hidden& hidden) {
  if (moving_part(hidden, runs_[i].free) != Hidden{})
    return changed_ = simulate(rig_, runs_[i], hidden, step_);
  if (sensors_are_true(hidden)) return bare(i);
  changed_ = bare(i);
  read_sensors(hidden, runs_[i], changed_);
  return changed_;
}

}  // namespace blind
