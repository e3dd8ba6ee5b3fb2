#include "isac/explain/any_lag.hpp"

#include <algorithm>
#include <utility>
#include <vector>

#include "isac/explain/filters.hpp"
#include "isac/explain/workers.hpp"

namespace isac::explain {
namespace {

constexpr std::size_t kTaps = 6;   // 1 to 32 samples
constexpr double kOwnPart = 1e-9;  // of ‖x‖²: less is those before it

/// Column k: q(t − δ_k) − q(t) in the rows of the pressures.
std::vector<Eigen::VectorXd> differences(const Around& place, int threads) {
  const Prepared& data = place.predictor->data();
  std::vector<Eigen::VectorXd> columns(kTaps,
                                       Eigen::VectorXd::Zero(static_cast<Eigen::Index>(data.rows.size())));
  share_work(threads, data.runs.size(), [&](std::size_t r) {
    const PreparedRun& run = data.runs[r];
    if (!run.has_command) return;
    Predictor::FullRate full = place.predictor->full_rate(place.fit->model, r);
    for (std::vector<double>& q : full.pressure) q = low_pass(q, data.smoothing.torque / run.interval);
    for (std::size_t i = data.run_begin[r]; i < data.run_begin[r + 1]; ++i) {
      const Row& row = data.rows[i];
      if ((bit(row.chain) & kPressureChains) == 0) continue;
      const std::vector<double>& q = full.pressure[row.chain == Chain::kPressure1 ? 0 : 1];
      for (std::size_t k = 0; k < kTaps; ++k) {
        const std::size_t before = row.sample - std::min<std::size_t>(row.sample, std::size_t{1} << k);
        columns[k][static_cast<Eigen::Index>(i)] = q[before] - q[row.sample];
      }
    }
  });
  return columns;
}

}  // namespace

AnyLag any_lag(const Around& place, int threads) {
  AnyLag lag;
  lag.residual = place.residual;
  std::vector<Eigen::VectorXd> taken;
  for (Eigen::VectorXd& column : differences(place, threads)) {
    weigh(place.predictor->data(), *place.weights, column);
    Eigen::VectorXd x = place.project(column);
    const double whole = x.squaredNorm();
    for (const Eigen::VectorXd& unit : taken) x -= unit * unit.dot(x);
    if (!(x.squaredNorm() > kOwnPart * whole)) continue;
    x.normalize();
    lag.residual -= x * x.dot(lag.residual);
    taken.push_back(std::move(x));
  }
  lag.taps = static_cast<int>(taken.size());
  return lag;
}

Comparison behind_any_lag(const Around& place, const AnyLag& lag) {
  const Prepared& data = place.predictor->data();
  return compare(data, lag.residual, place.residual, -lag.taps, noise_density(data, lag.residual));
}

}  // namespace isac::explain
