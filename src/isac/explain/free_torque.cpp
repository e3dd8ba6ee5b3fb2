#include "isac/explain/free_torque.hpp"

#include <algorithm>
#include <cstddef>
#include <vector>

namespace isac::explain {
namespace {

// In rms. Fast decays leave more than noise (the velocity's kernel, the encoder's steps times D): 1.63 times as much at most in 16 days without
// an effect; three thresholds that no driven run fell below made 2.9 to 6.8.
constexpr double kFurther = 2.0;
constexpr std::size_t kFewest = 500;  // samples

struct Power {
  double sum = 0, count = 0;
};

Power off_by(const Predictor& predictor, const ModelPoint& model, std::size_t index) {
  const PreparedRun& run = predictor.data().runs[index];
  const std::vector<double> told = predictor.full_rate(model, index).torque;
  Power power;
  for (std::size_t k = 0; k < told.size(); ++k) {
    if (run.loaded[k] == 0 || (run.is_free && run.dry_velocity[k] == 0)) continue;
    const double off = run.smooth_torque[k] - told[k];
    power.sum += off * off;
    ++power.count;
  }
  return power;
}

}  // namespace

bool free_torque_is_off(const Predictor& predictor, const ModelPoint& model) {
  Power driven;
  double most = 0;
  for (std::size_t r = 0; r < predictor.data().runs.size(); ++r) {
    const PreparedRun& run = predictor.data().runs[r];
    if (!run.has_torque || !run.has_pressure) continue;
    const Power power = off_by(predictor, model, r);
    if (!run.is_free) {
      driven.sum += power.sum;
      driven.count += power.count;
    } else if (power.count >= kFewest) {
      most = std::max(most, power.sum / power.count);
    }
  }
  return driven.count >= kFewest && most > kFurther * kFurther * driven.sum / driven.count;
}

}  // namespace isac::explain
