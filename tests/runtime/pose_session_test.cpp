// Poses held on the simulated arm, without the program around it.
#include "isac/runtime/pose_session.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "../system/run_program.hpp"
#include "isac/core/error.hpp"

namespace isac::runtime {
namespace {

const std::string kArm = std::string(ISAC_SOURCE_DIR) + "/data/arms/right_soft_arm.toml";
constexpr double kDegree = kPi / 180;

class Listener final : public PoseObserver {
 public:
  void note(const std::string& sentence) override { notes += sentence + "\n"; }
  void held(const HeldPose&, std::size_t done, std::size_t) override {
    if (done == stop_after) stop = true;
  }
  std::string notes;
  std::size_t stop_after = 0;
  std::atomic<bool> stop{false};
};

class Poses : public testing::Test {
 protected:
  PoseSessionOptions options(const std::string& words = "") const {
    PoseSessionOptions out;
    out.card = "sim:arm=" + kArm + words;
    out.arm = record::read_arm(kArm);
    out.theta = {{0.2, 0.4, -0.3, 0.2, 0.5, -0.4}, {-0.2, -0.5, 0.4, 0.1, -0.6, 0.3}};
    out.file = folder_ / "poses.csv";
    return out;
  }
  std::string code_of(const PoseSessionOptions& bad) {
    try {
      static_cast<void>(hold_poses(bad, listener_, listener_.stop));
    } catch (const Error& error) {
      return error.code();
    }
    return "";
  }
  test::ScratchFolder folder_;
  Listener listener_;
};

/// Torques that hold the arm by the file's model, mean of both sides, against gravity of the file's masses.
double largest_gap(const PoseSessionResult& result, const record::ArmFile& arm) {
  double worst = 0;
  for (std::size_t i = 0; i + 1 < result.rows.size(); i += 2) {
    const HeldPose &up = result.rows[i], &down = result.rows[i + 1];
    ArmAngles phi{};
    for (std::size_t j = 0; j < 6; ++j) phi[j] = (up.phi[j] + down.phi[j]) / 2;
    const ArmAngles gravity = models::multiply_transposed<double, 6>(
        arm.coupling, models::gravity_torque(arm.chain, models::multiply<double, 6>(arm.coupling, phi)));
    for (std::size_t j = 0; j < 6; ++j) {
      const record::ArmActuator& a = arm.actuators[j];
      const double r = a.wheel_radius, delta = (up.delta_pressure[j] + down.delta_pressure[j]) / 2;
      // Steps of the encoder: 0.785 mrad on |A| r² of this joint, both sides.
      worst = std::max(
          worst, std::abs(a.A * r * r * phi[j] + a.B * r * delta + gravity[j]) / (-a.A * r * r * 0.785e-3));
    }
  }
  return worst;
}

TEST_F(Poses, friction_cancels_in_the_mean_of_both_sides) {
  const PoseSessionOptions rubbing = options(",friction=0.02");
  const PoseSessionResult result = hold_poses(rubbing, listener_, listener_.stop);
  ASSERT_TRUE(result.complete);
  ASSERT_EQ(result.rows.size(), 4u);
  EXPECT_EQ(result.rows[0].approach, 1);
  EXPECT_EQ(result.rows[1].approach, -1);
  // One side alone is off by the friction, 0.14 N m on joint 3: 20 steps of its encoder. The mean by less than one step.
  EXPECT_LT(largest_gap(result, rubbing.arm), 1.0);
  const record::ArmActuator& third = rubbing.arm.actuators[2];
  const double swing =
      third.B * third.wheel_radius * (result.rows[0].delta_pressure[2] - result.rows[1].delta_pressure[2]) /
          2 +
      third.A * third.wheel_radius * third.wheel_radius * (result.rows[0].phi[2] - result.rows[1].phi[2]) / 2;
  EXPECT_NEAR(swing, 0.02 * third.B * third.wheel_radius * 2 * kPascalPerKgfCm2, 0.015);
}

TEST_F(Poses, a_stop_keeps_the_poses_that_were_finished_and_closes_the_file) {
  listener_.stop_after = 2;
  const PoseSessionOptions all = options();
  const PoseSessionResult result = hold_poses(all, listener_, listener_.stop);
  EXPECT_FALSE(result.complete);
  EXPECT_EQ(result.rows.size(), 2u);
  const std::string text = test::read_text(all.file);
  EXPECT_NE(text.find("# closed:"), std::string::npos) << text;
  EXPECT_NE(text.find(",1,-1,"), std::string::npos) << text;
}

TEST_F(Poses, what_cannot_be_held_is_refused_before_anything_is_written) {
  PoseSessionOptions bad = options();
  bad.theta.clear();
  EXPECT_EQ(code_of(bad), "no_poses");
  bad = options();
  bad.card = "sim:";
  EXPECT_EQ(code_of(bad), "card_too_small");
  bad = options();
  bad.rate = 5;
  EXPECT_EQ(code_of(bad), "rate_nonsense");
  bad = options();
  bad.side = 0;
  EXPECT_EQ(code_of(bad), "side_nonsense");
  bad = options();
  bad.theta[1][0] = std::nan("");
  EXPECT_EQ(code_of(bad), "pose_impossible");
  bad = options();
  bad.arm.actuators[3].A = 10;
  EXPECT_EQ(code_of(bad), "actuators_unknown");
  EXPECT_FALSE(std::filesystem::exists(bad.file));
}

TEST_F(Poses, outside_its_limits_the_arm_is_vented) {
  PoseSessionOptions narrow = options();
  narrow.theta = {{}};
  narrow.arm.limits.lower[1] = -12 * kDegree;
  narrow.arm.limits.upper[1] = 12 * kDegree;
  narrow.card += ",pull=2:20";  // what nobody reckoned with: 20 N m
  EXPECT_EQ(code_of(narrow), "limit");
}

}  // namespace
}  // namespace isac::runtime
