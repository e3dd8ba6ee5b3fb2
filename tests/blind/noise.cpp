#include "noise.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <numbers>
#include <stdexcept>

#include "baseline.hpp"

namespace blind {
namespace {

constexpr double kEncoderStep = 2.0 * std::numbers::pi / kEncoderSteps;

/// Two columns of a recording of a muscle held still: force and pressure.
struct Held {
  std::vector<double> pressure, force;
};

Held read_held(const std::filesystem::path& file) {
  std::ifstream in(file);
  if (!in) throw std::runtime_error("cannot read " + file.string() + ": noise 'real' needs that recording");
  Held held;
  std::string line;
  std::getline(in, line);
  while (std::getline(in, line)) {
    const std::size_t first = line.find(','), second = line.find(',', first + 1);
    held.pressure.push_back(std::stod(line.substr(first + 1)));
    held.force.push_back(std::stod(line.substr(second + 1)));
  }
  return held;
}

/// What is left after a moving mean over `window` rows, where the muscle was filled slowly and not vented; sd one. Taken
/// row by row: the recording's 107 rows per second become the dataset's 500.
std::vector<double> detrended(const std::vector<double>& x, const std::vector<double>& pressure,
                              std::size_t window) {
  std::vector<double> sums(x.size() + 1, 0.0);
  for (std::size_t i = 0; i < x.size(); ++i) sums[i + 1] = sums[i] + x[i];
  std::vector<double> rest;
  double squares = 0.0;
  for (std::size_t i = window; i + window < x.size(); ++i) {
    if (std::abs(pressure[i + window] - pressure[i - window]) > 80.0) continue;  // kPa: being vented
    const double mean = (sums[i + window + 1] - sums[i - window]) / static_cast<double>(2 * window + 1);
    rest.push_back(x[i] - mean);
    squares += rest.back() * rest.back();
  }
  if (rest.size() < 1000 || squares == 0.0)
    throw std::runtime_error("the recording holds still for too short a time to take its noise from it");
  const double scale = 1.0 / std::sqrt(squares / static_cast<double>(rest.size()));
  for (double& value : rest) value = std::clamp(value * scale, -6.0, 6.0);
  return rest;
}

double stepped(double x, double step) {
  return step > 0.0 ? std::round(x / step) * step : x;
}

}  // namespace

double Noise::torque_floor(double r) const {
  const double each =
      force_white * force_white + force_wander * force_wander + force_step * force_step / 12.0;
  return std::sqrt(2.0 * each * r * r + torque_coloured * torque_coloured);
}

double Noise::pressure_floor() const {
  return std::sqrt(pressure_white * pressure_white + pressure_coloured * pressure_coloured +
                   pressure_step * pressure_step / 12.0);
}

double Noise::balance_floor(const Rig& rig) const {
  return std::hypot(torque_floor(rig.r), rig.inertia * acceleration_noise(kEncoderStep / std::sqrt(12.0)));
}

Noise draw_noise(const std::string& kind, const Rig& rig, Random& random,
                 const std::filesystem::path& recordings) {
  Noise noise;
  noise.kind = kind;
  noise.jitter = random.uniform() < 0.5;
  noise.force_white *= random.uniform(0.8, 1.25);
  noise.pressure_white *= random.uniform(0.8, 1.25);
  if (kind == "white") return noise;
  if (kind == "coloured") {
    noise.force_white *= 0.7;
    noise.torque_coloured = random.uniform(0.6, 1.3) * std::numbers::sqrt2 * 0.3 * rig.r;
    noise.torque_memory = random.log_uniform(0.05, 0.5);
    noise.pressure_white *= 0.8;
    noise.pressure_coloured = random.uniform(0.4, 1.0) * 0.004;
    noise.pressure_memory = random.log_uniform(0.05, 0.5);
    return noise;
  }
  if (kind == "quantised") {
    noise.force_white *= random.uniform(0.4, 1.0);
    noise.pressure_white *= random.uniform(0.3, 1.0);
    noise.force_step = 1200.0 / 4096.0;
    noise.pressure_step = 6.0 / 4096.0;
    noise.force_wander = random.uniform(0.1, 0.3);
    noise.wander_memory = random.log_uniform(50.0, 200.0);
    return noise;
  }
  if (kind == "real") {
    const char* files[] = {"festo10_L10cm_kink0.csv", "festo10_L10cm_kink25.csv", "festo10_L20cm_kink0.csv"};
    const Held held = read_held(recordings / "festo10_isometric" / files[random.index(3)]);
    noise.recorded_force = detrended(held.force, held.pressure, 50);
    noise.recorded_pressure = detrended(held.pressure, held.pressure, 50);
    return noise;
  }
  throw std::invalid_argument("noise is white, coloured, quantised or real, not '" + kind + "'");
}

std::vector<double> ornstein_uhlenbeck(std::size_t count, double sd, double memory, Random& random) {
  const double stay = std::exp(-kRowTime / memory), fresh = sd * std::sqrt(1.0 - stay * stay);
  std::vector<double> x(count);
  double value = sd * random.normal();
  for (double& out : x) {
    out = value;
    value = stay * value + fresh * random.normal();
  }
  return x;
}

std::vector<double> block_bootstrap(const std::vector<double>& recorded, std::size_t count, std::size_t block,
                                    Random& random) {
  std::vector<double> x;
  x.reserve(count + block);
  while (x.size() < count) {
    const auto from = static_cast<std::size_t>(random.index(static_cast<int>(recorded.size())));
    const double sign = random.sign();
    for (std::size_t i = 0; i < block; ++i) x.push_back(sign * recorded[(from + i) % recorded.size()]);
  }
  x.resize(count);
  return x;
}

Signals add_noise(const Signals& clean, const Noise& noise, const Rig& rig, Random& random) {
  constexpr std::size_t kBlock = 250;  // rows
  const std::size_t rows = clean.angle.size();
  Signals out = clean;
  const auto white = [&](std::vector<double>& x, double sd, const std::vector<double>& recorded) {
    if (!recorded.empty()) {
      const std::vector<double> drawn = block_bootstrap(recorded, rows, kBlock, random);
      for (std::size_t k = 0; k < rows; ++k) x[k] += sd * drawn[k];
      return;
    }
    for (double& value : x) value += sd * random.normal();
  };
  const auto coloured = [&](std::vector<double>& x, double sd, double memory) {
    if (sd == 0.0) return;
    const std::vector<double> drawn = ornstein_uhlenbeck(rows, sd, memory, random);
    for (std::size_t k = 0; k < rows; ++k) x[k] += drawn[k];
  };
  for (auto* force : {&out.F1, &out.F2}) {
    white(*force, noise.force_white, noise.recorded_force);
    coloured(*force, noise.force_wander, noise.wander_memory);
  }
  if (noise.torque_coloured != 0.0) {
    const std::vector<double> T =
        ornstein_uhlenbeck(rows, noise.torque_coloured, noise.torque_memory, random);
    for (std::size_t k = 0; k < rows; ++k) {
      out.F1[k] -= T[k] / (2.0 * rig.r);
      out.F2[k] += T[k] / (2.0 * rig.r);
    }
  }
  for (auto* pressure : {&out.p1, &out.p2}) {
    white(*pressure, noise.pressure_white, noise.recorded_pressure);
    coloured(*pressure, noise.pressure_coloured, noise.pressure_memory);
  }
  for (std::size_t k = 0; k < rows; ++k) {
    out.angle[k] = (std::floor(clean.angle[k] / kEncoderStep) + 0.5) * kEncoderStep;
    for (auto* force : {&out.F1, &out.F2}) (*force)[k] = stepped((*force)[k], noise.force_step);
    for (auto* pressure : {&out.p1, &out.p2}) (*pressure)[k] = stepped((*pressure)[k], noise.pressure_step);
  }
  return out;
}

}  // namespace blind
