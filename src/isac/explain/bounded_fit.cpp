#include "isac/explain/bounded_fit.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "isac/estimate/linear_algebra.hpp"

namespace isac::explain {

Eigen::VectorXd bounded_quadratic(const Eigen::MatrixXd& H, const Eigen::VectorXd& g,
                                  const Eigen::VectorXd& lower, const Eigen::VectorXd& upper) {
  const Eigen::Index n = g.size();
  Eigen::VectorXd d = Eigen::VectorXd::Zero(n).cwiseMax(lower).cwiseMin(upper);
  std::vector<signed char> held(static_cast<std::size_t>(n), 0);  // −1 at the lower bound, 1 at the upper
  const auto at = [&](Eigen::Index i) -> signed char& { return held[static_cast<std::size_t>(i)]; };
  // Each round frees or holds one coordinate; the loss falls with every round but degenerate ones, which the count ends.
  for (Eigen::Index round = 0; round < 8 * n + 8; ++round) {
    std::vector<Eigen::Index> free;
    for (Eigen::Index i = 0; i < n; ++i)
      if (at(i) == 0) free.push_back(i);
    Eigen::VectorXd target = d;
    if (!free.empty()) {
      const auto m = static_cast<Eigen::Index>(free.size());
      Eigen::MatrixXd h(m, m);
      Eigen::VectorXd right(m);
      for (Eigen::Index a = 0; a < m; ++a) {
        const Eigen::Index i = free[static_cast<std::size_t>(a)];
        right[a] = -g[i];
        for (Eigen::Index j = 0; j < n; ++j)
          if (at(j) != 0) right[a] -= H(i, j) * d[j];
        for (Eigen::Index b = 0; b < m; ++b) h(a, b) = H(i, free[static_cast<std::size_t>(b)]);
      }
      const Eigen::VectorXd solution = estimate::solve_symmetric(h, right);
      if (!solution.allFinite()) return d;
      for (Eigen::Index a = 0; a < m; ++a) target[free[static_cast<std::size_t>(a)]] = solution[a];
    }
    // As far towards it as the bounds let.
    double share = 1;
    Eigen::Index stops = -1;
    for (const Eigen::Index i : free) {
      const double move = target[i] - d[i];
      const double room = move > 0 ? upper[i] - d[i] : lower[i] - d[i];
      if (move == 0 || room / move >= share) continue;
      share = std::max(0.0, room / move);
      stops = i;
    }
    for (const Eigen::Index i : free) d[i] += share * (target[i] - d[i]);
    if (stops >= 0) {
      at(stops) = target[stops] > d[stops] ? 1 : -1;
      d[stops] = at(stops) > 0 ? upper[stops] : lower[stops];
      continue;
    }
    // Let go of the bound against which the slope pulls most, measured in what it is worth.
    const Eigen::VectorXd slope = H * d + g;
    Eigen::Index worst = -1;
    double gain = 0;
    for (Eigen::Index i = 0; i < n; ++i) {
      if (at(i) == 0 || slope[i] * at(i) <= 0 || !(upper[i] > lower[i])) continue;
      const double worth = slope[i] * slope[i] / H(i, i);
      if (worth > gain) {
        gain = worth;
        worst = i;
      }
    }
    if (worst < 0) return d;
    at(worst) = 0;
  }
  return d;
}

BoundedFit bounded_fit(const Evaluate& evaluate, Eigen::VectorXd start, const Eigen::VectorXd& lower,
                       const Eigen::VectorXd& upper, const BoundedOptions& options) {
  BoundedFit fit;
  fit.x = start.cwiseMax(lower).cwiseMin(upper);
  Eigen::MatrixXd jacobian;
  if (!evaluate(fit.x, fit.residual, fit.x.size() > 0 ? &jacobian : nullptr)) return fit;
  fit.loss = fit.residual.squaredNorm();
  if (fit.x.size() == 0) {
    fit.converged = true;
    return fit;
  }
  double damping = 0;
  while (fit.rounds < options.rounds) {
    Eigen::MatrixXd H = Eigen::MatrixXd::Zero(fit.x.size(), fit.x.size());
    H.selfadjointView<Eigen::Lower>().rankUpdate(jacobian.transpose());
    H = Eigen::MatrixXd(H.selfadjointView<Eigen::Lower>());
    fit.curvature = H;
    const Eigen::VectorXd g = jacobian.transpose() * fit.residual;
    const double largest = std::max(H.diagonal().maxCoeff(), 1e-300);
    // What the data do not feel stays where it is: a stop that nothing reached would be moved by the noise of its slope, into what was reached.
    Eigen::VectorXd low = lower - fit.x, high = upper - fit.x;
    for (Eigen::Index i = 0; i < low.size(); ++i) {
      const double range = upper[i] - lower[i];
      if (H(i, i) * range * range < options.tolerance * fit.loss) low[i] = high[i] = 0;
    }
    bool moved = false;
    while (fit.rounds < options.rounds) {
      ++fit.rounds;
      Eigen::MatrixXd damped = H;
      for (Eigen::Index i = 0; i < H.rows(); ++i)
        damped(i, i) += (damping + 1e-12) * H(i, i) + 1e-14 * largest;
      const Eigen::VectorXd d = bounded_quadratic(damped, g, low, high);
      const double promised = -(2 * g.dot(d) + d.dot(H * d));
      if (!(promised > options.tolerance * fit.loss)) {
        fit.converged = true;
        return fit;
      }
      const Eigen::VectorXd x = (fit.x + d).cwiseMax(lower).cwiseMin(upper);
      Eigen::VectorXd residual;
      const double loss = evaluate(x, residual, nullptr) ? residual.squaredNorm() : INFINITY;
      if (!(loss < fit.loss)) {
        damping = damping > 0 ? 8 * damping : 0.05;
        if (damping > 1e8) {
          fit.converged = true;  // no way down that differences can see
          return fit;
        }
        continue;
      }
      // A full step that closed what it promised leaves nothing to the next: what bends the residual bends the promise as well.
      const bool kept = damping == 0 && std::abs(fit.loss - loss - promised) < options.tolerance * loss;
      damping = fit.loss - loss > 0.25 * promised ? damping / 10 : std::max(damping, 0.05);
      if (damping < 1e-4) damping = 0;
      const bool enough = kept || fit.loss - loss < options.tolerance * loss;
      fit.x = x;
      fit.residual = std::move(residual);
      fit.loss = loss;
      if (enough) {
        fit.converged = true;
        return fit;
      }
      moved = true;
      break;
    }
    if (!moved || fit.rounds >= options.rounds) return fit;
    Eigen::VectorXd again;
    if (!evaluate(fit.x, again, &jacobian)) return fit;
  }
  return fit;
}

}  // namespace isac::explain
