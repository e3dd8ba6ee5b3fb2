// The seed's experiments of chapter 5 on a joint simulated by an independent Runge-Kutta integration: step, sine, another
// load, a disturbance, a torque step. Each number stands beside the seed's, with the reason where they differ:
//   (v) the seed measured T_C = 0.17 s on a step to 5 kg/cm² (4.1); its small steps on hardware are visibly faster. Here
//       every motion has 0.17 s, and PI-MBPI, which models the torque of Δp *commanded*, does not see that lag.
//   (g) K_J = 0.39 at r = 0.019 m where the seed prints 0.3 (errata).
//   (f) friction, hysteresis and dead time of the hardware are not in this joint.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <vector>

#include "isac/control/joint_controller.hpp"
#include "rk4_joint.hpp"

namespace {

using namespace isac::control;
using isac::kPascalPerKgfCm2;
using isac::Status;
using isac::test::Rk4Joint;

constexpr double kDt = 5e-4, kKg = kPascalPerKgfCm2, kDegree = 3.14159265358979 / 180;

JointSettings<double> mbpi() {
  JointSettings<double> s = testbed_settings<double>();
  s.limits.speed = std::numeric_limits<double>::infinity();  // the seed gives true steps
  return s;
}

JointSettings<double> pid(double kp, double ki, double kd) {
  JointSettings<double> s = mbpi();
  s.structure = Structure::kPid;
  s.position = {.proportional = kp * kKg, .integral = ki * kKg, .derivative = kd * kKg};
  return s;
}
JointSettings<double> ziegler_nichols() {
  return pid(0.4, 7, 0.08);
}  // as run, 5.1.1
JointSettings<double> chien_hrones_reswick() {
  return pid(0.2, 4, 0.0014);
}  // as run, 5.1.1

struct Trace {
  std::vector<double> time, wanted, angle, torque, modelled;
};

/// `seconds` from rest; half a second of standing still comes first and is not recorded.
Trace simulate(const JointSettings<double>& s, Rk4Joint rig, double seconds, Mode mode,
               const std::function<double(double)>& wanted,
               const std::function<void(double, Rk4Joint&)>& act = nullptr) {
  JointController<double> controller;
  EXPECT_EQ(controller.configure(s), Status::kOk);
  EXPECT_EQ(controller.set_mode(mode), Status::kOk);
  rig.rest_at(s.mean_pressure);
  Trace trace;
  for (int k = -1000; k * kDt < seconds; ++k) {
    const double t = k * kDt, aim = k < 0 ? 0.0 : wanted(t);
    if (act && k >= 0) act(t, rig);
    JointCommand<double> u;
    EXPECT_EQ(controller.step({rig.angle, rig.velocity, rig.torque()}, {.angle = aim, .torque = aim}, kDt, u),
              Status::kOk);
    rig.step(u.pressure.muscle_1, u.pressure.muscle_2, kDt);
    if (k < 0) continue;
    trace.time.push_back(t + kDt);
    trace.wanted.push_back(aim);
    trace.angle.push_back(rig.angle);
    trace.torque.push_back(rig.torque());
    trace.modelled.push_back(u.torque);
  }
  return trace;
}

struct StepFigures {
  double overshoot = 0;  ///< share of the step
  double rise = 0;       ///< s to 90 %
  double settle = 0;     ///< s to stay within 5 %
};

StepFigures step_of(const JointSettings<double>& s, double inertia, double height) {
  Rk4Joint rig;
  rig.J = inertia;
  const Trace trace = simulate(s, rig, 3, Mode::kPosition, [height](double) { return height; });
  StepFigures figures{-1, 0, 0};
  for (std::size_t i = 0; i < trace.time.size(); ++i) {
    figures.overshoot = std::max(figures.overshoot, trace.angle[i] / height - 1);
    if (figures.rise == 0 && trace.angle[i] > 0.9 * height) figures.rise = trace.time[i];
    if (std::abs(trace.angle[i] / height - 1) > 0.05) figures.settle = trace.time[i];
  }
  return figures;
}

// Tolerances below: the integrator is exact to 1e-6 of these figures; what is asserted are the digits reported.

TEST(ClosedLoop, inner_loop_reaches_63_percent_of_a_torque_in_29_ms) {
  // C4: T_T = 0.025 s, "hardly depends on the amount of the reference torque". The modelled torque, joint clamped:
  // u jumps by a/(1 + a), a = B r K_P = 0.331, then goes on with (1 + a)/(B r K_I) = 40 ms: 63 % after 28.7 ms. (g)
  for (const double torque : {1.0, 2.0, 4.0}) {
    Rk4Joint rig;
    rig.clamped = true;
    const Trace trace = simulate(mbpi(), rig, 1.5, Mode::kTorque, [torque](double) { return torque; });
    double modelled = 0, real = 0;
    for (std::size_t i = 0; i < trace.time.size(); ++i) {
      if (modelled == 0 && trace.modelled[i] >= 0.632 * torque) modelled = trace.time[i];
      if (real == 0 && trace.torque[i] >= 0.632 * torque) real = trace.time[i];
    }
    EXPECT_NEAR(modelled, 0.029, 0.0005);
    // The torque at the joint comes behind the valve's 0.17 s; the seed's figure 3.11 has 0.15 s to 2 N m, 0.25 s to 4 N m.
    EXPECT_NEAR(real, 0.2045, 0.001);
    EXPECT_NEAR(trace.torque.back(), torque, 0.005 * torque);
  }
}

TEST(ClosedLoop, steps_of_the_pid_with_both_tunings) {
  // C1, figure 5.2: Chien-Hrones-Reswick smoother and slower, Ziegler-Nichols with a small spike.
  const StepFigures zn = step_of(ziegler_nichols(), 0.0085, 0.3),
                    chr = step_of(chien_hrones_reswick(), 0.0085, 0.3);
  EXPECT_NEAR(zn.overshoot, 0.028, 0.001);
  EXPECT_LT(chr.overshoot, 0.0);
  EXPECT_NEAR(zn.rise, 0.710, 0.002);
  EXPECT_NEAR(chr.rise, 1.280, 0.002);
  EXPECT_GT(zn.overshoot, chr.overshoot);
  EXPECT_LT(zn.rise, chr.rise);
}

TEST(ClosedLoop, step_of_the_model_based_cascade_is_faster_than_the_pid) {
  // C4, figure 5.9: "faster and smoother". Faster holds; smoother does not with 0.17 s for every motion: (v).
  const StepFigures figures = step_of(mbpi(), 0.0085, 0.3);
  EXPECT_NEAR(figures.rise, 0.453, 0.002);
  EXPECT_LT(figures.rise, step_of(ziegler_nichols(), 0.0085, 0.3).rise);
  EXPECT_NEAR(figures.overshoot, 0.324, 0.002);
}

TEST(ClosedLoop, four_times_the_inertia_hardly_changes_the_model_based_cascade) {
  // C4, figure 5.11: 0.0085 → 0.036 kg m²; the seed sees 10 to 15 % of overshoot. Ours is 33.7 % after 32.4 % without the
  // load (v): the load adds 1.3 % of the step.
  const StepFigures light = step_of(mbpi(), 0.0085, 0.3), heavy = step_of(mbpi(), 0.036, 0.3);
  EXPECT_NEAR(heavy.overshoot - light.overshoot, 0.013, 0.002);
  EXPECT_NEAR(heavy.rise, light.rise, 0.05);
}

TEST(ClosedLoop, the_measured_torque_closes_the_inner_loop_around_the_valve) {
  // C3, PI-PI of 5.2 with the gains of PI-MBPI: the inner loop is then B r (K_P s + K_I)/(0.17 s² + 1.33 s + 33), ζ = 0.28.
  // It swings; the seed could not try it (no torque sensors in the arm) and gives no figure for it.
  JointSettings<double> s = mbpi();
  s.structure = Structure::kCascade;
  const StepFigures seeds_gains = step_of(s, 0.0085, 0.1);
  EXPECT_GT(seeds_gains.overshoot, 0.5);
  // Gains for that plant: K_P up by 10, K_I by 2: ζ = 0.64.
  s.torque = {.proportional = 1.0 * kKg, .integral = 20 * kKg};
  s.position = {.proportional = 4, .integral = 8};
  const StepFigures mended = step_of(s, 0.0085, 0.1);
  EXPECT_LT(mended.overshoot, seeds_gains.overshoot);
}

double amplitude_at(const Trace& trace, double omega, double& lag_degrees) {
  double s = 0, c = 0;
  int n = 0;
  const double period = 2 * 3.14159265358979 / omega;
  for (std::size_t i = 0; i < trace.time.size(); ++i) {
    if (trace.time[i] <= trace.time.back() - period) continue;
    s += trace.angle[i] * std::sin(omega * trace.time[i]);
    c += trace.angle[i] * std::cos(omega * trace.time[i]);
    ++n;
  }
  lag_degrees = -std::atan2(c, s) / kDegree;
  return 2 * std::hypot(s, c) / n;
}

TEST(ClosedLoop, sine_of_the_pid_lags_far_behind) {
  // C1, figure 5.3: 0.15 sin 2t, "the difference was up to 18°" with CHR. Angles of ±8.6° differ by 17.2° at the very
  // most, so the figure's unit is not ours; here the difference is 7.9° at most, the phase 63°.
  const auto wave = [](double t) { return 0.15 * std::sin(2 * t); };
  double lag_zn = 0, lag_chr = 0;
  EXPECT_NEAR(amplitude_at(simulate(ziegler_nichols(), {}, 7, Mode::kPosition, wave), 2, lag_zn), 0.140,
              0.001);
  const Trace chr = simulate(chien_hrones_reswick(), {}, 7, Mode::kPosition, wave);
  EXPECT_NEAR(amplitude_at(chr, 2, lag_chr), 0.1035, 0.001);
  EXPECT_NEAR(lag_zn, 44.2, 0.3);
  EXPECT_NEAR(lag_chr, 63.2, 0.3);
  double worst = 0;
  for (std::size_t i = 7000; i < chr.time.size(); ++i)
    worst = std::max(worst, std::abs(chr.wanted[i] - chr.angle[i]));
  EXPECT_NEAR(worst / kDegree, 7.9, 0.1);
}

TEST(ClosedLoop, sine_of_the_model_based_cascade_lags_as_far_as_the_valve_does) {
  // C4, figure 5.10: "nearly without lag". With 0.17 s for every motion 35°; the quicker the valve, the nearer to the
  // seed's figure: 7° at 25 ms, and 5° at 10 ms. (v)
  const auto wave = [](double t) { return 0.15 * std::sin(2 * t); };
  const struct {
    double valve, lag;
  } rows[] = {{0.17, 35.1}, {0.10, 19.4}, {0.05, 10.6}, {0.025, 6.9}, {0.010, 4.8}};
  for (const auto& row : rows) {
    Rk4Joint rig;
    rig.lag = row.valve;
    double lag = 0;
    const double amplitude = amplitude_at(simulate(mbpi(), rig, 7, Mode::kPosition, wave), 2, lag);
    EXPECT_NEAR(lag, row.lag, 0.2) << row.valve;
    EXPECT_GT(amplitude, 0.15);
  }
}

TEST(ClosedLoop, a_valve_lag_that_the_model_knows_takes_the_lag_out_of_the_sine) {
  // ModelPressure::kPredicted: the model's Δp goes through the valve unit. 2.3° instead of 35°, at the same gains; the
  // price is the swinging inner loop of the PI-PI test, so these gains are not for steps.
  JointSettings<double> s = mbpi();
  s.model_pressure = ModelPressure::kPredicted;
  double lag = 0;
  EXPECT_NEAR(
      amplitude_at(simulate(s, {}, 7, Mode::kPosition, [](double t) { return 0.15 * std::sin(2 * t); }), 2,
                   lag) /
          0.15,
      1.098, 0.003);
  EXPECT_NEAR(lag, 2.3, 0.2);
}

TEST(ClosedLoop, a_predicted_torque_is_the_measured_one_when_the_model_is_right) {
  JointSettings<double> predicted = mbpi(), measured = mbpi();
  predicted.model_pressure = ModelPressure::kPredicted;
  measured.structure = Structure::kCascade;
  const auto step = [](double) { return 0.1; };
  const Trace a = simulate(predicted, {}, 2, Mode::kPosition, step),
              b = simulate(measured, {}, 2, Mode::kPosition, step);
  for (std::size_t i = 0; i < a.angle.size(); ++i)
    ASSERT_NEAR(a.angle[i], b.angle[i], 1e-6);  // exact lag against RK4 of 0.25 ms
}

/// Led to 18° in 0.2 s, held 0.2 s, let go: degrees of overshoot to the other side, and s to stay within 5 %.
void disturb(const JointSettings<double>& s, double& overshoot, double& settle) {
  const Trace trace = simulate(
      s, {}, 5, Mode::kPosition, [](double) { return 0.0; },
      [](double t, Rk4Joint& rig) {
        rig.clamped = t > 0 && t < 0.4;
        if (!rig.clamped) return;
        rig.velocity = 0;
        rig.angle = 18 * kDegree * std::min(1.0, t / 0.2);
      });
  overshoot = settle = 0;
  for (std::size_t i = 801; i < trace.time.size(); ++i) {
    overshoot = std::max(overshoot, -trace.angle[i] / kDegree);
    if (std::abs(trace.angle[i]) > 0.05 * 18 * kDegree) settle = trace.time[i] - 0.4;
  }
}

TEST(ClosedLoop, a_disturbance_overshoots_half_as_far_with_the_model_based_cascade) {
  // C1 and C4, figures 5.5 and 5.12: PID 27° of overshoot after 18°, settled in 0.8 to 1.0 s; PI-MBPI "only 50 %" of that,
  // settled in 0.5 s. How long the seed's hand held on is not said; ours holds 0.2 s.
  double pid_overshoot = 0, pid_settle = 0, overshoot = 0, settle = 0;
  disturb(ziegler_nichols(), pid_overshoot, pid_settle);
  disturb(mbpi(), overshoot, settle);
  EXPECT_NEAR(pid_overshoot, 14.7, 0.1);
  EXPECT_NEAR(pid_settle, 0.994, 0.005);               // the seed's 0.8 to 1.0 s
  EXPECT_NEAR(overshoot / pid_overshoot, 0.52, 0.02);  // the seed's 50 %
  EXPECT_NEAR(settle, 2.58, 0.02);  // not the seed's 0.5 s: (v); 1.2 s with a valve of 25 ms
}

TEST(ClosedLoop, load_torque_leaves_no_error_at_rest) {
  for (const JointSettings<double>& s : {mbpi(), ziegler_nichols(), chien_hrones_reswick()}) {
    Rk4Joint rig;
    rig.external = -1.0;
    const Trace trace = simulate(s, rig, 12, Mode::kPosition, [](double) { return 0.2; });
    EXPECT_NEAR(trace.angle.back(), 0.2, 5e-4);  // the slowest tail: PI-MBPI's, 1/s
  }
}

}  // namespace
