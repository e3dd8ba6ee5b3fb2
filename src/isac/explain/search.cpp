#include "isac/explain/search.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <map>
#include <set>
#include <thread>

#include "isac/series/statistics.hpp"

namespace isac::explain {
namespace {

constexpr std::size_t kShortlist = 9;
constexpr double kWorthRefitting = 0.25;  // of the best linear gain: a candidate below it is not refitted…
constexpr double kWorthRefittingUnits = 12;  // …unless it still is this many units of noise
constexpr double kMinimumBlocks = 24;

Floors floors_of(const Prepared& data) {
  Floors floors;
  std::vector<const std::vector<double>*> torque, pressure;
  for (const PreparedRun& run : data.runs) {
    if (run.has_torque) torque.push_back(&run.torque);
    for (const auto& p : run.raw_pressure)
      if (!p.empty()) pressure.push_back(&p);
  }
  if (!torque.empty()) floors.white[0] = floors.white[3] = white_noise(torque);
  if (!pressure.empty()) floors.white[1] = floors.white[2] = white_noise(pressure);
  return floors;
}

/// Standard deviation of rows that is not slower than half a second: noise, with little of a missing effect in it.
void reweight(const Predictor& predictor, const Fit& fit, Weights& weights) {
  const Prepared& data = predictor.data();
  for (int c = 0; c < kChains; ++c) {
    std::vector<double> fast;
    std::vector<double> piece;
    unsigned run = ~0U;
    const auto flush = [&] {
      const auto window = static_cast<std::ptrdiff_t>(16);
      double sum = 0;
      for (std::ptrdiff_t k = 0; k < static_cast<std::ptrdiff_t>(piece.size()); ++k) {
        sum += piece[static_cast<std::size_t>(k)];
        if (k >= 2 * window) {
          sum -= piece[static_cast<std::size_t>(k - 2 * window)];
          fast.push_back(piece[static_cast<std::size_t>(k - window)] - sum / static_cast<double>(2 * window));
        }
      }
      piece.clear();
    };
    for (std::size_t i = 0; i < data.rows.size(); ++i) {
      if (static_cast<int>(data.rows[i].chain) != c) continue;
      if (data.rows[i].run != run) flush();
      run = data.rows[i].run;
      piece.push_back(fit.residual[static_cast<Eigen::Index>(i)]);
    }
    flush();
    const double spread = series::robust_deviation(fast);
    if (spread > 0 && std::isfinite(spread)) weights.sigma[c] *= spread;
  }
  if (data.has(Chain::kPressure1))
    weights.sigma[1] = weights.sigma[2] = std::max(weights.sigma[1], weights.sigma[2]);
}

double correlation_seconds(const Prepared& data, const Fit& fit) {
  double longest = 0;
  for (const Chain chain : {Chain::kTorque, Chain::kMotion, Chain::kPressure1}) {
    std::vector<std::vector<double>> pieces;
    unsigned run = ~0U;
    for (std::size_t i = 0; i < data.rows.size(); ++i) {
      if (data.rows[i].chain != chain) continue;
      if (data.rows[i].run != run) pieces.emplace_back();
      run = data.rows[i].run;
      pieces.back().push_back(fit.residual[static_cast<Eigen::Index>(i)]);
    }
    if (pieces.empty()) continue;
    const double spacing = data.runs.front().interval * data.stride * (chain == Chain::kPressure1 ? 2 : 1);
    longest = std::max(longest, series::correlation_time(pieces) * spacing);
  }
  return longest;
}

class Search {
 public:
  Search(const Predictor& predictor, const Library& library, Prepared& data, const ExplainOptions& options)
      : predictor_(predictor), library_(library), data_(data), options_(options) {}

  Found run() {
    found_.floors = floors_of(data_);
    first_weights();
    found_.baseline = fit_baseline(predictor_, library_.tolerances, found_.weights);
    reweight(predictor_, found_.baseline, found_.weights);
    found_.baseline = fit_baseline(predictor_, library_.tolerances, found_.weights);
    choose_blocks(found_.baseline);
    for (std::size_t i = 0; i < found_.baseline.tolerances; ++i)
      say(fmt::format("  tolerance {} = {:.3g}", found_.baseline.model.effects[i].hypothesis->id(),
                      found_.baseline.model.effects[i].values[0]));
    for (std::size_t i = 0; i < found_.baseline.model.rest.size(); ++i)
      if (found_.baseline.model.rest[i] != 0)
        say(fmt::format("  rest {} = {:.3g}", i, found_.baseline.model.rest[i]));
    say(fmt::format("baseline fitted: {} rows, {} blocks of {:.1f} s", data_.rows.size(), data_.blocks,
                    data_.block_seconds));
    found_.model = found_.baseline;
    place_ = around(predictor_, found_.model, found_.weights);
    for (int step = 0; step < options_.most_effects; ++step) {
      if (!advance()) break;
    }
    if (static_cast<int>(found_.added.size()) == options_.most_effects) {
      Step last;
      last.screen = screen_of(found_.model);
      last.gate = gate_of(found_.model, last.screen);
      found_.adequate = !(last.gate.significant && last.gate.material);
      found_.steps.push_back(std::move(last));
    }
    return std::move(found_);
  }

 private:
  void say(const std::string& line) const {
    if (options_.progress) options_.progress(line);
  }

  void first_weights() {
    for (int c = 0; c < kChains; ++c) found_.weights.sigma[c] = 1e-9;
    for (int c : {0, 3})
      found_.weights.sigma[c] = std::isfinite(found_.floors.white[c]) && found_.floors.white[c] > 0
                                    ? 0.4 * found_.floors.white[c]
                                    : 1e-3;
    found_.weights.sigma[1] = found_.weights.sigma[2] = 150.0;  // Pa
  }

  void choose_blocks(const Fit& fit) {
    const double tau = correlation_seconds(data_, fit);
    double total = 0, longest = 0;
    for (const PreparedRun& run : data_.runs)
      if (!run.time.empty()) {
        total += run.time.back();
        longest = std::max(longest, run.time.back());
      }
    double seconds = std::clamp(6 * tau, 2.0, std::max(2.0, longest / 3));
    seconds = std::max(1.0, std::min(seconds, total / kMinimumBlocks));
    cut_blocks(data_, seconds);
  }

  Screen screen_of(const Fit& fit) const {
    (void)fit;
    return screen(place_, library_,
                  {.flips = 1999,
                   .significance = 0.5 * options_.significance,
                   .seed = options_.seed,
                   .threads = options_.threads,
                   .dictionary = true});
  }

  /// Size of the largest single response that the data asks for, over the floor of its chain.
  Gate gate_of(const Fit& fit, const Screen& s) const {
    Gate gate;
    gate.p_value = std::min(1.0, 2 * std::min(s.p_value, s.rare_p));
    gate.significant = gate.p_value <= options_.significance;
    for (const Screened& c : s.candidates) {
      if (c.gain <= 0) break;
      if (!significant(c, s)) continue;
      Chain chain{};
      const double size =
          size_of_gain(c.gain, library_.hypotheses[static_cast<std::size_t>(c.hypothesis)].chains, &chain);
      if (size > gate.size) {
        gate.size = size;
        gate.chain = chain;
      }
    }
    if (std::getenv("ISAC_EXPLAIN_DEBUG") != nullptr) {
      for (std::size_t r = 0; r < data_.runs.size(); ++r) {
        double sum[kChains] = {}, count[kChains] = {};
        for (std::size_t i = data_.run_begin[r]; i < data_.run_begin[r + 1]; ++i) {
          const auto c = static_cast<std::size_t>(data_.rows[i].chain);
          sum[c] += fit.residual[static_cast<Eigen::Index>(i)] * fit.residual[static_cast<Eigen::Index>(i)];
          ++count[c];
        }
        say(fmt::format("    run {} {} day {:.0f}: {:.2f} {:.2f} {:.2f} {:.2f}", data_.runs[r].name,
                        data_.runs[r].experiment, data_.runs[r].day_offset, std::sqrt(sum[0] / count[0]),
                        std::sqrt(sum[1] / count[1]), std::sqrt(sum[2] / count[2]),
                        std::sqrt(sum[3] / count[3])));
      }
      std::vector<const Column*> order;
      for (const Column& c : s.columns) order.push_back(&c);
      std::sort(order.begin(), order.end(),
                [](const Column* a, const Column* b) { return a->rare_z > b->rare_z; });
      for (std::size_t i = 0; i < 6 && i < order.size(); ++i)
        say(fmt::format("    rare {:.1f} T {:.1f} unit {:.2f} {} {}", order[i]->rare_z, order[i]->T,
                        order[i]->unit, order[i]->name,
                        order[i]->hypothesis >= 0
                            ? library_.hypotheses[static_cast<std::size_t>(order[i]->hypothesis)].id()
                            : ""));
      std::sort(order.begin(), order.end(), [](const Column* a, const Column* b) { return a->T > b->T; });
      for (std::size_t i = 0; i < 6 && i < order.size(); ++i)
        say(fmt::format("    T {:.1f} rare {:.1f} unit {:.2f} {} {}", order[i]->T, order[i]->rare_z,
                        order[i]->unit, order[i]->name,
                        order[i]->hypothesis >= 0
                            ? library_.hypotheses[static_cast<std::size_t>(order[i]->hypothesis)].id()
                            : ""));
      say(fmt::format("    p flips {:.4g} rare {:.4g} maxT {:.2f}", s.p_value, s.rare_p, s.max_T));
    }
    for (const Column& c : s.columns) {
      if (c.hypothesis >= 0 || c.norm2 <= 0 || c.T < s.limit) continue;
      const double gain = c.score * c.score / c.norm2;
      const unsigned chains = c.name.starts_with("torque")   ? bit(Chain::kTorque)
                              : c.name.starts_with("motion") ? bit(Chain::kMotion)
                                                             : kPressureChains;
      Chain chain{};
      const double size = size_of_gain(gain, chains, &chain);
      if (size > gate.size) {
        gate.size = size;
        gate.chain = chain;
      }
    }
    (void)fit;
    gate.material = gate.size >= options_.material;
    return gate;
  }

  static bool significant(const Screened& c, const Screen& s) {
    return c.T >= s.limit || c.rare_z >= s.rare_limit;
  }

  /// If all of a gain came from one chain: its rms over the floor; the chain with most rows of those that may be.
  double size_of_gain(double gain, unsigned chains, Chain* where) const {
    double best = 0;
    for (int c = 0; c < kChains; ++c) {
      if ((chains & (1U << c)) == 0) continue;
      std::size_t rows = 0;
      for (const Row& row : data_.rows) rows += static_cast<int>(row.chain) == c ? 1U : 0U;
      if (rows == 0) continue;
      const double floor = floor_of(c);
      const double size = std::sqrt(gain / static_cast<double>(rows)) * found_.weights.sigma[c] / floor;
      if (best == 0 || size < best) {
        best = size;
        *where = static_cast<Chain>(c);
      }
    }
    return best;
  }

  double floor_of(int chain) const {
    const double white = found_.floors.white[chain];
    return std::isfinite(white) && white > found_.weights.sigma[chain] ? white : found_.weights.sigma[chain];
  }

  std::vector<Screened> shortlist(const Screen& s) const {
    std::vector<Screened> list;
    std::map<std::string, int> per_id;
    if (s.candidates.empty()) return list;
    const double best = s.candidates.front().gain;
    for (const Screened& c : s.candidates) {
      if (c.gain <= 0) break;
      if (list.size() >= kShortlist) break;
      if (!significant(c, s) && c.gain < 0.5 * best) continue;
      if (c.gain < kWorthRefitting * best && c.gain < kWorthRefittingUnits * s.noise_unit) break;
      if (c.gain < 0.15 * best && list.size() >= 4) break;
      const Hypothesis& h = library_.hypotheses[static_cast<std::size_t>(c.hypothesis)];
      if (std::find(found_.added.begin(), found_.added.end(), c.hypothesis) != found_.added.end()) continue;
      if (++per_id[h.id()] > 2) continue;
      list.push_back(c);
    }
    return list;
  }

  std::vector<Trial> refit_all(const std::vector<Screened>& list) const {
    std::vector<Trial> trials(list.size());
    std::atomic<std::size_t> next{0};
    const auto work = [&] {
      for (std::size_t i = next++; i < list.size(); i = next++) {
        const Hypothesis& h = library_.hypotheses[static_cast<std::size_t>(list[i].hypothesis)];
        Refined refined = refine(place_, h, list[i].start);
        // Where the linear start was a bad one, the shape's own values are another.
        if (!h.info().linear && refined.loss > place_.residual.squaredNorm() - 0.5 * list[i].gain) {
          Refined other = refine(place_, h, h.shapes[static_cast<std::size_t>(list[i].shape)]);
          if (other.loss < refined.loss) refined = std::move(other);
        }
        trials[i].hypothesis = list[i].hypothesis;
        trials[i].values = refined.values;
        trials[i].residual = std::move(refined.residual);
        trials[i].loss = refined.loss;
      }
    };
    std::vector<std::thread> pool;
    for (int t = 1; t < options_.threads; ++t) pool.emplace_back(work);
    work();
    for (std::thread& thread : pool) thread.join();
    return trials;
  }

  int parameters_of(const Trial& t) const {
    return library_.hypotheses[static_cast<std::size_t>(t.hypothesis)].parameters();
  }
  std::string id_of(const Trial& t) const {
    return library_.hypotheses[static_cast<std::size_t>(t.hypothesis)].id();
  }

  /// Best first; those that cannot be ruled out are marked; general cases of a simpler one in the set are dropped.
  void rank(std::vector<Trial>& trials, double unit) const {
    if (trials.empty()) return;
    const auto penalised = [&](const Trial& t) { return t.loss + 2 * unit * parameters_of(t); };
    std::stable_sort(trials.begin(), trials.end(),
                     [&](const Trial& a, const Trial& b) { return penalised(a) < penalised(b); });
    // The best reading of an effect speaks for it.
    std::set<std::string> seen;
    std::erase_if(trials, [&](const Trial& t) { return !seen.insert(id_of(t)).second; });
    const auto mark = [&] {
      const Trial& best = trials.front();
      for (Trial& t : trials) {
        t.behind = compare(data_, best.residual, t.residual, parameters_of(t) - parameters_of(best), unit);
        t.in_set = &t == &best || cannot_rule_out(t.behind);
        t.material = size_over_floor(data_, found_.weights, found_.floors, t.residual - place_.residual);
      }
    };
    mark();
    // Parsimony: a simpler case that is not ruled out stands for the general one.
    for (bool changed = true; changed;) {
      changed = false;
      for (std::size_t i = 1; i < trials.size(); ++i) {
        if (!trials[i].in_set || !nests(id_of(trials[0]), id_of(trials[i]))) continue;
        std::rotate(trials.begin(), trials.begin() + static_cast<std::ptrdiff_t>(i),
                    trials.begin() + static_cast<std::ptrdiff_t>(i) + 1);
        mark();
        changed = true;
        break;
      }
    }
    for (Trial& t : trials)
      if (&t != &trials.front() && t.in_set)
        for (const Trial& simple : trials)
          if (simple.in_set && nests(id_of(t), id_of(simple))) t.in_set = false;
    double sum = 0;
    for (Trial& t : trials) {
      const double c = std::max(t.behind.unit, unit);
      t.weight = t.in_set ? std::exp(-0.5 * std::max(0.0, t.behind.delta) / c) : 0.0;
      sum += t.weight;
    }
    for (Trial& t : trials) t.weight /= sum;
  }

  bool advance() {
    Step step;
    step.screen = screen_of(found_.model);
    step.gate = gate_of(found_.model, step.screen);
    if (found_.added.empty()) found_.gate = step.gate;
    if (!step.gate.significant || !step.gate.material) {
      say(fmt::format("nothing {} is left (p = {:.3g}, size {:.2f} of the noise floor)",
                      step.gate.significant ? "material" : "significant", step.gate.p_value, step.gate.size));
      found_.adequate = true;
      found_.steps.push_back(std::move(step));
      return false;
    }
    const std::vector<Screened> list = shortlist(step.screen);
    std::string names;
    for (const Screened& c : list)
      names += (names.empty() ? "" : ", ") + library_.hypotheses[static_cast<std::size_t>(c.hypothesis)].id();
    say(fmt::format("something is missing (p = {:.3g}, {:.2f} of the noise floor); refitting {}",
                    step.gate.p_value, step.gate.size, names));
    step.trials = refit_all(list);
    rank(step.trials, step.screen.noise_unit);
    for (const Trial& t : step.trials) {
      const Trial& best = step.trials.front();
      const std::string sentence =
          &t == &best ? fmt::format("closes {:.0f} units of noise",
                                    (place_.residual.squaredNorm() - t.loss) / step.screen.noise_unit)
          : t.in_set  ? fmt::format("cannot be told from {} ({:.1f} sigma of data between them)", id_of(best),
                                    t.behind.separation)
                      : fmt::format("ruled out: {:.1f} sigma behind {}", t.behind.t, id_of(best));
      found_.notes.push_back({id_of(t), sentence});
      say(id_of(t) + ": " + sentence);
    }
    if (step.trials.empty() || step.trials.front().material < options_.material) {
      found_.adequate = false;
      found_.steps.push_back(std::move(step));
      return false;
    }
    const Trial& best = step.trials.front();
    found_.added.push_back(best.hypothesis);
    Active active;
    active.hypothesis = &library_.hypotheses[static_cast<std::size_t>(best.hypothesis)];
    active.values = best.values;
    found_.model = refit(predictor_, found_.model, {active}, found_.weights, 6);
    place_ = around(predictor_, found_.model, found_.weights);
    found_.steps.push_back(std::move(step));
    return true;
  }

  const Predictor& predictor_;
  const Library& library_;
  Prepared& data_;
  const ExplainOptions& options_;
  Found found_;
  Around place_;  ///< of found_.model
};

}  // namespace

double size_over_floor(const Prepared& data, const Weights& weights, const Floors& floors,
                       const Eigen::VectorXd& difference, Chain* where) {
  double sum[kChains] = {}, best = 0;
  std::size_t rows[kChains] = {};
  for (std::size_t i = 0; i < data.rows.size(); ++i) {
    const auto c = static_cast<std::size_t>(data.rows[i].chain);
    sum[c] += difference[static_cast<Eigen::Index>(i)] * difference[static_cast<Eigen::Index>(i)];
    ++rows[c];
  }
  for (int c = 0; c < kChains; ++c) {
    if (rows[c] == 0) continue;
    const double floor =
        std::isfinite(floors.white[c]) ? std::max(floors.white[c], weights.sigma[c]) : weights.sigma[c];
    const double size = std::sqrt(sum[c] / static_cast<double>(rows[c])) * weights.sigma[c] / floor;
    if (size > best) {
      best = size;
      if (where != nullptr) *where = static_cast<Chain>(c);
    }
  }
  return best;
}

Found search(const Predictor& predictor, const Library& library, Prepared& data,
             const ExplainOptions& options) {
  return Search(predictor, library, data, options).run();
}

}  // namespace isac::explain
