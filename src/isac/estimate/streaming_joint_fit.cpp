#include "isac/estimate/streaming_joint_fit.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "isac/core/error.hpp"
#include "isac/estimate/block_covariance.hpp"
#include "isac/estimate/joint_core.hpp"
#include "isac/estimate/joint_verdict.hpp"
#include "isac/estimate/linear_algebra.hpp"
#include "isac/estimate/robust.hpp"
#include "isac/estimate/row_recipe.hpp"

namespace isac::estimate {
namespace {

constexpr std::size_t kMostBlocks = 4096;
constexpr std::size_t kSample = 20000;

void append(std::vector<double>& to, const std::vector<double>& from, std::size_t begin) {
  if (begin < from.size()) to.insert(to.end(), from.begin() + static_cast<std::ptrdiff_t>(begin), from.end());
}

void append(JointRun& to, const JointRun& from, std::size_t begin = 0) {
  append(to.time, from.time, begin);
  append(to.angle, from.angle, begin);
  append(to.velocity, from.velocity, begin);
  append(to.delta_pressure, from.delta_pressure, begin);
  append(to.mean_pressure, from.mean_pressure, begin);
  append(to.output, from.output, begin);
}

struct OpenBlock {
  BlockSums sums;
  Eigen::MatrixXd gram;
  std::size_t rows = 0;
  std::size_t run = 0;
  void add(const OpenBlock& other) {
    sums.score += other.sums.score;
    sums.curvature += other.sums.curvature;
    gram += other.gram;
    rows += other.rows;
  }
};

struct AngleRange {
  double low = std::numeric_limits<double>::infinity(), high = -std::numeric_limits<double>::infinity();
};

/// The sums of the angle's zero stand last; those of a resting run's own zero are the same sums over its blocks.
Eigen::VectorXd with_own(const Eigen::VectorXd& sums, Eigen::Index runs, Eigen::Index own) {
  Eigen::VectorXd out = Eigen::VectorXd::Zero(sums.size() + runs);
  out.head(sums.size()) = sums;
  if (own >= 0) out[sums.size() + own] = sums[sums.size() - 1];
  return out;
}

Eigen::MatrixXd with_own(const Eigen::MatrixXd& sums, Eigen::Index runs, Eigen::Index own) {
  const Eigen::Index n = sums.rows();
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(n + runs, n + runs);
  out.topLeftCorner(n, n) = sums;
  if (own < 0) return out;
  out.row(n + own).head(n) = sums.row(n - 1);
  out.col(n + own).head(n) = sums.col(n - 1);
  out(n + own, n + own) = sums(n - 1, n - 1);
  return out;
}

}  // namespace

struct StreamingJointFit::State {
  JointFitOptions options;
  JointTerms terms;
  std::size_t pilot_rows;

  std::vector<JointRun> waiting;  ///< rows kept until the pilot can be made
  std::size_t waiting_rows = 0;
  bool ready = false;

  StatedRecipe stated;
  JointCore pilot;
  Eigen::VectorXd start;  ///< θ₀ of the kept columns, and of the angle's zero behind them
  bool zero = false;
  Loss loss;
  double pilot_interval = 0;
  double base = 0;  ///< variance of the output's own noise, for the weights
  std::size_t block_rows = 1;

  JointRun carry;  ///< the last rows of the run, which the next block's window needs
  std::vector<OpenBlock> blocks;
  std::vector<AngleRange> ranges;  ///< of the runs
  bool open = false;
  Eigen::MatrixXd plain_gram;
  Eigen::VectorXd plain_moment;
  double plain_square = 0;
  std::size_t rows = 0, outliers = 0, seen = 0;
  JointRows sample;
  std::size_t stride = 1, counter = 0;

  State(const JointFitOptions& o, std::size_t n) : options(o), terms(o), pilot_rows(n) {
    if (!terms.nonlinear().empty())
      throw Error(ErrorKind::kUsage, "terms_not_linear",
                  "a fit in one pass needs terms that are linear in their parameters; leave out " +
                      terms.nonlinear().front().name + " or fit in memory");
  }

  void make_pilot() {
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

  void take_waiting() {
    std::vector<JointRun> held;
    held.swap(waiting);
    for (const JointRun& run : held) consume(run);
  }

  void clear_sample() {
    sample = JointRows{};
    sample.plain.resize(terms.linear().size());
  }

  /// Rows that a block's edge takes away on each side.
  std::size_t halo() const {
    const auto half = static_cast<std::size_t>(stated.recipe.window / 2);
    return stated.recipe.parallel_filter ? 2 * half : half;
  }

  /// The same at the end, where a late output takes away rows too.
  std::size_t tail() const {
    if (!(stated.recipe.output_lag > 0)) return halo();
    const auto late = static_cast<std::size_t>(std::ceil(stated.recipe.output_lag / pilot_interval)) + 1;
    const auto half = static_cast<std::size_t>(stated.recipe.window / 2);
    return std::max(halo(), stated.recipe.parallel_filter ? half + late : late);
  }

  void consume(const JointRun& block) {
    if (carry.name != block.name) {
      carry = JointRun{};
      carry.name = block.name;
      open = false;
      ranges.emplace_back();
    }
    append(carry, block);
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
    append(rest, carry, carry.time.size() - keep);
    carry = std::move(rest);
  }

  void add_rows(const JointRows& fresh) {
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
            excess(a, b) = all(pilot.rank.kept[static_cast<std::size_t>(a)],
                               pilot.rank.kept[static_cast<std::size_t>(b)]);
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

  void begin_block() {
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

  /// Every stride-th row, for ranges and quantiles.
  void keep_sample(const JointRows& fresh) {
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
};

StreamingJointFit::StreamingJointFit(const JointFitOptions& options, std::size_t pilot_rows)
    : state_(std::make_unique<State>(options, pilot_rows)) {}
StreamingJointFit::~StreamingJointFit() = default;
StreamingJointFit::StreamingJointFit(StreamingJointFit&&) noexcept = default;
StreamingJointFit& StreamingJointFit::operator=(StreamingJointFit&&) noexcept = default;

void StreamingJointFit::learn(std::vector<JointRun> runs) {
  state_->waiting = std::move(runs);
  state_->make_pilot();
  state_->waiting.clear();
}

bool StreamingJointFit::knows_all_terms() const {
  return state_->pilot.rank.kept.size() == state_->terms.linear().size();
}

void StreamingJointFit::add(const JointRun& block) {
  State& s = *state_;
  if (s.ready) {
    s.consume(block);
    return;
  }
  if (s.waiting.empty() || s.waiting.back().name != block.name) {
    s.waiting.push_back({});
    s.waiting.back().name = block.name;
  }
  append(s.waiting.back(), block);
  s.waiting_rows += block.time.size();
  if (s.waiting_rows < s.pilot_rows) return;
  s.make_pilot();
  s.take_waiting();
}

StreamingJointFit StreamingJointFit::fork() const {
  StreamingJointFit out(state_->options, state_->pilot_rows);
  State& to = *out.state_;
  const State& from = *state_;
  to.stated = from.stated;
  to.pilot = from.pilot;
  to.start = from.start;
  to.zero = from.zero;
  to.pilot_interval = from.pilot_interval;
  to.loss = from.loss;
  to.base = from.base;
  to.block_rows = from.block_rows;
  to.plain_gram = Eigen::MatrixXd::Zero(from.plain_gram.rows(), from.plain_gram.cols());
  to.plain_moment = Eigen::VectorXd::Zero(from.plain_moment.size());
  to.clear_sample();
  to.ready = from.ready;
  return out;
}

void StreamingJointFit::merge(StreamingJointFit& other) {
  State& s = *state_;
  State& o = *other.state_;
  s.open = false;
  for (OpenBlock& block : o.blocks) block.run += s.ranges.size();
  s.blocks.insert(s.blocks.end(), o.blocks.begin(), o.blocks.end());
  s.ranges.insert(s.ranges.end(), o.ranges.begin(), o.ranges.end());
  s.plain_gram += o.plain_gram;
  s.plain_moment += o.plain_moment;
  s.plain_square += o.plain_square;
  s.rows += o.rows;
  s.outliers += o.outliers;
  s.seen += o.seen;
  s.keep_sample(o.sample);
}

JointFit StreamingJointFit::finish() {
  State& s = *state_;
  if (!s.ready) {
    s.make_pilot();
    s.take_waiting();
  }
  std::vector<Eigen::Index> own(s.ranges.size(), -1);  // the zero of a resting run of its own
  Eigen::Index resting = 0;
  if (s.zero)
    for (std::size_t r = 0; r < own.size(); ++r)
      if (rests(s.ranges[r].low, s.ranges[r].high, s.stated.recipe.angle_step)) own[r] = resting++;
  if (s.zero) {
    s.pilot.zero.resting.assign(static_cast<std::size_t>(resting), {});
    for (OpenBlock& block : s.blocks) {
      block.sums.score = with_own(block.sums.score, resting, own[block.run]);
      block.sums.curvature = with_own(block.sums.curvature, resting, own[block.run]);
      block.gram = with_own(block.gram, resting, own[block.run]);
    }
    s.start.conservativeResizeLike(Eigen::VectorXd::Zero(s.start.size() + resting));
  }
  const Eigen::Index n = s.start.size(), known = static_cast<Eigen::Index>(s.pilot.rank.kept.size());
  Prior prior = prior_of(s.pilot.zero, s.pilot.rank.kept.size(), static_cast<int>(n), s.pilot.spread);
  Eigen::MatrixXd bread = Eigen::MatrixXd::Zero(n, n), gram = bread;
  Eigen::VectorXd score = -prior.curvature.cwiseProduct(s.start);
  bread.diagonal() += prior.curvature;
  gram.diagonal() += prior.curvature;
  for (const OpenBlock& block : s.blocks) {
    bread += block.sums.curvature;
    gram += block.gram;
    score += block.sums.score;
  }
  const Eigen::VectorXd scale = gram.diagonal().cwiseSqrt().cwiseMax(1e-300).cwiseInverse();
  const Eigen::MatrixXd unit = scale.asDiagonal() * bread * scale.asDiagonal();
  const Eigen::VectorXd step = scale.cwiseProduct(solve_symmetric(unit, scale.cwiseProduct(score)));
  std::vector<BlockSums> sums;
  for (const OpenBlock& block : s.blocks)
    sums.push_back({scale.cwiseProduct(block.sums.score - block.sums.curvature * step),
                    scale.asDiagonal() * block.sums.curvature * scale.asDiagonal()});
  prior.curvature = prior.curvature.cwiseProduct(scale).cwiseProduct(scale);
  prior.score_variance = prior.score_variance.cwiseProduct(scale).cwiseProduct(scale);
  const BlockCovariance covariance = block_covariance(sums, prior);
  const Eigen::VectorXd inflation = n > 0 ? variance_inflation(gram) : Eigen::VectorXd();

  JointCore core = s.pilot;
  core.converged = true;
  for (Eigen::Index i = 0; i < known; ++i) {
    const int a = s.pilot.rank.kept[static_cast<std::size_t>(i)];
    core.theta[a] = s.start[i] + step[i];
    core.degrees_of_freedom[a] = covariance.degrees_of_freedom[i];
    core.inflation[a] = inflation[i];
    for (Eigen::Index j = 0; j < known; ++j)
      core.covariance(a, s.pilot.rank.kept[static_cast<std::size_t>(j)]) =
          covariance.covariance(i, j) * scale[i] * scale[j];
  }
  if (s.zero) {
    core.zero.value = s.start[known] + step[known];
    core.zero.std_error = std::sqrt(covariance.covariance(known, known)) * scale[known];
  }
  core.outliers = s.outliers;
  core.blocks.assign(s.blocks.size(), {});
  core.block_seconds =
      static_cast<double>(s.block_rows) * (s.sample.runs.empty() ? 0.0 : s.sample.runs.front().interval);

  JointFit fit;
  fit.converged = true;
  fit.solver_summary = "one pass: a Newton step from the pilot (" + s.pilot.report + ")";
  fit.differentiator = s.stated.words;
  fit.samples = s.rows;
  fit.outliers = s.outliers;
  fit.blocks = s.blocks.size();
  fit.block_seconds = core.block_seconds;
  fit.box = validity_box(s.sample);
  std::vector<int> order;
  fit.parameters = judge_parameters(s.sample, s.terms, core, s.options, order);
  fit.correlation.assign(order.size() * order.size(), std::nan(""));
  for (std::size_t i = 0; i < order.size(); ++i)
    for (std::size_t j = 0; j < order.size(); ++j)
      if (fit.parameters[i].identifiable && fit.parameters[j].identifiable)
        fit.correlation[i * order.size() + j] =
            core.covariance(order[i], order[j]) /
            std::sqrt(core.covariance(order[i], order[i]) * core.covariance(order[j], order[j]));
  fit.angle_zero = angle_zero(core.zero, s.options);
  if (fit.angle_zero.used) fit.tests.push_back(zero_test(fit.angle_zero, core.zero, s.options));
  const Eigen::VectorXd moved = step.head(known);
  const double square = s.plain_square - 2.0 * moved.dot(s.plain_moment) + moved.dot(s.plain_gram * moved);
  fit.rmse = s.rows > 0 ? std::sqrt(std::max(0.0, square) / static_cast<double>(s.rows)) : std::nan("");
  s.sample.seen = s.sample.size();
  add_warnings(s.sample, s.terms, core, s.options, fit);
  return fit;
}

}  // namespace isac::estimate
