#include "latent.hpp"

#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

namespace baselines {
namespace {

struct Process {
  Eigen::Matrix2d step, noise, start;
};

Process process_of(double deviation, double length, double spacing) {
  const double r = std::sqrt(3.0) / length, e = std::exp(-r * spacing), v = deviation * deviation;
  Process p;
  p.step << (1 + r * spacing) * e, spacing * e, -r * r * spacing * e, (1 - r * spacing) * e;
  p.start << v, 0, 0, v * r * r;
  p.noise = p.start - p.step * p.start * p.step.transpose();
  return p;
}

/// Log-likelihood of the innovations; `mean` is smoothed if asked for.
double filter(const Piece& piece, const Process& p, std::vector<double>* mean) {
  Eigen::Vector2d m = Eigen::Vector2d::Zero();
  Eigen::Matrix2d c = p.start;
  std::vector<Eigen::Vector2d> means, ahead;
  std::vector<Eigen::Matrix2d> spreads, spreads_ahead;
  double likelihood = 0;
  for (std::size_t k = 0; k < piece.y.size(); ++k) {
    if (k > 0) {
      m = p.step * m;
      c = p.step * c * p.step.transpose() + p.noise;
    }
    if (mean != nullptr) {
      ahead.push_back(m);
      spreads_ahead.push_back(c);
    }
    const double s = c(0, 0) + 1, innovation = piece.y[k] - m[0];
    likelihood -= 0.5 * (std::log(s) + innovation * innovation / s);
    const Eigen::Vector2d gain = c.col(0) / s;
    m += gain * innovation;
    c -= gain * c.row(0);
    c = 0.5 * (c + c.transpose().eval());
    if (mean != nullptr) {
      means.push_back(m);
      spreads.push_back(c);
    }
  }
  if (mean == nullptr) return likelihood;
  mean->assign(piece.y.size(), 0.0);
  Eigen::Vector2d next = m;
  for (std::size_t k = piece.y.size(); k-- > 0;) {
    if (k + 1 < piece.y.size()) {
      Eigen::Matrix2d inner = spreads_ahead[k + 1];
      inner.diagonal() *= 1 + 1e-9;
      const Eigen::Matrix2d back = spreads[k] * p.step.transpose() * inner.inverse();
      next = means[k] + back * (next - ahead[k + 1]);
    }
    (*mean)[k] = next[0];
  }
  return likelihood;
}

}  // namespace

Latent latent_force(const std::vector<Piece>& pieces) {
  Latent out;
  double best = -std::numeric_limits<double>::infinity();
  for (const double length : {0.05, 0.15, 0.5, 1.5, 5.0})
    for (const double deviation : {0.1, 0.2, 0.4, 0.8, 1.6, 3.2}) {
      double sum = 0;
      for (const Piece& piece : pieces)
        sum += filter(piece, process_of(deviation, length, piece.spacing), nullptr);
      if (sum <= best) continue;
      best = sum;
      out.length = length;
      out.deviation = deviation;
    }
  out.mean.resize(pieces.size());
  for (std::size_t i = 0; i < pieces.size(); ++i)
    (void)filter(pieces[i], process_of(out.deviation, out.length, pieces[i].spacing), &out.mean[i]);
  return out;
}

}  // namespace baselines
