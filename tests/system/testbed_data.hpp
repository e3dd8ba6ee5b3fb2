/// @file
/// Recordings of a testbed made without the toolkit: analytic motion, the torque law written out, sensors with coloured
/// noise, encoder steps and jitter. Nothing here shares code with the simulator or the fit.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <random>
#include <string>
#include <vector>

namespace isac::test {

/// Truth in the seed's units: A N/m, B N cm²/kg, C N m s³, D N m s; diameter in mm.
struct TestbedTruth {
  double A = -23450, B = 174.2, C = 0.0026, D = 0.14, diameter_mm = 38;
  double K_C = 1.0, T_C = 0.17, dead_time = 0.0;
};

struct SensorNoise {
  double force = 0.3;        ///< N
  double pressure = 0.004;   ///< kg/cm²
  double correlation = 0.3;  ///< AR(1) coefficient of the force noise
  double spike_share = 0;    ///< share of samples with a spike in F1
  double spike = 60;         ///< N
};

struct Sweep {
  std::string name, experiment = "constant-pressure";
  double seconds = 30, amplitude = 0.4, peak_speed = 1.0, delta_pressure = 0.0;  ///< rad, rad/s, kg/cm²
  double pressure_swing = 0;  ///< kg/cm², triangle amplitude in constant-angle runs
};

inline std::string rig_toml(const TestbedTruth& truth) {
  char text[512];
  std::snprintf(
      text, sizeof text,
      "format = \"isac.rig/1\"\nname = \"testbed\"\n\n[joint]\nchain_wheel_diameter = \"%.3f mm\"\n"
      "initial_pressure = \"3.0 kg/cm2\"\ninertia = \"0.0085 kg m2\"\n\n[encoder]\nsteps_per_turn = 8000\n\n"
      "[sensors]\nforce_noise = \"0.3 N\"\npressure_noise = \"0.004 kg/cm2\"\n",
      truth.diameter_mm);
  return text;
}

/// Writes one sweep as CSV (time, angle, p1, p2, F1, F2).
inline void write_sweep(const std::filesystem::path& path, const TestbedTruth& truth, const Sweep& sweep,
                        std::uint32_t seed, const SensorNoise& noise = {}, double rate = 500) {
  std::mt19937 random(seed);
  std::normal_distribution<double> gauss;
  std::uniform_real_distribution<double> uniform;
  const double r = truth.diameter_mm * 1e-3 / 2;
  // Three sines whose periods have no common measure; the largest speed of the sum is at most peak_speed.
  const std::array<double, 3> share{0.62, 0.25, 0.13}, tone{1.0, 1.6180339887, 0.4142135624};
  std::array<double, 3> phase{};
  for (double& p : phase) p = 6.283185307 * uniform(random);
  double speed_per_radian = 0;
  for (int i = 0; i < 3; ++i) speed_per_radian += share[i] * tone[i];
  const double omega = sweep.amplitude > 0 ? sweep.peak_speed / (sweep.amplitude * speed_per_radian) : 0.0;
  const bool clamped = sweep.experiment == "constant-angle";

  std::ofstream file(path);
  file << "# experiment: " << sweep.experiment << "\n# started: 2026-11-20T10:00:00Z\n"
       << "time [s],angle [rad],p1 [kg/cm2],p2 [kg/cm2],F1 [N],F2 [N]\n";
  double ar1 = 0, ar2 = 0, dp_lagged = sweep.delta_pressure;
  const double innovation = noise.force * std::sqrt(1 - noise.correlation * noise.correlation);
  const double step = 6.283185307179586 / 8000;
  const long rows = std::lround(sweep.seconds * rate);
  for (long k = 0; k < rows; ++k) {
    const double t = static_cast<double>(k) / rate + 2e-5 * (uniform(random) - 0.5);
    double phi = 0, w = 0;
    for (int i = 0; i < 3; ++i) {
      phi += sweep.amplitude * share[i] * std::sin(omega * tone[i] * t + phase[i]);
      w += sweep.amplitude * share[i] * omega * tone[i] * std::cos(omega * tone[i] * t + phase[i]);
    }
    if (clamped) {
      phi = sweep.amplitude;
      w = 0;
      const double u = std::fmod(t / 8.0, 1.0);  // a triangle of 8 s
      const double target = sweep.pressure_swing * (u < 0.5 ? 4 * u - 1 : 3 - 4 * u);
      dp_lagged += (target - dp_lagged) * (1.0 / rate) / 0.17;
    }
    const double dp = clamped ? dp_lagged : sweep.delta_pressure + 0.02 * std::sin(2.7 * t + phase[0]);
    const double torque = truth.A * r * r * phi + truth.B * r * dp - truth.C * w * w * w - truth.D * w;
    ar1 = noise.correlation * ar1 + innovation * gauss(random);
    ar2 = noise.correlation * ar2 + innovation * gauss(random);
    double F1 = 90 - 0.5 * torque / r + ar1, F2 = 90 + 0.5 * torque / r + ar2;
    if (uniform(random) < noise.spike_share) F1 += uniform(random) < 0.5 ? noise.spike : -noise.spike;
    char line[160];
    std::snprintf(line, sizeof line, "%.6f,%.8f,%.5f,%.5f,%.4f,%.4f\n", t,
                  step * std::floor(phi / step + 0.5), 3 - dp + noise.pressure * gauss(random),
                  3 + dp + noise.pressure * gauss(random), F1, F2);
    file << line;
  }
}

/// The sweeps of chapter 3: slow, fast and the bundle at several Δp, the joint clamped, and two held-out runs.
inline std::vector<Sweep> chapter_three() {
  return {{"slow_0", "constant-pressure", 30, 0.40, 0.314, 0.0},
          {"slow_p1", "constant-pressure", 30, 0.35, 0.314, 1.0},
          {"slow_m1", "constant-pressure", 30, 0.35, 0.314, -1.0},
          {"fast_0", "constant-pressure", 30, 0.45, 6.28, 0.0},
          {"fast_p1", "constant-pressure", 20, 0.40, 6.28, 1.0},
          {"fast_m1", "constant-pressure", 20, 0.40, 6.28, -1.0},
          {"bundle", "constant-pressure", 60, 0.45, 4.0, 0.0},
          {"clamped", "constant-angle", 24, 0.10, 0, 0, 1.5}};
}

/// A dataset folder: rig.toml, the sweeps, heldout/.
inline void write_dataset(const std::filesystem::path& folder, const TestbedTruth& truth,
                          const std::vector<Sweep>& sweeps, std::uint32_t seed,
                          const SensorNoise& noise = {}) {
  std::filesystem::create_directories(folder / "heldout");
  std::ofstream(folder / "rig.toml") << rig_toml(truth);
  for (const Sweep& sweep : sweeps) write_sweep(folder / (sweep.name + ".csv"), truth, sweep, seed++, noise);
  write_sweep(folder / "heldout" / "mixed.csv", truth, {"mixed", "constant-pressure", 20, 0.4, 3.0, 0.5},
              seed, noise);
}

/// Steps of the valve command and the first-order answer, written as p1, p1_cmd, p2, p2_cmd.
inline void write_valve_steps(const std::filesystem::path& path, const TestbedTruth& truth,
                              std::uint32_t seed, double pressure_noise = 0.004, double rate = 500) {
  std::mt19937 random(seed);
  std::normal_distribution<double> gauss;
  std::ofstream file(path);
  file << "# experiment: pcu-step\ntime [s],p1_cmd [kg/cm2],p1 [kg/cm2],p2_cmd [kg/cm2],p2 [kg/cm2]\n";
  const std::array<double, 7> levels{0.5, 5.0, 0.5, 3.0, 1.0, 4.0, 0.5};
  const double hold = 2.0;
  const auto answer = [&](double t, double swap) {  // exact sum of the steps' exponentials
    double p = truth.K_C * (swap > 0 ? levels[0] : 5.5 - levels[0]);
    for (std::size_t i = 1; i < levels.size(); ++i) {
      const double since = t - hold * static_cast<double>(i) - truth.dead_time;
      if (since > 0) p += truth.K_C * swap * (levels[i] - levels[i - 1]) * (1 - std::exp(-since / truth.T_C));
    }
    return p;
  };
  for (long k = 0; k < std::lround(hold * 7 * rate); ++k) {
    const double t = static_cast<double>(k) / rate;
    const auto index = static_cast<std::size_t>(static_cast<double>(k) / (hold * rate) + 1e-9);
    char line[160];
    std::snprintf(line, sizeof line, "%.4f,%.3f,%.5f,%.3f,%.5f\n", t, levels[index],
                  answer(t, 1) + pressure_noise * gauss(random), 5.5 - levels[index],
                  answer(t, -1) + pressure_noise * gauss(random));
    file << line;
  }
}

}  // namespace isac::test
