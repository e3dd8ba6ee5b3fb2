/// @file
/// Holds answers of isac-explain against the labels and counts.
///
/// Where the oracle says that a rival is less than three sigma from the truth, an answer is right when its set (effects
/// and alternatives) holds the truth and the nearest rival; a single name earns nothing there. Of two hidden effects of which one
/// alone is less than three sigma from both, the set that holds both.
#pragma once

#include <map>
#include <string>
#include <vector>

namespace blind {

/// What a label says, as far as it is scored.
struct Truth {
  std::string key, kind, noise, side, signal;  ///< kind: none, single, pair, unknown or left_out
  double ratio = 0;                            ///< asked for
  bool testable = true;
  std::vector<std::string> ids, subsystems, depends_on;
  std::string nearest_equal;        ///< the nearest rival below three sigma, or empty
  std::vector<std::string> equals;  ///< all of them
  std::string alone;                ///< of two hidden the one that is below three sigma by itself, or empty
  /// Per signal (torque, driven, pressure, p1, p2, balance): gap that the true model closes on held-out runs, the noise left, and the mean
  /// square that it takes out of these very recordings.
  std::map<std::string, double> gap, gap_noise, gap_closes;
};

inline constexpr const char* kNotAsked = "not asked";  ///< `failed` where baselines were asked alone

/// What an answer says. `failed` is not empty when there is none.
struct Answer {
  std::string failed, verdict, where, signal;
  bool detected = false;
  std::vector<std::string> effects, alternatives, depends_on;
  std::vector<double> confidences;                            ///< of `effects`
  std::vector<std::string> subsystems;                        ///< of `effects`
  double p_value = -1;                                        ///< over the whole search; −1: not given
  double heldout_before = 0, heldout_after = 0, seconds = 0;  ///< zero when not given
  double freed_before = 0,
         freed_after = 0;  ///< the same, freed of the noise's slow part; zero when not given
};

struct Case {
  Truth truth;
  Answer answer;
  /// By signal, as answers name them: rms on the held-out runs of the same day with nothing hidden, read and fitted by the same program.
  std::map<std::string, double> floor = {};
  std::map<std::string, Answer> baselines = {};  ///< by the method's name, of the same dataset
};

/// The signal of an answer's gap as labels call it.
std::string signal_of_label(const std::string& signal);

/// One line of a results file of blind_run, or of a ledger. Throws std::runtime_error on a line that is none.
Case read_case(const std::string& line);
/// A label file and an answer file.
Case read_pair(const std::string& label, const std::string& answer);

struct Judgement {
  bool first = false, first_three = false, in_set = false;
  bool single_wrong = false;  ///< one name, wrong, and nothing says that it might be
  bool all_named = false;     ///< of two hidden effects both
  bool both_told =
      false;  ///< the same; where a rival is below three sigma, a set of both and the rival; where one
              ///< of the two is below three sigma by itself, a set of both
  bool one_named = false;  ///< of two hidden effects just one
  bool asserted = false;   ///< named, and nothing beside it says that it might be another
  bool tied =
      false;  ///< asserted under the name of a rival below three sigma of what was left out: nobody can know
  bool left_unnamed = false, right_variables = false;
  bool right_side = false;  ///< sensor or process; of a tie a set that holds both
  int set_size = 0;
  /// Share of the gap closed on held-out runs; −1: not known. `closed`: of what lies above the same day with nothing hidden (without that twin, as
  /// `closed_truth`); `closed_truth`: of what the generator's own true model closes there.
  double closed = -1, closed_truth = -1;
};

Judgement judge_case(const Case& one);

/// How far p-values are from uniform: the largest share by which values up to some p are too many (`small`: an alarm more
/// than p promises) or too few (`large`). Values k/N, 100 ≤ N ≤ 10000, as a count of random trials gives them, are held against
/// the uniform law on that grid, equal ones together; a distance counts nothing between two steps of the grid.
struct PDistance {
  double small = 0, large = 0;
  double limit = 0;  ///< of either in 19 of 20 cases, were they uniform (on a grid: in more)
};
PDistance p_distance(std::vector<double> p_values);

/// Every baseline beside the answer, on the datasets that both were given: a table as Markdown, empty where there is none.
std::string methods_table(const std::vector<Case>& cases);

/// Names (the first effects of answers) by the confidence that was stated: are they right as often as that? Left-out effects do not count,
/// for no name could be right.
struct Reliability {
  struct Bin {
    double low = 0;     ///< of a tenth: 0.9 ≤ stated ≤ 1
    double stated = 0;  ///< mean
    double right = 0, count = 0;
  };
  std::vector<Bin> bins;  ///< those with a name in them
  double error = 0;       ///< expected calibration error: mean of |stated − right|, by names
};
Reliability reliability(const std::vector<Case>& cases);

/// All tables, as Markdown. `picture`: where the reliability diagram will be found from the page, or empty.
std::string report(const std::vector<Case>& cases, const std::string& picture = "");

/// Datasets of which baselines and the program were asked one by one are one case again: `baselines` of a case that was not asked go to
/// the answered case of the same key, if there is one.
void join_asked_alone(std::vector<Case>& cases);

/// The seed in a case's key ("clear/white/leak/9312.0": 9312), or an empty text.
std::string seed_of_key(const std::string& key);

}  // namespace blind
