#include "isac/series/derive.hpp"

#include <cassert>
#include <cmath>
#include <utility>

#include "isac/core/error.hpp"

namespace isac::series {
namespace {

template <typename Rule>
std::vector<double> by_row(std::span<const double> a, std::span<const double> b, Rule rule) {
  assert(a.size() == b.size());
  std::vector<double> out(a.size());
  for (std::size_t i = 0; i < a.size(); ++i) out[i] = rule(a[i], b[i]);
  return out;
}

}  // namespace

std::vector<double> torque_from_forces(std::span<const double> F1, std::span<const double> F2,
                                       double wheel_radius) {
  return by_row(F1, F2, [wheel_radius](double f1, double f2) { return (f2 - f1) * wheel_radius; });
}

std::vector<double> pressure_difference(std::span<const double> p1, std::span<const double> p2) {
  return by_row(p1, p2, [](double a, double b) { return (b - a) / 2; });
}

std::vector<double> mean_pressure(std::span<const double> p1, std::span<const double> p2) {
  return by_row(p1, p2, [](double a, double b) { return (a + b) / 2; });
}

void add_torque(Recording& recording, double wheel_radius) {
  if (recording.find("torque") != nullptr) return;
  if (!(wheel_radius > 0.0) || std::isinf(wheel_radius)) {
    throw Error(ErrorKind::kBadInput, "wheel_radius_missing",
                "there is no torque and no radius of the chain wheel to compute it from; write "
                "chain_wheel_diameter into the "
                "[joint] section of rig.toml",
                {recording.source, 0, 0});
  }
  const std::vector<double>& F1 = recording.column("F1").values;
  const std::vector<double>& F2 = recording.column("F2").values;
  Column torque{.name = "torque", .unit = "N m", .values = torque_from_forces(F1, F2, wheel_radius)};
  recording.columns.push_back(std::move(torque));
}

}  // namespace isac::series
