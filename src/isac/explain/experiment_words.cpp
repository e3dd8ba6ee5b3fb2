#include "isac/explain/experiment_words.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string_view>

namespace isac::explain {
namespace {

using std::string_view;

std::string swing_words(const PlannedRun& run, const char* what) {
  if (!(run.pressure_swing_kgcm2 > 0) || run.waveform == "hold") return {};
  const char* how = run.waveform == "steps"  ? "in steps"
                    : run.waveform == "sine" ? "as a sine"
                                             : "as a triangle";
  return fmt::format(", {} moving by ±{:.3g} kg/cm2 {} of {:.3g} s", what, run.pressure_swing_kgcm2, how,
                     run.pressure_period_s);
}

std::string words_for(const PlannedRun& run) {
  std::string text = fmt::format("{:.0f} s ", run.seconds);
  const std::string mean = fmt::format("a mean pressure of {:.3g} kg/cm2", run.mean_pressure_kgcm2);
  const std::string difference =
      run.delta_pressure_kgcm2 != 0
          ? fmt::format(" and a pressure difference of {:+.2g} kg/cm2", run.delta_pressure_kgcm2)
          : "";
  if (run.experiment == "constant-pressure") {
    text += fmt::format("by hand at {}{}, ±{:.2g} rad at up to {:.2g} rad/s", mean, difference,
                        run.amplitude_rad, run.peak_speed_rad_s);
    return text + swing_words(run, "the mean pressure");
  }
  if (run.experiment == "constant-angle") {
    text += fmt::format("with the bar clamped at {:.2g} rad, at {}{}",
                        std::isfinite(run.middle_rad) ? run.middle_rad + 0.0 : 0.0, mean, difference);
    return text + swing_words(run, "the pressure difference");
  }
  if (run.experiment == "free") {
    text += fmt::format("with the bar free, at {}{}", mean, difference);
    return text + swing_words(run, "the pressure difference");
  }
  text += fmt::format("of the valves with the bar clamped, about {}", mean);
  return text + swing_words(run, "both pressures");
}

struct Action {
  const char* one;
  const char* other;  ///< empty: any
  const char* what;
};

constexpr const char* kUnloaded =
    "read the forces unloaded, with the muscles vented and the chains off the sensors, and set their zero";
constexpr const char* kWeight = "hang a known weight on each force sensor and compare its reading";
constexpr const char* kGauge =
    "connect a reference gauge to a muscle and compare it with the sensor's reading";
constexpr const char* kVent = "vent both muscles and read the pressure sensors at zero";
constexpr const char* kAngle =
    "set the bar to two known angles (a template or an inclinometer) and compare the encoder's reading";
constexpr const char* kStop =
    "lead the bar to the same stop before and after the recording and compare the encoder's reading";
constexpr const char* kTilt =
    "tilt the base by a known angle, or take the bar's weight off it, and record again";
constexpr const char* kMass = "fix a known mass to the bar and record a free run with it";

// Pairs first, then what a single effect in doubt asks for; the first row that fits counts.
constexpr Action kActions[] = {
    {"torque_offset", "force_offset", kUnloaded},
    {"torque_offset", "gravity_imbalance", kTilt},
    {"torque_offset", "encoder_offset",
     "read the forces unloaded, and set the bar to its marked middle and read the encoder"},
    {"force_offset", "encoder_offset", kUnloaded},
    {"pressure_offset", "pressure_gain_error", kVent},
    {"pressure_offset", "torque_offset", kVent},
    {"pressure_offset", "encoder_offset", kVent},
    {"pressure_offset", "force_offset", kVent},
    {"pressure_sensor_gain", "pressure_gain_error", kGauge},
    {"force_drift", "thermal_drift", "read the unloaded force sensors before and after the recording"},
    {"encoder_drift", "", kStop},
    {"encoder_slip", "", kStop},
    {"encoder_play", "", "turn the encoder's shaft against the blocked wheel by hand and read its play"},
    {"encoder_gain", "", kAngle},
    {"lever_arm_variation", "encoder_gain", kAngle},
    {"force_gain_error", "", kWeight},
    {"force_saturation", "", kWeight},
    {"force_offset", "", kUnloaded},
    {"pressure_sensor_gain", "", kGauge},
    {"pressure_gain_error", "", kGauge},
    {"pressure_offset", "", kVent},
    {"encoder_offset", "", kAngle},
    {"inertia_error", "", kMass},
    {"series_elasticity", "", kMass},
    {"gravity_imbalance", "", kTilt},
    {"muscle_asymmetry", "",
     "exchange the two muscles and record again: what belongs to them changes its side"},
    {"torque_offset", "", kUnloaded},
    {"backlash", "", "block the wheel and turn the bar by hand to feel and read the play"},
    {"bearing_friction", "", "take the muscles' chains off the wheel and let the bar swing out"},
    {"sensor_lag", "", "strike a loaded force sensor and record its answer at the highest rate"},
    {"time_skew", "", "record one source of voltage on all inputs at once and compare the times"},
    {"supply_droop", "", "read a gauge at the supply while both muscles are filled"},
    {"leak", "", "shut the valves on a filled muscle and read a gauge over some minutes"},
    {"crosstalk", "", "fill one muscle with the other's tube shut and read both sensors"},
    {"thermal_drift", "", "repeat the first recording when the rig is warm"},
};

bool fits(const Action& action, string_view a, string_view b) {
  const string_view one = action.one, other = action.other;
  if (other.empty()) return a == one || b == one;
  return (a == one && b == other) || (a == other && b == one);
}

}  // namespace

std::string hardware_action(const std::string& a, const std::string& b) {
  const auto* found =
      std::find_if(std::begin(kActions), std::end(kActions), [&](const Action& x) { return fits(x, a, b); });
  if (found != std::end(kActions)) return found->what;
  return "take one of the two parts in question off the rig, or exchange it, and record again";
}

std::string words_for_runs(const std::vector<PlannedRun>& runs, const std::string& term_a,
                           const std::string& term_b, double now, double expected) {
  std::string text = "Record ";
  for (std::size_t i = 0; i < runs.size(); ++i) text += (i == 0 ? "" : ", and then ") + words_for(runs[i]);
  return text + fmt::format(": {} {} from {} by about {:.{}f} sigma (now {:.1f}).",
                            runs.size() == 1 ? "it separates" : "together they separate", term_a, term_b,
                            expected, expected < 9.95 ? 1 : 0, now);
}

std::string words_for_hardware(const std::string& id_a, const std::string& id_b, const std::string& term_a,
                               const std::string& term_b, double reach) {
  return fmt::format("No recording within the rig's limits separates {} from {} ({:.1f} sigma at best): {}.",
                     term_a, term_b, reach, hardware_action(id_a, id_b));
}

}  // namespace isac::explain
