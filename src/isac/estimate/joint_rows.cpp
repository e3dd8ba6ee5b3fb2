#include "isac/estimate/joint_rows.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "isac/estimate/linear_algebra.hpp"
#include "isac/series/differentiate.hpp"
#include "isac/series/statistics.hpp"

namespace isac::estimate {
namespace {

using series::Segment;

double norm(const std::vector<double>& weights) {
  double sum = 0;
  for (const double w : weights) sum += w * w;
  return std::sqrt(sum);
}

/// a ∗ b: the kernel of one filter behind the other.
std::vector<double> chain(const std::vector<double>& a, const std::vector<double>& b) {
  std::vector<double> out(a.size() + b.size() - 1, 0.0);
  for (std::size_t i = 0; i < a.size(); ++i)
    for (std::size_t j = 0; j < b.size(); ++j) out[i + j] += a[i] * b[j];
  return out;
}

RowNoise noise_of(const RowRecipe& recipe, double interval, bool velocity_measured, double velocity_noise) {
  const series::LocalPolynomial polynomial{.window = recipe.window, .order = recipe.order};
  const std::vector<double> low_pass =
      recipe.parallel_filter ? series::implied_low_pass(polynomial) : std::vector<double>{1.0};
  const std::vector<double> first = series::kernel(polynomial, 1, interval),
                            second = series::kernel(polynomial, 2, interval);
  RowNoise noise;
  const auto set = [&](Input input, double sigma, const std::vector<double>& weights) {
    noise.raw[static_cast<int>(input)] = sigma * norm(weights);
    noise.filtered[static_cast<int>(input)] = sigma * norm(chain(weights, low_pass));
  };
  const std::vector<double> plain{1.0};
  set(Input::kAngle, recipe.angle_noise, plain);
  if (velocity_measured) {
    set(Input::kVelocity, velocity_noise, plain);
    set(Input::kAcceleration, velocity_noise, first);
  } else {
    set(Input::kVelocity, recipe.angle_noise, first);
    set(Input::kAcceleration, recipe.angle_noise, second);
  }
  set(Input::kDeltaPressure, recipe.delta_pressure_noise, plain);
  set(Input::kMeanPressure, recipe.delta_pressure_noise, plain);
  return noise;
}

/// Columns of one run over all its samples, NaN where not known.
struct RunColumns {
  std::span<const double> input[kInputs];  ///< empty: zero throughout
  std::span<const double> time, y;
  std::vector<std::vector<double>> x;  ///< made only for the parallel filter, which needs whole columns
  std::vector<Segment> segments;
  double interval = 0;
  RowNoise noise;
  bool resting = false;
  std::vector<double> first, second, late;  ///< derivatives and shifted output that the spans look at
  [[nodiscard]] double at(int z, std::size_t i) const { return input[z].empty() ? 0.0 : input[z][i]; }
};

/// A regressor that is a constant times one input; input −1: it is not.
struct Proportional {
  int input = -1;
  double factor = 0;
};

Proportional proportional(const JointTerms& terms, std::size_t k) {
  int read = -1;
  for (int z = 0; z < kInputs; ++z) {
    if (!terms.reads(k, static_cast<Input>(z))) continue;
    if (read >= 0) return {};
    read = z;
  }
  if (read < 0 || terms.regressor(k, {}) != 0.0) return {};
  const auto at = [&](double value) {
    JointState state;
    set_value(state, static_cast<Input>(read), value);
    return terms.regressor(k, state);
  };
  const double factor = at(1.0);
  for (const double value : {-3.7, 0.013, 1.9e5})
    if (std::abs(at(value) - factor * value) > 1e-12 * std::abs(factor * value)) return {};
  return {read, factor};
}

/// x_k of rows [begin, end).
void fill_regressor(const RunColumns& run, const JointTerms& terms, const RowRecipe& recipe, std::size_t k,
                    std::size_t begin, std::size_t end, double* x) {
  if (const Proportional p = proportional(terms, k);
      p.input >= 0) {  // A, B, D, inertia: no need to ask row by row
    const std::span<const double> z = run.input[p.input];
    for (std::size_t i = begin; i < end; ++i) x[i - begin] = z.empty() ? 0.0 : p.factor * z[i];
    return;
  }
  if (terms.is_cubic_damping(k)) {
    // E[v̂³] = v³ + 3σ²v: the Hermite polynomial is unbiased.
    const double sigma = recipe.unbiased_cube ? run.noise.raw[static_cast<int>(Input::kVelocity)] : 0.0;
    const double factor = terms.regressor(k, {.velocity = 1.0});
    const std::span<const double> v = run.input[static_cast<int>(Input::kVelocity)];
    for (std::size_t i = begin; i < end; ++i)
      x[i - begin] = factor * (v[i] * v[i] - 3.0 * sigma * sigma) * v[i];
    return;
  }
  const double origin = run.time.empty() ? 0.0 : run.time.front();
  for (std::size_t i = begin; i < end; ++i) {
    const JointState state{run.at(0, i), run.at(1, i), run.at(2, i),
                           run.at(3, i), run.at(4, i), run.time[i] - origin};
    x[i - begin] = std::isfinite(state.velocity) ? terms.regressor(k, state) : std::nan("");
  }
}

bool run_rests(std::span<const double> angle, double step) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const double value : angle) {
    if (!std::isfinite(value)) continue;
    low = std::min(low, value);
    high = std::max(high, value);
    if (!rests(low, high, step)) return false;
  }
  return low <= high;
}

RunColumns columns_of(const JointRun& run, const JointTerms& terms, const RowRecipe& recipe) {
  RunColumns out;
  const series::LocalPolynomial polynomial{.window = recipe.window, .order = recipe.order};
  const bool measured = !run.velocity.empty();
  const bool acceleration = terms.reads(Input::kAcceleration);
  series::Derivatives d = series::differentiate(
      run.time, measured ? run.velocity : run.angle, polynomial,
      {.value = false, .first = !measured || acceleration, .second = !measured && acceleration});
  out.segments = std::move(d.segments);
  out.interval = d.interval;
  out.first = std::move(d.first);
  out.second = std::move(d.second);
  double velocity_noise = 0;
  if (measured && recipe.unbiased_cube)
    velocity_noise = series::sample_noise(run.time, run.velocity, recipe.order);
  out.noise = noise_of(recipe, d.interval, measured, std::isfinite(velocity_noise) ? velocity_noise : 0.0);
  if (recipe.angle_step > 0 && run_rests(run.angle, recipe.angle_step)) {
    out.resting = true;  // its error is a constant, which a parameter of its own takes up
    out.noise.raw[static_cast<int>(Input::kAngle)] = out.noise.filtered[static_cast<int>(Input::kAngle)] = 0;
  }
  out.time = run.time;
  out.input[0] = run.angle;
  out.input[1] = measured ? std::span<const double>(run.velocity) : out.first;
  if (acceleration) out.input[2] = measured ? out.first : out.second;
  out.input[3] = run.delta_pressure;
  out.input[4] = run.mean_pressure;
  out.y = run.output;
  if (recipe.output_lag > 0) {
    out.late = advanced(run.time, run.output, recipe.output_lag, d.interval);
    out.y = out.late;
  }
  if (recipe.parallel_filter) {
    out.x.assign(terms.linear().size(), std::vector<double>(run.time.size()));
    for (std::size_t k = 0; k < out.x.size(); ++k)
      fill_regressor(out, terms, recipe, k, 0, run.time.size(), out.x[k].data());
  }
  return out;
}

/// A robust fit to some 20 000 rows, good enough to tell a spike from motion.
Eigen::VectorXd pilot_fit(const std::vector<RunColumns>& runs, std::size_t terms) {
  std::size_t total = 0;
  for (const RunColumns& run : runs) total += run.y.size();
  const std::size_t stride = std::max<std::size_t>(1, total / 20000);
  std::vector<std::vector<double>> picked;
  for (const RunColumns& run : runs)
    for (std::size_t i = stride / 2; i < run.y.size(); i += stride) {
      std::vector<double> row;
      for (std::size_t k = 0; k < terms; ++k) row.push_back(run.x[k][i]);
      row.push_back(run.y[i]);
      if (std::all_of(row.begin(), row.end(), [](double v) { return std::isfinite(v); }))
        picked.push_back(std::move(row));
    }
  const auto n = static_cast<Eigen::Index>(picked.size());
  const auto p = static_cast<Eigen::Index>(terms);
  Eigen::MatrixXd x(n, p);
  Eigen::VectorXd y(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index k = 0; k < p; ++k)
      x(i, k) = picked[static_cast<std::size_t>(i)][static_cast<std::size_t>(k)];
    y[i] = picked[static_cast<std::size_t>(i)][terms];
  }
  const Eigen::VectorXd scale = x.colwise().norm().transpose().cwiseMax(1e-300).cwiseInverse();
  x = x * scale.asDiagonal();
  Eigen::VectorXd theta = Eigen::VectorXd::Zero(p), weight = Eigen::VectorXd::Ones(n);
  for (int round = 0; round < 6; ++round) {
    Eigen::MatrixXd normal = x.transpose() * weight.asDiagonal() * x;
    normal.diagonal().array() += 1e-10;  // still columns stay at zero
    theta = solve_symmetric(normal, x.transpose() * weight.cwiseProduct(y));
    const Eigen::VectorXd residual = y - x * theta;
    const double bend =
        1.345 * series::robust_deviation({residual.data(), static_cast<std::size_t>(n)}, true);
    if (!(bend > 0)) break;
    for (Eigen::Index i = 0; i < n; ++i)
      weight[i] = std::min(1.0, bend / std::max(std::abs(residual[i]), 1e-300));
  }
  return theta.cwiseProduct(scale);
}

/// Hampel's identifier over seven samples of the pilot's residual; returns how many samples were replaced.
std::size_t remove_spikes(const RunColumns& run, const Eigen::VectorXd& pilot, std::vector<double>& y) {
  constexpr std::size_t kHalf = 3;
  if (y.size() < 2 * kHalf + 1) return 0;
  std::vector<double> residual = y, off(y.size(), std::nan(""));
  for (std::size_t k = 0; k < run.x.size(); ++k) {
    const double theta = pilot[static_cast<Eigen::Index>(k)];
    for (std::size_t i = 0; i < y.size(); ++i) residual[i] -= theta * run.x[k][i];
  }
  for (std::size_t i = kHalf; i + kHalf < y.size(); ++i) {
    double near[2 * kHalf + 1], sum = 0;
    for (std::size_t j = 0; j <= 2 * kHalf; ++j) sum += near[j] = residual[i + j - kHalf];
    if (!std::isfinite(sum)) continue;
    std::nth_element(near, near + kHalf, near + 2 * kHalf + 1);
    off[i] = residual[i] - near[kHalf];
  }
  std::vector<double> some;
  const std::size_t stride = std::max<std::size_t>(1, off.size() / 50000);
  for (std::size_t i = 0; i < off.size(); i += stride) some.push_back(off[i]);
  // A spike stands out of its neighbours and out of the residual as a whole; noise that grows with speed does neither.
  std::vector<double> overall;
  for (std::size_t i = 0; i < residual.size(); i += stride) overall.push_back(residual[i]);
  const double limit =
      std::max(6.0 * series::robust_deviation(some, true), 4.0 * series::robust_deviation(overall, true));
  if (!(limit > 0)) return 0;
  std::size_t count = 0;
  for (std::size_t i = 0; i < y.size(); ++i)
    if (std::abs(off[i]) > limit) {
      y[i] -= off[i];
      ++count;
    }
  return count;
}

}  // namespace

JointState JointRows::state(std::size_t i) const {
  return {input[0][i], input[1][i], input[2][i], input[3][i], input[4][i], time[i]};
}

bool rests(double lowest, double highest, double step) noexcept {
  return highest - lowest <= 1.5 * step;
}

std::vector<double> advanced(std::span<const double> time, std::span<const double> signal, double lag,
                             double interval) {
  const std::size_t rows = std::min(time.size(), signal.size());
  std::vector<double> out(rows, std::nan(""));
  std::size_t left = 0;
  for (std::size_t i = 0; i < rows; ++i) {
    const double wanted = time[i] + lag;
    while (left + 1 < rows && time[left + 1] <= wanted) ++left;
    if (left + 1 >= rows) break;
    const double step = time[left + 1] - time[left];
    if (step > 2.5 * interval) continue;
    out[i] = signal[left] + (signal[left + 1] - signal[left]) * ((wanted - time[left]) / step);
  }
  return out;
}

namespace {

/// Stretches of rows in which all columns are finite: 0 · x is 0 only there.
std::vector<Segment> usable_rows(std::span<const std::span<const double>> columns, std::size_t rows) {
  constexpr std::size_t kChunk = 512;
  std::vector<Segment> out;
  double probe[kChunk];
  bool open = false;
  for (std::size_t begin = 0; begin < rows; begin += kChunk) {
    const std::size_t count = std::min(kChunk, rows - begin);
    std::fill_n(probe, count, 0.0);
    for (const std::span<const double> column : columns)
      for (std::size_t i = 0; i < count; ++i) probe[i] += 0.0 * column[begin + i];
    for (std::size_t i = 0; i < count; ++i) {
      const bool usable = probe[i] == 0.0;
      if (usable && !open) out.push_back({begin + i, rows});
      if (!usable && open) out.back().end = begin + i;
      open = usable;
    }
  }
  return out;
}

void append(std::vector<double>& to, std::span<const double> from, const Segment& part) {
  if (from.empty())
    to.insert(to.end(), part.end - part.begin, 0.0);
  else
    to.insert(to.end(), from.begin() + static_cast<std::ptrdiff_t>(part.begin),
              from.begin() + static_cast<std::ptrdiff_t>(part.end));
}

}  // namespace

JointRows make_rows(std::span<const JointRun> runs, const JointTerms& terms, const RowRecipe& recipe) {
  JointRows out;
  const std::size_t terms_count = terms.linear().size();
  out.plain.resize(terms_count);
  if (recipe.parallel_filter) out.filtered.resize(terms_count);
  const series::LocalPolynomial polynomial{.window = recipe.window, .order = recipe.order};
  const std::vector<double> low_pass = series::implied_low_pass(polynomial);
  std::vector<RunColumns> all;
  std::size_t total = 0;
  for (const JointRun& run : runs) {
    all.push_back(columns_of(run, terms, recipe));
    total += run.time.size();
  }
  out.time.reserve(total);
  out.output.reserve(total);
  for (auto& column : out.input) column.reserve(total);
  for (auto& column : out.plain) column.reserve(total);
  for (auto& column : out.filtered) column.reserve(total);
  if (recipe.parallel_filter) out.filtered_output.reserve(total);
  const bool clean = recipe.parallel_filter && recipe.clean_spikes;
  const Eigen::VectorXd pilot = clean ? pilot_fit(all, terms_count) : Eigen::VectorXd();
  std::vector<std::vector<double>> filtered(recipe.parallel_filter ? terms_count : 0);
  for (std::size_t r = 0; r < runs.size(); ++r) {
    const JointRun& run = runs[r];
    const std::size_t rows = run.time.size();
    out.seen += rows;
    RunColumns& columns = all[r];
    std::vector<double> cleaned, filtered_output;
    std::vector<std::span<const double>> needed{columns.y, columns.input[1], columns.input[0]};
    if (recipe.parallel_filter) {
      cleaned.assign(columns.y.begin(), columns.y.end());
      if (clean) out.cleaned += remove_spikes(columns, pilot, cleaned);
      for (std::size_t k = 0; k < terms_count; ++k) {
        filtered[k] = series::convolve(columns.x[k], low_pass, columns.segments);
        needed.push_back(columns.x[k]);
        needed.push_back(filtered[k]);
      }
      filtered_output = series::convolve(cleaned, low_pass, columns.segments);
      needed.push_back(filtered_output);
    } else {
      columns.x.assign(terms_count, {});
      for (std::size_t k = 0; k < terms_count; ++k) {
        const Proportional p = proportional(terms, k);  // its input says whether it is finite
        const bool simple = p.input >= 0 || terms.is_cubic_damping(k);
        const int z = p.input >= 0 ? p.input : static_cast<int>(Input::kVelocity);
        if (simple && !columns.input[z].empty()) needed.push_back(columns.input[z]);
        if (simple) continue;
        columns.x[k].resize(rows);
        fill_regressor(columns, terms, recipe, k, 0, rows, columns.x[k].data());
        needed.push_back(columns.x[k]);
      }
    }
    if (!terms.nonlinear().empty())
      for (const auto& input : columns.input)
        if (!input.empty()) needed.push_back(input);
    RunRows span{.name = run.name,
                 .begin = out.size(),
                 .end = 0,
                 .interval = columns.interval,
                 .noise = columns.noise,
                 .resting = columns.resting};
    const double origin = rows > 0 ? run.time.front() : 0.0;
    for (const Segment& part : usable_rows(needed, rows)) {
      for (std::size_t i = part.begin; i < part.end; ++i) out.time.push_back(run.time[i] - origin);
      for (int z = 0; z < kInputs; ++z) append(out.input[z], columns.input[z], part);
      append(out.output, columns.y, part);
      for (std::size_t k = 0; k < terms_count; ++k) {
        if (!columns.x[k].empty()) {
          append(out.plain[k], columns.x[k], part);
        } else {
          out.plain[k].resize(out.time.size());
          fill_regressor(columns, terms, recipe, k, part.begin, part.end,
                         out.plain[k].data() + out.time.size() - (part.end - part.begin));
        }
        if (recipe.parallel_filter) append(out.filtered[k], filtered[k], part);
      }
      if (recipe.parallel_filter) append(out.filtered_output, filtered_output, part);
    }
    span.end = out.size();
    out.runs.push_back(std::move(span));
  }
  return out;
}

namespace {

/// How the k-th regressor follows one standard deviation of an input, at a state.
double slope(const JointTerms& terms, std::size_t k, const JointState& state, Input input, double sigma) {
  if (sigma == 0.0) return 0.0;
  JointState up = state, down = state;
  set_value(up, input, value_of(state, input) + sigma);
  set_value(down, input, value_of(state, input) - sigma);
  return 0.5 * (terms.regressor(k, up) - terms.regressor(k, down));
}

/// Does x_k change by the same amount everywhere (A, B, D, inertia)? Then one evaluation serves all rows.
bool constant_slope(const JointTerms& terms, std::size_t k, Input input) {
  const JointState a{
      .angle = 0.3, .velocity = 0.7, .acceleration = 0.9, .delta_pressure = 4e4, .mean_pressure = 2e5};
  const JointState b{
      .angle = -0.8, .velocity = -2.1, .acceleration = -1.3, .delta_pressure = -9e4, .mean_pressure = 3e5};
  const double h = input == Input::kDeltaPressure || input == Input::kMeanPressure ? 1e3 : 1e-2;
  const double first = slope(terms, k, a, input, h), second = slope(terms, k, b, input, h);
  const double middle = slope(terms, k, {}, input, h);  // a step at zero is flat on both sides
  return std::abs(first - second) <= 1e-9 * std::abs(first) &&
         std::abs(first - middle) <= 1e-9 * std::abs(first);
}

struct Sensitivity {
  std::size_t k;
  Input input;
  bool constant;
  double cube;  ///< factor of v³ for cubic damping, else 0
};

std::vector<Sensitivity> sensitivities(const JointTerms& terms) {
  std::vector<Sensitivity> out;
  for (std::size_t k = 0; k < terms.linear().size(); ++k)
    for (int z = 0; z < kInputs; ++z)
      if (terms.reads(k, static_cast<Input>(z)))
        out.push_back({k, static_cast<Input>(z), constant_slope(terms, k, static_cast<Input>(z)),
                       terms.is_cubic_damping(k) ? terms.regressor(k, {.velocity = 1.0}) : 0.0});
  return out;
}

double sensitivity_at(const JointTerms& terms, const Sensitivity& s, const JointState& state, double sigma) {
  if (s.cube != 0.0) return s.cube * 3.0 * sigma * (state.velocity * state.velocity - sigma * sigma);
  return slope(terms, s.k, state, s.input, sigma);
}

}  // namespace

Eigen::MatrixXd noise_gram(const JointRows& rows, const JointTerms& terms, const double* omega,
                           std::size_t begin, std::size_t end) {
  const auto n = static_cast<Eigen::Index>(terms.linear().size());
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(n, n);
  const std::vector<Sensitivity> all = sensitivities(terms);
  const bool filtered = !rows.filtered.empty();
  std::vector<double> d(all.size());
  for (const RunRows& run : rows.runs) {
    const std::size_t first = std::max(begin, run.begin), last = std::min(end, run.end);
    if (first >= last) continue;
    const double* sigma = filtered ? run.noise.filtered : run.noise.raw;
    double weight = 0;
    bool varying = false;
    for (std::size_t i = first; i < last; ++i) weight += omega != nullptr ? omega[i] : 1.0;
    for (std::size_t a = 0; a < all.size(); ++a) {
      if (all[a].constant) d[a] = sensitivity_at(terms, all[a], {}, sigma[static_cast<int>(all[a].input)]);
      varying = varying || !all[a].constant;
    }
    for (std::size_t a = 0; a < all.size(); ++a)
      for (std::size_t b = 0; b < all.size(); ++b)
        if (all[a].constant && all[b].constant && all[a].input == all[b].input)
          out(static_cast<Eigen::Index>(all[a].k), static_cast<Eigen::Index>(all[b].k)) +=
              weight * d[a] * d[b];
    if (!varying) continue;
    // Cubic damping needs moments of the speed only: Var(v̂³ − 3σ²v̂) has the unbiased estimate 9σ²v̂⁴ − 36σ⁴v̂² + 15σ⁶,
    // its covariance with v̂ 3σ²(v̂² − σ²).
    const double s2 = sigma[static_cast<int>(Input::kVelocity)] * sigma[static_cast<int>(Input::kVelocity)];
    const double* v = rows.input[static_cast<int>(Input::kVelocity)].data();
    double m2 = 0, m4 = 0;
    for (std::size_t i = first; i < last; ++i) {
      const double w = omega != nullptr ? omega[i] : 1.0, v2 = v[i] * v[i];
      m2 += w * v2;
      m4 += w * v2 * v2;
    }
    bool others = false;
    for (std::size_t a = 0; a < all.size(); ++a) {
      others = others || (!all[a].constant && all[a].cube == 0.0);
      if (all[a].cube == 0.0) continue;
      const auto ka = static_cast<Eigen::Index>(all[a].k);
      out(ka, ka) +=
          all[a].cube * all[a].cube * (9.0 * s2 * m4 - 36.0 * s2 * s2 * m2 + 15.0 * s2 * s2 * s2 * weight);
      for (std::size_t b = 0; b < all.size(); ++b) {
        if (!all[b].constant || all[b].input != Input::kVelocity || s2 == 0.0) continue;
        const auto kb = static_cast<Eigen::Index>(all[b].k);
        const double cross = all[a].cube * 3.0 * std::sqrt(s2) * d[b] * (m2 - s2 * weight);
        out(ka, kb) += cross;
        out(kb, ka) += cross;
      }
    }
    if (!others) continue;
    for (std::size_t i = first; i < last; ++i) {
      const double w = omega != nullptr ? omega[i] : 1.0;
      const JointState state = rows.state(i);
      for (std::size_t a = 0; a < all.size(); ++a)
        if (!all[a].constant)
          d[a] = sensitivity_at(terms, all[a], state, sigma[static_cast<int>(all[a].input)]);
      const auto general = [&](const Sensitivity& s) { return !s.constant && s.cube == 0.0; };
      for (std::size_t a = 0; a < all.size(); ++a)
        for (std::size_t b = 0; b < all.size(); ++b)
          if (all[a].input == all[b].input && (general(all[a]) || general(all[b])))
            out(static_cast<Eigen::Index>(all[a].k), static_cast<Eigen::Index>(all[b].k)) += w * d[a] * d[b];
    }
  }
  return out;
}

std::vector<double> prediction_variance(const JointRows& rows, const JointTerms& terms,
                                        const Eigen::VectorXd& theta) {
  std::vector<double> out(rows.size(), 0.0);
  const bool filtered = !rows.filtered.empty();
  std::vector<Sensitivity> all = sensitivities(terms);
  for (const RunRows& run : rows.runs) {
    const double* sigma = filtered ? run.noise.filtered : run.noise.raw;
    double base[kInputs] = {};
    for (const Sensitivity& s : all)
      if (s.constant)
        base[static_cast<int>(s.input)] += theta[static_cast<Eigen::Index>(s.k)] *
                                           sensitivity_at(terms, s, {}, sigma[static_cast<int>(s.input)]);
    for (std::size_t i = run.begin; i < run.end; ++i) {
      double part[kInputs];
      std::copy(std::begin(base), std::end(base), std::begin(part));
      const JointState state = rows.state(i);
      for (const Sensitivity& s : all)
        if (!s.constant)
          part[static_cast<int>(s.input)] +=
              theta[static_cast<Eigen::Index>(s.k)] *
              sensitivity_at(terms, s, state, sigma[static_cast<int>(s.input)]);
      for (const double p : part) out[i] += p * p;
    }
  }
  return out;
}

std::vector<double> angle_slope(const JointRows& rows, const JointTerms& terms, const Eigen::VectorXd& theta,
                                double half_step) {
  double constant = 0;
  std::vector<std::size_t> varying;
  for (std::size_t k = 0; k < terms.linear().size(); ++k) {
    if (!terms.reads(k, Input::kAngle)) continue;
    if (constant_slope(terms, k, Input::kAngle))
      constant +=
          theta[static_cast<Eigen::Index>(k)] * slope(terms, k, {}, Input::kAngle, half_step) / half_step;
    else
      varying.push_back(k);
  }
  std::vector<double> out(rows.size(), constant);
  const std::size_t linear = terms.linear().size();
  const bool bent = !terms.nonlinear().empty() && terms.reads(Input::kAngle);
  if (varying.empty() && !bent) return out;
  for (std::size_t i = 0; i < out.size(); ++i) {
    const JointState state = rows.state(i);
    for (const std::size_t k : varying)
      out[i] +=
          theta[static_cast<Eigen::Index>(k)] * slope(terms, k, state, Input::kAngle, half_step) / half_step;
    if (!bent) continue;
    JointState up = state, down = state;
    up.angle += half_step;
    down.angle -= half_step;
    out[i] += (terms.nonlinear_value(up, theta.data() + linear, nullptr) -
               terms.nonlinear_value(down, theta.data() + linear, nullptr)) /
              (2.0 * half_step);
  }
  return out;
}

std::vector<double> predict(const JointRows& rows, const JointTerms& terms, const Eigen::VectorXd& theta) {
  std::vector<double> out(rows.size(), 0.0);
  const std::size_t linear = terms.linear().size();
  for (std::size_t k = 0; k < linear; ++k)
    for (std::size_t i = 0; i < out.size(); ++i)
      out[i] += theta[static_cast<Eigen::Index>(k)] * rows.plain[k][i];
  if (!terms.nonlinear().empty())
    for (std::size_t i = 0; i < out.size(); ++i)
      out[i] += terms.nonlinear_value(rows.state(i), theta.data() + linear, nullptr);
  return out;
}

}  // namespace isac::estimate
