#include "isac/estimate/joint_rows.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "isac/estimate/row_columns.hpp"
#include "isac/estimate/row_spikes.hpp"
#include "isac/series/differentiate.hpp"

namespace isac::estimate {
namespace {

using series::Segment;

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

void append_part(std::vector<double>& to, std::span<const double> from, const Segment& part) {
  if (from.empty())
    to.insert(to.end(), part.end - part.begin, 0.0);
  else
    to.insert(to.end(), from.begin() + static_cast<std::ptrdiff_t>(part.begin),
              from.begin() + static_cast<std::ptrdiff_t>(part.end));
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
      if (clean) out.cleaned += remove_output_spikes(columns, pilot, cleaned);
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
      for (int z = 0; z < kInputs; ++z) append_part(out.input[z], columns.input[z], part);
      append_part(out.output, columns.y, part);
      for (std::size_t k = 0; k < terms_count; ++k) {
        if (!columns.x[k].empty()) {
          append_part(out.plain[k], columns.x[k], part);
        } else {
          out.plain[k].resize(out.time.size());
          fill_regressor(columns, terms, recipe, k, part.begin, part.end,
                         out.plain[k].data() + out.time.size() - (part.end - part.begin));
        }
        if (recipe.parallel_filter) append_part(out.filtered[k], filtered[k], part);
      }
      if (recipe.parallel_filter) append_part(out.filtered_output, filtered_output, part);
    }
    span.end = out.size();
    out.runs.push_back(std::move(span));
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
