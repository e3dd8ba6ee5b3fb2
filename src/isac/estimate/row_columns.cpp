#include "isac/estimate/row_columns.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "isac/series/statistics.hpp"

namespace isac::estimate {
namespace {

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

}  // namespace

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

}  // namespace isac::estimate
