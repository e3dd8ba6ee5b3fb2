#include "isac/explain/end_of_reading.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "isac/series/statistics.hpp"

namespace isac::explain {
namespace {

constexpr double kBand = 8;  // deviations: the largest of a plateau lies four above it, the least four below
constexpr double kBeyond = 2e-4;  // of the readings: strokes of noise

double largest_of(const Prepared& data, std::size_t muscle) {
  std::vector<double> readings;
  for (const PreparedRun& run : data.runs)
    for (std::size_t i = 0; i < run.force[muscle].size(); ++i)
      if (run.usable[i] != 0 && std::isfinite(run.force[muscle][i])) readings.push_back(run.force[muscle][i]);
  return readings.empty() ? std::numeric_limits<double>::infinity() : series::quantile(readings, 1 - kBeyond);
}

}  // namespace

EndOfReading acts_at_the_end_of_a_reading(const Prepared& data, const Eigen::VectorXd& closed,
                                          double torque_noise) {
  const std::array<double, 2> largest = {largest_of(data, 0), largest_of(data, 1)};
  const double band = kBand * torque_noise / (std::sqrt(2.0) * data.rig.wheel_radius);
  EndOfReading found;
  double all = 0, there = 0, most = 0;
  for (std::size_t i = 0; i < data.rows.size(); ++i) {
    const Row& row = data.rows[i];
    if (row.chain != Chain::kTorque) continue;
    const PreparedRun& run = data.runs[row.run];
    const double c = closed[static_cast<Eigen::Index>(i)], squares = c * c;
    all += squares;
    for (std::size_t k = 0; k < 2; ++k) {
      if (run.force[k].empty() || !(run.force[k][row.sample] >= largest[k] - band)) continue;
      there += squares;
      if (squares > most) {
        most = squares;
        found.force = largest[k];
      }
      break;
    }
  }
  found.share = all > 0 ? there / all : 0.0;
  return found;
}

}  // namespace isac::explain
