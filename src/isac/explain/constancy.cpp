#include "isac/explain/constancy.hpp"

#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "isac/explain/screen.hpp"

namespace isac::explain {

Eigen::VectorXd share_of(const Around& baseline, const Fit& fit, std::size_t effect, double s) {
  ModelPoint other = fit.model;
  Active& a = other.effects[effect];
  const Hypothesis& h = *a.hypothesis;
  for (int i = 0; i < h.info().parameter_count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const double null = h.info().parameters[i].null_value;
    if (h.amplitude[k] && std::isfinite(null)) a.values[k] += s * (a.values[k] - null);
  }
  if (a.values == fit.model.effects[effect].values) return {};
  const Predictor& predictor = *baseline.predictor;
  Eigen::VectorXd here = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(predictor.rows())), there = here;
  predictor.predict(fit.model, h.chains, here);
  predictor.predict(other, h.chains, there);
  there -= here;
  weigh(predictor.data(), *baseline.weights, there);
  return baseline.project(there);
}

namespace {

/// What rests within its runs is as constant as a sensor's zero, which the noise's model has already.
bool rests(const Prepared& data, const Eigen::VectorXd& x) {
  double held = 0, all = 0, sum = 0;
  Eigen::Index count = 0;
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    const Row& row = data.rows[static_cast<std::size_t>(i)];
    sum += x[i];
    all += x[i] * x[i];
    ++count;
    const bool last = i + 1 == x.size() || data.rows[static_cast<std::size_t>(i) + 1].run != row.run ||
                      data.rows[static_cast<std::size_t>(i) + 1].chain != row.chain;
    if (!last) continue;
    held += sum * sum / static_cast<double>(count);
    sum = 0;
    count = 0;
  }
  return held > Column::kResting * all;
}

}  // namespace

Constancy constancy_of(const Around& baseline, const Fit& fit, std::size_t effect) {
  constexpr double kPieceSeconds = 1.0, kNudge = 0.01;
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  const Prepared& data = baseline.predictor->data();
  const Eigen::VectorXd x = share_of(baseline, fit, effect, kNudge) / kNudge;
  if (x.size() == 0 || rests(data, unfiltered(data, *baseline.weights, x)))
    return {.variation = kNone, .error = kNone};
  struct Piece {
    double score = 0, norm2 = 0;
    double noise = 0;  ///< variance of the score where nothing varies
  };
  const Colour* noise_of = baseline.weights->colour;  // the residual's own density would hold what varies
  std::map<std::pair<unsigned, long>, Piece> pieces;
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    const Row& row = data.rows[static_cast<std::size_t>(i)];
    if ((fit.model.effects[effect].hypothesis->chains & bit(row.chain)) == 0) continue;
    Piece& piece = pieces[{row.run, std::lround(data.runs[row.run].time[row.sample] / kPieceSeconds)}];
    piece.score += x[i] * fit.residual[i];
    piece.norm2 += x[i] * x[i];
    piece.noise += noise_of[static_cast<int>(row.chain)].white * x[i] * x[i];
  }
  double scores = 0, noise = 0, noise2 = 0, squared_norms = 0;
  Piece greatest;
  const auto add = [&](const Piece& piece, double sign) {
    scores += sign * piece.score * piece.score;
    noise += sign * piece.noise;
    noise2 += sign * piece.noise * piece.noise;
    squared_norms += sign * piece.norm2 * piece.norm2;
  };
  for (const auto& [where, piece] : pieces) {
    add(piece, 1);
    if (std::abs(piece.score) > std::abs(greatest.score)) greatest = piece;
  }
  add(greatest, -1);
  if (!(squared_norms > 0)) return {.variation = kNone, .error = kNone};
  return {.variation = (scores - noise) / squared_norms, .error = std::sqrt(2 * noise2) / squared_norms};
}

}  // namespace isac::explain
