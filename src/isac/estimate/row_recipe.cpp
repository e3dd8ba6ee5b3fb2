#include "isac/estimate/row_recipe.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "isac/series/differentiate.hpp"
#include "isac/series/statistics.hpp"

namespace isac::estimate {

StatedRecipe choose_recipe(std::span<const JointRun> runs, const JointTerms& terms,
                           const JointFitOptions& options) {
  StatedRecipe out;
  RowRecipe& recipe = out.recipe;
  recipe.order = options.differentiator.order;
  recipe.window = options.differentiator.window;
  const bool careful = options.errors_in_variables;
  recipe.parallel_filter = careful && options.parallel_filter && terms.nonlinear().empty();
  recipe.clean_spikes = options.loss.kind != Loss::Kind::kSquared;
  recipe.unbiased_cube = careful;

  recipe.output_lag = options.output_lag;
  std::vector<double> angle_noise, pressure_noise;
  double seen_step = 0;
  int narrowest = 0;
  double interval = std::nan("");
  for (const JointRun& run : runs) {
    if (run.time.size() < 8) continue;
    interval = series::median_interval(run.time);
    const bool asks_step = careful && run.velocity.empty() && !std::isfinite(options.noise.angle_step);
    if (recipe.window == 0 || asks_step || (careful && !std::isfinite(options.noise.angle))) {
      const bool measured = !run.velocity.empty();
      const series::WindowChoice choice =
          series::choose_window(run.time, measured ? run.velocity : run.angle, recipe.order,
                                measured ? std::nan("") : options.noise.angle);
      if (narrowest == 0 || choice.polynomial.window < narrowest) narrowest = choice.polynomial.window;
      if (!measured) angle_noise.push_back(choice.noise);
      if (!measured) seen_step = std::max(seen_step, choice.step);
    }
    if (careful && !run.delta_pressure.empty() && terms.reads(Input::kDeltaPressure) &&
        !std::isfinite(options.noise.delta_pressure))
      pressure_noise.push_back(series::sample_noise(run.time, run.delta_pressure, recipe.order));
  }
  if (recipe.window == 0) recipe.window = std::max(narrowest, 5);
  if (careful) {
    const auto chosen = [](double given, const std::vector<double>& seen) {
      if (std::isfinite(given)) return given;
      const double middle = series::median(seen);
      return std::isfinite(middle) ? middle : 0.0;
    };
    recipe.angle_noise = chosen(options.noise.angle, angle_noise);
    recipe.angle_step = std::isfinite(options.noise.angle_step) ? options.noise.angle_step : seen_step;
    recipe.delta_pressure_noise = chosen(options.noise.delta_pressure, pressure_noise);
  }
  const series::NoiseGain gain =
      series::noise_gain({.window = recipe.window, .order = recipe.order}, interval);
  out.words = fmt::format(
      "local polynomial (Savitzky-Golay) of order {} over {} samples ({:.3g} s) on the actual time stamps, "
      "no extrapolation",
      recipe.order, recipe.window, (recipe.window - 1) * interval);
  if (recipe.angle_noise > 0)
    out.words += fmt::format("; noise {:.2g} {} per sample gives {:.2g} {}/s", recipe.angle_noise,
                             options.position_unit, recipe.angle_noise * gain.first, options.position_unit);
  if (recipe.parallel_filter) out.words += "; output and regressors pass the same low-pass";
  return out;
}

}  // namespace isac::estimate
