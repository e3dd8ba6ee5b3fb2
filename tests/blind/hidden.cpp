#include "hidden.hpp"

namespace blind {

Hidden moving_part(const Hidden& hidden, bool free) {
  const Hidden none;
  Hidden h = hidden;
  h.force_offset_1 = h.force_offset_2 = h.force_gain_1 = h.force_gain_2 = 0.0;
  h.force_drift_1 = h.force_drift_2 = h.clip = 0.0;
  h.pressure_offset_1 = h.pressure_offset_2 = h.pressure_gain_1 = h.pressure_gain_2 = 0.0;
  h.encoder_offset = h.encoder_gain = h.encoder_drift = h.encoder_play = 0.0;
  h.slip = h.slip_time = h.skew = 0.0;
  h.spikes = h.spike_share = 0.0;
  h.hum = none.hum;
  h.hum_frequency = none.hum_frequency;
  h.hum_phase_1 = h.hum_phase_2 = 0.0;
  if (!free) {
    h.gravity = h.gravity_angle = h.bearing = h.added_inertia = h.quadratic_damping = 0.0;
    h.stop_stiffness = none.stop_stiffness;
    h.stop_angle = none.stop_angle;
    h.stop_side = none.stop_side;
    h.compliance = none.compliance;
    h.second_share = none.second_share;
    h.second_damping = none.second_damping;
  }
  if (h.sticking == 0) h.seed = none.seed;
  return h;
}

bool sensors_are_true(const Hidden& hidden) {
  Hidden moving = moving_part(hidden, true);
  moving.seed = hidden.seed;
  return moving == hidden;
}

}  // namespace blind
