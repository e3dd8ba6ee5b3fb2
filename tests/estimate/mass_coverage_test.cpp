// Bias and coverage of the masses over 200 seeds, and the designed poses against the smallest errors that physics allows.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <random>

#include "isac/estimate/mass_fit.hpp"
#include "isac/estimate/pose_design.hpp"
#include "mass_data.hpp"

namespace isac::estimate::test {
namespace {

constexpr int kSeeds = 200;

struct Counts {
  int inside[3] = {};
  double bias[3] = {}, error[3] = {};
};

Counts count(int poses, const MassFitOptions& options, double noise, std::uint32_t first) {
  const MassArm arm = soft_arm();
  Counts out;
  for (int s = 0; s < kSeeds; ++s) {
    const MassFit fit =
        fit_masses(arm, random_poses(arm, poses, noise, first + static_cast<std::uint32_t>(s)), options);
    for (std::size_t k = 0; k < 3; ++k) {
      out.inside[k] += fit.masses[k].ci_low < kTruth[k] && kTruth[k] < fit.masses[k].ci_high ? 1 : 0;
      out.bias[k] += (fit.masses[k].value - kTruth[k]) / kSeeds;
      out.error[k] += fit.masses[k].std_error / kSeeds;
    }
  }
  return out;
}

void expect_covered(const Counts& counts) {
  for (int k = 0; k < 3; ++k) {
    // 92 to 98 % of 200 are asked for; three standard deviations of 95 % are 4.6 %, so a seed set is chosen once and kept.
    EXPECT_GE(counts.inside[k], 184) << "m" << k + 1;
    EXPECT_LE(counts.inside[k], 196) << "m" << k + 1;
    EXPECT_LT(std::abs(counts.bias[k]), 4 * counts.error[k] / std::sqrt(kSeeds)) << "m" << k + 1;
  }
}

TEST(MassCoverage, intervals_cover_when_the_noise_is_estimated) {
  expect_covered(count(20, {}, 0.1, 1000));
}

TEST(MassCoverage, intervals_cover_when_the_noise_is_told) {
  MassFitOptions options;
  options.torque_noise.fill(0.1);
  expect_covered(count(8, options, 0.1, 3000));
}

TEST(MassCoverage, intervals_cover_when_the_actuators_are_as_wrong_as_they_are_said_to_be) {
  MassArm arm = soft_arm();
  for (MassActuator& actuator : arm.actuators) {
    actuator.A_error = 0.01 * std::abs(actuator.A);
    actuator.B_error = 0.02 * actuator.B;
  }
  models::Coupling<double, 6> inverse;
  ASSERT_TRUE(ok(models::inverse_coupling<double, 6>(arm.coupling, inverse)));
  MassFitOptions options;
  options.from_pressures = true;
  int inside[3] = {}, random_only[3] = {};
  for (std::uint32_t s = 0; s < kSeeds; ++s) {
    std::mt19937 random(7000 + s);
    std::normal_distribution<double> normal;
    double A[6], B[6];  // the true ones; the arm holds what was identified
    for (std::size_t j = 0; j < 6; ++j) {
      A[j] = arm.actuators[j].A + arm.actuators[j].A_error * normal(random);
      B[j] = arm.actuators[j].B + arm.actuators[j].B_error * normal(random);
    }
    auto poses = random_poses(arm, 40, 0, 8000 + s);
    for (MassPose& pose : poses) {
      const ArmVector phi = models::multiply<double, 6>(inverse, pose.angle);
      const ArmVector torque = models::multiply_transposed<double, 6>(arm.coupling, pose.torque);
      for (std::size_t j = 0; j < 6; ++j) {
        const double r = arm.actuators[j].wheel_radius;
        pose.delta_pressure[j] = (torque[j] + 0.02 * normal(random) - A[j] * r * r * phi[j]) / (B[j] * r);
      }
    }
    const MassFit fit = fit_masses(arm, poses, options);
    for (std::size_t k = 0; k < 3; ++k) {
      const double error = std::abs(fit.masses[k].value - kTruth[k]);
      inside[k] += error < fit.masses[k].ci_high - fit.masses[k].value ? 1 : 0;
      random_only[k] += error < 1.96 * fit.random_errors[k] ? 1 : 0;
    }
  }
  for (int k = 0; k < 3; ++k) {
    EXPECT_GE(inside[k], 184) << "m" << k + 1;
    EXPECT_LE(inside[k], 196) << "m" << k + 1;
  }
  EXPECT_LT(random_only[0], 184) << "without the model's part the interval of m1 is too short";
}

TEST(MassCoverage, a_clean_record_is_rarely_called_biased) {
  const MassArm arm = soft_arm();
  int alarms = 0;
  for (std::uint32_t s = 0; s < 200; ++s)
    alarms +=
        has_warning(fit_masses(arm, random_poses(arm, 20, 0.1, 5000 + s), {}), "unmodelled_error") ? 1 : 0;
  EXPECT_LE(alarms, 8);  // level 1 %, Bonferroni: 2 expected; more than 8 has a chance of 2e-4
}

TEST(PoseDesign, comes_within_fifteen_percent_of_the_smallest_errors_and_beats_random_poses) {
  const MassArm arm = soft_arm();
  const struct {
    int poses;
    double m1, m2, m3;
  } best[] = {{8, 0.051, 0.032, 0.0135}, {20, 0.031, 0.019, 0.0085}, {50, 0.019, 0.012, 0.0054}};
  for (const DesignCriterion criterion : {DesignCriterion::kA, DesignCriterion::kD}) {
    for (const auto& row : best) {
      PoseDesignOptions options;
      options.poses = row.poses;
      options.criterion = criterion;
      const PoseDesign design = design_poses(arm, options);
      const double wanted[] = {row.m1, row.m2, row.m3};
      for (std::size_t k = 0; k < 3; ++k) {
        EXPECT_LT(design.std_errors[k], 1.15 * wanted[k]) << row.poses << " poses, m" << k + 1;
        EXPECT_LT(design.std_errors[k], 0.75 * design.random_std_errors[k]);
      }
      ASSERT_EQ(design.theta.size(), static_cast<std::size_t>(row.poses));
      for (std::size_t i = 0; i < design.phi.size(); ++i) {
        for (std::size_t j = 0; j < 6; ++j) {
          EXPECT_GE(design.phi[i][j], arm.limits.lower[j]);
          EXPECT_LE(design.phi[i][j], arm.limits.upper[j]);
        }
      }
    }
  }
}

TEST(PoseDesign, predicts_the_errors_that_a_fit_of_its_poses_has) {
  const MassArm arm = soft_arm();
  const PoseDesign design = design_poses(arm, {});
  std::vector<MassPose> poses;
  for (const ArmVector& theta : design.theta) {
    MassPose pose;
    pose.name = "designed";
    pose.angle = theta;
    pose.torque = models::gravity_torque(arm.chain, theta);
    poses.push_back(pose);
  }
  MassFitOptions options;
  options.torque_noise.fill(0.1);
  options.robust = false;
  const MassFit fit = fit_masses(arm, poses, options);
  for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(fit.masses[k].std_error, design.std_errors[k], 1e-9);
}

TEST(PoseDesign, is_the_same_twice_and_adds_to_what_was_recorded) {
  const MassArm arm = soft_arm();
  PoseDesignOptions options;
  options.poses = 4;
  const PoseDesign first = design_poses(arm, options), second = design_poses(arm, options);
  EXPECT_EQ(first.theta, second.theta);
  options.recorded = fit_masses(arm, random_poses(arm, 12, 0.1, 9), {}).information;
  options.add_to_recorded = true;
  const PoseDesign added = design_poses(arm, options);
  options.add_to_recorded = false;
  const PoseDesign alone = design_poses(arm, options);
  double with = 0, without = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    with += std::pow(added.with_recorded[k] / kTruth[k], 2);
    without += std::pow(alone.with_recorded[k] / kTruth[k], 2);
  }
  EXPECT_LE(with, without * 1.001);  // the search ends a round when it gains less than that
}

/// What the masses' standard errors do not cover must be said: an angle's zero off by up to 4 degrees, or B or A of one actuator
/// off by up to 10 % although they are taken for exact; 8 or 20 random poses.
TEST(MassBias, a_wrong_zero_or_actuator_is_found_said_to_hide_or_does_no_harm) {
  const MassArm arm = soft_arm();
  models::Coupling<double, 6> inverse;
  ASSERT_TRUE(ok(models::inverse_coupling<double, 6>(arm.coupling, inverse)));
  for (const bool by_zero : {true, false}) {
    int harmed = 0, silent = 0, found = 0;
    constexpr int kRuns = 200;
    for (std::uint32_t seed = 1; seed <= kRuns; ++seed) {
      std::mt19937 random(seed + 9000);
      std::uniform_real_distribution<double> unit(0, 1);
      auto poses = random_poses(arm, seed % 2 == 0 ? 8 : 20, 0.05, seed + 9000);
      const auto joint = static_cast<std::size_t>(seed % 6);
      const double sign = unit(random) < 0.5 ? -1 : 1, size = unit(random);
      MassFitOptions options;
      if (by_zero) {
        for (MassPose& pose : poses) pose.angle[joint] += sign * size * 4 * 3.14159265358979 / 180;
      } else {
        options.from_pressures = true;
        const bool gain = seed % 4 < 2;
        for (MassPose& pose : poses) {
          const ArmVector phi = models::multiply<double, 6>(inverse, pose.angle);
          const ArmVector torque = models::multiply_transposed<double, 6>(arm.coupling, pose.torque);
          for (std::size_t j = 0; j < 6; ++j) {
            const MassActuator& a = arm.actuators[j];
            const double off = j == joint ? 1 + 0.1 * sign * size : 1;
            const double A = gain ? a.A : a.A * off, B = gain ? a.B * off : a.B;
            pose.delta_pressure[j] =
                (torque[j] - A * a.wheel_radius * a.wheel_radius * phi[j]) / (B * a.wheel_radius);
          }
        }
      }
      const MassFit fit = fit_masses(arm, poses, options);
      bool off = false;
      for (std::size_t k = 0; k < 3; ++k)
        off = off || !(std::abs(fit.masses[k].value - kTruth[k]) < 3 * fit.masses[k].std_error);
      const bool said = has_warning(fit, "unmodelled_error") || has_warning(fit, "hidden_zero") ||
                        has_warning(fit, "actuator_model") || has_warning(fit, "noise_differs");
      found += has_warning(fit, "unmodelled_error") ? 1 : 0;
      harmed += off ? 1 : 0;
      silent += off && !said ? 1 : 0;
    }
    if (std::getenv("ISAC_SHOW") != nullptr)
      std::printf(
          "%s: masses off by 3 standard errors in %d of %d, silently in %d; found in the residuals in %d\n",
          by_zero ? "zero" : "actuator", harmed, kRuns, silent, found);
    EXPECT_LE(silent, kRuns / 50);  // 2 %
  }
}

}  // namespace
}  // namespace isac::estimate::test
