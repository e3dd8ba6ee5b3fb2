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
// sigma that a general case must lead a simpler one by to stand first, and to stand beside it: chance alone passes the first in one of a hundred.
constexpr double kNestedLimit = 0.75, kNestedDoubt = 0.2;
constexpr double kSmallRemainder = 0.2;  // of the first effect's size: less does not cast doubt on its name
constexpr double kSecondOfFirst = 0.35, kSecondOfFloor = 0.35;

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

double correlation_seconds(const Prepared& data, const Eigen::VectorXd& residual) {
  double longest = 0;
  for (const Chain chain : {Chain::kTorque, Chain::kMotion, Chain::kPressure1}) {
    std::vector<std::vector<double>> pieces;
    unsigned run = ~0U;
    for (std::size_t i = 0; i < data.rows.size(); ++i) {
      if (data.rows[i].chain != chain) continue;
      if (data.rows[i].run != run) pieces.emplace_back();
      run = data.rows[i].run;
      pieces.back().push_back(residual[static_cast<Eigen::Index>(i)]);
    }
    if (pieces.empty()) continue;
    const double spacing = data.runs.front().interval * data.stride * (chain == Chain::kPressure1 ? 2 : 1);
    longest = std::max(longest, series::correlation_time(pieces) * spacing);
  }
  return longest;
}

class Search {
 public:
  Search(const Predictor& predictor, Library& library, Prepared& data, const ExplainOptions& options)
      : predictor_(predictor), library_(library), data_(data), options_(options) {}

  Found run() {
    found_.floors = floors_of(data_);
    first_weights();
    found_.baseline = fit_baseline(predictor_, library_.tolerances, found_.weights);
    reweight(predictor_, found_.baseline, found_.weights);
    found_.baseline = fit_baseline(predictor_, library_.tolerances, found_.weights);
    for (const Row& row : data_.rows) ++rows_[static_cast<int>(row.chain)];
    choose_blocks(found_.baseline.residual);
    say(fmt::format("baseline fitted to {} rows of {} runs", data_.rows.size(), data_.runs.size()));
    place_slip(library_, data_, found_.baseline.residual);
    move_to(found_.baseline);
    forward();
    if (found_.added.size() > 1) swap_and_drop();
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

  void choose_blocks(const Eigen::VectorXd& residual) {
    const double tau = correlation_seconds(data_, residual);
    double total = 0, longest = 0;
    for (const PreparedRun& run : data_.runs)
      if (!run.time.empty()) {
        total += run.time.back();
        longest = std::max(longest, run.time.back());
      }
    double seconds = std::clamp(6 * tau, kAtomSeconds, std::max(kAtomSeconds, longest / 3));
    seconds = std::max(kAtomSeconds, std::min(seconds, total / kMinimumBlocks));
    cut_blocks(data_, seconds);
  }

  ScreenOptions screen_options() const {
    return {.flips = 1999,
            .significance = 0.5 * options_.significance,
            .seed = options_.seed,
            .threads = options_.threads,
            .dictionary = true};
  }

  void move_to(const Fit& fit) {
    found_.model = fit;
    place_ = around(predictor_, found_.model, found_.weights);
  }

  /// Blocks must be longer than the noise remembers, not than a missing effect does: their length is taken from what the best
  /// candidate leaves over.
  Screen screen_here() {
    choose_blocks(place_.residual);
    Screen s = screen(place_, library_, screen_options());
    const double before = data_.block_seconds;
    for (const Screened& c : s.candidates) {
      if (c.gain <= 0) break;
      const std::vector<Trial> best = refit_all({c});
      choose_blocks(best.front().residual);
      break;
    }
    if (data_.block_seconds < before) {
      judge(s, data_, library_, screen_options());
    } else if (data_.block_seconds > before) {
      cut_blocks(data_, before);
    }
    return s;
  }

  /// Size of the largest response that is significant, over the floor of its chain.
  Gate gate_of(const Screen& s, const std::set<std::string>& ignored = {}) const {
    Gate gate;
    gate.p_value = std::min(1.0, 2 * std::min(s.p_value, s.rare_p));
    gate.significant = gate.p_value <= options_.significance;
    const auto consider = [&](double gain, const double* share, const std::string& what, bool dense) {
      for (int c = 0; c < kChains; ++c) {
        if (rows_[c] == 0 || share[c] <= 0) continue;
        const double size = std::sqrt(gain * share[c] / static_cast<double>(rows_[c])) *
                            found_.weights.sigma[c] / floor_of(c);
        if (dense) gate.dense_size = std::max(gate.dense_size, size);
        if (size <= gate.size) continue;
        gate.size = size;
        gate.chain = static_cast<Chain>(c);
        gate.what = what;
      }
    };
    for (const Screened& c : s.candidates)
      if (c.gain > 0 && significant(c, s) &&
          ignored.count(library_.hypotheses[static_cast<std::size_t>(c.hypothesis)].id()) == 0)
        consider(c.gain, c.chain_share, library_.hypotheses[static_cast<std::size_t>(c.hypothesis)].id(),
                 c.T >= s.limit);
    for (const Column& c : s.columns) {
      if (c.hypothesis >= 0 || c.norm2 <= 0 || c.T < s.limit) continue;
      double share[kChains] = {};
      share[static_cast<int>(c.chain)] = 1;
      consider(c.score * c.score / c.norm2, share, c.name, true);
    }
    gate.material = gate.size >= options_.material;
    return gate;
  }

  static bool significant(const Screened& c, const Screen& s) {
    return c.T >= s.limit || c.rare_z >= s.rare_limit;
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
      if (std::any_of(found_.added.begin(), found_.added.end(),
                      [&](int a) { return library_.hypotheses[static_cast<std::size_t>(a)].id() == h.id(); }))
        continue;
      if (++per_id[h.id()] > 3) continue;
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

  /// A shape at the end of its range is the simpler effect that it turns into there; a width of few steps of the encoder is none.
  bool is_limit_case(const Trial& t) const {
    const Hypothesis& h = library_.hypotheses[static_cast<std::size_t>(t.hypothesis)];
    for (int i = 0; i < h.info().parameter_count; ++i) {
      const auto k = static_cast<std::size_t>(i);
      const auto& parameter = h.info().parameters[i];
      if (!h.free[k] || std::isfinite(parameter.null_value)) continue;
      // The loss is flat there: a tenth is near enough.
      const double low = h.lower[k] + 0.1 * std::abs(h.lower[k]),
                   high = h.upper[k] - 0.1 * std::abs(h.upper[k]);
      if (t.values[k] <= low || t.values[k] >= high) return true;
      if (h.dry && std::string_view(parameter.unit) == "rad" && t.values[k] < 3 * data_.rig.angle_step)
        return true;
    }
    return false;
  }

  /// Best first; those that cannot be ruled out are marked; general cases of a simpler one in the set are dropped, and among twins
  /// the one of fewer parameters stands first.
  void rank(std::vector<Trial>& trials, double unit) const {
    if (trials.empty()) return;
    const auto penalised = [&](const Trial& t) { return t.loss + 2 * unit * parameters_of(t); };
    std::stable_sort(trials.begin(), trials.end(),
                     [&](const Trial& a, const Trial& b) { return penalised(a) < penalised(b); });
    // The best reading of an effect speaks for it.
    std::set<std::string> seen;
    std::erase_if(trials, [&](const Trial& t) { return !seen.insert(id_of(t)).second; });
    mark(trials, unit);
    // Parsimony: a simpler case that is not ruled out stands for the general one.
    for (bool changed = true; changed;) {
      changed = false;
      for (std::size_t i = 1; i < trials.size(); ++i) {
        const bool twins = trials[i].behind.separation < kTwinLimit;
        const bool simpler = nests(id_of(trials[0]), id_of(trials[i])) &&
                             (trials[i].behind.t < kNestedLimit || twins || is_limit_case(trials[0]));
        const bool fewer = twins && parameters_of(trials[i]) < parameters_of(trials[0]);
        if (!simpler && !fewer) continue;
        std::rotate(trials.begin(), trials.begin() + static_cast<std::ptrdiff_t>(i),
                    trials.begin() + static_cast<std::ptrdiff_t>(i) + 1);
        mark(trials, unit);
        changed = true;
        break;
      }
    }
    for (Trial& t : trials)
      if (&t != &trials.front() && t.in_set)
        for (const Trial& simple : trials)
          if (simple.in_set && nests(id_of(t), id_of(simple)) &&
              (t.behind.t > -kNestedDoubt || is_limit_case(t)))
            t.in_set = false;
    weigh(trials, unit);
  }

  /// Each against the first.
  void mark(std::vector<Trial>& trials, double unit) const {
    const Trial& best = trials.front();
    for (Trial& t : trials) {
      t.behind = compare(data_, best.residual, t.residual, parameters_of(t) - parameters_of(best), unit);
      t.in_set = &t == &best || cannot_rule_out(t.behind);
      t.material = size_over_floor(data_, found_.weights, found_.floors, t.residual - place_.residual);
    }
  }

  static void weigh(std::vector<Trial>& trials, double unit) {
    double sum = 0;
    for (Trial& t : trials) {
      const double c = std::max(t.behind.unit, unit);
      // Twins are equally likely: what lies between them is less than the data can tell.
      const double behind = t.behind.separation < kTwinLimit ? 0.0 : std::max(0.0, t.behind.delta);
      t.weight = t.in_set ? std::exp(-0.5 * behind / c) : 0.0;
      sum += t.weight;
    }
    for (Trial& t : trials) t.weight /= sum;
  }

  void report(const std::vector<Trial>& trials, double unit) {
    for (const Trial& t : trials) {
      const Trial& best = trials.front();
      const std::string sentence =
          &t == &best ? fmt::format("fits best; closes {:.0f} units of noise, {:.2f} of the floor",
                                    (place_.residual.squaredNorm() - t.loss) / unit, t.material)
          : t.in_set
              ? fmt::format("cannot be told from {} ({:.1f} sigma behind, {:.1f} sigma of data between them)",
                            id_of(best), t.behind.t, t.behind.separation)
              : fmt::format("ruled out: {:.1f} sigma behind {}", t.behind.t, id_of(best));
      found_.notes.push_back({id_of(t), sentence});
      say(id_of(t) + ": " + sentence);
    }
  }

  Step step_here() {
    Step step;
    step.screen = screen_here();
    step.gate = gate_of(step.screen);
    if (!step.gate.significant || !step.gate.material) return step;
    step.trials = refit_all(shortlist(step.screen));
    std::set<std::string> unphysical;
    std::erase_if(step.trials, [&](const Trial& t) {
      const bool wrong = is_unphysical(t);
      if (wrong) unphysical.insert(id_of(t));
      return wrong;
    });
    if (!unphysical.empty()) step.gate = gate_of(step.screen, unphysical);
    rank(step.trials, step.screen.noise_unit);
    // What shows in a few blocks only is as large as its refit says, not as its linear response promised.
    const double refitted = step.trials.empty() ? 0.0 : step.trials.front().material;
    step.gate.material = std::max(step.gate.dense_size, refitted) >= options_.material;
    return step;
  }

  /// An amplitude at the end of its plausible range closes a gap for the wrong reason.
  bool is_unphysical(const Trial& t) {
    const Hypothesis& h = library_.hypotheses[static_cast<std::size_t>(t.hypothesis)];
    for (int i = 0; i < h.info().parameter_count; ++i) {
      const auto k = static_cast<std::size_t>(i);
      const double null = h.info().parameters[i].null_value, margin = 1e-6 * (h.upper[k] - h.lower[k]);
      if (!h.free[k] || !h.amplitude[k]) continue;
      const bool at_end = (t.values[k] <= h.lower[k] + margin && h.lower[k] != null) ||
                          (t.values[k] >= h.upper[k] - margin && h.upper[k] != null);
      if (!at_end) continue;
      const std::string sentence =
          fmt::format("ruled out: needs {} at the end of its plausible range", h.info().parameters[i].name);
      found_.notes.push_back({h.id(), sentence});
      say(h.id() + ": " + sentence);
      return true;
    }
    return false;
  }

  Active active_of(const Trial& t) const {
    Active a;
    a.hypothesis = &library_.hypotheses[static_cast<std::size_t>(t.hypothesis)];
    a.values = t.values;
    return a;
  }

  void forward() {
    double first_size = 0;
    for (;;) {
      Step step = step_here();
      if (found_.steps.empty()) found_.gate = step.gate;
      const bool open = step.gate.significant && step.gate.material &&
                        (found_.added.empty() || step.gate.size >= kSmallRemainder * first_size);
      say(open ? fmt::format("{} is missing: p = {:.2g}, {:.2f} of the noise floor, most like {} ({} blocks "
                             "of {:.1f} s)",
                             found_.added.empty() ? "something" : "something more", step.gate.p_value,
                             step.gate.size, step.gate.what, data_.blocks, data_.block_seconds)
               : fmt::format("nothing {} is left: p = {:.2g}, {:.2f} of the noise floor",
                             step.gate.significant ? "material" : "significant", step.gate.p_value,
                             step.gate.size));
      report(step.trials, step.screen.noise_unit);
      found_.adequate = !open;
      if (open && found_.added.size() == 1 && another_leaves_nothing()) return;
      bool take =
          open && !step.trials.empty() && static_cast<int>(found_.added.size()) < options_.most_effects;
      if (take) {
        const double size = step.trials.front().material;
        take = size >= options_.material;
        // What is left over after a good name is small; a remainder that needs another name must be as clear as the first,
        // or the first was only like the truth.
        if (take && !found_.added.empty())
          take = size >= kSecondOfFirst * first_size && size >= kSecondOfFloor;
        if (take && found_.added.empty()) first_size = size;
      }
      found_.steps.push_back(std::move(step));
      if (!take) return;
      const Trial& best = found_.steps.back().trials.front();
      found_.added.push_back(best.hypothesis);
      move_to(refit(predictor_, found_.model, {active_of(best)}, found_.weights, 6));
    }
  }

  /// The effect that stood first leaves something over: one of its rivals that leaves nothing takes its place.
  bool another_leaves_nothing() {
    std::vector<Trial>& trials = found_.steps.front().trials;
    const Fit kept = found_.model;
    const std::string first = id_of(trials.front());
    int tried = 0;
    for (std::size_t i = 1; i < trials.size() && tried < 3; ++i) {
      if (!cannot_rule_out(trials[i].behind) && !nests(id_of(trials[i]), first)) continue;
      ++tried;
      found_.added.back() = trials[i].hypothesis;
      move_to(refit(predictor_, found_.baseline, {active_of(trials[i])}, found_.weights, 6));
      Step rest = step_here();
      if (rest.gate.significant && rest.gate.material &&
          rest.gate.size >= kSmallRemainder * trials[i].material)
        continue;
      say(fmt::format("{} leaves nothing, {} does: it takes its place", id_of(trials[i]), first));
      std::rotate(trials.begin(), trials.begin() + static_cast<std::ptrdiff_t>(i),
                  trials.begin() + static_cast<std::ptrdiff_t>(i) + 1);
      const double unit = found_.steps.front().screen.noise_unit;
      mark(trials, unit);
      for (Trial& t : trials)
        if (id_of(t) == first) t.in_set = false;
      weigh(trials, unit);
      found_.steps.push_back(std::move(rest));
      found_.adequate = true;
      return true;
    }
    found_.added.back() = trials.front().hypothesis;
    move_to(kept);
    return false;
  }

  Fit with(const std::vector<Trial>& effects) const {
    std::vector<Active> active;
    for (const Trial& t : effects) active.push_back(active_of(t));
    return active.empty() ? found_.baseline : refit(predictor_, found_.baseline, active, found_.weights, 6);
  }

  /// Each effect is given up once, with the others in place: another may do better, or nothing may be missed.
  void swap_and_drop() {
    std::vector<Trial> chosen;
    for (std::size_t i = 0; i < found_.added.size(); ++i) chosen.push_back(found_.steps[i].trials.front());
    Step last = std::move(found_.steps.back());
    std::vector<Step> steps;
    bool changed = false;
    for (std::size_t i = 0; i < chosen.size();) {
      std::vector<Trial> others = chosen;
      others.erase(others.begin() + static_cast<std::ptrdiff_t>(i));
      found_.added.clear();
      for (const Trial& t : others) found_.added.push_back(t.hypothesis);
      move_to(with(others));
      Step step = step_here();
      if (step.trials.empty()) {
        say(fmt::format("{} is not missed when it is dropped", id_of(chosen[i])));
        chosen = others;
        changed = true;
        continue;
      }
      if (id_of(step.trials.front()) != id_of(chosen[i])) {
        say(fmt::format("{} does better in place of {}", id_of(step.trials.front()), id_of(chosen[i])));
        changed = true;
      }
      chosen[i] = step.trials.front();
      steps.push_back(std::move(step));
      ++i;
    }
    found_.added.clear();
    for (const Trial& t : chosen) found_.added.push_back(t.hypothesis);
    move_to(with(chosen));
    if (changed) {
      last = step_here();
      const double first =
          steps.empty() || steps.front().trials.empty() ? 0.0 : steps.front().trials.front().material;
      found_.adequate =
          !(last.gate.significant && last.gate.material && last.gate.size >= kSmallRemainder * first);
    }
    steps.push_back(std::move(last));
    found_.steps = std::move(steps);
  }

  const Predictor& predictor_;
  Library& library_;
  Prepared& data_;
  const ExplainOptions& options_;
  Found found_;
  Around place_;  ///< of found_.model
  std::size_t rows_[kChains] = {};
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

Found search(const Predictor& predictor, Library& library, Prepared& data, const ExplainOptions& options) {
  return Search(predictor, library, data, options).run();
}

}  // namespace isac::explain
