#include "methods.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>

#include "isac/core/units.hpp"
#include "isac/explain/labels.hpp"
#include "latent.hpp"
#include "network.hpp"

namespace baselines {
namespace {

using namespace isac::explain;

constexpr std::uint64_t kSeed = 11;
constexpr std::size_t kMostRefitted = 3;  // of the chosen effects, largest first, for the gap
constexpr int kMostTerms = 6;
constexpr double kStopBlock = 10;  // s, of which every fifth says when the training of a network ends

struct Choice {
  std::vector<Active> effects;  ///< of each chosen id the strongest column
  std::vector<double> confidence;
};

Choice choice_of(const Bench& b, const std::vector<int>& offered, const Terms& terms) {
  Choice out;
  for (std::size_t i = 0; i < terms.columns.size(); ++i) {
    const int column = offered[static_cast<std::size_t>(terms.columns[i])];
    const std::string id = b.of(column).id();
    if (std::any_of(out.effects.begin(), out.effects.end(),
                    [&](const Active& a) { return a.hypothesis->id() == id; }))
      continue;
    out.effects.push_back(b.active(column, terms.coefficients[i]));
    out.confidence.push_back(terms.probability[i]);
  }
  return out;
}

/// Squares of the weighted residual of one chain.
double squares(const Bench& b, const Eigen::VectorXd& residual, Chain chain) {
  double sum = 0;
  for (std::size_t i = 0; i < b.data.rows.size(); ++i)
    if (b.data.rows[i].chain == chain)
      sum += residual[static_cast<Eigen::Index>(i)] * residual[static_cast<Eigen::Index>(i)];
  return sum;
}

/// The chain in which the fitted rows gain most, and the gap there on held-out runs.
void tell_gap(const Bench& b, const Fit& after, Said& said) {
  Chain best = Chain::kTorque;
  double most = -1;
  for (const Chain chain : {Chain::kTorque, Chain::kPressure1, Chain::kPressure2, Chain::kMotion}) {
    if (!b.data.has(chain)) continue;
    const double gain = squares(b, b.base.residual, chain) - squares(b, after.residual, chain);
    if (gain <= most) continue;
    most = gain;
    best = chain;
  }
  const Label label = label_of(b.data, best);
  said.signal = label.signal;
  said.unit = label.unit;
  said.heldout_before = label.scale * b.proof->residual(b.base.model, best).rms();
  said.heldout_after = label.scale * b.proof->residual(after.model, best).rms();
}

Said told(const Bench& b, const Choice& choice) {
  Said said;
  for (std::size_t i = 0; i < choice.effects.size(); ++i) {
    said.ids.push_back(choice.effects[i].hypothesis->id());
    said.subsystems.emplace_back(subsystem_name(choice.effects[i].hypothesis->info().where));
    said.confidence.push_back(choice.confidence[i]);
  }
  std::vector<Active> refitted = choice.effects;
  if (refitted.size() > kMostRefitted) refitted.resize(kMostRefitted);
  tell_gap(b, refitted.empty() ? b.base : refit(*b.predictor, b.base, refitted, b.weights, 6), said);
  return said;
}

/// BIC over refits: one effect after another while the criterion falls. The ten that a linear fit likes best are refitted.
Choice by_bic(const Bench& b) {
  constexpr std::size_t kRefitted = 10;
  Choice out;
  Around place = b.place;
  Fit stem = b.base;
  const double n = static_cast<double>(b.predictor->rows());
  double bic = n * std::log(place.residual.squaredNorm() / n);
  for (std::size_t round = 0; round < kMostRefitted; ++round) {
    std::vector<std::pair<double, int>> order;
    for (const int column : b.one_of_each) {
      if (std::any_of(out.effects.begin(), out.effects.end(),
                      [&](const Active& a) { return a.hypothesis->id() == b.of(column).id(); }))
        continue;
      const Eigen::VectorXd x = place.project(b.x.col(column).cast<double>());
      const double score = x.dot(place.residual), norm2 = x.squaredNorm();
      if (norm2 > 1e-4 * n) order.emplace_back(-score * score / norm2, column);
    }
    std::sort(order.begin(), order.end());
    if (order.size() > kRefitted) order.resize(kRefitted);
    double best = bic;
    Active chosen;
    for (const auto& [gain, column] : order) {
      const Eigen::VectorXd x = place.project(b.x.col(column).cast<double>());
      const Active start = b.active(column, -x.dot(place.residual) / x.squaredNorm());
      const Refined refined = refine(place, *start.hypothesis, start.values, 6);
      double now = n * std::log(refined.loss / n) + start.hypothesis->parameters() * std::log(n);
      for (const Active& a : out.effects) now += a.hypothesis->parameters() * std::log(n);
      if (now >= best) continue;
      best = now;
      chosen = {start.hypothesis, refined.values};
    }
    if (chosen.hypothesis == nullptr) break;
    bic = best;
    out.effects.push_back(chosen);
    out.confidence.push_back(1);
    if (round + 1 == kMostRefitted) break;
    stem = refit(*b.predictor, stem, {chosen}, b.weights, 6);
    place = around(*b.predictor, stem, b.weights);
  }
  return out;
}

/// The residual of every run and chain, smoothed as a latent force.
Eigen::VectorXd smoothed(const Bench& b) {
  Eigen::VectorXd out = b.target;
  for (const Chain chain : {Chain::kTorque, Chain::kPressure1, Chain::kPressure2, Chain::kMotion}) {
    std::vector<Piece> pieces;
    std::vector<std::vector<Eigen::Index>> where;
    unsigned run = ~0U, sample = 0;
    for (std::size_t i = 0; i < b.data.rows.size(); ++i) {
      const Row& row = b.data.rows[i];
      if (row.chain != chain) continue;
      const auto& time = b.data.runs[row.run].time;
      // A gap begins a new piece: the smoother steps evenly.
      const unsigned stride = static_cast<unsigned>(b.data.stride) *
                              (chain == Chain::kPressure1 || chain == Chain::kPressure2 ? 2U : 1U);
      if (row.run != run || row.sample != sample + stride) {
        pieces.emplace_back();
        where.emplace_back();
        pieces.back().spacing = time.size() > 1 ? (time[1] - time[0]) * stride : 1;
      }
      run = row.run;
      sample = row.sample;
      pieces.back().y.push_back(b.target[static_cast<Eigen::Index>(i)]);
      where.back().push_back(static_cast<Eigen::Index>(i));
    }
    if (pieces.empty()) continue;
    const Latent latent = latent_force(pieces);
    for (std::size_t p = 0; p < pieces.size(); ++p)
      for (std::size_t k = 0; k < where[p].size(); ++k) out[where[p][k]] = latent.mean[p][k];
  }
  return out;
}

/// What a network may look at in one sample.
Eigen::VectorXd features(const PreparedRun& run, std::size_t k, Chain chain) {
  const bool pressed = run.has_pressure;
  if (chain == Chain::kTorque) {
    Eigen::VectorXd z(5);
    z << run.angle[k], run.velocity[k], std::tanh(20 * run.velocity[k]),
        pressed ? run.pressure[1][k] - run.pressure[0][k] : 0.0,
        pressed ? run.pressure[1][k] + run.pressure[0][k] : 0.0;
    return z;
  }
  const int i = chain == Chain::kPressure1 ? 0 : 1;
  Eigen::VectorXd z(4);
  z << run.smooth_pressure[i][k], run.command[i][k], run.smooth_pressure[1 - i][k],
      run.velocity.empty() ? 0.0 : run.velocity[k];
  return z;
}

struct NetworkGap {
  double fitted = 1, heldout = 1;  ///< share of the squares of the rows that is left
};

/// Trained on the fitted rows of one chain, judged on those of the held-out runs.
NetworkGap network_gap(const Bench& b, Chain chain) {
  const auto rows_of = [&](const Prepared& data, const Eigen::VectorXd& target, Eigen::MatrixXd& z,
                           Eigen::VectorXd& y, std::vector<unsigned>& run) {
    std::vector<Eigen::VectorXd> list;
    std::vector<double> values;
    for (std::size_t i = 0; i < data.rows.size(); ++i) {
      const Row& row = data.rows[i];
      if (row.chain != chain) continue;
      list.push_back(features(data.runs[row.run], row.sample, chain));
      values.push_back(target[static_cast<Eigen::Index>(i)]);
      run.push_back(static_cast<unsigned>(data.runs[row.run].time[row.sample] / kStopBlock) + row.run);
    }
    if (list.empty()) return;
    z.resize(list.front().size(), static_cast<Eigen::Index>(list.size()));
    for (std::size_t i = 0; i < list.size(); ++i) z.col(static_cast<Eigen::Index>(i)) = list[i];
    y = Eigen::Map<Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
  };
  NetworkGap out;
  Eigen::MatrixXd z, z_held;
  Eigen::VectorXd y, y_held;
  std::vector<unsigned> run, run_held;
  rows_of(b.data, -b.base.residual, z, y, run);
  const Predictor held(*b.heldout);
  Eigen::VectorXd prediction = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(held.rows()));
  ModelPoint model = b.base.model;
  model.rest.assign(held.resting_runs().size(), 0.0);
  held.predict(model, kAllChains, prediction);
  Eigen::VectorXd target = held.measured() - prediction;
  for (std::size_t i = 0; i < held.rows(); ++i)
    target[static_cast<Eigen::Index>(i)] /= b.weights.sigma[static_cast<int>(b.heldout->rows[i].chain)];
  rows_of(*b.heldout, target, z_held, y_held, run_held);
  if (y.size() < 1000 || y_held.size() == 0) return out;
  const Network network(z, y, run, kSeed);
  const auto share = [&](const Eigen::MatrixXd& inputs, const Eigen::VectorXd& values) {
    double sum = 0;
    for (Eigen::Index i = 0; i < values.size(); ++i) {
      const double miss = values[i] - network(inputs.col(i));
      sum += miss * miss;
    }
    return sum / values.squaredNorm();
  };
  out.fitted = share(z, y);
  out.heldout = share(z_held, y_held);
  return out;
}

Said neural(const Bench& b) {
  Said said;
  if (!b.heldout) return said;
  Chain chain = Chain::kTorque;
  NetworkGap best;
  for (const Chain c : {Chain::kTorque, Chain::kPressure1}) {
    if (!b.data.has(c) || !b.heldout->has(c)) continue;
    const NetworkGap gap = network_gap(b, c);
    if (gap.fitted >= best.fitted) continue;
    best = gap;
    chain = c;
  }
  const Label label = label_of(b.data, chain);
  said.signal = label.signal;
  said.unit = label.unit;
  said.heldout_before = label.scale * b.proof->residual(b.base.model, chain).rms();
  // The network takes away what is in the low-passed rows; the noise of single samples stays.
  double rows2 = 0, count = 0;
  const Predictor held(*b.heldout);
  Eigen::VectorXd prediction = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(held.rows()));
  ModelPoint model = b.base.model;
  model.rest.assign(held.resting_runs().size(), 0.0);
  held.predict(model, kAllChains, prediction);
  for (std::size_t i = 0; i < held.rows(); ++i)
    if (b.heldout->rows[i].chain == chain) {
      const double miss =
          held.measured()[static_cast<Eigen::Index>(i)] - prediction[static_cast<Eigen::Index>(i)];
      rows2 += miss * miss;
      count += 1;
    }
  const double taken = count > 0 ? label.scale * label.scale * rows2 / count * (1 - best.heldout) : 0.0;
  said.heldout_after = std::sqrt(std::max(0.0, said.heldout_before * said.heldout_before - taken));
  return said;
}

}  // namespace

std::vector<Said> all_methods(const Bench& b) {
  const std::vector<Sums> runs = b.sums(b.one_of_each, b.target, b.run),
                          blocks = b.sums(b.one_of_each, b.target, b.block);
  std::vector<int> all(b.columns.size());
  for (std::size_t j = 0; j < all.size(); ++j) all[j] = static_cast<int>(j);
  std::vector<Said> out;
  const auto run = [&](const char* name, const std::function<Said()>& method) {
    const auto begin = std::chrono::steady_clock::now();
    Said said = method();
    said.method = name;
    said.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    out.push_back(std::move(said));
  };
  run("B0 refit only", [&] { return told(b, {}); });
  run("B1 STLSQ", [&] { return told(b, choice_of(b, b.one_of_each, stlsq(runs))); });
  run("B2 ensemble of STLSQ",
      [&] { return told(b, choice_of(b, b.one_of_each, ensemble(runs, blocks, kSeed))); });
  run("B3 FROLS, ERR", [&] { return told(b, choice_of(b, all, frols(b.x, b.target, b.run, kMostTerms))); });
  run("B4 BIC over refits", [&] { return told(b, by_bic(b)); });
  run("B5 latent force, STLSQ",
      [&] { return told(b, choice_of(b, b.one_of_each, stlsq(b.sums(b.one_of_each, smoothed(b), b.run)))); });
  run("B6 neural residual", [&] { return neural(b); });
  return out;
}

}  // namespace baselines
