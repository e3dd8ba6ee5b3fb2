#include <algorithm>
#include <cmath>

#include "isac/core/units.hpp"
#include "isac/series/excitation.hpp"

namespace isac::series {

namespace {

Pressures along(const std::vector<Knot>& knots, double time) noexcept {
  const auto next = std::upper_bound(knots.begin(), knots.end(), time,
                                     [](double value, const Knot& knot) { return value < knot.time; });
  if (next == knots.begin()) return {next->p1, next->p2};
  if (next == knots.end()) return {knots.back().p1, knots.back().p2};
  const Knot& before = *(next - 1);
  const double share = (time - before.time) / (next->time - before.time);
  return {before.p1 + share * (next->p1 - before.p1), before.p2 + share * (next->p2 - before.p2)};
}

}  // namespace

Pressures Program::lead_at(double time) const noexcept {
  return along(lead, time);
}

Pressures Program::at(double time) const noexcept {
  Pressures out = along(knots, time);
  if (!tones.empty() && time >= tones_from && time < tones_to) {
    double sum = 0.0;
    for (const Tone& tone : tones) {
      sum += tone.amplitude * std::sin(2.0 * kPi * tone.frequency * (time - tones_from) + tone.phase);
    }
    constexpr double kFade =
        0.5;  // s; the multisine grows from nothing, so that it does not begin with a step
    const double rise = std::clamp(std::min(time - tones_from, tones_to - time) / kFade, 0.0, 1.0);
    sum *= rise;
    out.p1 -= sum;
    out.p2 += sum;
  }
  return out;
}

const std::vector<ExperimentInfo>& experiments() {
  static const std::vector<ExperimentInfo> kAll = {
      {"constant-pressure",
       "a person moves the bar at held pressures, slowly (0.1 pi rad/s) and fast (to 2 pi rad/s)"},
      {"bundle", "five minutes at held pressures, all positions, all speeds"},
      {"constant-angle", "the bar is clamped, the pressure difference makes triangles and steps"},
      {"free", "the muscles move the bar: steps and a multisine in the pressure difference"},
      {"pcu-step", "valve steps of several heights, up and down, from a held baseline"},
      {"pose", "the bar is held still at several angles"},
      {"calibrate", "one recording per level: force sensors, pressure sensors, valves, the encoder's middle"},
      {"testbed-bundle", "all sweeps of the seed's chapter 3 into one dataset folder, with held-out runs"},
      {"all", "the same as testbed-bundle"},
  };
  return kAll;
}

}  // namespace isac::series
