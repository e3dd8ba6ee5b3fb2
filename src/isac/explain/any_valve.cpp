#include "isac/explain/any_valve.hpp"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "isac/explain/filters.hpp"
#include "isac/explain/workers.hpp"

namespace isac::explain {
namespace {

constexpr std::size_t kTaps = 6;   // 1 to 32 samples
constexpr std::size_t kKnots = 6;  // a third to a 729th of the largest error
constexpr double kOwnPart = 1e-9;  // of ‖x‖²: less is those before it

/// Rows of the pressures in every column, from signals at the recording's rate.
class Columns {
 public:
  Columns(const Prepared& data, std::size_t count)
      : data_(data), columns_(count, Eigen::VectorXd::Zero(static_cast<Eigen::Index>(data.rows.size()))) {}

  /// `at(valve, sample)`: of column k in this run.
  template <class At>
  void fill(std::size_t run, std::size_t k, const At& at) {
    for (std::size_t i = data_.run_begin[run]; i < data_.run_begin[run + 1]; ++i)
      if (const Row& row = data_.rows[i]; (bit(row.chain) & kPressureChains) != 0)
        columns_[k][static_cast<Eigen::Index>(i)] = at(row.chain == Chain::kPressure1 ? 0 : 1, row.sample);
  }
  std::vector<Eigen::VectorXd> take() { return std::move(columns_); }

 private:
  const Prepared& data_;
  std::vector<Eigen::VectorXd> columns_;
};

/// Column k: q(t − δ_k) − q(t).
std::vector<Eigen::VectorXd> differences(const Around& place, int threads) {
  const Prepared& data = place.predictor->data();
  Columns columns(data, kTaps);
  share_work(threads, data.runs.size(), [&](std::size_t r) {
    const PreparedRun& run = data.runs[r];
    if (!run.has_command) return;
    Predictor::FullRate full = place.predictor->full_rate(place.fit->model, r);
    for (std::vector<double>& q : full.pressure) q = low_pass(q, data.smoothing.torque / run.interval);
    for (std::size_t k = 0; k < kTaps; ++k)
      columns.fill(r, k, [&](std::size_t valve, std::size_t at) {
        const std::vector<double>& q = full.pressure[valve];
        return q[at - std::min<std::size_t>(at, std::size_t{1} << k)] - q[at];
      });
  });
  return columns.take();
}

/// K_C u − q of every run and valve, at the recording's rate; empty without commands.
struct Errors {
  std::vector<double> of[2];
};

std::vector<Errors> errors_of(const Around& place, int threads) {
  const Prepared& data = place.predictor->data();
  std::vector<Errors> errors(data.runs.size());
  const double gain = place.predictor->valve_gain(place.fit->model);
  share_work(threads, data.runs.size(), [&](std::size_t r) {
    const PreparedRun& run = data.runs[r];
    if (!run.has_command) return;
    const Predictor::FullRate full = place.predictor->full_rate(place.fit->model, r);
    for (int i = 0; i < 2; ++i) {
      errors[r].of[i].resize(full.pressure[i].size());
      for (std::size_t k = 0; k < errors[r].of[i].size(); ++k)
        errors[r].of[i][k] = gain * run.command[i][k] - full.pressure[i][k];
    }
  });
  return errors;
}

/// Column k: sat(e, ε_k) as the valve's lag lets it through.
std::vector<Eigen::VectorXd> bent(const Around& place, int threads) {
  const Prepared& data = place.predictor->data();
  const std::vector<Errors> errors = errors_of(place, threads);
  double largest = 0;
  for (const Errors& e : errors)
    for (const std::vector<double>& of : e.of)
      for (const double v : of) largest = std::max(largest, std::abs(v));
  Columns columns(data, largest > 0 ? kKnots : 0);
  const double lag = place.predictor->valve_lag(place.fit->model);
  share_work(threads, largest > 0 ? errors.size() : 0, [&](std::size_t r) {
    if (errors[r].of[0].empty()) return;
    const double interval = data.runs[r].interval, share = -std::expm1(-interval / lag);
    double knot = largest;
    for (std::size_t k = 0; k < kKnots; ++k) {
      knot /= 3;
      std::vector<double> passed[2];
      for (int i = 0; i < 2; ++i) {
        double x = std::clamp(errors[r].of[i].front(), -knot, knot);
        for (const double e : errors[r].of[i]) {
          passed[i].push_back(x);
          x += share * (std::clamp(e, -knot, knot) - x);
        }
        passed[i] = low_pass(passed[i], data.smoothing.torque / interval);
      }
      columns.fill(r, k, [&](std::size_t valve, std::size_t at) { return passed[valve][at]; });
    }
  });
  return columns.take();
}

/// The residual with all of them taken out, beside what the model's parameters make up for.
AnyValve without(const Around& place, std::vector<Eigen::VectorXd> columns) {
  AnyValve rival;
  rival.residual = place.residual;
  std::vector<Eigen::VectorXd> taken;
  for (Eigen::VectorXd& column : columns) {
    weigh(place.predictor->data(), *place.weights, column);
    Eigen::VectorXd x = place.project(column);
    const double whole = x.squaredNorm();
    for (const Eigen::VectorXd& unit : taken) x -= unit * unit.dot(x);
    if (!(x.squaredNorm() > kOwnPart * whole)) continue;
    x.normalize();
    rival.residual -= x * x.dot(rival.residual);
    taken.push_back(std::move(x));
  }
  rival.columns = static_cast<int>(taken.size());
  return rival;
}

}  // namespace

AnyValve any_lag(const Around& place, int threads) {
  return without(place, differences(place, threads));
}

AnyValve any_curve(const Around& place, int threads) {
  return without(place, bent(place, threads));
}

Comparison behind_any_valve(const Around& place, const AnyValve& rival) {
  const Prepared& data = place.predictor->data();
  return compare(data, rival.residual, place.residual, -rival.columns, noise_density(data, rival.residual));
}

}  // namespace isac::explain
