#include "isac/explain/halves.hpp"

#include <fmt/format.h>

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "isac/explain/coordinates.hpp"
#include "isac/explain/labels.hpp"
#include "isac/explain/projection.hpp"
#include "isac/explain/slopes.hpp"
#include "isac/explain/variable_words.hpp"

namespace isac::explain {
namespace {

constexpr double kNeither = std::numeric_limits<double>::quiet_NaN();
constexpr double kNextToNothing = 0.02;  // of the effect's square

/// Something that is high or low, or goes one way or the other.
struct WayToHalve {
  const char* where;  ///< {}: "angle", or "position" of a linear axis
  bool about_zero;    ///< else about the median
  double (*value)(const PreparedRun& run, const Row& row);
};

double of_pressures(const PreparedRun& run, const Row& row, double first) {
  return run.has_pressure ? run.pressure[1][row.sample] + first * run.pressure[0][row.sample] : kNeither;
}

double of_motion(const std::vector<double>& signal, const Row& row) {
  return signal.empty() ? kNeither : signal[row.sample];
}

constexpr WayToHalve kWaysToHalve[] = {
    {"in one direction of motion and in the other", true,
     [](const PreparedRun& run, const Row& row) { return of_motion(run.dry_velocity, row); }},
    {"at low and at high speed", false,
     [](const PreparedRun& run, const Row& row) { return std::abs(of_motion(run.velocity, row)); }},
    {"at low and at high {}s", false,
     [](const PreparedRun& run, const Row& row) { return of_motion(run.angle, row); }},
    {"near the zero of the {} and far from it", false,
     [](const PreparedRun& run, const Row& row) { return std::abs(of_motion(run.angle, row)); }},
    {"at low and at high pressure differences", false,
     [](const PreparedRun& run, const Row& row) { return of_pressures(run, row, -1); }},
    {"at low and at high mean pressure", false,
     [](const PreparedRun& run, const Row& row) { return of_pressures(run, row, 1); }},
    {"early and late in a run", false,
     [](const PreparedRun& run, const Row& row) { return run.time[row.sample]; }},
    {"early and late in the day", false,
     [](const PreparedRun& run, const Row& row) { return run.day_offset + run.time[row.sample]; }},
};
constexpr const char* kOwnSign = "where it pushes one way and where it pushes the other";

bool is_of_forces(const Row& row) {
  return (bit(row.chain) & kForceChains) != 0;
}

/// s of each row: ±1, 0 where `values` says neither.
Eigen::VectorXd signs_of(const std::vector<double>& values, bool about_zero) {
  double middle = 0;
  if (!about_zero) {
    std::vector<double> known;
    std::copy_if(values.begin(), values.end(), std::back_inserter(known),
                 [](double v) { return std::isfinite(v); });
    if (known.empty()) return Eigen::VectorXd::Zero(static_cast<Eigen::Index>(values.size()));
    const auto at = known.begin() + static_cast<std::ptrdiff_t>(known.size() / 2);
    std::nth_element(known.begin(), at, known.end());
    middle = *at;
  }
  Eigen::VectorXd signs(static_cast<Eigen::Index>(values.size()));
  for (std::size_t i = 0; i < values.size(); ++i)
    signs[static_cast<Eigen::Index>(i)] = values[i] > middle ? 1.0 : values[i] < middle ? -1.0 : 0.0;
  return signs;
}

/// The sigma of a normal law beyond which lies what lies beyond χ².
double sigma_of(double chi2, double freedom) {
  const double spread = 2 / (9 * freedom);
  return (std::cbrt(chi2 / freedom) - (1 - spread)) / std::sqrt(spread);
}

/// Of an effect: what it does, its slopes, and what either half of it would close by being another.
class Halving {
 public:
  Halving(const Around& place, std::size_t effect, int threads)
      : place_(place), data_(place.predictor->data()), threads_(threads) {
    const ModelPoint& model = place.fit->model;
    const Active& active = model.effects[effect];
    hypothesis_ = active.hypothesis;
    ModelPoint without = model;
    without.effects[effect].values = null_values(*hypothesis_, active.values);
    Eigen::VectorXd there = place.here;
    place.predictor->predict(without, hypothesis_->chains, there);
    does_ = place.here - there;
    std::vector<Coordinate> coordinates;
    std::vector<double> values;
    for (int i = 0; i < hypothesis_->info().parameter_count; ++i) {
      if (!hypothesis_->free[static_cast<std::size_t>(i)]) continue;
      coordinates.push_back(effect_coordinate(active, static_cast<int>(effect), i, false));
      values.push_back(active.values[static_cast<std::size_t>(i)]);
    }
    Weights one = *place.weights;  // halves are cut before the noise's filter joins neighbours
    for (Colour& colour : one.colour) colour = {};
    for (double& sigma : one.sigma) sigma = 1;
    one.one_zero = false;
    one.filter.reset();
    slopes_ = slopes_of(*place.predictor, model, place.here, one, coordinates, values);
    Eigen::MatrixXd weighted = does_;
    weigh(data_, *place.weights, weighted, threads);
    weighted_ = weighted.col(0);
    noise_.resize(does_.size());
    for (Eigen::Index i = 0; i < noise_.size(); ++i)
      noise_[i] = std::sqrt(
          place.weights->colour[static_cast<int>(data_.rows[static_cast<std::size_t>(i)].chain)].white);
  }

  [[nodiscard]] bool is_nothing() const { return !(weighted_.squaredNorm() > 0); }

  void by(const WayToHalve& way, std::vector<Halves>& halves) const {
    std::vector<double> values(data_.rows.size(), kNeither);
    for (std::size_t i = 0; i < values.size(); ++i) {
      const Row& row = data_.rows[i];
      if (is_of_forces(row) && does_[static_cast<Eigen::Index>(i)] != 0)
        values[i] = way.value(data_.runs[row.run], row);
    }
    const bool linear = of_linear_axis(axis_unit("rad", data_.baseline));
    by(fmt::format(fmt::runtime(way.where), linear ? "position" : "angle"), signs_of(values, way.about_zero),
       halves);
  }
  void by_its_own_sign(std::vector<Halves>& halves) const {
    std::vector<double> values(does_.begin(), does_.end());
    for (std::size_t i = 0; i < values.size(); ++i)
      if (!is_of_forces(data_.rows[i])) values[i] = kNeither;
    by(kOwnSign, signs_of(values, true), halves);
  }

 private:
  void by(std::string where, const Eigen::VectorXd& signs, std::vector<Halves>& halves) const {
    const double whole = weighted_.squaredNorm();
    const double up = (signs.array() > 0).select(weighted_, 0).squaredNorm(),
                 down = (signs.array() < 0).select(weighted_, 0).squaredNorm();
    if (std::min(up, down) < kNextToNothing * whole) return;
    Eigen::MatrixXd d = signs.asDiagonal() * slopes_;
    weigh(data_, *place_.weights, d, threads_);
    take_out(place_.basis, d);
    const Eigen::VectorXd score = -(d.transpose() * place_.residual);
    const Eigen::MatrixXd noisy = noise_.asDiagonal() * d;
    const Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> variance(noisy.transpose() * noisy),
        norm(d.transpose() * d);
    if (variance.rank() == 0) return;
    halves.push_back(
        {.where = std::move(where),
         .sigma = sigma_of(score.dot(variance.solve(score)), static_cast<double>(variance.rank())),
         .share = std::sqrt(std::max(0.0, score.dot(norm.solve(score))) / whole)});
  }

  const Around& place_;
  const Prepared& data_;
  int threads_;
  const Hypothesis* hypothesis_ = nullptr;
  Eigen::VectorXd does_, weighted_, noise_;
  Eigen::MatrixXd slopes_;
};

}  // namespace

std::vector<Halves> halves_of(const Around& place, std::size_t effect, int threads) {
  std::vector<Halves> halves;
  const Hypothesis& hypothesis = *place.fit->model.effects[effect].hypothesis;
  if ((hypothesis.chains & kForceChains) == 0 || has_fitted_states(hypothesis)) return halves;
  const Halving halving(place, effect, threads);
  if (halving.is_nothing()) return halves;
  halving.by_its_own_sign(halves);
  for (const WayToHalve& way : kWaysToHalve) halving.by(way, halves);
  std::stable_sort(halves.begin(), halves.end(),
                   [](const Halves& a, const Halves& b) { return a.sigma > b.sigma; });
  return halves;
}

bool differs_by_half(const Halves& halves, double own_error) noexcept {
  constexpr double kForSure = 4.0;  // sigma
  return halves.sigma >= kForSure && halves.share >= own_error;
}

}  // namespace isac::explain
