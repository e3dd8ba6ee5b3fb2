// Masses of an arm from poses: the seed's own pose, many poses, errors that are shared, hidden, gross or refused by name.
#include "isac/estimate/mass_fit.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "isac/core/error.hpp"
#include "isac/estimate/mass_problem.hpp"
#include "mass_data.hpp"

namespace isac::estimate::test {
namespace {

const Estimated& other(const MassFit& fit, const std::string& name) {
  const auto hit =
      std::find_if(fit.others.begin(), fit.others.end(), [&](const Estimated& e) { return e.name == name; });
  EXPECT_NE(hit, fit.others.end()) << name;
  return *hit;
}

TEST(Masses, the_pose_of_6_4_gives_the_seeds_masses_and_their_standard_errors) {
  const std::vector<MassPose> poses{pose_of_6_4()};
  const MassFit fit = fit_masses(soft_arm(), poses, {});
  // The torques are given with four digits: 5e-5 N m times at most 3.6 kg per N m.
  for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(fit.masses[k].value, kTruth[k], 2e-4);
  EXPECT_NEAR(fit.masses[0].std_error, 0.36, 0.005);  // as printed in docs/errata.md
  EXPECT_NEAR(fit.masses[1].std_error, 0.21, 0.005);
  EXPECT_NEAR(fit.masses[2].std_error, 0.064, 0.0005);
  EXPECT_NEAR(fit.condition, 38, 0.5);
  EXPECT_EQ(fit.degrees_of_freedom, 0);
  EXPECT_NE(text_of(fit, "nothing_to_check_with").find("A single pose"), std::string::npos);
  EXPECT_TRUE(has_warning(fit, "noise_assumed"));
  EXPECT_EQ(fit.sign, TorqueSign::kGravity);
}

TEST(Masses, torques_that_hold_the_arm_are_told_by_their_sign) {
  MassPose pose = pose_of_6_4();
  for (double& torque : pose.torque) torque = -torque;
  const MassFit fit = fit_masses(soft_arm(), std::vector<MassPose>{pose}, {});
  EXPECT_EQ(fit.sign, TorqueSign::kActuator);
  for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(fit.masses[k].value, kTruth[k], 2e-4);
}

TEST(Masses, derivatives_by_every_unknown_are_those_of_differences) {
  MassArm arm = soft_arm();
  for (MassActuator& actuator : arm.actuators) actuator.A_error = 500, actuator.B_error = actuator.B / 50;
  for (const bool actuator_angles : {false, true}) {
    MassFitOptions options;
    options.actuator_angles = actuator_angles;
    options.torques_by_model = actuator_angles;
    MassProblem problem(arm, options);
    problem.poses = random_poses(arm, 3, 0.1, 11);
    fill_data(problem, options, {1, 1, 1}, TorqueSign::kActuator, false);
    using Kind = MassUnknown::Kind;
    for (std::size_t k = 0; k < 3; ++k) problem.unknowns.push_back({Kind::kMass, k, "m", "kg"});
    problem.unknowns.push_back({Kind::kLoad, 0, "load", "kg"});
    for (const Kind kind : {Kind::kOffset, Kind::kZero, Kind::kActuatorA, Kind::kActuatorB})
      for (std::size_t j = 0; j < 6; ++j) problem.unknowns.push_back({kind, j, "x", "-"});
    const auto n = static_cast<Eigen::Index>(problem.unknowns.size());
    Eigen::VectorXd values = Eigen::VectorXd::Constant(n, 0.07);
    values.head(4) << 1.7, 0.5, 0.2, 0.3;
    Eigen::VectorXd slope(n);
    for (const MassDatum& row : problem.data) {
      (void)problem.predict(row, values, slope.data());
      for (Eigen::Index k = 0; k < n; ++k) {
        Eigen::VectorXd up = values, down = values;
        up[k] += 1e-6;
        down[k] -= 1e-6;
        const double difference =
            (problem.predict(row, up, nullptr) - problem.predict(row, down, nullptr)) / 2e-6;
        EXPECT_NEAR(slope[k], difference, 2e-8);  // 1e-12 of curvature, 1e-9 of rounding on 10 N m
      }
    }
  }
}

TEST(Masses, the_robust_fit_of_clean_poses_is_exact) {
  const MassArm arm = soft_arm();
  const MassFit fit = fit_masses(arm, random_poses(arm, 6, 0, 5), {});
  for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(fit.masses[k].value, kTruth[k], 1e-9);
  EXPECT_EQ(fit.sign, TorqueSign::kActuator);
}

TEST(Masses, a_gross_pose_is_named_and_moves_no_mass_by_a_standard_error) {
  const MassArm arm = soft_arm();
  auto poses = random_poses(arm, 20, 0.1, 21);
  const MassFit clean = fit_masses(arm, poses, {});
  for (double& torque : poses[6].torque) torque += 1.5;
  const MassFit fit = fit_masses(arm, poses, {});
  EXPECT_TRUE(fit.poses[6].left_out);
  EXPECT_NE(text_of(fit, "pose_left_out").find("row 7"), std::string::npos);
  for (std::size_t k = 0; k < 3; ++k)
    EXPECT_LT(std::abs(fit.masses[k].value - clean.masses[k].value), clean.masses[k].std_error);
}

TEST(Masses, poses_from_both_sides_are_averaged_so_that_friction_cancels) {
  const MassArm arm = soft_arm();
  std::vector<MassPose> rows;
  long target = 0;
  for (const MassPose& pose : random_poses(arm, 10, 0.01, 8)) {
    for (const int side : {1, -1}) {
      MassPose row = pose;
      row.target = target;
      row.approach = side;
      for (double& torque : row.torque) torque += side * 0.4;
      rows.push_back(row);
    }
    ++target;
  }
  const MassFit fit = fit_masses(arm, rows, {});
  EXPECT_EQ(fit.poses.size(), 10u);
  for (std::size_t j = 0; j < 6; ++j)
    EXPECT_NEAR(fit.friction[j], 0.4, 1e-9);  // the same noise on both sides
  for (std::size_t k = 0; k < 3; ++k)
    EXPECT_NEAR(fit.masses[k].value, kTruth[k], 5 * fit.masses[k].std_error);  // 5: one in a million
  EXPECT_LT(fit.masses[0].std_error, 0.01) << "0.4 N m of friction is gone; 10 poses at 0.01 N m are left";
  rows.pop_back();
  EXPECT_TRUE(has_warning(fit_masses(arm, rows, {}), "approach_one_sided"));
}

TEST(Masses, a_load_where_m3_sits_is_refused_by_name_unless_it_was_taken_off) {
  MassArm arm = soft_arm();
  auto poses = random_poses(arm, 20, 0.05, 31);
  MassFitOptions options;
  options.load = true;
  const MassFit refused = fit_masses(arm, poses, options);
  EXPECT_FALSE(other(refused, "load").identifiable);
  EXPECT_NE(other(refused, "load").reason.find("m3"), std::string::npos);
  MassArm loaded = arm;
  loaded.chain.masses[2].mass += 0.34;
  auto with = random_poses(loaded, 20, 0.05, 32);
  for (MassPose& pose : poses) pose.load = 0;
  poses.insert(poses.end(), with.begin(), with.end());
  const MassFit fit = fit_masses(arm, poses, options);
  EXPECT_NEAR(other(fit, "load").value, 0.34, 4 * other(fit, "load").std_error);
  EXPECT_LT(other(fit, "load").std_error, 0.02);
  EXPECT_NEAR(fit.masses[2].value, 0.14, 4 * fit.masses[2].std_error);
}

TEST(Masses, zeros_and_offsets_are_fitted_where_poses_allow_and_else_refused_by_name) {
  const MassArm arm = soft_arm();
  auto poses = random_poses(arm, 40, 0.03, 41);
  for (MassPose& pose : poses) {
    pose.angle[2] -= 0.05;   // the encoder of joint 3 reads too little
    pose.torque[1] += 0.30;  // a hose pulls on joint 2
  }
  MassFitOptions options;
  options.zeros = options.offsets = true;
  const MassFit fit = fit_masses(arm, poses, options);
  EXPECT_NEAR(other(fit, "zero_theta3").value, 0.05, 4 * other(fit, "zero_theta3").std_error);
  EXPECT_LT(other(fit, "zero_theta3").std_error, 0.02);
  EXPECT_NEAR(other(fit, "offset_tau2").value, -0.30,
              4 * other(fit, "offset_tau2").std_error);  // gravity's sign
  EXPECT_FALSE(other(fit, "zero_theta1").identifiable) << "gravity does not change around the vertical axis";
  EXPECT_NE(other(fit, "zero_theta1").reason.find("calibrate"), std::string::npos);
  for (std::size_t k = 0; k < 3; ++k)
    EXPECT_NEAR(fit.masses[k].value, kTruth[k], 4 * fit.masses[k].std_error);
  // One pose tells none of them, and keeps its masses.
  const MassFit single = fit_masses(arm, std::vector<MassPose>{pose_of_6_4()}, options);
  for (const Estimated& unknown : single.others) EXPECT_FALSE(unknown.identifiable) << unknown.name;
  EXPECT_NEAR(single.masses[0].value, 1.75, 2e-4);
}

TEST(Masses, a_wrong_zero_is_found_in_the_residuals_or_said_to_be_hidden) {
  const MassArm arm = soft_arm();
  auto poses = random_poses(arm, 30, 0.05, 51);
  EXPECT_FALSE(has_warning(fit_masses(arm, poses, {}), "unmodelled_error"));
  for (MassPose& pose : poses) pose.angle[1] += 0.08;
  const MassFit fit = fit_masses(arm, poses, {});
  EXPECT_NE(text_of(fit, "unmodelled_error").find("zero of theta2"), std::string::npos)
      << text_of(fit, "unmodelled_error");
  const MassFit single = fit_masses(arm, std::vector<MassPose>{pose_of_6_4()}, {});
  ASSERT_FALSE(single.sensitivities.empty());
  // What the poses hide is said: one degree of theta2 in the seed's pose.
  MassPose turned = pose_of_6_4();
  turned.angle[1] += 3.14159265358979 / 180;
  const MassFit shifted = fit_masses(arm, std::vector<MassPose>{turned}, {});
  const auto hit = std::find_if(single.sensitivities.begin(), single.sensitivities.end(),
                                [](const MassSensitivity& s) { return s.cause == "zero of theta2"; });
  ASSERT_NE(hit, single.sensitivities.end());
  // The recorded angle is too large by one degree: the zero is −1°. Second order in one degree: 1e-3 kg.
  EXPECT_NEAR(shifted.masses[0].value - single.masses[0].value, -hit->per_unit[0] * 3.14159265358979 / 180,
              5e-3);
}

TEST(Masses, the_actuators_errors_are_part_of_the_standard_errors_and_do_not_average_away) {
  MassArm arm = soft_arm();
  for (MassActuator& actuator : arm.actuators) actuator.B_error = 0.02 * actuator.B;
  models::Coupling<double, 6> inverse;
  ASSERT_TRUE(ok(models::inverse_coupling<double, 6>(arm.coupling, inverse)));
  MassFitOptions options;
  options.from_pressures = true;
  const auto held = [&](int count, std::uint32_t seed, double gain) {
    auto poses = random_poses(arm, count, 0.05, seed);
    for (MassPose& pose : poses) {
      const ArmVector phi = models::multiply<double, 6>(inverse, pose.angle);
      const ArmVector torque = models::multiply_transposed<double, 6>(arm.coupling, pose.torque);
      for (std::size_t j = 0; j < 6; ++j) {
        const MassActuator& a = arm.actuators[j];
        pose.delta_pressure[j] =
            (torque[j] - a.A * a.wheel_radius * a.wheel_radius * phi[j]) / (gain * a.B * a.wheel_radius);
      }
    }
    return poses;
  };
  const MassFit few = fit_masses(arm, held(10, 61, 1), options),
                many = fit_masses(arm, held(160, 62, 1), options);
  for (std::size_t k = 0; k < 3; ++k) {
    EXPECT_NEAR(many.masses[k].value, kTruth[k], 4 * many.masses[k].std_error);
    EXPECT_GT(many.model_errors[k], 0);
    EXPECT_NEAR(std::hypot(many.random_errors[k], many.model_errors[k]), many.masses[k].std_error, 1e-12);
    // Sixteen times the poses: the random part falls to about a quarter.
    EXPECT_LT(many.random_errors[k], 0.4 * few.random_errors[k]);
  }
  // Ten times the errors of B, the actuator is 10 % wrong: found, since A r² φ − gravity fixes the scale.
  const MassFit wrong = fit_masses(arm, held(60, 63, 1.1), options);
  EXPECT_TRUE(has_warning(wrong, "actuator_model"));
}

TEST(Masses, a_joint_that_scatters_more_than_the_others_is_named) {
  const MassArm arm = soft_arm();
  auto poses = random_poses(arm, 30, 0.05, 71);
  EXPECT_FALSE(has_warning(fit_masses(arm, poses, {}), "noise_differs"));
  std::mt19937 random(72);
  std::normal_distribution<double> normal;
  for (MassPose& pose : poses) pose.torque[2] += 0.2 * normal(random);
  EXPECT_NE(text_of(fit_masses(arm, poses, {}), "noise_differs").find("joint 3"), std::string::npos);
}

TEST(Masses, what_the_poses_cannot_tell_is_refused_by_name) {
  const MassArm arm = soft_arm();
  std::vector<MassPose> poses{pose_of_6_4()};
  poses[0].torque[4] = std::nan("");
  poses[0].torque[2] = std::nan("");
  const MassFit fit = fit_masses(arm, poses, {});  // joint 2 alone: one equation
  for (const Estimated& mass : fit.masses) {
    EXPECT_FALSE(mass.identifiable) << mass.name;
    EXPECT_FALSE(mass.reason.empty());
  }
  poses[0].torque.fill(std::nan(""));
  EXPECT_THROW((void)fit_masses(arm, poses, {}), Error);
}

}  // namespace
}  // namespace isac::estimate::test
