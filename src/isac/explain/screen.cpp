#include "isac/explain/screen.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>

#include "isac/explain/projection.hpp"
#include "isac/explain/signed_fit.hpp"
#include "isac/explain/workers.hpp"

namespace isac::explain {
namespace {

constexpr std::size_t kTogether = 8;  // functions of the dictionary that are projected at once
constexpr double kMimicked =
    3e-5;  // of a response's squares in a chain, left by the projection: all is mimicked
// The same of a function without a name: less than 3 % of v p_mean, beside the damping of that very form, held T = 6 of the encoder's own steps.
constexpr double kMimickedFunction = 1e-3;

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

/// So many columns of doubles are few beside what a search keeps as floats, and so many tasks leave no thread without work.
std::size_t shapes_at_once(const Hypothesis& h) {
  constexpr std::size_t kColumns = 16;
  return h.shapes.empty() ? 1 : std::max<std::size_t>(1, kColumns / directions(h, h.shapes.front()).size());
}

std::size_t parts_of(const Hypothesis& h) {
  return (h.shapes.size() + shapes_at_once(h) - 1) / shapes_at_once(h);
}

/// Rows of one chain in one atom, one after another.
struct Stretch {
  Eigen::Index from = 0, rows = 0, atom = 0, run = 0;
  int chain = 0;
  bool ends_run = false;  ///< the last of its chain in its run
};

std::vector<Stretch> stretches_of(const Prepared& data) {
  std::vector<Stretch> stretches;
  const Row* last = nullptr;
  for (const Row& row : data.rows) {
    const bool same_run = last != nullptr && row.run == last->run && row.chain == last->chain;
    if (!same_run && last != nullptr) stretches.back().ends_run = true;
    if (!same_run || row.atom != last->atom) {
      const Eigen::Index from = last == nullptr ? 0 : stretches.back().from + stretches.back().rows;
      stretches.push_back({.from = from,
                           .rows = 0,
                           .atom = static_cast<Eigen::Index>(row.atom),
                           .run = static_cast<Eigen::Index>(row.run),
                           .chain = static_cast<int>(row.chain),
                           .ends_run = false});
    }
    ++stretches.back().rows;
    last = &row;
  }
  if (last != nullptr) stretches.back().ends_run = true;
  return stretches;
}

/// What one hypothesis, or some functions of the dictionary, add to the evidence.
struct Done {
  std::vector<Column> columns;
  std::vector<Screened> shapes;
};

/// Can an amplitude not change its sign? Its bound is at its absence.
bool is_one_way(const Hypothesis& h, const Values& way, bool alone) {
  for (int i = 0; i < h.info().parameter_count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const double null = h.info().parameters[i].null_value;
    if (!h.amplitude[k] || (!alone && way[k] == null)) continue;
    if (h.lower[k] < null && h.upper[k] > null) return false;
  }
  return true;
}

class Screening {
 public:
  Screening(const Around& place, const Library& library, Responses* kept)
      : place_(place),
        library_(library),
        data_(place.predictor->data()),
        generic_(data_),
        kept_(kept),
        stretches_(stretches_of(data_)),
        noise_(noise_of(place)),
        errors_(errors_of_reading(place)) {}

  std::size_t functions() const { return generic_.size(); }

  /// Shapes of a hypothesis, one part of them.
  Done effect(int hypothesis, std::size_t part) const {
    const Hypothesis& h = library_.hypotheses[static_cast<std::size_t>(hypothesis)];
    const std::size_t at_once = shapes_at_once(h), first_shape = part * at_once,
                      last_shape = std::min(first_shape + at_once, h.shapes.size());
    std::vector<std::vector<Values>> ways;
    Eigen::Index columns = 0;
    for (std::size_t s = first_shape; s < last_shape; ++s) {
      ways.push_back(directions(h, h.shapes[s]));
      columns += static_cast<Eigen::Index>(ways.back().size());
    }
    Eigen::MatrixXd x = rows_of(h, hypothesis, part, ways, columns);
    const Eigen::VectorXd raw = x.colwise().squaredNorm();
    const Eigen::MatrixXd raw_of_chain = norms_by_chain(x);
    take_out(place_.basis, x);
    leave_out_mimicked(raw_of_chain, x);
    const Eigen::MatrixXd plain = unfiltered_each(data_, *place_.weights, x);
    Done done;
    Eigen::Index first = 0;
    for (std::size_t i = 0; i < ways.size(); ++i) {
      const auto m = static_cast<Eigen::Index>(ways[i].size());
      std::vector<Column> of_shape;
      for (Eigen::Index a = 0; a < m; ++a) {
        Column c = summary(x.col(first + a), plain.col(first + a), raw[first + a], 0);
        c.hypothesis = hypothesis;
        c.shape = static_cast<int>(first_shape + i);
        c.amplitude = static_cast<int>(a);
        of_shape.push_back(std::move(c));
      }
      done.shapes.push_back(
          linear_fit(h, h.shapes[first_shape + i], ways[i], of_shape, x.middleCols(first, m)));
      for (Column& c : of_shape) done.columns.push_back(std::move(c));
      first += m;
    }
    return done;
  }

  /// Functions `first` to `last` of the dictionary.
  Done dictionary(std::size_t first, std::size_t last) const {
    Eigen::MatrixXd x(rows(), static_cast<Eigen::Index>(last - first));
    std::vector<Eigen::Index> fresh;
    std::vector<std::size_t> asked;
    for (std::size_t d = first; d < last; ++d) {
      const auto column = static_cast<Eigen::Index>(d - first);
      const Eigen::VectorXf* known = kept_ != nullptr ? &kept_->function(d) : nullptr;
      if (known != nullptr && known->size() > 0) {
        x.col(column) = known->cast<double>();
        continue;
      }
      fresh.push_back(column);
      asked.push_back(d);
    }
    if (!fresh.empty()) {
      Eigen::MatrixXd weighed = generic_.rows(asked);
      weigh(data_, *place_.weights, weighed);
      x(Eigen::all, fresh) = weighed;
      for (const Eigen::Index column : fresh)
        if (kept_ != nullptr)
          kept_->function(first + static_cast<std::size_t>(column)) = x.col(column).cast<float>();
    }
    const Eigen::VectorXd raw = x.colwise().squaredNorm();
    take_out(place_.basis, x);
    const Eigen::MatrixXd plain = unfiltered_each(data_, *place_.weights, x);
    Done done;
    for (std::size_t d = first; d < last; ++d) {
      const auto column = static_cast<Eigen::Index>(d - first);
      done.columns.push_back(summary(x.col(column), plain.col(column), raw[column], kMimickedFunction));
      done.columns.back().name = generic_.name(d);
      done.columns.back().chain = generic_.chain(d);
    }
    return done;
  }

 private:
  Eigen::Index rows() const { return static_cast<Eigen::Index>(data_.rows.size()); }

  static Eigen::VectorXd noise_of(const Around& place) {
    const Prepared& data = place.predictor->data();
    std::vector<Eigen::Index> block_of_row;
    block_of_row.reserve(data.rows.size());
    for (const Row& row : data.rows) block_of_row.push_back(static_cast<Eigen::Index>(row.block));
    return with_share_of_fit(place.basis, place.residual, block_of_row,
                             static_cast<Eigen::Index>(data.blocks));
  }

  /// Weighted responses to every way, side by side.
  Eigen::MatrixXd rows_of(const Hypothesis& h, int hypothesis, std::size_t part,
                          const std::vector<std::vector<Values>>& ways, Eigen::Index columns) const {
    Eigen::MatrixXf* known =
        kept_ != nullptr && Responses::hold(*place_.fit, h) ? &kept_->effect(hypothesis, part) : nullptr;
    if (known != nullptr && known->cols() == columns) return known->cast<double>();
    Eigen::MatrixXd x(rows(), columns);
    Eigen::Index column = 0;
    for (const std::vector<Values>& of_shape : ways)
      for (const Values& way : of_shape) {
        x.col(column) = change(*place_.predictor, *place_.fit, place_.here, {&h, way, true});
        if (!x.col(column).allFinite()) x.col(column).setZero();
        ++column;
      }
    weigh(data_, *place_.weights, x);
    if (known != nullptr) *known = x.cast<float>();
    return x;
  }

  /// Σ x² of each chain, a column for each column.
  Eigen::MatrixXd norms_by_chain(const Eigen::MatrixXd& x) const {
    Eigen::MatrixXd norms = Eigen::MatrixXd::Zero(kChains, x.cols());
    for (const Stretch& s : stretches_)
      norms.row(s.chain) += x.middleRows(s.from, s.rows).colwise().squaredNorm();
    return norms;
  }

  /// Chain by chain: a gain of the encoder that the torque's own parameters mimic moves a free joint all the same.
  void leave_out_mimicked(const Eigen::MatrixXd& raw, Eigen::MatrixXd& x) const {
    const Eigen::MatrixXd left = norms_by_chain(x);
    for (Eigen::Index j = 0; j < x.cols(); ++j)
      for (const Stretch& s : stretches_)
        if (left(s.chain, j) < kMimicked * raw(s.chain, j)) x.col(j).segment(s.from, s.rows).setZero();
  }

  /// Scores of a projected response against the residual.
  Column summary(const Eigen::Ref<const Eigen::VectorXd>& x, const Eigen::Ref<const Eigen::VectorXd>& plain,
                 double raw_norm2, double mimicked) const {
    const auto atoms = static_cast<Eigen::Index>(data_.atoms);
    Column column;
    column.raw_norm2 = raw_norm2;
    column.atom_score = Eigen::VectorXd::Zero(atoms);
    column.atom_norm = Eigen::VectorXd::Zero(atoms);
    column.atom_noise = Eigen::VectorXd::Zero(atoms);
    const auto runs = static_cast<Eigen::Index>(data_.runs.size());
    column.shared_error = Eigen::VectorXd::Zero(runs + ErrorsOfReading::kOfDay);
    double held_by_runs = 0, sum = 0;
    Eigen::Index count = 0;
    for (const Stretch& s : stretches_) {
      const auto part = x.segment(s.from, s.rows);
      const double norm2 = part.squaredNorm();
      // Prediction − measured: an effect that is missing has the other sign.
      column.atom_score[s.atom] -= part.dot(place_.residual.segment(s.from, s.rows));
      column.atom_noise[s.atom] -= part.dot(noise_.segment(s.from, s.rows));
      column.atom_norm[s.atom] += norm2;
      column.chain_norm2[s.chain] += norm2;
      column.shared_error[s.run] += part.dot(errors_.of_run.segment(s.from, s.rows));
      for (Eigen::Index e = 0; e < ErrorsOfReading::kOfDay; ++e)
        column.shared_error[runs + e] += part.dot(errors_.of_day[e].segment(s.from, s.rows));
      sum += part.sum();
      count += s.rows;
      if (!s.ends_run) continue;
      held_by_runs += sum * sum / static_cast<double>(count);
      sum = 0;
      count = 0;
    }
    if (place_.weights->is_coloured()) {
      for (const Stretch& s : stretches_)
        column.plain_norm2[s.chain] += plain.segment(s.from, s.rows).squaredNorm();
    } else {
      std::copy(std::begin(column.chain_norm2), std::end(column.chain_norm2), std::begin(column.plain_norm2));
    }
    column.norm2 = column.atom_norm.sum();
    column.resting = column.norm2 > 0 ? held_by_runs / column.norm2 : 0.0;
    // Half a percent of a response is how its column was low-passed, not what the effect does.
    if (column.norm2 < mimicked * std::max(column.raw_norm2, 1e-300)) {
      column.atom_score.setZero();
      column.atom_noise.setZero();
      column.shared_error.setZero();
      column.norm2 = 0;
    }
    column.score = column.atom_score.sum();
    if (column.resting > Column::kResting && column.norm2 > 0) {
      const Eigen::VectorXd left = place_.left_beside(x);
      column.atom_left = Eigen::VectorXd::Zero(atoms);
      for (const Stretch& s : stretches_)
        column.atom_left[s.atom] -= x.segment(s.from, s.rows).dot(left.segment(s.from, s.rows));
    }
    return column;
  }

  /// Amplitudes by least squares, and the values that a refit may start from.
  Screened linear_fit(const Hypothesis& h, const Values& shape, const std::vector<Values>& ways,
                      const std::vector<Column>& columns, const Eigen::Ref<const Eigen::MatrixXd>& x) const {
    const auto m = static_cast<Eigen::Index>(ways.size());
    Eigen::VectorXd score(m);
    std::vector<bool> positive;
    for (std::size_t a = 0; a < ways.size(); ++a) {
      score[static_cast<Eigen::Index>(a)] = columns[a].score;
      positive.push_back(is_one_way(h, ways[a], ways.size() == 1));
    }
    const SignedFit linear = signed_fit(x.transpose() * x, score, positive);
    Screened s;
    s.hypothesis = columns.front().hypothesis;
    s.shape = columns.front().shape;
    s.gain = linear.gain;
    double all = 0;
    for (std::size_t a = 0; a < ways.size(); ++a) {
      const double amplitude = linear.amplitude[static_cast<Eigen::Index>(a)];
      all += amplitude * amplitude * columns[a].norm2;
      for (int c = 0; c < kChains; ++c) s.chain_norm2[c] += amplitude * amplitude * columns[a].plain_norm2[c];
    }
    // Parts that lie against one another are less together than each by itself.
    for (double& norm2 : s.chain_norm2) norm2 *= all > 0 ? linear.gain / all : 0.0;
    s.start = null_values(h, shape);
    const double most = h.info().linear || h.info().hook == models::Hook::kTorque ? 50.0 : 4.0;
    for (std::size_t a = 0; a < ways.size(); ++a) {
      s.reach = std::max(s.reach, std::sqrt(columns[a].norm2));
      const double factor = std::clamp(linear.amplitude[static_cast<Eigen::Index>(a)], -most, most);
      for (int i = 0; i < h.info().parameter_count; ++i) {
        const auto k = static_cast<std::size_t>(i);
        const double null = h.info().parameters[i].null_value;
        if (!std::isfinite(null)) {
          s.start[k] = shape[k];
          continue;
        }
        if (ways.size() > 1 && ways[a][k] == null) continue;
        s.start[k] = std::clamp(null + factor * (shape[k] - null), h.lower[k], h.upper[k]);
      }
    }
    return s;
  }

  const Around& place_;
  const Library& library_;
  const Prepared& data_;
  const Dictionary generic_;
  Responses* kept_;
  const std::vector<Stretch> stretches_;
  const Eigen::VectorXd noise_;  ///< r′
  const ErrorsOfReading errors_;
};

}  // namespace

bool Responses::hold(const Fit& fit, const Hypothesis& h) noexcept {
  const bool smooth_torque = h.info().hook == models::Hook::kTorque && !h.dry;
  return std::none_of(fit.model.effects.begin() + static_cast<std::ptrdiff_t>(fit.tolerances),
                      fit.model.effects.end(), [&](const Active& a) {
                        return smooth_torque ? a.hypothesis->reads_force && !a.hypothesis->shifts_force
                                             : (a.hypothesis->chains & h.chains) != 0;
                      });
}

void Responses::make_room(const Library& library, std::size_t functions) {
  effects_.resize(library.hypotheses.size());
  for (std::size_t h = 0; h < effects_.size(); ++h) effects_[h].resize(parts_of(library.hypotheses[h]));
  functions_.resize(functions);
}

Screen screen(const Around& place, const Library& library, const ScreenOptions& options, Responses* kept,
              const Screen* known) {
  const Prepared& data = place.predictor->data();
  const Screening screening(place, library, kept);
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
  Screen result;
  std::vector<char> have(library.hypotheses.size(), 0);
  bool has_dictionary = false;
  if (known != nullptr) {
    result.columns = known->columns;
    result.shapes = known->shapes;
    for (const Screened& s : known->shapes) have[static_cast<std::size_t>(s.hypothesis)] = 1;
    has_dictionary = std::any_of(known->columns.begin(), known->columns.end(),
                                 [](const Column& c) { return c.hypothesis < 0; });
  }
  std::vector<std::function<Done()>> tasks;
  const auto asked = [&](const Hypothesis& h) { return !options.only || options.only->count(h.id()) > 0; };
  for (std::size_t h = 0; h < library.hypotheses.size(); ++h)
    if (have[h] == 0 && asked(library.hypotheses[h]) && !taken_up(library.hypotheses[h]) &&
        !library.hypotheses[h].shapes.empty())
      for (std::size_t part = 0; part < parts_of(library.hypotheses[h]); ++part)
        tasks.emplace_back([&screening, h, part] { return screening.effect(static_cast<int>(h), part); });
  if (kept != nullptr) kept->make_room(library, screening.functions());
  for (std::size_t d = 0; options.dictionary && !has_dictionary && d < screening.functions(); d += kTogether)
    tasks.emplace_back(
        [&screening, d] { return screening.dictionary(d, std::min(d + kTogether, screening.functions())); });
  std::vector<Done> done(tasks.size());
  share_work(options.threads, tasks.size(), [&](std::size_t t) { done[t] = tasks[t](); });

  for (Done& d : done) {
    for (Column& c : d.columns) result.columns.push_back(std::move(c));
    for (Screened& s : d.shapes) result.shapes.push_back(s);
  }
  judge(result, data, library, options);
  return result;
}

}  // namespace isac::explain
