#include "isac/estimate/step_shapes.hpp"

#include <ceres/ceres.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <boost/math/distributions/fisher_f.hpp>
#include <cmath>
#include <limits>

namespace isac::estimate {

const char* describe(StepShape shape) noexcept {
  switch (shape) {
    case StepShape::kFirstOrder:
      return "first order";
    case StepShape::kSecondOrder:
      return "second order";
    case StepShape::kFlowLimited:
      return "flow limited";
    case StepShape::kTwoRates:
      return "two rates";
  }
  return "unknown";
}

double step_shape(StepShape shape, double x, double lag, double second, double share) noexcept {
  if (!(x > 0)) return 0;
  switch (shape) {
    case StepShape::kFirstOrder:
      return 1 - std::exp(-x / lag);
    case StepShape::kSecondOrder: {
      // Equal lags: the limit, within rounding of the quotient below.
      if (std::abs(lag - second) < 1e-5 * lag) return 1 - (1 + x / lag) * std::exp(-x / lag);
      return 1 - (lag * std::exp(-x / lag) - second * std::exp(-x / second)) / (lag - second);
    }
    case StepShape::kFlowLimited: {
      const double end = share * lag / (1 - share);
      return x < end ? (1 - share) / lag * x : 1 - (1 - share) * std::exp(-(x - end) / lag);
    }
    case StepShape::kTwoRates:
      return 1 - (1 - share) * std::exp(-x / lag) - share * std::exp(-x / second);
  }
  return 0;
}

namespace {

struct Condensed {
  std::vector<double> s, y, weight;  // weight: root of the rows in the bin
  double rows = 0;
};

// Fine bins while the pressure moves, coarse ones at rest: at most about 300 points whatever the record's length.
Condensed condense(const StepData& data, double onset, double lag) {
  Condensed out;
  const double fine = std::max(data.sample_time, lag / 25);
  const double moving_end = onset + 10 * lag;
  const double coarse = std::max(fine, (data.s.back() - moving_end) / 20);
  std::size_t i = 0;
  while (i < data.s.size()) {
    const bool moving = data.s[i] >= onset - 2 * lag && data.s[i] < moving_end;
    const double end = data.s[i] + (moving ? fine : coarse) - 0.5 * data.sample_time;
    double s = 0, y = 0, n = 0;
    do {
      s += data.s[i];
      y += data.y[i];
      n += 1;
      ++i;
    } while (i < data.s.size() && data.s[i] < end);
    out.s.push_back(s / n);
    out.y.push_back(y / n);
    out.weight.push_back(std::sqrt(n));
    out.rows += n;
  }
  return out;
}

double logistic(double u) {
  return 1 / (1 + std::exp(-u));
}

struct Shape {
  StepShape kind;
  double onset = 0, lag = 0, second = 0, share = 0;
};

// θ = (L, ln T, u[, v]): u → T2/T or the share, v → the share of two rates.
Shape decode(StepShape kind, const double* theta) {
  Shape shape{kind, theta[0], std::exp(theta[1])};
  if (kind == StepShape::kSecondOrder) shape.second = shape.lag * logistic(theta[2]);
  if (kind == StepShape::kFlowLimited) shape.share = logistic(theta[2]);
  if (kind == StepShape::kTwoRates) {
    shape.second = shape.lag * logistic(theta[2]);
    shape.share = logistic(theta[3]);
  }
  return shape;
}

// Residuals with the levels solved for (two linear unknowns); returns false where they cannot be.
bool projected_residuals(const Condensed& data, const Shape& shape, double* residuals) {
  double w = 0, wg = 0, wgg = 0, wy = 0, wgy = 0;
  std::vector<double> g(data.s.size());
  for (std::size_t i = 0; i < g.size(); ++i) {
    g[i] = step_shape(shape.kind, data.s[i] - shape.onset, shape.lag, shape.second, shape.share);
    const double q = data.weight[i] * data.weight[i];
    w += q;
    wg += q * g[i];
    wgg += q * g[i] * g[i];
    wy += q * data.y[i];
    wgy += q * g[i] * data.y[i];
  }
  const double det = w * wgg - wg * wg;
  if (!(det > 1e-12 * w * w)) return false;
  const double gain = (w * wgy - wg * wy) / det;
  const double low = (wy - gain * wg) / w;
  for (std::size_t i = 0; i < g.size(); ++i) residuals[i] = data.weight[i] * (data.y[i] - low - gain * g[i]);
  return true;
}

// Variable projection with central differences: three or four parameters on a few hundred points.
class ShapeCost : public ceres::CostFunction {
 public:
  ShapeCost(const Condensed& data, StepShape kind, int parameters)
      : data_(data), kind_(kind), parameters_(parameters) {
    set_num_residuals(static_cast<int>(data.s.size()));
    mutable_parameter_block_sizes()->push_back(parameters);
  }
  bool Evaluate(double const* const* x, double* residuals, double** jacobians) const override {
    if (!projected_residuals(data_, decode(kind_, x[0]), residuals)) return false;
    if (!jacobians || !jacobians[0]) return true;
    const std::size_t n = data_.s.size();
    std::vector<double> up(n), down(n);
    std::array<double, 4> theta{};
    for (int k = 0; k < parameters_; ++k) {
      std::copy_n(x[0], parameters_, theta.begin());
      const double h = k == 0 ? 1e-4 * std::exp(x[0][1]) : 1e-4;
      theta[static_cast<std::size_t>(k)] = x[0][k] + h;
      if (!projected_residuals(data_, decode(kind_, theta.data()), up.data())) return false;
      theta[static_cast<std::size_t>(k)] = x[0][k] - h;
      if (!projected_residuals(data_, decode(kind_, theta.data()), down.data())) return false;
      for (std::size_t i = 0; i < n; ++i)
        jacobians[0][i * static_cast<std::size_t>(parameters_) + static_cast<std::size_t>(k)] =
            (up[i] - down[i]) / (2 * h);
    }
    return true;
  }

 private:
  const Condensed& data_;
  StepShape kind_;
  int parameters_;
};

}  // namespace

StepShapeFit fit_shape(StepShape kind, const StepData& data, const StepFit& first_order, double earliest) {
  const double lag = first_order.parameters[2], onset = first_order.parameters[3];
  StepShapeFit out{.shape = kind};
  if (kind == StepShape::kFirstOrder) {
    out.lag = lag;
    out.dead_time = onset;
    out.rmse = std::sqrt(first_order.sse / static_cast<double>(data.y.size()));
    return out;
  }
  const Condensed condensed = condense(data, onset, lag);
  const int parameters = kind == StepShape::kTwoRates ? 4 : 3;
  const double bound = std::max(earliest, data.s.front());
  // What the condensing has hidden (scatter within bins) is the same for all shapes.
  const auto rmse_of = [&](const Shape& shape) {
    std::vector<double> g(data.s.size());
    double sg = 0, sgg = 0, sy = 0, sgy = 0;
    const double n = static_cast<double>(g.size());
    for (std::size_t i = 0; i < g.size(); ++i) {
      g[i] = step_shape(kind, data.s[i] - shape.onset, shape.lag, shape.second, shape.share);
      sg += g[i];
      sgg += g[i] * g[i];
      sy += data.y[i];
      sgy += g[i] * data.y[i];
    }
    const double gain = (n * sgy - sg * sy) / (n * sgg - sg * sg), low = (sy - gain * sg) / n;
    double sse = 0;
    for (std::size_t i = 0; i < g.size(); ++i) sse += std::pow(data.y[i] - low - gain * g[i], 2);
    return std::sqrt(sse / n);
  };
  double best_cost = std::numeric_limits<double>::infinity();
  for (const double lag_factor : {1.0, 0.5})
    for (const double u : {-1.5, 0.8}) {
      double theta[4] = {std::max(bound, onset - (1 - lag_factor) * lag), std::log(lag * lag_factor), u, -u};
      ceres::Problem problem;
      problem.AddResidualBlock(new ShapeCost(condensed, kind, parameters), nullptr, theta);
      problem.SetParameterLowerBound(theta, 0, bound);
      for (int k = 2; k < parameters; ++k) {
        problem.SetParameterLowerBound(theta, k, -7.0);
        problem.SetParameterUpperBound(theta, k, 7.0);
      }
      problem.SetParameterLowerBound(theta, 1, std::log(lag) - 4);
      problem.SetParameterUpperBound(theta, 1, std::log(lag) + 4);
      ceres::Solver::Options options;
      options.linear_solver_type = ceres::DENSE_QR;
      options.max_num_iterations = 40;
      options.logging_type = ceres::SILENT;
      ceres::Solver::Summary summary;
      ceres::Solve(options, &problem, &summary);
      if (!summary.IsSolutionUsable() || !(summary.final_cost < best_cost)) continue;
      best_cost = summary.final_cost;
      const Shape shape = decode(kind, theta);
      out.lag = shape.lag;
      out.dead_time = shape.onset;
      if (kind != StepShape::kFlowLimited) out.second_lag = shape.second;
      if (kind != StepShape::kSecondOrder) out.share = shape.share;
      out.rmse = rmse_of(shape);
    }
  return out;
}

namespace {

constexpr double kSwing = 0.03;  // of the step: more than a sensor's noise, a limit cycle

struct BlockMeans {
  std::vector<double> moving, moving_at, resting, rows;
};

// Means of the residual over a sixteenth of the lag, while the pressure moves and at rest.
BlockMeans block_means(const StepData& data, const StepFit& fit) {
  BlockMeans out;
  const double lag = fit.parameters[2], onset = fit.parameters[3];
  const double width = std::max(lag / 16, data.sample_time);
  std::size_t i = 0;
  while (i < data.s.size()) {
    const double begin = data.s[i];
    double sum = 0, n = 0;
    do {
      sum += fit.residuals[i];
      n += 1;
      ++i;
    } while (i < data.s.size() && data.s[i] < begin + width - 0.5 * data.sample_time);
    if (begin >= onset - lag && begin < onset + 5 * lag) {
      out.moving.push_back(sum / n);
      out.moving_at.push_back(begin + 0.5 * width);
      out.rows.push_back(n);
    } else {
      out.resting.push_back(sum / n);
    }
  }
  return out;
}

double mean_square(const std::vector<double>& v) {
  double sum = 0;
  for (double x : v) sum += x * x;
  return v.empty() ? 0 : sum / static_cast<double>(v.size());
}

// Each further parameter must cut the rmse by a tenth: a picture's worth, not a decimal's.
StepShape best_shape(const std::vector<StepShapeFit>& shapes) {
  StepShape best = StepShape::kFirstOrder;
  double best_score = shapes.front().rmse;
  for (const StepShapeFit& s : shapes) {
    const double penalty = s.shape == StepShape::kFirstOrder ? 1.0
                           : s.shape == StepShape::kTwoRates ? 1 / 0.81
                                                             : 1 / 0.9;
    if (s.rmse * penalty < best_score) {
      best_score = s.rmse * penalty;
      best = s.shape;
    }
  }
  return best;
}

std::string shape_words(const StepShapeFit& s, bool filling) {
  const char* move = filling ? "rise" : "fall";
  switch (s.shape) {
    case StepShape::kFlowLimited:
      return fmt::format("the {} begins with a constant slope: flow limited until {:.0f} % of the step", move,
                         100 * s.share);
    case StepShape::kSecondOrder:
      return fmt::format("the {} begins softly: a second lag of {:.3g} s beside one of {:.3g} s", move,
                         s.second_lag, s.lag);
    case StepShape::kTwoRates:
      return fmt::format("{:.0f} % of the {} comes with a lag of {:.3g} s, the rest with {:.3g} s",
                         100 * s.share, move, s.second_lag, s.lag);
    case StepShape::kFirstOrder:
      break;
  }
  return "none of the shapes known here (second lag, flow limit, two rates) describes it better";
}

}  // namespace

StepAdequacy judge_step(const StepData& data, const StepFit& fit, double earliest, double tolerance) {
  StepAdequacy out;
  const double size = std::abs(fit.parameters[1]);
  const bool filling = fit.parameters[1] > 0;
  const BlockMeans blocks = block_means(data, fit);
  if (blocks.moving.size() < 6) {
    out.sentence = "too few rows while the pressure moves to judge the shape";
    return out;
  }
  double rest = std::sqrt(mean_square(blocks.resting));
  double rest_count = static_cast<double>(blocks.resting.size());
  if (blocks.resting.size() < 5) {
    rest = data.noise / std::sqrt(median_of(blocks.rows));
    rest_count = static_cast<double>(data.y.size()) / 3;
  }
  rest = std::max(rest, data.quantum / std::sqrt(12.0));
  for (std::size_t k = 0; k < blocks.moving.size(); ++k) {
    const double excess = std::max(0.0, std::abs(blocks.moving[k]) - 2 * rest) / size;
    if (excess > out.misfit_worst) {
      out.misfit_worst = excess;
      out.misfit_at = blocks.moving_at[k];
    }
  }
  const double moving = mean_square(blocks.moving);
  out.misfit_rms = std::sqrt(std::max(0.0, moving - rest * rest)) / size;
  const double dof = static_cast<double>(blocks.moving.size()) - 3;
  if (rest > 0)
    out.p_value = boost::math::cdf(
        boost::math::complement(boost::math::fisher_f(dof, rest_count), moving / (rest * rest)));
  out.first_order = out.misfit_worst <= tolerance;
  const std::string swing =
      rest > kSwing * size
          ? fmt::format("; at rest the pressure still swings by {:.0f} % rms of the step", 100 * rest / size)
          : std::string();

  out.shapes.push_back(fit_shape(StepShape::kFirstOrder, data, fit, earliest));
  const bool clean = out.misfit_worst < 0.01 || out.p_value > 0.001;
  if (out.first_order && clean) {
    out.sentence = fmt::format("first order: the largest smooth misfit is {:.2g} % of the step",
                               100 * out.misfit_worst) +
                   swing;
    return out;
  }
  for (const StepShape s : {StepShape::kSecondOrder, StepShape::kFlowLimited, StepShape::kTwoRates})
    out.shapes.push_back(fit_shape(s, data, fit, earliest));
  out.best = best_shape(out.shapes);
  const StepShapeFit& best = *std::find_if(out.shapes.begin(), out.shapes.end(),
                                           [&](const StepShapeFit& s) { return s.shape == out.best; });
  if (!out.first_order)
    out.sentence = fmt::format("not first order (misfit up to {:.0f} % of the step): {}",
                               100 * out.misfit_worst, shape_words(best, filling));
  else if (out.best == StepShape::kFirstOrder)
    out.sentence = fmt::format("first order to within {:.1f} % of the step", 100 * out.misfit_worst);
  else
    out.sentence = fmt::format(
        "first order to within {:.1f} % of the step; closer still ({:.3g} against {:.3g} Pa rms): {}",
        100 * out.misfit_worst, best.rmse, out.shapes.front().rmse, shape_words(best, filling));
  out.sentence += swing;
  return out;
}

}  // namespace isac::estimate
