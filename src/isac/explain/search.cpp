#include "isac/explain/search.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <thread>

#include "isac/explain/gate.hpp"
#include "isac/explain/generic_fit.hpp"
#include "isac/explain/plausible.hpp"
#include "isac/series/statistics.hpp"

namespace isac::explain {
namespace {

constexpr std::size_t kShortlist = 9;
constexpr std::size_t kContenders = 16;   // of each screen
constexpr double kWorthRefitting = 0.25;  // of the best linear gain: a candidate below it is not refitted…
constexpr double kWorthRefittingUnits = 12;  // …unless it still is this many units of noise
constexpr double kLargeForSure =
    25;  // units of noise, five sigma: whoever is so large and not found has too few blocks
constexpr double kThreeSigma = 9;  // units of noise
constexpr double kMinimumBlocks = 24;
constexpr double kConvention = 0.12;  // relative
constexpr double kWorthALook = 0.5;   // of what is material: a refit may be larger than the linear response
constexpr double kKeptPromise = 0.1;  // of the linear gain
constexpr double kSmallRemainder = 0.2;  // of the largest effect's size: less does not cast doubt on its name
constexpr double kHardlyAnything =
    0.01;  // of the units of noise that an effect closed: its equation and the noise's model are no truer
constexpr double kBeaten = 1.645;   // sigma, by functions without a name
constexpr double kDoubtful = 0.02;  // p of what a named model leaves over: one right name in fifty has it
// Of the first effect's size: an equation that is so nearly right is right. Noise of pressures is quick, noise of forces slow: less of it is noise.
constexpr double kWorthDoubting = 0.17, kWorthDoubtingOfPressure = 0.03;
constexpr double kSecondOfFirst = 0.35, kSecondOfFloor = 0.35;

class Search {
 public:
  Search(const Predictor& predictor, Library& library, Prepared& data, const ExplainOptions& options,
         const Look& look)
      : predictor_(predictor),
        library_(library),
        data_(data),
        options_(options),
        look_(look),
        gate_(data, library, options.significance, options.material),
        ranking_(data, library),
        plausible_(data) {}

  Found run() {
    found_.floors = floors_of(data_);
    first_weights();
    found_.baseline = fit_baseline(predictor_, library_.tolerances, found_.weights);
    reweight(data_, found_.baseline, found_.weights);
    found_.baseline = fit_baseline(predictor_, library_.tolerances, found_.weights);
    choose_blocks(found_.baseline.residual);
    say(fmt::format("baseline fitted to {} rows of {} runs", data_.rows.size(), data_.runs.size()));
    place_slip(library_, data_, found_.baseline.residual);
    move_to(found_.baseline);
    take_colour(place_.residual);
    if (!found_.wants_torque_of_free_runs) forward();
    if (found_.wants_torque_of_free_runs || found_.worth_another_look) return std::move(found_);
    if (found_.added.size() > 1) swap_and_drop();
    if (found_.adequate && !found_.added.empty()) hold_against_functions();
    look_at_remainder();
    if (found_.adequate) leave_half_a_step();
    if (!found_.added.empty()) found_.model = polished(predictor_, std::move(found_.model), found_.weights);
    add_slow_part(noise_of_what_is_left(), found_.floors);
    return std::move(found_);
  }

 private:
  void say(const std::string& line) const {
    if (options_.progress) options_.progress(line);
  }

  bool touches_pressures() const {
    return std::any_of(found_.added.begin(), found_.added.end(), [&](int h) {
      return (library_.hypotheses[static_cast<std::size_t>(h)].chains & kPressureChains) != 0;
    });
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
            .significance = options_.significance,
            .seed = options_.seed,
            .threads = options_.threads,
            .dictionary = true,
            .only = asked_for_};
  }

  /// What stood anywhere near the top while effects were added: what may take the place of one of them.
  std::set<std::string> contenders() const {
    std::set<std::string> ids;
    for (const Step& step : found_.steps) {
      for (const Trial& t : step.trials) ids.insert(ranking_.id_of(t));
      for (std::size_t i = 0; i < std::min(kContenders, step.screen.candidates.size()); ++i)
        ids.insert(library_.hypotheses[static_cast<std::size_t>(step.screen.candidates[i].hypothesis)].id());
    }
    return ids;
  }

  void move_to(const Fit& fit) {
    found_.model = fit;
    place_ = around(predictor_, found_.model, found_.weights);
  }

  /// Everything is fitted anew beside the noise's slow part, read off what is left over (r/σ).
  void take_colour(const Eigen::VectorXd& left_over) {
    take_colours(data_, beside_generic_functions(data_, left_over), found_.weights);
    found_.wants_torque_of_free_runs = found_.weights.colour[static_cast<int>(Chain::kTorque)].wander > 0 &&
                                       can_add_torque_of_free_runs(data_);
    responses_.forget();
    found_.baseline = fit_baseline(predictor_, library_.tolerances, found_.weights);
    move_to(found_.baseline);
  }

  /// The noise's colour once more, from what an adequate model leaves: as it was found beside generic functions it holds some of the effect.
  Weights noise_of_what_is_left() const {
    Weights left = found_.weights;
    if (!found_.adequate) return left;
    const Eigen::VectorXd plain = unfiltered(data_, found_.weights, found_.model.residual);
    for (int c = 0; c < kChains; ++c)
      if (data_.has(static_cast<Chain>(c))) left.colour[c] = colour_of(data_, plain, static_cast<Chain>(c));
    return left;
  }

  /// Blocks must be longer than the noise remembers, not than a missing effect does: their length is taken from what the best
  /// candidate leaves over. So is the yardstick of one that few blocks carry.
  Screen screen_here() {
    choose_blocks(place_.residual);
    Screen s = screen(place_, library_, screen_options(), &responses_);
    if (s.candidates.empty() || s.candidates.front().gain <= 0) return s;
    const Screened first = s.candidates.front();
    const double before = data_.block_seconds;
    const std::vector<Trial> best = refit_all({first});
    choose_blocks(best.front().residual);
    if (data_.block_seconds > before) cut_blocks(data_, before);
    const bool large_and_not_found = !is_significant(first, s) && first.gain > kLargeForSure * s.noise_unit;
    if (large_and_not_found && found_.added.empty() && !colour_beside_best_) {
      // Too little is left of it in the other blocks, or the noise was taken for as slow as the effect is.
      colour_beside_best_ = true;
      take_colour(unfiltered(data_, found_.weights, best.front().residual));
      return found_.wants_torque_of_free_runs ? s : screen_here();
    }
    if (large_and_not_found) {
      judge(s, data_, library_, screen_options(),
            yardstick_beside(s, data_, responses_, first.hypothesis, best.front().residual));
    } else if (data_.block_seconds < before) {
      judge(s, data_, library_, screen_options());
    }
    return s;
  }

  Gate gate_of(const Screen& s, const std::set<std::string>& ignored = {}) const {
    return gate_.judge(s, found_.weights, found_.floors, !found_.added.empty(), ignored);
  }

  std::vector<Screened> shortlist(const Screen& s) const {
    std::vector<Screened> list;
    std::map<std::string, int> per_id;
    std::optional<Screened> slip;
    if (s.candidates.empty()) return list;
    const double best = s.candidates.front().gain;
    for (const Screened& c : s.candidates) {
      if (c.gain <= 0) break;
      if (list.size() >= kShortlist) break;
      if (!is_significant(c, s) && c.gain < 0.5 * best) continue;
      if (c.gain < kWorthRefitting * best && c.gain < kWorthRefittingUnits * s.noise_unit) break;
      if (c.gain < 0.15 * best && list.size() >= 4) break;
      const Hypothesis& h = library_.hypotheses[static_cast<std::size_t>(c.hypothesis)];
      if (std::any_of(found_.added.begin(), found_.added.end(),
                      [&](int a) { return library_.hypotheses[static_cast<std::size_t>(a)].id() == h.id(); }))
        continue;
      if (++per_id[h.id()] > 3) continue;
      list.push_back(c);
      if (h.id() == "encoder_slip") slip = c;
    }
    if (slip) add_other_moments(*slip, s, list);
    return list;
  }

  /// The moment of a slip is not refined: those whose linear response does nearly as well are tried as well.
  static void add_other_moments(const Screened& best, const Screen& s, std::vector<Screened>& list) {
    constexpr double kNearlyAsWell = 0.6;  // of the gain
    for (const Screened& other : s.shapes)
      if (other.hypothesis == best.hypothesis && other.shape != best.shape &&
          other.gain > kNearlyAsWell * best.gain)
        list.push_back(other);
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
        trials[i].material =
            size_over_floor(data_, found_.weights, found_.floors, trials[i].residual - place_.residual);
      }
    };
    std::vector<std::thread> pool;
    for (int t = 1; t < options_.threads; ++t) pool.emplace_back(work);
    work();
    for (std::thread& thread : pool) thread.join();
    return trials;
  }

  void report(const std::vector<Trial>& trials) {
    for (const Trial& t : trials) {
      const Trial& best = trials.front();
      const std::string sentence =
          &t == &best ? fmt::format("fits best; closes {:.0f} units of noise, {:.2f} of the floor",
                                    units_closed(t), t.material)
          : t.in_set
              ? fmt::format("cannot be told from {} ({:.1f} sigma behind, {:.1f} sigma of data between them)",
                            ranking_.id_of(best), t.behind.t, t.behind.separation)
              : fmt::format("ruled out: {:.1f} sigma behind {}", t.behind.t, ranking_.id_of(best));
      found_.notes.push_back({ranking_.id_of(t), sentence});
      say(ranking_.id_of(t) + ": " + sentence);
    }
  }

  /// Functions without a name show at least this much of the floor, whatever refits say of the effects.
  bool is_open_at_least(const Step& step, double size) const {
    std::set<std::string> every;
    for (const Hypothesis& h : library_.hypotheses) every.insert(h.id());
    const Gate nameless = gate_of(step.screen, every);
    return step.gate.significant && nameless.dense_size >= std::max(options_.material, size);
  }

  Step screened_step() {
    Step step;
    step.screen = screen_here();
    step.gate = gate_of(step.screen);
    return step;
  }

  Step step_here() { return refitted(screened_step()); }

  Step refitted(Step step) {
    const double least =
        std::max(options_.material, found_.added.empty() ? 0.0 : kSmallRemainder * largest_size_);
    if (!step.gate.significant || step.gate.size < kWorthALook * least) return step;
    step.trials = refit_all(shortlist(step.screen));
    std::set<std::string> ignored;
    std::erase_if(step.trials, [&](const Trial& t) {
      const bool wrong = is_implausible(t) || is_empty_promise(t, step.screen);
      if (wrong) ignored.insert(ranking_.id_of(t));
      return wrong;
    });
    if (!ignored.empty()) step.gate = gate_of(step.screen, ignored);
    ranking_.rank(step.trials, place_.residual);
    // What shows in a few blocks only is as large as its refit says, not as its linear response promised.
    const double refitted = step.trials.empty() ? 0.0 : step.trials.front().material;
    step.gate.material = std::max(step.gate.dense_size, refitted) >= options_.material;
    leave_to_slow_noise(step);
    return step;
  }

  /// What blocks agree on may still be no more than the noise's own model makes of the best of so many, where that noise is slow. (A first
  /// effect is given the benefit of three sigma: that noise is a model.)
  void leave_to_slow_noise(Step& step) {
    if (step.trials.empty()) return;
    const double units = units_left(step), sigma = std::sqrt(std::max(0.0, units));
    const double best_of_many =
        std::min(1.0, static_cast<double>(step.screen.candidates.size()) * std::erfc(sigma / std::sqrt(2.0)));
    if (found_.added.empty() ? units >= kThreeSigma : best_of_many <= options_.significance) return;
    step.gate.significant = false;
    step.gate.p_value = std::max(step.gate.p_value, best_of_many);
    const std::string id = ranking_.id_of(step.trials.front());
    const std::string sentence = fmt::format(
        "ruled out: {:.1f} sigma, no more than noise as slow as this makes of the best of so many", sigma);
    found_.notes.push_back({id, sentence});
    say(id + ": " + sentence);
  }

  /// What functions without a name close, by the noise's own model: an effect that no name is like is no noise for that.
  double units_of_functions(const Step& step) const {
    const GenericFit generic = fit_generic(place_, step.screen);
    if (generic.functions.empty()) return 0;
    const double unit =
        compare(data_, generic.residual, place_.residual, 0, noise_density(data_, generic.residual)).unit;
    return generic.gain / unit - 2.0 * kChoosingOne * static_cast<double>(generic.functions.size());
  }

  bool is_implausible(const Trial& t) {
    const Hypothesis& h = library_.hypotheses[static_cast<std::size_t>(t.hypothesis)];
    const std::string objection = plausible_.objection(h, t.values);
    if (objection.empty()) return false;
    found_.notes.push_back({h.id(), "ruled out: " + objection});
    say(h.id() + ": ruled out: " + objection);
    return true;
  }

  /// A response at a finite size that no size of the effect keeps: it was the curvature of noise.
  bool is_empty_promise(const Trial& t, const Screen& s) const {
    for (const Screened& c : s.candidates)
      if (c.hypothesis == t.hypothesis) return place_.residual.squaredNorm() - t.loss < kKeptPromise * c.gain;
    return false;
  }

  Active active_of(const Trial& t) const {
    Active a;
    a.hypothesis = &library_.hypotheses[static_cast<std::size_t>(t.hypothesis)];
    a.values = t.values;
    return a;
  }

  void forward() {
    first_size_ = largest_size_ = largest_units_ = 0;
    for (;;) {
      const bool narrow = !found_.added.empty() && !look_.contenders.empty();
      if (narrow) asked_for_ = look_.contenders;
      Step step = step_here();
      asked_for_.reset();
      if (found_.wants_torque_of_free_runs) return;
      if (narrow && !is_open(step)) step = step_here();
      if (found_.steps.empty()) found_.gate = step.gate;
      const bool open = is_open(step);
      say(open ? fmt::format("{} is missing: p = {:.2g}, {:.2f} of the noise floor, most like {} ({} blocks "
                             "of {:.1f} s)",
                             found_.added.empty() ? "something" : "something more", step.gate.p_value,
                             step.gate.size, step.gate.what, data_.blocks, data_.block_seconds)
               : fmt::format("nothing {} is left: p = {:.2g}, {:.2f} of the noise floor",
                             step.gate.significant ? "material" : "significant", step.gate.p_value,
                             step.gate.size));
      report(step.trials);
      found_.adequate = !open;
      if (open && found_.added.empty() && is_convention(step)) continue;
      if (open && is_within_a_step(step) && leave_half_a_step()) continue;
      if (open && found_.added.size() == 1 && another_leaves_nothing()) return;
      bool take =
          open && !step.trials.empty() && static_cast<int>(found_.added.size()) < options_.most_effects;
      if (take) {
        const double size = step.trials.front().material;
        take = size >= options_.material;
        if (take && !found_.added.empty()) take = is_clear_enough(size);
        if (take && found_.added.empty()) first_size_ = size;
        if (take) {
          largest_size_ = std::max(largest_size_, size);
          largest_units_ = std::max(largest_units_, units_closed(step.trials.front()));
        }
      }
      if (open && !take && found_.added.size() == 1 && a_rival_goes_better_with(step)) continue;
      found_.steps.push_back(std::move(step));
      if (take) {
        const Trial& best = found_.steps.back().trials.front();
        found_.added.push_back(best.hypothesis);
        move_to(refit(predictor_, found_.model, {active_of(best)}, found_.weights, 6));
      }
      // A valve's effect was added, and it is not all that is missing.
      if (look_.provisional && touches_pressures() && (found_.added.size() > 1 || (!take && open))) {
        found_.worth_another_look = true;
        found_.contenders = contenders();
        return;
      }
      if (!take) return;
    }
  }

  double units_closed(const Trial& t) const {
    return (place_.residual.squaredNorm() - t.loss) /
           compare(data_, t.residual, place_.residual, 0, noise_density(data_, t.residual)).unit;
  }

  bool is_open(const Step& step) const {
    return step.gate.significant && step.gate.material &&
           (found_.added.empty() ||
            ((step.gate.size >= kSmallRemainder * largest_size_ || is_worth_a_second_name(step)) &&
             units_left(step) >= kHardlyAnything * largest_units_));
  }

  /// What a name or functions without one can still close.
  double units_left(const Step& step) const {
    return std::max(step.trials.empty() ? 0.0 : units_closed(step.trials.front()), units_of_functions(step));
  }

  /// Beside a wrong share of the first, a second effect shows little until both are refitted.
  bool is_worth_a_second_name(const Step& step) const {
    return !step.trials.empty() && is_clear_enough(step.trials.front().material) &&
           units_closed(step.trials.front()) > kLargeForSure;
  }

  /// What is left over after a good name is small; a remainder that needs another name must be as clear as the first, or the first was
  /// only like the truth.
  bool is_clear_enough(double size) const {
    return size >= std::max(kSecondOfFirst * first_size_, kSecondOfFloor);
  }

  /// How a recorder counts is no effect: an encoder that is read at the lower end of its steps stands half a step off, a command that
  /// is written before or after its sample half a sample or one. Such a value becomes a tolerance, and the search begins anew.
  bool is_convention(const Step& step) {
    const auto near = [](double share, double convention) {
      return std::abs(share - convention) < kConvention * convention;
    };
    for (const Trial& t : step.trials) {
      if (!t.in_set) continue;
      const std::string id = ranking_.id_of(t);
      const double step_angle = data_.rig.angle_step, interval = data_.runs.front().interval;
      // Once: what lies beyond a tolerance that is there already is an effect, however near.
      if (std::any_of(library_.tolerances.begin(), library_.tolerances.end(),
                      [&](const Hypothesis& h) { return h.id() == id && h.upper[0] > 0; }))
        continue;
      if (id == "encoder_offset" && near(std::abs(t.values[0]) / step_angle, 0.5)) {
        tolerate(library_, data_, id, -0.5 * step_angle, 0.5 * step_angle);
      } else if (id == "dead_time" &&
                 (near(t.values[0] / interval, 0.5) || near(t.values[0] / interval, 1))) {
        tolerate(library_, data_, id, -interval, interval);
      } else {
        continue;
      }
      say(fmt::format("{} of {:.3g}: how the recorder counts, not an effect", id, t.values[0]));
      found_.baseline = fit_baseline(predictor_, library_.tolerances, found_.weights);
      move_to(found_.baseline);
      return true;
    }
    return false;
  }

  /// Names that functions without one beat are only like the truth, though they leave nothing that a whole search would find.
  void hold_against_functions() {
    const Around baseline = around(predictor_, found_.baseline, found_.weights);
    const GenericFit generic = fit_generic(baseline, found_.steps.front().screen);
    if (generic.functions.empty()) return;
    std::string names;
    int parameters = 0;
    for (std::size_t i = 0; i < found_.added.size(); ++i) {
      const Trial& named = found_.steps[i].trials.front();
      names += (i > 0 ? " and " : "") + ranking_.id_of(named);
      // Of those beyond the first, each was the best of many as well.
      parameters += ranking_.parameters_of(named) + (i > 0 ? kChoosingOne : 0);
    }
    const Eigen::VectorXd left = found_.added.size() == 1 ? found_.steps.front().trials.front().residual
                                                          : baseline.project(found_.model.residual);
    const Comparison behind = behind_generic(data_, left, parameters, generic);
    if (generic.functions.size() < found_.added.size() && behind.separation < kTwinLimit)
      found_.doubts.push_back(fmt::format(
          "Together they do no more than one function without a name ({:.1f} sigma of data between them): it "
          "may be one thing, and neither of them.",
          behind.separation));
    if (behind.t < kBeaten || behind.separation < kTwinLimit) {
      say(fmt::format("{}: functions without a name are {:.1f} sigma {} ({:.1f} sigma of data between them)",
                      names, std::abs(behind.t), behind.t > 0 ? "ahead" : "behind", behind.separation));
      return;
    }
    const std::string sentence =
        fmt::format("ruled out: {:.1f} sigma behind functions that have no name", behind.t);
    for (std::size_t i = 0; i < found_.added.size(); ++i)
      found_.notes.push_back({ranking_.id_of(found_.steps[i].trials.front()), sentence});
    say(names + ": " + sentence);
    found_.adequate = false;
  }

  /// What an adequate model leaves over by chance alone is seldom as unlikely as this, however little it be.
  void look_at_remainder() {
    if (!found_.adequate || found_.added.empty() || found_.steps.size() <= found_.added.size()) return;
    const double p = found_.steps.back().gate.p_value;
    const Gatekeeper::Sized left =
        gate_.most_significant(found_.steps.back().screen, found_.weights, found_.floors);
    const bool pressure = (bit(left.chain) & kPressureChains) != 0;
    if (p > kDoubtful || left.size < (pressure ? kWorthDoubtingOfPressure : kWorthDoubting) * first_size_)
      return;
    found_.doubts.push_back(
        fmt::format("What is left over beside it noise has on one day in {:.0f}: {:.2f} of the noise floor.",
                    1 / p, left.size));
    say(found_.doubts.back());
  }

  /// Beside an effect, an offset of less than half a step is how the encoder is read.
  bool is_within_a_step(const Step& step) const {
    return !found_.added.empty() && std::any_of(step.trials.begin(), step.trials.end(), [&](const Trial& t) {
      return t.in_set && ranking_.id_of(t) == "encoder_offset" &&
             std::abs(t.values[0]) < 0.5 * data_.rig.angle_step;
    });
  }

  /// How an encoder is read within its step stays unknown where nothing told: what was found is refitted beside half a step of the zero,
  /// so that its numbers and their intervals know it. (An offset itself would lose half a step to it.)
  bool leave_half_a_step() {
    if (found_.added.empty() || !std::isfinite(data_.rig.angle_step) || !data_.baseline.terms.empty())
      return false;
    std::vector<Active> effects(
        found_.model.model.effects.begin() + static_cast<std::ptrdiff_t>(found_.model.tolerances),
        found_.model.model.effects.end());
    const bool an_offset = std::any_of(effects.begin(), effects.end(), [](const Active& a) {
      const std::string id = a.hypothesis->id();
      return id == "encoder_offset" || id == "torque_offset";
    });
    const bool there =
        std::any_of(library_.tolerances.begin(), library_.tolerances.end(),
                    [](const Hypothesis& h) { return h.id() == "encoder_offset" && h.upper[0] > 0; });
    if (an_offset || there || library_.tolerances.size() + 1 > library_.tolerances.capacity()) return false;
    tolerate(library_, data_, "encoder_offset", -0.5 * data_.rig.angle_step, 0.5 * data_.rig.angle_step);
    const Fit base = fit_baseline(predictor_, library_.tolerances, found_.weights);
    move_to(refit(predictor_, base, effects, found_.weights, 8));
    return true;
  }

  /// The effect that stood first leaves something over: one of its rivals that leaves nothing takes its place.
  bool another_leaves_nothing() {
    std::vector<Trial>& trials = found_.steps.front().trials;
    const Fit kept = found_.model;
    const std::string first = ranking_.id_of(trials.front());
    int tried = 0;
    for (std::size_t i = 1; i < trials.size() && tried < 3; ++i) {
      if (!cannot_rule_out(trials[i].behind) && !nests(ranking_.id_of(trials[i]), first)) continue;
      ++tried;
      found_.added.back() = trials[i].hypothesis;
      move_to(refit(predictor_, found_.baseline, {active_of(trials[i])}, found_.weights, 6));
      const double large = kSmallRemainder * trials[i].material;
      asked_for_.emplace();  // functions without a name, which cost next to nothing, often say it already
      const Step nameless = screened_step();
      asked_for_.reset();
      if (is_open_at_least(nameless, large)) continue;
      Step rest = screened_step();
      if (is_open_at_least(rest, large)) continue;
      rest = refitted(std::move(rest));
      if (rest.gate.significant && rest.gate.material && rest.gate.size >= large) continue;
      say(fmt::format("{} leaves nothing, {} does: it takes its place", ranking_.id_of(trials[i]), first));
      put_first(i);
      found_.steps.push_back(std::move(rest));
      found_.adequate = true;
      return true;
    }
    found_.added.back() = trials.front().hypothesis;
    move_to(kept);
    return false;
  }

  /// The effect that stood first leaves too little for a second name and too much for none: one of its rivals, which fitted nearly as well
  /// alone, may fit better with that second one, and leave it larger. It takes the place of the first.
  bool a_rival_goes_better_with(const Step& step) {
    if (a_rival_was_tried_ || step.trials.empty()) return false;
    a_rival_was_tried_ = true;
    std::vector<Trial>& trials = found_.steps.front().trials;
    const Trial& second = step.trials.front();
    const auto loss_of = [&](const Trial& first) { return with({first, second}).loss; };
    double least = loss_of(trials.front()) - kThreeSigma * step.screen.noise_unit;
    std::size_t best = 0, tried = 0;
    for (std::size_t i = 1; i < trials.size() && tried < 3; ++i) {
      if (!cannot_rule_out(trials[i].behind) || ranking_.id_of(trials[i]) == ranking_.id_of(second)) continue;
      ++tried;
      const double loss = loss_of(trials[i]);
      if (loss >= least) continue;
      least = loss;
      best = i;
    }
    if (best == 0) return false;
    say(fmt::format("{} goes better with {} than {} does: it takes its place", ranking_.id_of(trials[best]),
                    ranking_.id_of(second), ranking_.id_of(trials.front())));
    put_first(best);
    found_.added.back() = trials.front().hypothesis;
    first_size_ = largest_size_ = trials.front().material;
    move_to(with({trials.front()}));
    return true;
  }

  /// Of the first step's trials this one is taken; what stood first is ruled out.
  void put_first(std::size_t i) {
    std::vector<Trial>& trials = found_.steps.front().trials;
    const std::string first = ranking_.id_of(trials.front());
    std::rotate(trials.begin(), trials.begin() + static_cast<std::ptrdiff_t>(i),
                trials.begin() + static_cast<std::ptrdiff_t>(i) + 1);
    ranking_.mark(trials);
    for (Trial& t : trials)
      if (ranking_.id_of(t) == first) t.in_set = false;
    Ranking::weigh(trials);
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
    asked_for_ = contenders();
    for (std::size_t i = 0; i < chosen.size();) {
      if (!changed && i + 1 == chosen.size()) {  // beside all before it: so it was added
        steps.push_back(std::move(found_.steps[i]));
        break;
      }
      std::vector<Trial> others = chosen;
      others.erase(others.begin() + static_cast<std::ptrdiff_t>(i));
      found_.added.clear();
      for (const Trial& t : others) found_.added.push_back(t.hypothesis);
      move_to(with(others));
      Step step = step_here();
      if (step.trials.empty()) {
        say(fmt::format("{} is not missed when it is dropped", ranking_.id_of(chosen[i])));
        chosen = others;
        changed = true;
        continue;
      }
      if (ranking_.id_of(step.trials.front()) != ranking_.id_of(chosen[i])) {
        say(fmt::format("{} does better in place of {}", ranking_.id_of(step.trials.front()),
                        ranking_.id_of(chosen[i])));
        changed = true;
      }
      chosen[i] = step.trials.front();
      step.screen = std::move(found_.steps[steps.size()].screen);  // of everything that was looked for
      steps.push_back(std::move(step));
      ++i;
    }
    asked_for_.reset();
    found_.added.clear();
    for (const Trial& t : chosen) found_.added.push_back(t.hypothesis);
    move_to(with(chosen));
    if (changed) {
      last = step_here();
      double largest = 0;
      for (const Trial& t : chosen) largest = std::max(largest, t.material);
      found_.adequate =
          !(last.gate.significant && last.gate.material && last.gate.size >= kSmallRemainder * largest);
    }
    steps.push_back(std::move(last));
    found_.steps = std::move(steps);
  }

  const Predictor& predictor_;
  Library& library_;
  Prepared& data_;
  const ExplainOptions& options_;
  const Look& look_;
  Gatekeeper gate_;
  Ranking ranking_;
  Plausible plausible_;
  Found found_;
  Around place_;                                    ///< of found_.model
  std::optional<std::set<std::string>> asked_for_;  ///< ids; none: all
  Responses responses_;
  double first_size_ = 0;  ///< of the first effect, over the floor
  double largest_size_ =
      0;  ///< of all that were added: what is left is held against the largest, whose equation is only nearly right
  double largest_units_ = 0;  ///< of noise that one of them closed
  bool a_rival_was_tried_ = false;
  bool colour_beside_best_ = false;  ///< the noise's colour was read off once more, beside the best candidate
};

}  // namespace

Found search(const Predictor& predictor, Library& library, Prepared& data, const ExplainOptions& options,
             const Look& look) {
  return Search(predictor, library, data, options, look).run();
}

}  // namespace isac::explain
