#include "bench.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <map>
#include <thread>

#include "explain/inputs.hpp"
#include "isac/explain/screen.hpp"
#include "isac/record/csv_reader.hpp"

namespace baselines {
namespace {

using namespace isac::explain;
namespace fs = std::filesystem;

constexpr double kBlockSeconds = 10;
constexpr double kMimicked = 1e-5;  // of a column's energy: the base model does it as well

/// Weights: every chain by the deviation of what the base model leaves of it.
void weigh(Bench& b) {
  for (int c : {0, 3}) b.weights.sigma[c] = 0.01;
  for (int c : {1, 2}) b.weights.sigma[c] = 150;
  b.base = fit_baseline(*b.predictor, b.library.tolerances, b.weights);
  double squares[kChains] = {}, rows[kChains] = {};
  for (std::size_t i = 0; i < b.data.rows.size(); ++i) {
    const auto c = static_cast<std::size_t>(b.data.rows[i].chain);
    squares[c] +=
        b.base.residual[static_cast<Eigen::Index>(i)] * b.base.residual[static_cast<Eigen::Index>(i)];
    rows[c] += 1;
  }
  for (int c = 0; c < kChains; ++c)
    if (rows[c] > 0 && squares[c] > 0) b.weights.sigma[c] *= std::sqrt(squares[c] / rows[c]);
  b.base = fit_baseline(*b.predictor, b.library.tolerances, b.weights);
}

void fill_columns(Bench& b) {
  struct Task {
    ColumnOf column;
    Eigen::VectorXf rows;
  };
  // What a tolerance of the base model takes up within its bounds is no finding, for them as for isac-explain.
  const auto taken_up = [&](const Hypothesis& h) {
    for (std::size_t i = 0; i < b.base.tolerances; ++i) {
      const Active& a = b.base.model.effects[i];
      if (a.hypothesis->effect == h.effect && a.values[0] > a.hypothesis->lower[0] &&
          a.values[0] < a.hypothesis->upper[0])
        return true;
    }
    return false;
  };
  std::vector<Task> tasks;
  for (std::size_t h = 0; h < b.library.hypotheses.size(); ++h) {
    const Hypothesis& hypothesis = b.library.hypotheses[h];
    if (taken_up(hypothesis)) continue;
    for (std::size_t s = 0; s < hypothesis.shapes.size(); ++s)
      for (int k = 0; k < hypothesis.info().parameter_count; ++k)
        if (hypothesis.amplitude[static_cast<std::size_t>(k)])
          tasks.push_back({{static_cast<int>(h), static_cast<int>(s), k, 1}, {}});
  }
  const double root = std::sqrt(static_cast<double>(b.predictor->rows()));
  std::atomic<std::size_t> next{0};
  const auto work = [&] {
    for (std::size_t t = next++; t < tasks.size(); t = next++) {
      ColumnOf& c = tasks[t].column;
      const Hypothesis& h = b.library.hypotheses[static_cast<std::size_t>(c.hypothesis)];
      const Values& shape = h.shapes[static_cast<std::size_t>(c.shape)];
      const auto k = static_cast<std::size_t>(c.amplitude);
      Active active{&h, null_values(h, shape)};
      active.values[k] = shape[k];
      Eigen::VectorXd x = response(*b.predictor, b.base, b.place.here, active, b.weights);
      if (!x.allFinite()) continue;
      const double whole = x.norm();
      x = b.place.project(x);
      if (x.squaredNorm() < kMimicked * whole * whole || !(whole > 0)) continue;
      const double unit = x.norm() / root;
      c.scale = (shape[k] - null_values(h, shape)[k]) / unit;
      tasks[t].rows = (x / unit).cast<float>();
    }
  };
  std::thread second(work);
  work();
  second.join();
  std::erase_if(tasks, [](const Task& t) { return t.rows.size() == 0; });
  b.x.resize(static_cast<Eigen::Index>(b.predictor->rows()), static_cast<Eigen::Index>(tasks.size()));
  std::map<std::string, std::pair<double, int>> best;
  for (std::size_t j = 0; j < tasks.size(); ++j) {
    b.columns.push_back(tasks[j].column);
    b.x.col(static_cast<Eigen::Index>(j)) = tasks[j].rows;
    const double alike = std::abs(tasks[j].rows.dot(b.target.cast<float>()));
    auto& [most, column] = best[b.of(static_cast<int>(j)).id()];
    if (alike <= most) continue;
    most = alike;
    column = static_cast<int>(j);
  }
  for (const auto& [id, found] : best) b.one_of_each.push_back(found.second);
}

}  // namespace

Active Bench::active(int column, double coefficient) const {
  const ColumnOf& c = columns[static_cast<std::size_t>(column)];
  const Hypothesis& h = of(column);
  const auto k = static_cast<std::size_t>(c.amplitude);
  Active out{&h, null_values(h, h.shapes[static_cast<std::size_t>(c.shape)])};
  out.values[k] = std::clamp(out.values[k] + coefficient * c.scale, h.lower[k], h.upper[k]);
  return out;
}

std::vector<Sums> Bench::sums(const std::vector<int>& use, const Eigen::VectorXd& y,
                              const std::vector<unsigned>& parts) const {
  const unsigned count = parts.empty() ? 0 : *std::max_element(parts.begin(), parts.end()) + 1;
  std::vector<std::vector<Eigen::Index>> rows(count);
  for (std::size_t i = 0; i < parts.size(); ++i) rows[parts[i]].push_back(static_cast<Eigen::Index>(i));
  std::vector<Sums> out;
  for (const auto& list : rows) {
    if (list.empty()) continue;
    const Eigen::MatrixXf part = x(list, use);
    const Eigen::VectorXf target_part = y(list).cast<float>();
    Sums s;
    s.gram = (part.transpose() * part).cast<double>();
    s.score = (part.transpose() * target_part).cast<double>();
    s.energy = static_cast<double>(target_part.squaredNorm());
    s.rows = static_cast<double>(list.size());
    out.push_back(std::move(s));
  }
  return out;
}

void open_bench(const std::string& folder, Bench& b) {
  isac::apps::ExplainWords words;
  words.dataset = {folder};
  const isac::apps::ExplainInputs in = isac::apps::read_inputs(words);
  b.data = prepare(in.runs, in.facts, in.baseline, 4.0);
  b.library = make_library(b.data);
  b.predictor.emplace(b.data);
  weigh(b);
  b.place = around(*b.predictor, b.base, b.weights);
  b.target = -b.place.residual;
  b.proof.emplace(in.heldout, b.data);
  std::vector<isac::series::Recording> held;
  if (fs::is_directory(fs::path(folder) / "heldout"))
    for (const auto& entry : fs::directory_iterator(fs::path(folder) / "heldout"))
      if (entry.path().extension() == ".csv")
        held.push_back(
            isac::record::read_recording(entry.path(), {.map = {}, .require_time = true, .hash = false}));
  if (!held.empty()) b.heldout = prepare(held, in.facts, in.baseline, 4.0, b.data.first_start);
  unsigned block = 0, last_run = ~0U;
  double until = 0;
  for (const Row& row : b.data.rows) {
    const double t = b.data.runs[row.run].time[row.sample];
    if (row.run != last_run || t >= until || t < until - kBlockSeconds) {
      if (!b.block.empty()) ++block;
      until = t + kBlockSeconds;
      last_run = row.run;
    }
    b.block.push_back(block);
    b.run.push_back(row.run);
  }
  fill_columns(b);
}

}  // namespace baselines
