#include "isac/explain/screen.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <thread>
#include <utility>

namespace isac::explain {
namespace {

constexpr double kMimicked = 1e-5;  // of a response's squares left by the projection: all of it is mimicked

/// Values with one amplitude at its start and the others absent; all of them if there is no choice.
std::vector<Values> directions(const Hypothesis& h, const Values& shape) {
  std::vector<std::size_t> amplitudes;
  for (int i = 0; i < h.info().parameter_count; ++i)
    if (h.amplitude[static_cast<std::size_t>(i)] && h.free[static_cast<std::size_t>(i)])
      amplitudes.push_back(static_cast<std::size_t>(i));
  if (amplitudes.size() < 2) return {shape};
  std::vector<Values> all;
  for (const std::size_t keep : amplitudes) {
    Values v = null_values(h, shape);
    v[keep] = shape[keep];
    all.push_back(v);
  }
  return all;
}

/// Least squares within signs: the best subset of columns whose amplitudes are allowed (at most four columns).
struct SignedFit {
  double gain = 0;
  Eigen::VectorXd amplitude;
};

SignedFit signed_fit(const Eigen::MatrixXd& gram, const Eigen::VectorXd& score,
                     const std::vector<bool>& positive_only) {
  const int n = static_cast<int>(score.size());
  SignedFit best;
  best.amplitude = Eigen::VectorXd::Zero(n);
  for (int mask = 1; mask < (1 << n); ++mask) {
    std::vector<int> use;
    for (int i = 0; i < n; ++i)
      if ((mask >> i & 1) != 0 && gram(i, i) > 0) use.push_back(i);
    if (use.empty()) continue;
    const auto k = static_cast<Eigen::Index>(use.size());
    Eigen::MatrixXd g(k, k);
    Eigen::VectorXd s(k);
    for (Eigen::Index i = 0; i < k; ++i) {
      s[i] = score[use[static_cast<std::size_t>(i)]];
      for (Eigen::Index j = 0; j < k; ++j)
        g(i, j) = gram(use[static_cast<std::size_t>(i)], use[static_cast<std::size_t>(j)]);
      g(i, i) *= 1 + 1e-6;
    }
    const Eigen::VectorXd a = g.ldlt().solve(s);
    bool allowed = a.allFinite();
    for (Eigen::Index i = 0; i < k && allowed; ++i)
      allowed = !positive_only[static_cast<std::size_t>(use[static_cast<std::size_t>(i)])] || a[i] >= 0;
    if (!allowed) continue;
    const double gain = s.dot(a);
    if (gain <= best.gain) continue;
    best.gain = gain;
    best.amplitude.setZero();
    for (Eigen::Index i = 0; i < k; ++i) best.amplitude[use[static_cast<std::size_t>(i)]] = a[i];
  }
  return best;
}

/// Share of Σ x² that the means of runs (of each chain) hold.
double held_by_runs(const Prepared& data, const Eigen::VectorXd& x) {
  double held = 0, sum = 0;
  std::size_t count = 0;
  for (std::size_t i = 0; i < data.rows.size(); ++i) {
    sum += x[static_cast<Eigen::Index>(i)];
    ++count;
    if (i + 1 < data.rows.size() && data.rows[i + 1].run == data.rows[i].run &&
        data.rows[i + 1].chain == data.rows[i].chain)
      continue;
    held += sum * sum / static_cast<double>(count);
    sum = 0;
    count = 0;
  }
  const double all = x.squaredNorm();
  return all > 0 ? held / all : 0.0;
}

struct Task {
  int hypothesis, shape;
};

struct Done {
  std::vector<Column> columns;
  Screened screened;
};

}  // namespace

Eigen::MatrixXd basis_of(const Eigen::MatrixXd& sensitivities) {
  Eigen::MatrixXd scaled = sensitivities;
  for (Eigen::Index j = 0; j < scaled.cols(); ++j) {
    const double norm = scaled.col(j).norm();
    if (norm > 0) scaled.col(j) /= norm;
  }
  // Gram–Schmidt twice: columns are few, and nearly dependent ones must fall away instead of becoming noise.
  Eigen::MatrixXd q(scaled.rows(), scaled.cols());
  Eigen::Index count = 0;
  for (Eigen::Index j = 0; j < scaled.cols(); ++j) {
    Eigen::VectorXd v = scaled.col(j);
    for (int round = 0; round < 2; ++round)
      for (Eigen::Index k = 0; k < count; ++k) v -= q.col(k).dot(v) * q.col(k);
    const double norm = v.norm();
    if (norm > 1e-7) q.col(count++) = v / norm;
  }
  q.conservativeResize(scaled.rows(), count);
  return q;
}

Screen screen(const Around& place, const Library& library, const ScreenOptions& options) {
  const Predictor& predictor = *place.predictor;
  const Prepared& data = predictor.data();
  const auto n = static_cast<Eigen::Index>(predictor.rows());
  const auto atoms = static_cast<Eigen::Index>(data.atoms);
  const Eigen::VectorXd& residual = place.residual;

  const auto summarise = [&](Eigen::VectorXd& x, Column& column) {
    column.raw_norm2 = x.squaredNorm();
    x = place.project(x);
    column.atom_score = Eigen::VectorXd::Zero(atoms);
    column.atom_norm = Eigen::VectorXd::Zero(atoms);
    for (Eigen::Index i = 0; i < n; ++i) {
      const auto b = static_cast<Eigen::Index>(data.rows[static_cast<std::size_t>(i)].atom);
      column.atom_score[b] -=
          x[i] * residual[i];  // prediction − measured: an effect that is missing has the other sign
      column.atom_norm[b] += x[i] * x[i];
      column.chain_norm2[static_cast<int>(data.rows[static_cast<std::size_t>(i)].chain)] += x[i] * x[i];
    }
    column.resting = held_by_runs(data, x);
    const Eigen::VectorXd plain = unfiltered(data, *place.weights, x);
    for (Eigen::Index i = 0; i < n; ++i)
      column.plain_norm2[static_cast<int>(data.rows[static_cast<std::size_t>(i)].chain)] +=
          plain[i] * plain[i];
    column.norm2 = column.atom_norm.sum();
    // A third of a percent of a response is how its column was low-passed, not what the effect does.
    if (column.norm2 < kMimicked * std::max(column.raw_norm2, 1e-300)) {
      column.atom_score.setZero();
      column.norm2 = 0;
    }
    column.score = column.atom_score.sum();
  };

  std::vector<Task> tasks;
  // What a tolerance takes up within its bounds is no finding. (Nor could it be tested: the response to a shift of the angle
  // contains the encoder's noise twice.)
  const auto taken_up = [&](const Hypothesis& h) {
    for (std::size_t i = 0; i < place.fit->tolerances; ++i) {
      const Active& a = place.fit->model.effects[i];
      if (a.hypothesis->effect != h.effect) continue;
      const double margin = 0.01 * (a.hypothesis->upper[0] - a.hypothesis->lower[0]);
      return a.values[0] > a.hypothesis->lower[0] + margin && a.values[0] < a.hypothesis->upper[0] - margin;
    }
    return false;
  };
  for (std::size_t h = 0; h < library.hypotheses.size(); ++h)
    for (std::size_t s = 0; !taken_up(library.hypotheses[h]) && s < library.hypotheses[h].shapes.size(); ++s)
      tasks.push_back({static_cast<int>(h), static_cast<int>(s)});
  const Dictionary generic(data);
  const std::size_t effects = tasks.size();
  if (options.dictionary)
    for (std::size_t d = 0; d < generic.size(); ++d) tasks.push_back({-1, static_cast<int>(d)});
  std::vector<Done> done(tasks.size());
  std::atomic<std::size_t> next{0};
  const auto work = [&] {
    for (std::size_t t = next++; t < tasks.size(); t = next++) {
      if (t >= effects) {
        const auto d = static_cast<std::size_t>(tasks[t].shape);
        Column c;
        c.name = generic.name(d);
        c.chain = generic.chain(d);
        Eigen::VectorXd rows = generic.rows(d);
        weigh(data, *place.weights, rows);
        summarise(rows, c);
        done[t].columns.push_back(std::move(c));
        continue;
      }
      const Hypothesis& h = library.hypotheses[static_cast<std::size_t>(tasks[t].hypothesis)];
      const Values& shape = h.shapes[static_cast<std::size_t>(tasks[t].shape)];
      const std::vector<Values> ways = directions(h, shape);
      Eigen::MatrixXd x(n, static_cast<Eigen::Index>(ways.size()));
      std::vector<bool> positive;
      Done& result = done[t];
      for (std::size_t a = 0; a < ways.size(); ++a) {
        Eigen::VectorXd column = response(predictor, *place.fit, place.here, {&h, ways[a]}, *place.weights);
        Column c;
        c.hypothesis = tasks[t].hypothesis;
        c.shape = tasks[t].shape;
        c.amplitude = static_cast<int>(a);
        if (!column.allFinite()) column.setZero();
        summarise(column, c);
        x.col(static_cast<Eigen::Index>(a)) = column;
        result.columns.push_back(std::move(c));
        // An amplitude that cannot change its sign: its bound is at its absence.
        bool one_way = true;
        for (int i = 0; i < h.info().parameter_count; ++i) {
          const auto k = static_cast<std::size_t>(i);
          if (!h.amplitude[k] || (ways.size() > 1 && ways[a][k] == h.info().parameters[i].null_value))
            continue;
          const double null = h.info().parameters[i].null_value;
          if (h.lower[k] < null && h.upper[k] > null) one_way = false;
        }
        positive.push_back(one_way);
      }
      const auto m = static_cast<Eigen::Index>(ways.size());
      Eigen::VectorXd score(m);
      for (Eigen::Index a = 0; a < m; ++a) score[a] = result.columns[static_cast<std::size_t>(a)].score;
      const Eigen::MatrixXd gram = x.transpose() * x;
      const SignedFit linear = signed_fit(gram, score, positive);
      Screened& s = result.screened;
      s.hypothesis = tasks[t].hypothesis;
      s.shape = tasks[t].shape;
      s.gain = linear.gain;
      double all = 0;
      for (std::size_t a = 0; a < ways.size(); ++a) {
        const double amplitude = linear.amplitude[static_cast<Eigen::Index>(a)];
        all += amplitude * amplitude * result.columns[a].norm2;
        for (int c = 0; c < kChains; ++c)
          s.chain_norm2[c] += amplitude * amplitude * result.columns[a].plain_norm2[c];
      }
      // Parts that lie against one another are less together than each by itself.
      for (double& norm2 : s.chain_norm2) norm2 *= all > 0 ? linear.gain / all : 0.0;
      s.start = null_values(h, shape);
      for (std::size_t a = 0; a < ways.size(); ++a) {
        s.reach = std::max(s.reach, std::sqrt(result.columns[a].norm2));
        for (int i = 0; i < h.info().parameter_count; ++i) {
          const auto k = static_cast<std::size_t>(i);
          const double null = h.info().parameters[i].null_value;
          if (!std::isfinite(null)) {
            s.start[k] = shape[k];
            continue;
          }
          if (ways.size() > 1 && ways[a][k] == null) continue;
          const double factor = h.info().linear || h.info().hook == models::Hook::kTorque
                                    ? std::clamp(linear.amplitude[static_cast<Eigen::Index>(a)], -50.0, 50.0)
                                    : std::clamp(linear.amplitude[static_cast<Eigen::Index>(a)], -4.0, 4.0);
          s.start[k] = std::clamp(null + factor * (shape[k] - null), h.lower[k], h.upper[k]);
        }
      }
    }
  };
  std::vector<std::thread> pool;
  for (int i = 1; i < options.threads; ++i) pool.emplace_back(work);
  work();
  for (std::thread& thread : pool) thread.join();

  Screen result;
  for (Done& d : done) {
    for (Column& c : d.columns) result.columns.push_back(std::move(c));
    if (d.screened.hypothesis >= 0) result.shapes.push_back(d.screened);
  }
  judge(result, data, library, options);
  return result;
}

}  // namespace isac::explain
