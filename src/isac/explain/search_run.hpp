/// @file
/// A search while it runs: what it has found so far, where it stands, and its phases, each in a file of its own.
///
///   search.cpp       one effect after another, and what is no effect but how a recorder counts
///   search_step.cpp  one step: blocks and colour of the noise, screen, shortlist, joint refits, what is no finding
///   rivals.cpp       what may take the place of an effect that was added, and what is not missed
///   remainder.cpp    why a name may be none of the catalogue, though nothing significant is left
///
/// For these four files only; everyone else calls search() (search.hpp).
/// Units: sizes in noise floors, gains and losses in weighted squares, "units" of noise as compare() has them. Threads: one search is one
/// thread's; its refits use options.threads. Errors: none. Source: docs/derivations/explain.md.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "isac/explain/colours.hpp"
#include "isac/explain/plausible.hpp"
#include "isac/explain/search.hpp"

namespace isac::explain {

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

  Found run();

 private:
  static constexpr double kLargeForSure =
      25;  ///< units of noise, five sigma: whoever is so large and not found has too few blocks
  static constexpr double kThreeSigma = 9;  ///< units of noise
  static constexpr double kSmallRemainder =
      0.2;  ///< of the largest effect's size: less does not cast doubt on its name
  static constexpr double kSecondOfFirst = 0.35, kSecondOfFloor = 0.35;

  // One effect after another: search.cpp.
  void say(const std::string& line) const {
    if (options_.progress) options_.progress(line);
  }
  bool touches_pressures() const;
  void first_weights();
  /// Of the baseline's residual, or beside what an earlier look found where that one had to.
  void take_first_colour();
  /// What stood anywhere near the top while effects were added: what may take the place of one of them.
  std::set<std::string> contenders() const;
  void report(const std::vector<Trial>& trials);
  void forward();
  /// Steps that a second look, at the torque's pressures, need not take again: what was added, and its rivals, enters rows of the pressures only.
  std::vector<Step> settled_steps() const;
  /// Goes on after the steps that an earlier look settled.
  void take_settled();
  /// Where nothing material was found, something smaller that is there beyond doubt is looked for once more; it stays only with a name that stands.
  bool take_what_is_little();
  bool is_open(const Step& step) const;
  /// Beside a wrong share of the first, a second effect shows little until both are refitted.
  bool is_worth_a_second_name(const Step& step) const;
  /// What is left over after a good name is small; a remainder in the same rows that needs another name must be as clear as the first, or the
  /// first was only like the truth.
  bool is_clear_enough(double size, unsigned chains) const {
    return size >= std::max(leaves_over_in(chains) ? kSecondOfFirst * first_size_ : 0.0, kSecondOfFloor);
  }
  /// Two effects that go against each other leave little of either beside the other: a smaller second is as clear where it closes as much of the
  /// noise's units as no equation's own error does, and nothing is left beside both.
  bool closes_all_that_is_left(const Step& step);
  /// Does what was added enter rows that hang together with these? An equation that is only nearly right leaves nothing over in others: forces
  /// hang together with the motion, and pressures with one another.
  bool leaves_over_in(unsigned chains) const;
  /// What is less beside the largest effect casts no doubt on its name.
  double small_in(Chain chain) const {
    const double small = kSmallRemainder * largest_size_;
    return leaves_over_in(bit(chain)) ? small : std::min(small, kSecondOfFloor);
  }
  unsigned chains_of(const Trial& t) const {
    return library_.hypotheses[static_cast<std::size_t>(t.hypothesis)].chains;
  }
  /// What is left in rows that have nothing to do with those of the name, too little to be named, casts a doubt and takes no name away.
  bool leave_elsewhere(const Step& step);
  /// Nor does what is left in the same rows where it is hardly anything beside what the name closed, less than five sigma.
  void leave_a_little(const Step& step);
  /// Of an effect that a tolerance took its share of, with that share.
  double whole_size(const Trial& t) const;

  // What of a reading the recorder makes: conventions.cpp.
  /// How a recorder counts is no effect: an encoder that is read at the lower end of its steps stands half a step off, a command that
  /// is written before or after its sample half a sample or one. Such a value becomes a tolerance, and the search begins anew.
  bool is_convention(const Step& step);
  /// A skew within half a sample is tolerated, so that it stands for nothing else; where nothing else is missing and the skew is neither hardly
  /// any nor the half sample of a recorder's convention, it is looked for as the effect that it is. What is found in its place stays if it leaves less.
  void doubt_the_clock();
  /// Left over beside dry friction, in runs with slow turns, and less than the friction's own equation tells.
  bool is_blur_of_slow_turns(const Step& step) const;
  /// Beside an effect, an offset of less than half a step may be how the encoder is read; beside one that holds an offset of its own, of less than a step.
  /// In steps; 0: none is asked for.
  double offset_within_a_step(const Step& step) const;
  /// An offset that is left to how the encoder is read may be part of a general case of what was named: a hysteresis that differs by direction is
  /// one that does not and an offset. It stays in the set.
  void keep_what_holds_an_offset();
  /// A counter that gives the step below reads half a step low, which beside an effect is large or small as the noise is: what was found is looked
  /// for anew beside it.
  bool begins_anew_beside_half_a_step(const Step& step);
  /// How an encoder is read within its step stays unknown where nothing told: what was found is refitted beside half a step of the zero,
  /// so that its numbers and their intervals know it. (An offset itself would lose half a step to it.) It stays in the middle of the step unless
  /// the runs tell more; then it is the mean of what they and the step say. A remainder may have `asked_for` it.
  bool leave_half_a_step(bool asked_for);
  [[nodiscard]] bool half_a_step_is_free() const;

  // One step: search_step.cpp; what it takes for noise: search_noise.cpp.
  void choose_blocks(const Eigen::VectorXd& residual);
  ScreenOptions screen_options() const;
  void move_to(const Fit& fit);
  /// Rows without what functions of the measured signals make of them: where the noise's colour is read off.
  Eigen::VectorXd beside_functions(const Eigen::VectorXd& rows) const;
  Cleaned cleaned() const {
    return [this](const Eigen::VectorXd& rows) { return beside_functions(rows); };
  }
  static bool a_zero_wanders(const Weights& weights) {
    return weights.colour[static_cast<int>(Chain::kTorque)].wander > 0;
  }
  /// What is large and missing hides that the sensors' zero wanders: beside it, that zero passes for further effects. The step is taken anew.
  bool a_wandering_zero_was_hidden_by(const Step& step);
  /// And what is missing may look like such a zero where the runs, or the levels within one, differ by it: beside what was found it is none, and the
  /// search begins anew with a zero that stands still.
  bool no_zero_wanders_beside_it();
  /// What is slow and still missing beside a first effect passes for slow noise, which takes from its rows and spoils its blocks: as where nothing
  /// was added yet (screen_here), what is large and not found has the noise's colour read off once more beside it.
  bool slow_noise_hid_another(const Step& step);
  /// The search forgets what it added. Once only.
  void begin_anew_with_noise_of(const Eigen::VectorXd& rows);
  /// Everything is fitted anew beside the noise's slow part, read off what is left over (r/σ).
  void take_colour(const Eigen::VectorXd& left_over);
  /// The noise's colour once more, from what an adequate model leaves: as it was found beside generic functions it holds some of the effect.
  Weights noise_of_what_is_left() const;
  /// Blocks must be longer than the noise remembers, not than a missing effect does: their length is taken from what the best
  /// candidate leaves over. So is the yardstick of one that few blocks carry.
  Screen screen_here();
  /// What is significant in hardly any blocks only is refitted, and the noise that this leaves in these very blocks counts where it is louder
  /// there than elsewhere.
  void hold_rare_against_their_blocks(Screen& s, Yardstick yardstick);
  /// What the candidate leaves (r/σ) beside which the noise is likeliest, among those that are large for sure: what is slow and missing passes
  /// for slow noise until it is taken out.
  Eigen::VectorXd least_noise_beside(const Screen& s) const;
  Gate gate_of(const Screen& s, const std::set<std::string>& ignored = {}) const {
    return gate_.judge(s, found_.weights, found_.floors, !found_.added.empty(), ignored);
  }
  std::vector<Screened> shortlist(const Screen& s) const;
  /// The moment of a slip is not refined: those whose linear response does nearly as well are tried as well.
  static void add_other_moments(const Screened& best, const Screen& s, std::vector<Screened>& list);
  /// Linear responses let runs at rest stand where they will; within a step of the encoder, as a joint refit has them, they may tell when it
  /// slipped.
  void choose_moment(Step& step) const;
  /// Rows are projected off the slopes of what was fitted, which hold nearby only where a force's reading is clipped, or where something added has a
  /// shape that was fitted (a slack muscle's angle): a rival that moves it far (a gain of the encoder for an added inertia) is refitted with all of
  /// it before it is ruled out. Those further behind than this, in sigma, are left.
  void fit_with_the_baseline(std::vector<Trial>& trials, double nearer_than) const;
  bool a_shape_was_fitted() const;
  /// What it leaves of this place with its amplitude alone told by the data, not the states that its refit read off them.
  Eigen::VectorXd left_as_known_beforehand(const Trial& t) const;
  Trial refit_one(const Screened& candidate) const;
  /// An effect of the valves that is no linear one takes ten times as long as the others.
  bool is_slow(const Screened& candidate) const;
  std::vector<Trial> refit_all(const std::vector<Screened>& list) const;
  /// Functions without a name show at least this much of the floor, whatever refits say of the effects.
  bool is_open_at_least(const Step& step, double size) const;
  Step screened_step();
  Step step_here() { return refitted(screened_step()); }
  Step refitted(Step step);
  /// What closes next to nothing is not what shows so much: the best that closes enough stands first, where nothing rules it out.
  void put_material_first(Step& step) const;
  /// Noise floors that a finding must be as large as: half as many where a first effect is there beyond doubt (gate.hpp) and closes five sigma, once
  /// nothing larger was found.
  double least_material(const Step& step) const;
  bool is_beyond_doubt(const Step& step) const;
  /// What blocks agree on may still be no more than the noise's own model makes of the best of so many, where that noise is slow. (A first
  /// effect is given the benefit of three sigma: that noise is a model.)
  void leave_to_slow_noise(Step& step);
  /// What functions without a name close, by the noise's own model: an effect that no name is like is no noise for that.
  double units_of_functions(const Step& step) const;
  /// Does the best trial enter the rows where most shows, or is it significant by itself? Else what it closes, by chance, is nothing of that.
  bool speaks_of_what_shows(const Step& step) const;
  bool is_implausible(const Trial& t);
  /// A response at a finite size that no size of the effect keeps: it was the curvature of noise.
  bool is_empty_promise(const Trial& t, const Screen& s) const;
  Active active_of(const Trial& t) const;
  double units_closed(const Trial& t) const;
  /// The most that one of those added closed of rows of these chains, in units of the noise.
  double most_units_closed_in(unsigned chains) const;
  Fit with(const std::vector<Trial>& effects) const;

  // What may take an effect's place: rivals.cpp.
  /// The effect that stood first leaves something over: one of its rivals that leaves nothing takes its place.
  bool another_leaves_nothing(const Step& step);
  /// Where a slip took the place of an offset at a moment that only told beside it: what is the same as that offset leaves the same over.
  void leave_out_twins_of(const Eigen::VectorXd& residual);
  /// The effect that stood first leaves too little for a second name and too much for none: one of its rivals, which fitted nearly as well
  /// alone, may fit better with that second one, and leave it larger. It takes the place of the first.
  bool a_rival_goes_better_with(const Step& step);
  /// One effect may look like two at once (a gain of a pressure sensor like a leak and an offset): of the first effect's rivals that alone close
  /// less, one that closes more together with a second takes its place.
  bool another_pair_closes_more(const Step& step);
  /// Of the first step's trials this one is taken; what stood first is ruled out.
  /// Polished, a shape may have gone on to the end of its range, where it is a simpler effect: that stands for it, as where it had begun there.
  void leave_a_limit_to_its_simple_case();
  void put_first(std::size_t i);
  /// Each effect is given up once, with the others in place: another may do better, or nothing may be missed.
  void swap_and_drop();

  /// All of the following, one after another, until the names are ruled out.
  void hold_against_others();
  // What casts doubt on a name: remainder.cpp.
  /// Names that functions without one beat are only like the truth, though they leave nothing that a whole search would find.
  void hold_against_functions(const Around& baseline);
  /// What stands for the valve unit's dynamics may be another lag, or another curve, with no name; a rival of the name that is such a one takes
  /// its place.
  void hold_against_any_valve();
  /// What the names close, in units of noise, and the share of it that a rival may have beyond them without taking them away.
  struct Closed {
    double units = 0, hardly_any = 0;
  };
  /// Rules the names out where rivals without a name are ahead of them, or doubts them where these have hardly any of what they close beyond them.
  bool are_beaten(const Comparison& behind, const std::string& rivals, const std::string& made_of,
                  const Closed& closed);
  /// What moves with the time of the day may have happened at once, between two runs.
  void hold_against_a_step(const Around& baseline);
  /// And what is said to have happened at once may have gone on all day, where no drift with a name says so.
  void hold_against_a_drift(const Around& baseline);
  /// What a general effect has beyond its own simple case must be told, though that case has a name that is not looked for: simple_case.cpp.
  void hold_against_its_simple_case();
  /// What comes and goes, or is large only because another takes it back, is none of the catalogue's effects.
  void hold_against_itself(const Around& baseline);
  /// What an adequate model leaves over by chance alone is seldom as unlikely as this, however little it be.
  void look_at_remainder();
  /// A name that stands only as what it turns into at the end of its range, two sensors that err by the same, and a crowd of effects may each
  /// be one thing that the catalogue does not have.
  void look_at_limits();
  void doubt_at_the_end_of_a_reading();
  /// A few moments that stand out beside a name are something else, or the name is wrong.
  void look_at_moments_beside();

  const Predictor& predictor_;
  Library& library_;
  Prepared& data_;
  const ExplainOptions& options_;
  const Look& look_;
  Gatekeeper gate_;
  Ranking ranking_;
  Plausible plausible_;
  Found found_;
  Around place_;  ///< of found_.model
  struct RefittedHere {
    Values start;
    Trial trial;
  };
  std::vector<RefittedHere> refitted_here_;         ///< the first of a screen of this place
  std::optional<std::set<std::string>> asked_for_;  ///< ids; none: all
  std::optional<Screen> narrow_;                    ///< of this place, that was asked for some ids only
  Responses responses_;
  mutable std::optional<GenericFunctions> functions_;
  double first_size_ = 0;  ///< of the first effect, over the floor
  double largest_size_ =
      0;  ///< of all that were added: what is left is held against the largest, whose equation is only nearly right
  double largest_units_ = 0;     ///< of noise that one of them closed
  bool left_elsewhere_ = false;  ///< and told so
  double untold_half_step_ = 0;  ///< rad: of the encoder, which no run tells
  bool a_rival_was_tried_ = false, a_pair_was_tried_ = false;
  bool little_counts_ = false;       ///< half of what is material is enough, beyond doubt
  bool zero_was_stopped_ = false;    ///< the search began anew with a zero that stands still
  bool colour_beside_best_ = false;  ///< the noise's colour was read off once more, beside the best candidate
};

}  // namespace isac::explain
