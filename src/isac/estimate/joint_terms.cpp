#include "isac/estimate/joint_terms.hpp"

#include <ceres/jet.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "isac/core/error.hpp"
#include "isac/models/effects.hpp"

namespace isac::estimate {
namespace {

using Jet = ceres::Jet<double, models::kMaxEffectParameters>;

template <class S>
models::JointPoint<S> point_of(const JointState& state, double radius, double reference, double stiffness,
                               double gain) {
  models::JointPoint<S> point;
  point.angle = S(state.angle);
  point.velocity = S(state.velocity);
  point.acceleration = S(state.acceleration);
  point.delta_pressure = S(state.delta_pressure);
  point.mean_pressure = S(state.mean_pressure);
  point.time = S(state.time);
  point.wheel_radius = S(radius);
  point.reference_pressure = S(reference);
  point.stiffness = S(stiffness);
  point.pressure_gain = S(gain);
  return point;
}

/// "N m" on a rotary joint is "N" on a linear axis: m^k for rad^k, and the arm length is gone.
std::string axis_unit(const std::string& unit, bool linear_axis) {
  if (!linear_axis) return unit;
  static const std::map<std::string, std::string> kLinear{
      {"N m", "N"},    {"N m s", "N s/m"}, {"N m s2", "N s2/m2"}, {"N m s3", "N s3/m3"},
      {"kg m2", "kg"}, {"N m/rad", "N/m"}, {"N m/rad3", "N/m3"},  {"rad/s", "m/s"},
      {"rad", "m"},    {"1/rad", "1/m"},   {"1/rad2", "1/m2"}};
  const auto found = kLinear.find(unit);
  return found == kLinear.end() ? unit : found->second;
}

std::string known_terms() {
  std::string text = "A, B, C, D";
  for (const models::EffectInfo& info : models::effect_catalogue())
    if (info.torque_term && info.state_count == 0) text += std::string(", ") + info.id;
  return text;
}

}  // namespace

double value_of(const JointState& state, Input input) noexcept {
  switch (input) {
    case Input::kAngle:
      return state.angle;
    case Input::kVelocity:
      return state.velocity;
    case Input::kAcceleration:
      return state.acceleration;
    case Input::kDeltaPressure:
      return state.delta_pressure;
    case Input::kMeanPressure:
      return state.mean_pressure;
  }
  return 0;
}

void set_value(JointState& state, Input input, double value) noexcept {
  switch (input) {
    case Input::kAngle:
      state.angle = value;
      break;
    case Input::kVelocity:
      state.velocity = value;
      break;
    case Input::kAcceleration:
      state.acceleration = value;
      break;
    case Input::kDeltaPressure:
      state.delta_pressure = value;
      break;
    case Input::kMeanPressure:
      state.mean_pressure = value;
      break;
  }
}

JointTerms::JointTerms(const JointFitOptions& options)
    : wheel_radius_(options.wheel_radius), reference_pressure_(options.reference_pressure) {
  const auto catalogue = models::effect_catalogue();
  const bool linear_axis = options.position_unit == "m";
  if (options.terms.empty())
    throw Error(ErrorKind::kUsage, "no_terms", "the model has no terms; name some of: " + known_terms());
  std::vector<int> seen;
  for (const std::string& name : options.terms) {
    const int effect = models::find_effect(name);
    if (effect < 0)
      throw Error(ErrorKind::kUsage, "unknown_term",
                  "the term '" + name + "' is not in the catalogue; use some of: " + known_terms());
    const models::EffectInfo& info = catalogue[static_cast<std::size_t>(effect)];
    if (!info.torque_term || info.state_count > 0)
      throw Error(
          ErrorKind::kUsage, "term_not_memoryless",
          "the term '" + name +
              "' is not a torque that follows from angle, speed and pressure at one instant; use some of: " +
              known_terms());
    if (std::find(seen.begin(), seen.end(), effect) != seen.end())
      throw Error(ErrorKind::kUsage, "term_twice", "the term '" + name + "' is named twice; name it once");
    seen.push_back(effect);
    if (std::string(info.id) == "inertia") driven_ = true;
    for (int q = 0; q < info.parameter_count; ++q) {
      const models::ParameterInfo& parameter = info.parameters[q];
      JointParameter entry;
      entry.name = info.parameter_count == 1 ? name : name + "." + parameter.name;
      entry.term = info.term;
      entry.unit = axis_unit(parameter.unit, linear_axis);
      entry.si_per_unit = parameter.si_per_unit;
      entry.lower = parameter.lower;
      entry.upper = parameter.upper;
      entry.typical = parameter.typical;
      entry.shape = std::isnan(parameter.null_value);
      entry.effect = effect;
      entry.index = q;
      (info.linear ? linear_ : nonlinear_).push_back(entry);
    }
  }
  // Which inputs a regressor follows is asked of the equations themselves, at two states without special values.
  const JointState state{0.31, 0.73, 1.9, 4.1e4, 2.3e5, 1.0};
  const double step[kInputs] = {0.17, 0.41, 0.9, 1.3e4, 0.7e5};
  linear_reads_.assign(linear_.size(), std::vector<bool>(kInputs, false));
  for (int z = 0; z < kInputs; ++z) {
    for (const double direction :
         {1.0, -4.0}) {  // −4 also turns the sign, for terms that only know the direction
      JointState moved = state;
      const auto input = static_cast<Input>(z);
      set_value(moved, input, value_of(state, input) + direction * step[z]);
      for (std::size_t k = 0; k < linear_.size(); ++k)
        if (regressor(k, moved) != regressor(k, state))
          linear_reads_[k][static_cast<std::size_t>(z)] = reads_[z] = true;
      if (!nonlinear_.empty()) {
        std::vector<double> typical;
        for (const auto& p : nonlinear_) typical.push_back(p.typical);
        if (nonlinear_value(moved, typical.data(), nullptr) !=
            nonlinear_value(state, typical.data(), nullptr))
          reads_[z] = true;
      }
    }
  }
}

bool JointTerms::is_cubic_damping(std::size_t k) const noexcept {
  static const int kCubic = models::find_effect("C");
  return linear_[k].effect == kCubic;
}

bool JointTerms::is_viscous_damping(std::size_t k) const noexcept {
  static const int kViscous = models::find_effect("D");
  return linear_[k].effect == kViscous;
}

double JointTerms::regressor(std::size_t k, const JointState& state) const noexcept {
  double unit[models::kMaxEffectParameters] = {};
  unit[linear_[k].index] = 1.0;
  const auto point = point_of<double>(state, wheel_radius_, reference_pressure_, stiffness_, pressure_gain_);
  const double torque = models::effect_torque(linear_[k].effect, unit, point);
  const bool turned =
      driven_ && !models::effect_catalogue()[static_cast<std::size_t>(linear_[k].effect)].added_to_output;
  return turned ? -torque : torque;
}

double JointTerms::nonlinear_value(const JointState& state, const double* parameters,
                                   double* gradient) const noexcept {
  double sum = 0;
  for (std::size_t first = 0; first < nonlinear_.size();) {
    const int effect = nonlinear_[first].effect;
    const models::EffectInfo& info = models::effect_catalogue()[static_cast<std::size_t>(effect)];
    const auto count = static_cast<std::size_t>(info.parameter_count);
    const double sign = driven_ && !info.added_to_output ? -1.0 : 1.0;
    if (gradient == nullptr) {
      const auto point =
          point_of<double>(state, wheel_radius_, reference_pressure_, stiffness_, pressure_gain_);
      sum += sign * models::effect_torque(effect, parameters + first, point);
    } else {
      Jet jets[models::kMaxEffectParameters];
      for (std::size_t q = 0; q < count; ++q) jets[q] = Jet(parameters[first + q], static_cast<int>(q));
      const auto point = point_of<Jet>(state, wheel_radius_, reference_pressure_, stiffness_, pressure_gain_);
      const Jet torque = models::effect_torque(effect, jets, point);
      sum += sign * torque.a;
      for (std::size_t q = 0; q < count; ++q)
        gradient[first + q] = sign * torque.v[static_cast<Eigen::Index>(q)];
    }
    first += count;
  }
  return sum;
}

}  // namespace isac::estimate
