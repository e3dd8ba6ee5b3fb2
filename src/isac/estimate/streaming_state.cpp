#include "isac/estimate/streaming_state.hpp"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "isac/core/error.hpp"

namespace isac::estimate {
namespace {

constexpr std::size_t kMostBlocks = 4096;
constexpr std::size_t kSample = 20000;

void append_from(std::vector<double>& to, const std::vector<double>& from, std::size_t begin) {
  if (begin < from.size()) to.insert(to.end(), from.begin() + static_cast<std::ptrdiff_t>(begin), from.end());
}

}  // namespace

void append_rows(JointRun& to, const JointRun& from, std::size_t begin) {
  append_from(to.time, from.time, begin);
  append_from(to.angle, from.angle, begin);
  append_from(to.velocity, from.velocity, begin);
  append_from(to.delta_pressure, from.delta_pressure, begin);
  append_from(to.mean_pressure, from.mean_pressure, begin);
  append_from(to.output, from.output, begin);
}

StreamingJointFit::State::State(const JointFitOptions& o, std::size_t n)
    : options(o), terms(o), pilot_rows(n) {
  if (!terms.nonlinear().empty())
    throw Error(ErrorKind::kUsage, "terms_not_linear",
                "a fit in one pass needs terms that are linear in their parameters; leave out " +
                    terms.nonlinear().front().name + " or fit in memory");
}

void StreamingJointFit::State::make_pilot() {
  stated = choose_recipe(waiting, terms, options);
  const JointRows first = make_rows(waiting, terms, stated.recipe);
  if (first.size() < 4 * terms.linear().size() + 4)
    throw Error(ErrorKind::kAnswerIsNo, "no_usable_data",
                "the first rows cannot be used: time, angle and output must be there together over more "
                "than a window; mend the missing samples or add more rows");
  pilot = estimate_joint(first, terms, options, stated.recipe);
  const auto size = static_cast<Eigen::Index>(pilot.rank.kept.size());
  zero = pilot.zero.slope != 0;
  start.resize(size + (zero ? 1 : 0));
  for (Eigen::Index j = 0; j < size; ++j)
    start[j] = pilot.theta[pilot.rank.kept[static_cast<std::size_t>(j)]];
  if (zero) start[size] = pilot.zero.value;
  loss = options.loss;
  if (!std::isfinite(loss.scale))
    loss.scale = pilot.spread * (loss.kind == Loss::Kind::kCauchy ? 2.385 : 1.345);
  double interval = 0;
  for (const RunRows& run : first.runs) interval = std::max(interval, run.interval);
  pilot_interval = interval;
  block_rows =
      std::max<std::size_t>(1, static_cast<std::size_t>(std::llround(pilot.block_seconds / interval)));
  base = pilot.spread * pilot.spread;
  plain_gram = Eigen::MatrixXd::Zero(size, size);
  plain_moment = Eigen::VectorXd::Zero(size);
  pilot.residual = pilot.omega = {};
  clear_sample();
  ready = true;
}

void StreamingJointFit::State::take_waiting() {
  std::vector<JointRun> held;
  held.swap(waiting);
  for (const JointRun& run : held) consume(run);
}

void StreamingJointFit::State::clear_sample() {
  sample = JointRows{};
  sample.plain.resize(terms.linear().size());
}

std::size_t StreamingJointFit::State::halo() const {
  const auto half = static_cast<std::size_t>(stated.recipe.window / 2);
  return stated.recipe.parallel_filter ? 2 * half : half;
}

std::size_t StreamingJointFit::State::tail() const {
  if (!(stated.recipe.output_lag > 0)) return halo();
  const auto late = static_cast<std::size_t>(std::ceil(stated.recipe.output_lag / pilot_interval)) + 1;
  const auto half = static_cast<std::size_t>(stated.recipe.window / 2);
  return std::max(halo(), stated.recipe.parallel_filter ? half + late : late);
}

void StreamingJointFit::State::consume(const JointRun& block) {
  if (carry.name != block.name) {
    carry = JointRun{};
    carry.name = block.name;
    open = false;
    ranges.emplace_back();
  }
  append_rows(carry, block);
  for (const double angle : block.angle) {
    if (!std::isfinite(angle)) continue;
    ranges.back().low = std::min(ranges.back().low, angle);
    ranges.back().high = std::max(ranges.back().high, angle);
  }
  seen += block.time.size();
  const std::size_t keep = halo() + tail();
  if (carry.time.size() <= keep) return;
  add_rows(make_rows(std::span<const JointRun>(&carry, 1), terms, stated.recipe));
  JointRun rest;
  rest.name = carry.name;
  append_rows(rest, carry, carry.time.size() - keep);
  carry = std::move(rest);
}

void StreamingJointFit::State::add_rows(const JointRows& fresh) {
  if (fresh.size() == 0) return;
  RobustProblem problem, plain;
  problem.rows = plain.rows = fresh.size();
  for (const int k : pilot.rank.kept) {
    problem.columns.push_back(fresh.x(static_cast<std::size_t>(k)).data());
    plain.columns.push_back(fresh.plain[static_cast<std::size_t>(k)].data());
  }
  std::vector<double> by_angle;
  if (zero) {
    by_angle = angle_slope(fresh, terms, pilot.theta, pilot.zero.half_step);
    problem.columns.push_back(by_angle.data());
  }
  problem.output = fresh.y().data();
  plain.output = fresh.output.data();
  problem.kind = loss.kind;
  problem.scale = loss.scale;
  std::vector<double> weights;
  if (options.errors_in_variables && options.effective_variance && base > 0) {
    weights = prediction_variance(fresh, terms, pilot.theta);
    const double largest = *std::max_element(weights.begin(), weights.end());
    for (double& w : weights) w = base / (base + w);
    if (largest > 1e-3 * base) problem.weight = weights.data();
  }
  std::vector<double> residual;
  problem.residuals(start, residual);
  std::vector<double> omega(residual.size());
  for (std::size_t i = 0; i < omega.size(); ++i) {
    const double w = problem.weight != nullptr ? problem.weight[i] : 1.0,
                 r = std::sqrt(w) * std::abs(residual[i]);
    double slope = 1.0;
    if (loss.kind == Loss::Kind::kHuber && r > loss.scale) slope = loss.scale / r;
    if (loss.kind == Loss::Kind::kCauchy) slope = 1.0 / (1.0 + r * r / (loss.scale * loss.scale));
    outliers += slope < 0.5;
    omega[i] = w * slope;
  }
  for (std::size_t i = 0; i < fresh.size();) {
    if (!open || blocks.back().rows >= block_rows) begin_block();
    OpenBlock& block = blocks.back();
    const std::size_t end = std::min(fresh.size(), i + block_rows - block.rows);
    const Pass pass = problem.pass(start, i, end, true, true);
    block.sums.score += pass.moment;
    block.sums.curvature += pass.curvature;
    block.gram += pass.gram;
    if (options.errors_in_variables) {
      const Eigen::MatrixXd all = noise_gram(fresh, terms, omega.data(), i, end);
      const auto kept = static_cast<Eigen::Index>(pilot.rank.kept.size());
      Eigen::MatrixXd excess = Eigen::MatrixXd::Zero(start.size(), start.size());
      for (Eigen::Index a = 0; a < kept; ++a)
        for (Eigen::Index b = 0; b < kept; ++b)
          excess(a, b) =
              all(pilot.rank.kept[static_cast<std::size_t>(a)], pilot.rank.kept[static_cast<std::size_t>(b)]);
      block.sums.score += excess * start;
      block.sums.curvature -= excess;
    }
    block.rows += end - i;
    i = end;
  }
  const Pass pass = plain.pass(start.head(plain_moment.size()), 0, plain.rows, true, false);
  plain_gram += pass.gram;
  plain_moment += pass.moment;
  plain_square += pass.cost;
  rows += fresh.size();
  keep_sample(fresh);
}

void StreamingJointFit::State::begin_block() {
  if (blocks.size() >= kMostBlocks) {  // twice as long blocks, half as many
    std::size_t kept = 0;
    for (std::size_t b = 0; b < blocks.size(); ++kept) {
      blocks[kept] = std::move(blocks[b++]);
      if (b < blocks.size() && blocks[b].run == blocks[kept].run) blocks[kept].add(blocks[b++]);
    }
    blocks.resize(kept);
    block_rows *= 2;
  }
  const Eigen::Index n = start.size();
  blocks.push_back({{Eigen::VectorXd::Zero(n), Eigen::MatrixXd::Zero(n, n)},
                    Eigen::MatrixXd::Zero(n, n),
                    0,
                    ranges.size() - 1});
  open = true;
}

void StreamingJointFit::State::keep_sample(const JointRows& fresh) {
  for (std::size_t i = 0; i < fresh.size(); ++i) {
    if (counter++ % stride != 0) continue;
    sample.time.push_back(fresh.time[i]);
    for (int z = 0; z < kInputs; ++z) sample.input[z].push_back(fresh.input[z][i]);
    sample.output.push_back(fresh.output[i]);
    for (std::size_t k = 0; k < sample.plain.size(); ++k) sample.plain[k].push_back(fresh.plain[k][i]);
  }
  if (sample.runs.empty()) sample.runs = fresh.runs;
  sample.runs.front().begin = 0;
  sample.runs.front().end = sample.size();
  if (sample.size() < 2 * kSample) return;
  const auto thin = [](std::vector<double>& column) {
    for (std::size_t i = 0; 2 * i < column.size(); ++i) column[i] = column[2 * i];
    column.resize((column.size() + 1) / 2);
  };
  thin(sample.time);
  for (auto& column : sample.input) thin(column);
  thin(sample.output);
  for (auto& column : sample.plain) thin(column);
  sample.runs.front().end = sample.size();
  stride *= 2;
}

}  // namespace isac::estimate
