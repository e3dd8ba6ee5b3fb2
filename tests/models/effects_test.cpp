// Properties that every effect of the catalogue must have, checked over random points with printed seeds.
#include <ceres/jet.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <set>
#include <span>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include "isac/models/effect_hooks.hpp"

namespace isac::models {
namespace {

constexpr unsigned kSeed = 20031;

class EveryEffect : public ::testing::Test {
 protected:
  int index() const { return index_; }
  const EffectInfo& info() const { return effect_catalogue()[static_cast<std::size_t>(index())]; }
  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }

  JointPoint<double> random_point() {
    return {.delta_pressure = uniform(-2e5, 2e5),
            .mean_pressure = uniform(1e5, 4e5),
            .angle = uniform(-1.3, 1.3),
            .velocity = uniform(-6, 6),
            .acceleration = uniform(-100, 100),
            .time = uniform(0, 600),
            .wheel_radius = 0.019,
            .reference_pressure = 3e5,
            .stiffness = -23450,
            .pressure_gain = 1.78e-3};
  }
  ValvePoint<double> random_valve() {
    return {.command = {uniform(0, 5e5), uniform(0, 5e5)},
            .pressure = {uniform(0, 5e5), uniform(0, 5e5)},
            .velocity = uniform(-6, 6),
            .lag = 0.17};
  }
  Readings<double> random_readings() {
    return {.force = {uniform(0, 150), uniform(0, 150)},
            .pressure = {uniform(0, 5e5), uniform(0, 5e5)},
            .angle = uniform(-1.3, 1.3)};
  }
  void null_parameters(double* q) const {
    for (int k = 0; k < info().parameter_count; ++k)
      q[k] = std::isnan(info().parameters[k].null_value) ? info().parameters[k].typical
                                                         : info().parameters[k].null_value;
  }
  /// Near the typical value, between half and twice.
  void random_parameters(double* q) {
    for (int k = 0; k < info().parameter_count; ++k) q[k] = info().parameters[k].typical * uniform(0.5, 2);
  }

  int index_ = 0;
  std::mt19937 random_{kSeed};
};

TEST_F(EveryEffect, is_described_completely) {
  for (index_ = 0; index_ < Catalogue::kSize; ++index_) {
    const EffectInfo& e = info();
    SCOPED_TRACE(e.id);
    EXPECT_EQ(find_effect(e.id), index());
    EXPECT_GE(e.parameter_count, 1);
    EXPECT_LE(e.parameter_count, kMaxEffectParameters);
    EXPECT_LE(e.state_count, kMaxEffectStates);
    EXPECT_EQ(e.torque_term, e.hook == Hook::kTorque);
    EXPECT_GT(std::string(e.term).size(), 3u);
    EXPECT_GT(std::string(e.told_apart_by).size(), 3u);
    for (int k = 0; k < e.parameter_count; ++k) {
      const ParameterInfo& p = e.parameters[k];
      SCOPED_TRACE(p.name);
      EXPECT_GT(p.si_per_unit, 0.0);
      EXPECT_LT(p.lower, p.upper);
      EXPECT_GE(p.typical, p.lower);
      EXPECT_LE(p.typical, p.upper);
      if (std::isfinite(p.null_value)) {
        EXPECT_GE(p.null_value, p.lower);
        EXPECT_LE(p.null_value, p.upper);
      }
      if (std::string(p.unit).find("cm") == std::string::npos) {
        EXPECT_EQ(p.si_per_unit, 1.0) << p.unit;  // everything but the force-kilogram units is SI
      } else {
        EXPECT_NE(p.si_per_unit, 1.0) << p.unit;
      }
    }
    std::istringstream names(e.confused_with);
    for (std::string name; std::getline(names, name, ',');) {
      const auto first = name.find_first_not_of(' ');
      EXPECT_GE(find_effect(name.substr(first)), 0) << name;
      EXPECT_NE(name.substr(first), e.id);
    }
  }
}

TEST_F(EveryEffect, is_absent_at_its_null_values) {
  for (index_ = 0; index_ < Catalogue::kSize; ++index_) {
    SCOPED_TRACE(info().id);
    double q[kMaxEffectParameters];
    null_parameters(q);
    EXPECT_EQ(effect_delay(index(), q), 0.0);
    for (int i = 0; i < 50; ++i) {
      const auto point = random_point();
      double z[2] = {uniform(-1, 1), uniform(-1, 1)};
      EXPECT_EQ(effect_torque(index(), q, point, z), 0.0);

      const auto valve = random_valve();
      double u[2] = {valve.command[0], valve.command[1]};
      double states[2];
      effect_valve_rest(index(), q, valve, states);
      effect_command(index(), q, valve, states, u);
      EXPECT_EQ(u[0], valve.command[0]);
      EXPECT_EQ(u[1], valve.command[1]);
      double v[2] = {uniform(-3e6, 3e6), uniform(-3e6, 3e6)};
      const double before[2] = {v[0], v[1]};
      effect_pressure_rate(index(), q, valve, states, v);
      EXPECT_EQ(v[0], before[0]);
      EXPECT_EQ(v[1], before[1]);
      double p[2] = {valve.pressure[0], valve.pressure[1]};
      effect_outlet_pressure(index(), q, p);
      effect_muscle_pressure(index(), q, p);
      EXPECT_EQ(p[0], valve.pressure[0]);
      EXPECT_EQ(p[1], valve.pressure[1]);

      const auto truth = random_readings();
      auto seen = truth;
      effect_reading_rest(index(), q, truth, states);
      effect_reading(index(), q, point.time, states, seen);
      EXPECT_EQ(seen.force[0], truth.force[0]);
      EXPECT_EQ(seen.force[1], truth.force[1]);
      EXPECT_EQ(seen.pressure[0], truth.pressure[0]);
      EXPECT_EQ(seen.pressure[1], truth.pressure[1]);
      EXPECT_EQ(seen.angle, truth.angle);
    }
  }
}

TEST_F(EveryEffect, does_something_at_its_typical_values) {
  for (index_ = 0; index_ < Catalogue::kSize; ++index_) {
    SCOPED_TRACE(info().id);
    if (info().hook == Hook::kOutlier) continue;  // random: who simulates draws it
    double q[kMaxEffectParameters];
    for (int k = 0; k < info().parameter_count; ++k) q[k] = info().parameters[k].typical;
    double change = std::abs(effect_delay(index(), q));
    for (int i = 0; i < 50; ++i) {
      const auto point = random_point();
      double z[2] = {uniform(-1, 1), uniform(-1, 1)};
      change += std::abs(effect_torque(index(), q, point, z));
      const auto valve = random_valve();
      double u[2] = {valve.command[0], valve.command[1]}, v[2] = {1e7, -1e6}, p[2] = {1e4, 3e5};
      double states[2] = {3e5, 3e5};
      effect_command(index(), q, valve, states, u);
      effect_pressure_rate(index(), q, valve, states, v);
      effect_outlet_pressure(index(), q, p);
      effect_muscle_pressure(index(), q, p);
      change += std::abs(u[0] - valve.command[0]) + std::abs(v[0] - 1e7) + std::abs(v[1] + 1e6) +
                std::abs(p[0] - 1e4);
      auto seen = random_readings();
      seen.force[0] += 100;  // beyond the typical saturation
      const auto truth = seen;
      effect_reading(index(), q, point.time, z, seen);
      change += std::abs(seen.force[0] - truth.force[0]) + std::abs(seen.pressure[0] - truth.pressure[0]) +
                std::abs(seen.angle - truth.angle);
    }
    EXPECT_GT(change, 0.0);
  }
}

TEST_F(EveryEffect, of_the_torque_with_a_shape_is_linear_in_its_amplitudes) {
  int asked = 0;
  for (index_ = 0; index_ < Catalogue::kSize; ++index_) {
    if (!is_linear_for_its_shape(info())) continue;
    SCOPED_TRACE(info().id);
    ++asked;
    const auto is_shape = [&](int k) { return std::isnan(info().parameters[k].null_value); };
    for (int k = 0; k < info().parameter_count; ++k)
      if (!is_shape(k)) EXPECT_EQ(info().parameters[k].null_value, 0);
    for (int i = 0; i < 200; ++i) {
      auto point = random_point();
      const double z[2] = {uniform(-1, 1), uniform(-1, 1)};
      double a[kMaxEffectParameters], b[kMaxEffectParameters], sum[kMaxEffectParameters];
      random_parameters(a);
      random_parameters(b);
      const double s = uniform(-2, 2), t = uniform(-2, 2);
      for (int k = 0; k < info().parameter_count; ++k) {
        if (is_shape(k)) b[k] = a[k];
        sum[k] = is_shape(k) ? a[k] : s * a[k] + t * b[k];
      }
      const double of_a = effect_torque(index(), a, point, z), of_b = effect_torque(index(), b, point, z),
                   of_sum = effect_torque(index(), sum, point, z);
      EXPECT_NEAR(of_sum, s * of_a + t * of_b, 1e-12 * (std::abs(s * of_a) + std::abs(t * of_b)) + 1e-12);
      // Neither its states nor what else the baseline has in it depend on the amplitudes.
      double rate_a[2] = {}, rate_sum[2] = {};
      effect_derivative(index(), a, point, z, rate_a);
      effect_derivative(index(), sum, point, z, rate_sum);
      for (int k = 0; k < info().state_count; ++k) EXPECT_EQ(rate_a[k], rate_sum[k]);
      point.stiffness = point.pressure_gain = point.cubic_damping = point.damping = kAnyValue;
      EXPECT_EQ(effect_torque(index(), a, point, z), of_a);
    }
  }
  EXPECT_GE(asked, 30);
  EXPECT_FALSE(is_linear_for_its_shape(effect_catalogue()[find_effect("backlash")]));
  EXPECT_FALSE(is_linear_for_its_shape(effect_catalogue()[find_effect("lever_arm_variation")]));
}

TEST_F(EveryEffect, without_states_has_its_amplitudes_torques_at_once) {
  int asked = 0;
  for (index_ = 0; index_ < Catalogue::kSize; ++index_) {
    if (!is_linear_for_its_shape(info()) || info().state_count > 0) continue;
    SCOPED_TRACE(info().id);
    ++asked;
    std::vector<JointPoint<double>> points;
    for (int k = 0; k < 100; ++k) points.push_back(random_point());
    double shape[kMaxEffectParameters];
    random_parameters(shape);
    std::vector<std::vector<double>> torques(static_cast<std::size_t>(amplitude_count(info())),
                                             std::vector<double>(points.size(), 0.25));
    std::vector<double*> sums;
    for (std::vector<double>& torque : torques) sums.push_back(torque.data());
    const auto at = [&](std::size_t k) { return points[k]; };
    add_amplitude_torques(index(), shape, at, -2.0, points.size(), std::span<double* const>(sums));
    int of = -1;
    for (int j = 0; j < info().parameter_count; ++j) {
      if (!is_amplitude(info().parameters[j])) continue;
      ++of;
      double q[kMaxEffectParameters];
      for (int i = 0; i < info().parameter_count; ++i)
        q[i] = is_amplitude(info().parameters[i]) ? 0 : shape[i];
      q[j] = 1;
      for (std::size_t k = 0; k < points.size(); ++k)
        EXPECT_EQ(torques[static_cast<std::size_t>(of)][k],
                  0.25 - 2.0 * effect_torque(index(), q, points[k]));
    }
    // One sum too few: nothing is written.
    const std::vector<std::vector<double>> before = torques;
    sums.pop_back();
    add_amplitude_torques(index(), shape, at, -2.0, points.size(), std::span<double* const>(sums));
    EXPECT_EQ(torques, before);
  }
  EXPECT_GE(asked, 25);
}

// explain integrates them by steps whose slope it takes from the ends of this line.
TEST_F(EveryEffect, that_is_called_linear_in_its_state_has_a_rate_on_a_line) {
  int asked = 0;
  for (index_ = 0; index_ < Catalogue::kSize; ++index_) {
    if (!info().linear_in_state) continue;
    SCOPED_TRACE(info().id);
    ++asked;
    EXPECT_EQ(info().state_count, 1);
    for (int i = 0; i < 200; ++i) {
      const auto point = random_point();
      double q[kMaxEffectParameters];
      random_parameters(q);
      const auto rate = [&](double z) {
        double dz = 0;
        effect_derivative(index(), q, point, &z, &dz);
        return dz;
      };
      const double at = uniform(-1, 1), line = rate(0) + at * (rate(1) - rate(0));
      EXPECT_NEAR(rate(at), line, 1e-12 * (std::abs(rate(0)) + std::abs(rate(1))));
    }
  }
  EXPECT_EQ(asked, 3);
}

TEST_F(EveryEffect, that_is_called_linear_obeys_superposition) {
  for (index_ = 0; index_ < Catalogue::kSize; ++index_) {
    if (!info().linear) continue;  // not linear in its parameters
    SCOPED_TRACE(info().id);
    const auto added = [&](const double* q, const JointPoint<double>& point, const ValvePoint<double>& valve,
                           const Readings<double>& truth, double* out) {
      out[0] = effect_torque(index(), q, point);
      double u[2] = {valve.command[0], valve.command[1]}, v[2] = {1e6, -1e6};
      effect_command<double>(index(), q, valve, nullptr, u);
      effect_pressure_rate<double>(index(), q, valve, nullptr, v);
      Readings<double> seen = truth;
      effect_reading<double>(index(), q, point.time, nullptr, seen);
      out[1] = u[0] - valve.command[0];
      out[2] = u[1] - valve.command[1];
      out[3] = v[0] - 1e6;
      out[4] = v[1] + 1e6;
      out[5] = seen.force[0] - truth.force[0];
      out[6] = seen.force[1] - truth.force[1];
      out[7] = seen.pressure[0] - truth.pressure[0];
      out[8] = seen.pressure[1] - truth.pressure[1];
      out[9] = seen.angle - truth.angle;
    };
    for (int i = 0; i < 50; ++i) {
      const auto point = random_point();
      const auto valve = random_valve();
      const auto truth = random_readings();
      double a[kMaxEffectParameters], b[kMaxEffectParameters], sum[kMaxEffectParameters];
      random_parameters(a);
      random_parameters(b);
      const double s = uniform(-2, 2), t = uniform(-2, 2);
      for (int k = 0; k < info().parameter_count; ++k) sum[k] = s * a[k] + t * b[k];
      double of_a[10], of_b[10], of_sum[10];
      added(a, point, valve, truth, of_a);
      added(b, point, valve, truth, of_b);
      added(sum, point, valve, truth, of_sum);
      for (int k = 0; k < 10; ++k)  // rounding of the numbers that were subtracted, at most 5e6
        EXPECT_NEAR(of_sum[k], s * of_a[k] + t * of_b[k],
                    1e-12 * std::abs(of_sum[k]) + (k == 0 ? 1e-12 : 1e-8))
            << k;
    }
  }
}

TEST_F(EveryEffect, that_is_called_dissipative_never_gives_energy) {
  for (index_ = 0; index_ < Catalogue::kSize; ++index_) {
    if (!info().dissipative || info().state_count > 0) continue;  // not a memoryless dissipative term
    SCOPED_TRACE(info().id);
    for (int i = 0; i < 1000; ++i) {
      double q[kMaxEffectParameters];
      random_parameters(q);
      const auto point = random_point();
      EXPECT_LE(effect_torque(index(), q, point) * point.velocity, 0.0);
    }
  }
}

TEST_F(EveryEffect, with_states_that_is_called_dissipative_takes_energy_over_a_closed_cycle) {
  for (index_ = 0; index_ < Catalogue::kSize; ++index_) {
    if (!info().dissipative || info().state_count == 0) continue;  // not a dissipative term with states
    SCOPED_TRACE(info().id);
    double all_work = 0;
    for (double frequency : {0.02, 0.3, 5.0}) {
      double q[kMaxEffectParameters];
      random_parameters(q);
      const double w = 2 * kPi * frequency;
      const auto at = [&](double t) {
        JointPoint<double> x{.wheel_radius = 0.019, .reference_pressure = 3e5};
        x.angle = 0.6 * std::sin(w * t) + 0.15 * std::sin(3 * w * t);
        x.velocity = w * (0.6 * std::cos(w * t) + 0.45 * std::cos(3 * w * t));
        x.acceleration = -w * w * (0.6 * std::sin(w * t) + 1.35 * std::sin(3 * w * t));
        return x;
      };
      double z[2];
      effect_rest(index(), q, at(0), z);
      // Long enough to forget the start, then the work over one period; Heun, 40000 steps a period.
      const int steps = 40000, settle = 8;
      const double h = 1 / frequency / steps;
      double work = 0;
      for (int i = 0; i < (settle + 1) * steps; ++i) {
        const auto x0 = at(i * h), x1 = at((i + 1) * h);
        double k0[2] = {}, k1[2] = {}, guess[2];
        effect_derivative(index(), q, x0, z, k0);
        for (int k = 0; k < 2; ++k) guess[k] = z[k] + h * k0[k];
        effect_derivative(index(), q, x1, guess, k1);
        const double before = effect_torque(index(), q, x0, z) * x0.velocity;
        for (int k = 0; k < info().state_count; ++k) z[k] += h / 2 * (k0[k] + k1[k]);
        if (i >= settle * steps) work += h / 2 * (before + effect_torque(index(), q, x1, z) * x1.velocity);
      }
      EXPECT_LT(work, 1e-9) << frequency << " Hz, seed "
                            << kSeed;  // far below a resonance only rounding is left
      all_work += work;
    }
    EXPECT_LT(all_work, -1e-3);
  }
}

TEST_F(EveryEffect, has_parameter_derivatives_that_agree_with_finite_differences) {
  for (index_ = 0; index_ < Catalogue::kSize; ++index_) {
    if (info().hook != Hook::kTorque) continue;  // no torque
    SCOPED_TRACE(info().id);
    using Jet = ceres::Jet<double, kMaxEffectParameters>;
    int compared = 0;
    for (int i = 0; i < 50; ++i) {
      double q[kMaxEffectParameters] = {};
      random_parameters(q);
      const auto x = random_point();
      const double z[2] = {uniform(-1, 1), uniform(-1, 1)};
      Jet dual_q[kMaxEffectParameters];
      for (int k = 0; k < kMaxEffectParameters; ++k) dual_q[k] = Jet(q[k], k);
      const JointPoint<Jet> dual_x{.delta_pressure = Jet(x.delta_pressure),
                                   .mean_pressure = Jet(x.mean_pressure),
                                   .angle = Jet(x.angle),
                                   .velocity = Jet(x.velocity),
                                   .acceleration = Jet(x.acceleration),
                                   .time = Jet(x.time),
                                   .wheel_radius = Jet(x.wheel_radius),
                                   .reference_pressure = Jet(x.reference_pressure),
                                   .stiffness = Jet(x.stiffness),
                                   .pressure_gain = Jet(x.pressure_gain)};
      const Jet dual_z[2] = {Jet(z[0]), Jet(z[1])};
      const Jet torque = effect_torque(index(), dual_q, dual_x, dual_z);
      EXPECT_NEAR(torque.a, effect_torque(index(), q, x, z), 1e-12 * (1 + std::abs(torque.a)));
      for (int k = 0; k < info().parameter_count; ++k) {
        const double h = 1e-6 * std::abs(q[k]);
        double high[kMaxEffectParameters], low[kMaxEffectParameters];
        for (int j = 0; j < kMaxEffectParameters; ++j) high[j] = low[j] = q[j];
        high[k] += h;
        low[k] -= h;
        const double up = effect_torque(index(), high, x, z), down = effect_torque(index(), low, x, z);
        // Relative step 1e-6: truncation 1e-12 × third derivative (a few thousand for sin(2πft) over minutes),
        // cancellation 1e-16/1e-6.
        const double change = (up - down) / 2, expected = torque.v[k] * h;
        const double tolerance = 1e-9 * (1e-6 + std::abs(torque.a)) + 2e-2 * std::abs(expected);
        if (std::abs(effect_torque(index(), q, x, z) * 2 - up - down) <
            1e-9 * (1 + std::abs(up))) {  // no kink between
          EXPECT_NEAR(change, expected, tolerance) << info().parameters[k].name;
          ++compared;
        }
      }
    }
    EXPECT_GT(compared, 25);
  }
}

TEST(Catalogue, has_every_id_once_and_knows_the_seeds_letters) {
  std::set<std::string> ids;
  for (const EffectInfo& e : effect_catalogue()) EXPECT_TRUE(ids.insert(e.id).second) << e.id;
  EXPECT_EQ(find_effect("A"), find_effect("stiffness"));
  EXPECT_EQ(find_effect("B"), find_effect("pressure"));
  EXPECT_EQ(find_effect("C"), find_effect("cubic_damping"));
  EXPECT_EQ(find_effect("D"), find_effect("viscous_damping"));
  EXPECT_EQ(find_effect("E"), -1);
  EXPECT_EQ(find_effect(""), -1);
}

TEST(Catalogue, gives_nothing_for_an_index_outside) {
  const double q[kMaxEffectParameters] = {1, 1, 1, 1};
  EXPECT_EQ(effect_torque(-1, q, JointPoint<double>{.velocity = 1}), 0.0);
  EXPECT_EQ(effect_torque(Catalogue::kSize, q, JointPoint<double>{.velocity = 1}), 0.0);
}

TEST(Catalogue, is_the_same_in_float) {
  const JointPoint<float> x{.delta_pressure = 1e5f, .velocity = 2.0f, .wheel_radius = 0.019f};
  const float d[] = {0.14f};
  EXPECT_FLOAT_EQ(effect_torque(find_effect("D"), d, x), -0.28f);
}

}  // namespace
}  // namespace isac::models
