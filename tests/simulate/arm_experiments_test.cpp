// The seed's experiments with the whole arm (6.4, chapter 7), repeated on the simulated one. Numbers stand in docs/arm.md; set
// ISAC_SHOW=1 to have them printed. Two arms: table 6.1's last column read as a diameter (docs/errata.md) and as a radius.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "arm_loop.hpp"

namespace {

using namespace isac;
using namespace isac::simulate;
using namespace isac::test;
using models::Vec3;
using Samples = std::vector<ArmSample>;
using Line = control::LineTrajectory<double, 512>;

/// Lines of the hand one after another, each planned, checked, and begun where the one before ended.
class Path {
 public:
  explicit Path(const ArmPlantConfig& config, const ArmVector& start) : at_(start) {
    reach_.middle = test::kMiddle;
    for (std::size_t i = 0; i < kArmJoints; ++i) {
      const ArmJointConfig& joint = config.joints[i];
      reach_.limits.upper[i] =
          0.95 * full_torque(joint) / (-joint.muscle.A * joint.wheel_radius * joint.wheel_radius);
      reach_.limits.lower[i] = -reach_.limits.upper[i];
      reach_.speed[i] = 2 * kPi;
    }
    models::Chain<double, 6> chain = config.chain;
    tool_ = models::tool_position(chain, models::multiply<double, 6>(config.coupling, start));
  }
  /// To the place `offset` away from the start of the path; waits there for `pause` seconds.
  void to(const Vec3<double>& offset, double speed, double pause) {
    auto line = std::make_unique<Line>();
    const auto check = line->plan(reach_, at_, tool_ + offset, speed);
    ASSERT_EQ(check.refusal, control::LineRefusal::kNone)
        << describe(check.refusal) << ", point " << check.point << ", joint " << check.joint + 1;
    at_ = line->point(line->count() - 1);
    parts_.push_back({end_, std::move(line)});
    end_ += parts_.back().line->duration() + pause;
  }
  [[nodiscard]] double end() const { return end_; }
  [[nodiscard]] control::LinePoint<double> at(double time) const {
    std::size_t n = 0;
    while (n + 1 < parts_.size() && parts_[n + 1].start <= time) ++n;
    return parts_[n].line->at(time - parts_[n].start);
  }

 private:
  struct Part {
    double start;
    std::unique_ptr<Line> line;
  };
  control::ArmReach<double> reach_;
  ArmVector at_;
  Vec3<double> tool_;
  std::vector<Part> parts_;
  double end_ = 0;
};

struct Follow {
  Samples samples;
  double behind = 0;  ///< m, largest distance of the hand from where it should be
};

/// Until the integrals of the position loops (K_P/K_I is 2.5 to 4 s) have taken over what nobody compensates.
void settle(ArmLoop& loop) {
  loop.run(12, [&](double) { return loop.rest(); });
}

Follow follow(const Arm& arm, const Path& path, bool compensate, double load, const ArmVector& start = {}) {
  ArmPlantConfig truth = true_arm(arm);
  truth.load = load;
  ArmLoop loop = loop_of(truth, arm);
  loop.controller.compensate = compensate;
  loop.start(start);
  settle(loop);
  Follow out{loop.run(path.end(), [&](double t) { return path.at(t); })};
  for (const ArmSample& s : out.samples) out.behind = std::max(out.behind, length(s.tool - s.wanted_tool));
  return out;
}

/// Largest distance of the hand from the straight piece a b, from `from` s on.
double off_piece(const Samples& samples, const Vec3<double>& a, const Vec3<double>& b) {
  double worst = 0;
  for (const ArmSample& s : samples) {
    const double share = std::clamp(dot(s.tool - a, b - a) / dot(b - a, b - a), 0.0, 1.0);
    worst = std::max(worst, length(s.tool - (a + share * (b - a))));
  }
  return worst;
}

/// Standard deviation of the vertical speed of the strokes that go up (+1) or down (−1), m/s: over 0.5 s from 0.3 s
/// after the beginning of each; 0 is a straight line, at whatever delay.
double ripple(const Samples& samples, int direction) {
  const auto wanted = [&](std::size_t k) { return samples[k].wanted_tool.z; };
  double sum = 0;
  int strokes = 0;
  for (std::size_t k = 1; k + 1700 < samples.size(); ++k) {
    const bool begins = wanted(k) == wanted(k - 1) && (wanted(k + 1) - wanted(k)) * direction > 0;
    if (!begins) continue;
    double mean = 0, square = 0;
    constexpr int kPieces = 50;
    for (int n = 0; n < kPieces; ++n) {  // of 10 ms
      const std::size_t from = k + 600 + 20 * static_cast<std::size_t>(n);
      const double speed = (samples[from + 20].tool.z - samples[from].tool.z) / (20 * ArmLoop::kTick);
      mean += speed / kPieces;
      square += speed * speed / kPieces;
    }
    sum += square - mean * mean;
    ++strokes;
  }
  return strokes > 0 ? std::sqrt(sum / strokes) : -1;
}

TEST(ArmExperiments, z_moves_with_and_without_compensation) {
  for (const Arm& arm : {kDiameter, kRadius, kRubbing, kDamped}) {
    Path path(build(arm), {});
    for (int n = 0; n < 3; ++n) {
      path.to({0, 0, 0.1}, 0.2, 1.0);
      path.to({0, 0, -0.04}, 0.2, 1.0);
    }
    double behind[2] = {}, down[2] = {};
    for (const bool compensate : {false, true}) {
      const Follow f = follow(arm, path, compensate, 0);
      behind[compensate ? 1 : 0] = f.behind;
      down[compensate ? 1 : 0] = ripple(f.samples, -1);
      if (arm.radius < 2 || arm.friction > 0.02) {
        EXPECT_GT(ripple(f.samples, -1), 1.5 * ripple(f.samples, 1));
      }
      show("7.1 %s %s: behind %.1f cm, ripple up %.3f down %.3f m/s\n", arm.name,
           compensate ? "CMBPI" : "MBPI", 100 * f.behind, ripple(f.samples, 1), ripple(f.samples, -1));
    }
    if (arm.damping > 1) {
      EXPECT_NEAR(behind[1], behind[0], 0.002);  // damping holds the hand back, not its weight
    } else {
      EXPECT_LT(behind[1], behind[0]);
      EXPECT_NEAR(behind[1], arm.radius > 1 && arm.friction < 0.02 ? 0.054 : 0.064, 0.004);
    }
    // The seed sees the downward oscillation smoothed by compensation. Here compensation leaves it as it is.
    EXPECT_NEAR(down[1], down[0], 0.15 * down[0]);
  }
}

TEST(ArmExperiments, joint_one_at_0_9_rad_per_s) {
  for (const Arm& arm : {kDiameter, kRadius, kDamped}) {
    const double bend = 0.9 / arm.radius;
    const ArmVector start = {0, 0.6 / arm.radius, -bend / 2, -bend / 2, 0, 0};
    double means[2] = {}, largest[2] = {};
    for (const bool compensate : {false, true}) {
      ArmLoop loop = loop_of(true_arm(arm), arm);
      loop.controller.compensate = compensate;
      loop.start(start);
      settle(loop);
      // ±0.36 rad, straight at 0.9 rad/s, turning within 0.1 s.
      const auto wave = [&](double t) {
        control::LinePoint<double> p = loop.rest();
        const double period = 1.6, turn = 0.1, v = 0.9, a = 2 * v / turn;
        double u = std::fmod(t + period / 4, period), sign = 1;
        if (u >= period / 2) u -= period / 2, sign = -1;
        const double straight = period / 2 - turn;  // u = 0 … at −peak, turn half
        const double from = u < turn / 2 ? u : (u < turn / 2 + straight ? turn / 2 : u - straight);
        const double rate = u < turn / 2 ? a * u : (u < turn / 2 + straight ? v : v - a * (from - turn / 2));
        const double half = v * turn / 4 + v * straight / 2;
        const double place = u < turn / 2 ? a * u * u / 2
                             : u < turn / 2 + straight
                                 ? v * turn / 4 + v * (u - turn / 2)
                                 : 2 * half - a * (period / 2 - u) * (period / 2 - u) / 2;
        p.angle[0] = sign * (place - half);
        p.velocity[0] = sign * rate;
        p.acceleration[0] = u < turn / 2 ? sign * a : (u < turn / 2 + straight ? 0 : -sign * a);
        return p;
      };
      const Samples s = loop.run(8, wave);
      double worst = 0, mean = 0;
      int n = 0;
      for (const ArmSample& x : s) {
        if (x.time < 3.2) continue;
        worst = std::max(worst, std::abs(x.angle[0] - x.wanted[0]));
        mean += std::abs(x.angle[0] - x.wanted[0]);
        ++n;
      }
      means[compensate ? 1 : 0] = mean / n;
      largest[compensate ? 1 : 0] = worst;
      show("7.2 %s %s: worst %.3f rad, mean %.3f rad\n", arm.name, compensate ? "CMBPI" : "MBPI", worst,
           mean / n);
    }
    EXPECT_LT(means[1], means[0]);  // better on the whole, as in figure 7.2, and only by a little
    EXPECT_GT(means[1], 0.9 * means[0]);
    EXPECT_NEAR(largest[1], arm.damping > 1 ? 0.242 : arm.gains < 1 ? 0.194 : 0.135, 0.015);
  }
}

TEST(ArmExperiments, triangle_with_and_without_the_can) {
  for (const Arm& arm : {kDiameter, kRadius, kDamped}) {
    const double side = 0.08;
    Path path(build(arm), {});
    path.to({0, side, 0}, 0.2, 0);
    path.to({0, side / 2, side * 0.8}, 0.2, 0);
    path.to({0, 0, 0}, 0.2, 1);
    const Follow empty = follow(arm, path, true, 0), loaded = follow(arm, path, true, 0.34);
    // As figure 7.4 shows it: not instant by instant, but curve against curve.
    double apart = 0, curves = 0;
    for (std::size_t k = 0; k < empty.samples.size(); k += 20) {
      apart = std::max(apart, length(empty.samples[k].tool - loaded.samples[k].tool));
      double nearest = 1;
      for (std::size_t n = 0; n < empty.samples.size(); n += 4)
        nearest = std::min(nearest, length(empty.samples[n].tool - loaded.samples[k].tool));
      curves = std::max(curves, nearest);
    }
    show("7.4 %s: behind %.1f cm, with 340 g %.1f cm, apart %.1f cm, curves apart %.1f cm\n", arm.name,
         100 * empty.behind, 100 * loaded.behind, 100 * apart, 100 * curves);
    EXPECT_LT(loaded.behind, 1.25 * empty.behind);
    if (arm.damping > 1) {
      EXPECT_LT(curves, 0.005);  // the seed's "no significant difference"
    } else {
      EXPECT_NEAR(apart, 0.03, 0.01);
    }
  }
}

TEST(ArmExperiments, point_to_point_and_back) {
  for (const Arm& arm : {kDiameter, kRadius, kRubbing, kDamped}) {
    double before = 0;
    for (const double v : {0.2, 0.3, 0.4}) {
      const Vec3<double> way = {0, 0.07, 0.09};
      Path path(build(arm), {});
      path.to(way, v, 0);
      path.to({}, v, 0);
      path.to(way, v, 0);
      path.to({}, v, 1.5);
      const Follow f = follow(arm, path, true, 0);
      const Vec3<double> a = f.samples.front().wanted_tool;
      show("7.6 %s %.1f m/s: behind %.1f cm, off the path %.1f cm\n", arm.name, v, 100 * f.behind,
           100 * off_piece(f.samples, a, a + way));
      const double off = off_piece(f.samples, a, a + way);
      if (arm.radius > 1 && arm.friction < 0.02) {
        EXPECT_LT(off, 0.02);  // inside the seed's 4 cm at 0.3 m/s
        EXPECT_GT(f.behind, before);
        // The lag of the valves, 0.17 s, times the speed; with damping longer than that.
        if (arm.damping > 1) {
          EXPECT_GT(f.behind / v, 0.17);
        } else {
          EXPECT_NEAR(f.behind / v, 0.16, 0.03);
        }
      } else {
        EXPECT_GT(off, 0.02);
        EXPECT_LT(off, arm.gains < 1 ? 0.08 : 0.04);
      }
      before = f.behind;
    }
  }
}

struct Push {
  double seconds = 0.75;  ///< before the release at 0.75 s
  double force = 25;      ///< N, up and sideways
  double play = 0;        ///< rad, slack of joint one, either side
};

struct Release {
  double overshoot = 0;  ///< of the displacement
  double settled = 0;    ///< s after the release, within 10 % of the displacement or the slack
};

/// Pushed at the hand and let go: joints 1 to 3.
std::array<Release, 3> push(const Arm& arm, const Push& how) {
  ArmPlantConfig truth = true_arm(arm);
  truth.joints[0].play = how.play;
  ArmLoop loop = loop_of(truth, arm);
  loop.start({});
  settle(loop);
  const ArmVector rest = loop.plant().angle();
  const double begin = 0.75 - how.seconds, ramp = 0.4 * how.seconds;
  const Samples s = loop.run(
      5, [&](double) { return loop.rest(); },
      [&](double t, ArmPlant& p) {
        const double share = t > begin && t < 0.75 ? std::min(1.0, (t - begin) / ramp) : 0;
        p.push(share * how.force * Vec3<double>{0, 0.8, 0.6});
      });
  std::array<Release, 3> out;
  for (std::size_t i = 0; i < 3; ++i) {
    double far = 0;
    for (const ArmSample& x : s)
      if (x.time <= 0.75) far = std::abs(x.angle[i] - rest[i]) > std::abs(far) ? x.angle[i] - rest[i] : far;
    for (const ArmSample& x : s) {
      if (x.time <= 0.75) continue;
      const double off = x.angle[i] - rest[i];
      out[i].overshoot = std::max(out[i].overshoot, -off / far);
      if (std::abs(off) > std::max(0.1 * std::abs(far), i == 0 ? 1.2 * how.play : 0))
        out[i].settled = x.time - 0.75;
    }
    show(
        "7.8 %s, %.2f s of %.0f N, play %.2f, joint %zu: out %.3f rad, overshoot %.0f %%, settled in %.2f "
        "s\n",
        arm.name, how.seconds, how.force, how.play, i + 1, far, 100 * out[i].overshoot, out[i].settled);
  }
  return out;
}

TEST(ArmExperiments, push_and_release_with_the_tables_damping) {
  for (const Arm& arm : {kDiameter, kRadius}) {
    const auto tight = push(arm, {}), slack = push(arm, {.play = 0.01});
    for (const auto& joint : tight) {
      EXPECT_GT(joint.overshoot, 0.3);  // the seed: 6 to 10 %, joint one 20 %
      EXPECT_GT(joint.settled, 0.4);
      EXPECT_LT(joint.settled, 4.5);
    }
    EXPECT_GT(slack[0].overshoot, 1.05 * tight[0].overshoot);  // worse with slack, as the seed suspects
  }
}

/// What does not explain figure 7.8, and what does.
TEST(ArmExperiments, push_and_release_as_the_seed_saw_it) {
  // Neither faster valves nor more Coulomb friction, nor a model without D or with its sign as printed in 3.10: the torque loop
  // takes the muscles' damping away at any lag. Damping that the model does not know stays.
  const auto second = [](const char* what, const Arm& arm) {
    show("7.8 with %s:\n", what);
    return push(arm, {})[1].overshoot;
  };
  Arm one = kRadius;
  one.lag = 0.08;
  EXPECT_GT(second("valves of 0.08 s", one), 0.6);
  one.lag = 0.04;
  EXPECT_GT(second("valves of 0.04 s", one), 0.6);
  one = kRadius;
  one.friction = 0.03;
  EXPECT_GT(second("friction of 3 %", one), 0.6);
  one.friction = 0.06;
  EXPECT_GT(second("friction of 6 %", one), 0.6);
  one = kRadius;
  one.known = 0;
  EXPECT_GT(second("a model without D", one), 0.6);
  one.known = -1;
  EXPECT_GT(second("a model with -D", one), 0.6);
  double before = 1;
  for (const double damping : {3.0, 5.0, 9.0}) {
    one = kRadius;
    one.damping = damping;
    const double overshoot = second("more damping", one);
    EXPECT_LT(overshoot, before - 0.1);
    before = overshoot;
  }
  // A push of 0.75 s winds the outer integral up: with damping too, a fifth stays and decays with K_P/K_I = 2.5 s.
  const auto held = push(kDamped, {.force = 50});
  EXPECT_GT(held[2].overshoot, 0.15);
  EXPECT_GT(held[2].settled, 2.0);
  // Eleven times the table's damping, a short push, slack in joint one: 20 %, 6 to 10 %, 0.75 s of the seed.
  const auto tight = push(kDamped, {.seconds = 0.2, .force = 50});
  const auto slack = push(kDamped, {.seconds = 0.2, .force = 50, .play = 0.01});
  EXPECT_NEAR(slack[0].overshoot, 0.20, 0.04);
  EXPECT_GT(slack[0].overshoot, 1.3 * tight[0].overshoot);  // what the seed blames the slack for
  for (const std::size_t joint : {1u, 2u}) {
    EXPECT_GT(slack[joint].overshoot, 0.04);
    EXPECT_LT(slack[joint].overshoot, 0.12);
    EXPECT_LT(slack[joint].settled, 0.75);
  }
  EXPECT_LT(tight[0].settled, 0.75);
  // With that damping table 6.2 is stable on wheels of half the column too, but overshoots by a third.
  Arm diameter = kDamped;
  diameter.name = "diameter, damped";
  diameter.radius = 1;
  for (const Release& joint : push(diameter, {.seconds = 0.2, .force = 50})) {
    EXPECT_NEAR(joint.overshoot, 0.36, 0.06);
    EXPECT_LT(joint.settled, 1.0);
  }
}

}  // namespace
