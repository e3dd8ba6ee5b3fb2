#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include "numbers.hpp"
#include "score.hpp"

namespace blind {
namespace {

struct Scored {
  const Case* one;
  Judgement j;
};
using Group = std::vector<Scored>;

template <typename Predicate>
std::string share_of(const Group& group, Predicate&& yes) {
  return share(static_cast<double>(std::count_if(group.begin(), group.end(), yes)),
               static_cast<double>(group.size()));
}

template <typename Predicate>
Group only(const Group& group, Predicate&& yes) {
  Group out;
  std::copy_if(group.begin(), group.end(), std::back_inserter(out), yes);
  return out;
}

std::string_view strength(const Truth& t) {
  return t.ratio >= 1.5 ? "strong" : t.ratio >= 0.5 ? "clear" : "faint";
}

std::string percent(double share) {
  return fixed(100.0 * share, 1) + " %";
}

std::string false_alarms(const Group& none) {
  std::string text =
      "## Nothing hidden\n\n| noise | nothing named | no disagreement | p-values: too many small ones by | "
      "too "
      "few by | limit of either at 95 % |\n|---|---|---|---|---|---|\n";
  for (const char* noise : {"white", "coloured", "quantised", "real"}) {
    const Group group = only(none, [&](const Scored& s) { return s.one->truth.noise == noise; });
    if (group.empty()) continue;
    std::vector<double> p;
    for (const Scored& s : group)
      if (s.one->answer.failed.empty() && s.one->answer.p_value >= 0.0) p.push_back(s.one->answer.p_value);
    const PDistance far = p_distance(p);
    text +=
        std::string("| ") + noise + " | " +
        share_of(group,
                 [](const Scored& s) {
                   return s.one->answer.failed.empty() && s.one->answer.effects.empty() &&
                          s.one->answer.alternatives.empty();
                 }) +
        " | " +
        share_of(group,
                 [](const Scored& s) { return s.one->answer.failed.empty() && !s.one->answer.detected; }) +
        " | " +
        (p.empty() ? "– | – | –"
                   : percent(far.small) + " | " + percent(far.large) + " | " + percent(far.limit)) +
        " |\n";
  }
  return text + "\n";
}

std::string singles(const Group& single) {
  std::string text =
      "## One effect hidden\n\n| strength | noise | detected | named first | among the first three | in the "
      "set | mean set size | one name, wrong, not flagged | sensor or process "
      "|\n|---|---|---|---|---|---|---|---|---|\n";
  for (const char* size : {"strong", "clear", "faint"}) {
    for (const char* noise : {"", "white", "coloured", "quantised", "real"}) {
      const std::string kind = noise;
      const Group group = only(single, [&](const Scored& s) {
        return strength(s.one->truth) == size && (kind.empty() || s.one->truth.noise == kind);
      });
      if (group.empty()) continue;
      double sizes = 0.0;
      for (const Scored& s : group) sizes += s.j.set_size;
      text += std::string("| ") + size + " | " + (kind.empty() ? "all" : kind) + " | " +
              share_of(group, [](const Scored& s) { return s.one->answer.detected; }) + " | " +
              share_of(group, [](const Scored& s) { return s.j.first; }) + " | " +
              share_of(group, [](const Scored& s) { return s.j.first_three; }) + " | " +
              share_of(group, [](const Scored& s) { return s.j.in_set; }) + " | " +
              fixed(sizes / static_cast<double>(group.size()), 2) + " | " +
              share_of(group, [](const Scored& s) { return s.j.single_wrong; }) + " | " +
              share_of(group, [](const Scored& s) { return s.j.right_side; }) + " |\n";
    }
  }
  const Group ties = only(single, [](const Scored& s) { return !s.one->truth.nearest_equal.empty(); });
  return text + "\nTies by the oracle (a rival below 3 sigma), answered with a set that holds both: " +
         share_of(ties, [](const Scored& s) { return s.j.in_set; }) + "\n\n";
}

/// A table of shares, one row for every kind of noise that occurs and one for all.
struct Share {
  const char* title;
  bool (*yes)(const Scored& s);
};
std::string by_noise(const char* headline, const Group& group, const std::vector<Share>& shares) {
  if (group.empty()) return "";
  std::string text = std::string("## ") + headline + "\n\n| noise |", rule = "|---|";
  for (const Share& one : shares) {
    text += std::string(" ") + one.title + " |";
    rule += "---|";
  }
  text += "\n" + rule + "\n";
  for (const char* noise : {"", "white", "coloured", "quantised", "real"}) {
    const std::string kind = noise;
    const Group part =
        only(group, [&](const Scored& s) { return kind.empty() || s.one->truth.noise == kind; });
    if (part.empty()) continue;
    text += "| " + (kind.empty() ? "all" : kind) + " |";
    for (const Share& one : shares) text += " " + share_of(part, one.yes) + " |";
    text += "\n";
  }
  return text + "\n";
}

std::string pairs(const Group& pair) {
  return by_noise(
      "Two effects hidden", pair,
      {{"both named", [](const Scored& s) { return s.j.all_named; }},
       {"both named; of a tie, set of both with the rival", [](const Scored& s) { return s.j.both_told; }},
       {"just one named", [](const Scored& s) { return s.j.one_named; }},
       {"both in the set", [](const Scored& s) { return s.j.in_set; }},
       {"one name, wrong, not flagged", [](const Scored& s) { return s.j.single_wrong; }}});
}

std::string outside(const Group& unknown) {
  return by_noise("An effect outside the catalogue", unknown,
                  {{"detected", [](const Scored& s) { return s.one->answer.detected; }},
                   {"unknown, with the right variables", [](const Scored& s) { return s.j.right_variables; }},
                   {"unknown", [](const Scored& s) { return s.j.left_unnamed; }},
                   {"one name, not flagged", [](const Scored& s) { return s.j.single_wrong; }}});
}

bool flagged(const Scored& s) {
  const Answer& a = s.one->answer;
  return a.failed.empty() && !a.effects.empty() && !s.j.asserted;
}

/// Every dataset is in one of the columns, and the last line says whose names were taken.
std::string left_out(const Group& group) {
  std::string text =
      by_noise("The effect's own name taken out of the catalogue", group,
               {{"unknown", [](const Scored& s) { return s.j.left_unnamed; }},
                {"a set that says it is not sure", flagged},
                {"another's name, not flagged", [](const Scored& s) { return s.j.asserted && !s.j.tied; }},
                {"the name of a twin (below 3 sigma)", [](const Scored& s) { return s.j.tied; }},
                {"nothing found, or no answer",
                 [](const Scored& s) { return !s.j.left_unnamed && !s.j.asserted && !flagged(s); }}});
  std::map<std::string, int> taken;
  for (const Scored& s : group)
    if (s.j.asserted && !s.j.tied) ++taken[s.one->truth.ids.front() + " as " + s.one->answer.effects.front()];
  if (taken.empty()) return text;
  text += "Another's name, not flagged:";
  const char* before = " ";
  for (const auto& [names, count] : taken) {
    text += before + names + " (" + std::to_string(count) + ")";
    before = ", ";
  }
  return text + "\n\n";
}

std::string spread_of(const std::vector<double>& closed) {
  if (closed.empty()) return "–";
  return percent(quantile(closed, 0.5)) + ", " + percent(quantile(closed, 0.05)) + " (" +
         std::to_string(closed.size()) + ")";
}

bool is_worse(const Answer& a) {
  return a.heldout_after > 1.001 * a.heldout_before;
}

bool noise_decides(const Case& one) {
  const Answer& a = one.answer;
  if (a.freed_after < a.freed_before) return true;
  const auto closes = one.truth.gap_closes.find(signal_of_label(a.signal));
  return closes != one.truth.gap_closes.end() &&
         -closes->second >= a.heldout_after * a.heldout_after - a.heldout_before * a.heldout_before;
}

/// Of every strength, and of pairs.
std::string gaps(const Group& hidden) {
  std::string rows;
  for (const char* row : {"strong", "clear", "faint", "two effects"}) {
    std::vector<double> twin, truth;
    int worse = 0, by_noise = 0, given = 0;
    for (const Scored& s : hidden) {
      const Truth& t = s.one->truth;
      if ((t.kind == "pair" ? "two effects" : strength(t)) != row) continue;
      if (s.j.closed > -1.0 && s.one->floor.contains(s.one->answer.signal)) twin.push_back(s.j.closed);
      if (s.j.closed_truth > -1.0) truth.push_back(s.j.closed_truth);
      if (s.one->answer.heldout_before <= 0.0) continue;
      ++given;
      if (!is_worse(s.one->answer)) continue;
      ++worse;
      if (noise_decides(*s.one)) ++by_noise;
    }
    if (given > 0)
      rows += std::string("| ") + row + " | " + spread_of(twin) + " | " + spread_of(truth) + " | " +
              share(worse, given) + " | " + share(worse - by_noise, given) + " |\n";
  }
  if (rows.empty()) return "";
  return "## Gap closed on held-out runs\n\nMedian, 5th percentile (datasets): of what lies above the same "
         "day "
         "with nothing hidden, and of what the generator's own true model takes out of the same "
         "recordings. Noise decides which rms is larger where the true model's is larger by as much, or "
         "where the answer's is smaller in "
         "rows freed of the noise's slow part.\n\n| hidden | down to the same day without it | of what the "
         "true model closes | worse "
         "than before, plain rms | of these not by the noise's doing |\n|---|---|---|---|---|\n" +
         rows + "\n";
}

std::string confidences(const Reliability& names, const std::string& picture) {
  if (names.bins.empty()) return "";
  std::string text = "## Confidences of what was named\n\n| stated | mean stated | right |\n|---|---|---|\n";
  for (const Reliability::Bin& bin : names.bins)
    text += "| " + fixed(bin.low, 1) + " to " + fixed(bin.low + 0.1, 1) + " | " + fixed(bin.stated, 3) +
            " | " + share(bin.right, bin.count) + " |\n";
  text += "\nExpected calibration error: " + fixed(names.error, 3) + "\n\n";
  if (!picture.empty())
    text += "![Share of right names over the confidence stated, against the diagonal](" + picture + ")\n\n";
  return text;
}

std::string confusion(const Group& all) {
  std::map<std::string, std::map<std::string, int>> table;
  for (const Scored& s : all) {
    if (s.one->truth.kind == "pair" || s.one->truth.kind == "left_out") continue;
    const Answer& a = s.one->answer;
    const std::string said = !a.failed.empty()   ? "(no answer)"
                             : a.effects.empty() ? "(" + a.verdict + ")"
                                                 : a.effects.front();
    const std::string truth = s.one->truth.ids.empty() ? "(none)" : s.one->truth.ids.front();
    ++table[truth][said];
  }
  std::string text =
      "## Confusion matrix: hidden, and named first\n\n| hidden | datasets | right | also named (datasets) "
      "|\n|---|---|---|---|\n";
  for (const auto& [truth, said] : table) {
    int count = 0;
    std::vector<std::pair<int, std::string>> wrong;
    for (const auto& [name, n] : said) {
      count += n;
      if (name != truth) wrong.emplace_back(-n, name);
    }
    std::sort(wrong.begin(), wrong.end());
    const int right = said.contains(truth) ? said.at(truth) : 0;
    text += "| " + truth + " | " + std::to_string(count) + " | " + std::to_string(right) + " |";
    for (std::size_t i = 0; i < wrong.size(); ++i)
      text += (i > 0 ? ", " : " ") + wrong[i].second + " (" + std::to_string(-wrong[i].first) + ")";
    text += " |\n";
  }
  return text + "\n";
}

}  // namespace

Reliability reliability(const std::vector<Case>& cases) {
  std::array<Reliability::Bin, 10> bins;
  double count = 0.0;
  for (const Case& one : cases) {
    if (!one.truth.testable || one.truth.kind == "left_out") continue;
    const auto& ids = one.truth.ids;
    for (std::size_t i = 0; i < one.answer.effects.size(); ++i) {
      const double c = one.answer.confidences[i];
      Reliability::Bin& bin = bins[static_cast<std::size_t>(std::clamp(static_cast<int>(c * 10.0), 0, 9))];
      bin.count += 1;
      bin.stated += c;
      bin.right += std::find(ids.begin(), ids.end(), one.answer.effects[i]) != ids.end() &&
                   one.truth.kind != "unknown";
      count += 1;
    }
  }
  Reliability names;
  for (std::size_t i = 0; i < bins.size(); ++i) {
    if (bins[i].count == 0.0) continue;
    names.error += std::abs(bins[i].stated - bins[i].right) / count;
    names.bins.push_back(bins[i]);
    names.bins.back().low = 0.1 * static_cast<double>(i);
    names.bins.back().stated /= bins[i].count;
  }
  return names;
}

std::string report(const std::vector<Case>& cases, const std::string& picture) {
  Group asked;
  std::map<std::string, int> silent;
  std::set<std::string> untestable;
  std::vector<double> seconds;
  for (const Case& one : cases) {
    if (!one.truth.testable) {
      for (const std::string& id : one.truth.ids) untestable.insert(id);
      continue;
    }
    if (one.answer.failed == kNotAsked) continue;  // baselines alone were
    asked.push_back({&one, judge_case(one)});
    if (!one.answer.failed.empty()) ++silent[one.answer.failed];
    if (one.answer.seconds > 0.0) seconds.push_back(one.answer.seconds);
  }
  const auto of_kind = [&](const char* kind) {
    return only(asked, [&](const Scored& s) { return s.one->truth.kind == kind; });
  };
  std::string text = "# Blind datasets: " + std::to_string(asked.size()) +
                     "\n\nShares with their Wilson interval of 95 %.\n\n";
  for (const auto& [reason, count] : silent)
    text += "- without an answer: " + std::to_string(count) + " (" + reason + ")\n";
  if (!silent.empty()) text += "\n";
  if (const Group none = of_kind("none"); !none.empty()) text += false_alarms(none);
  if (const Group single = of_kind("single"); !single.empty()) text += singles(single);
  text += pairs(of_kind("pair")) + outside(of_kind("unknown")) + left_out(of_kind("left_out"));
  text += gaps(only(
      asked, [](const Scored& s) { return s.one->truth.kind == "single" || s.one->truth.kind == "pair"; }));
  text += methods_table(cases) + confidences(reliability(cases), picture) + confusion(asked);
  if (!untestable.empty()) {
    text += "Not testable at the strength asked for, so left out (some or all datasets):";
    for (const std::string& id : untestable) text += " " + id;
    text += "\n\n";
  }
  if (!seconds.empty())
    text += "Seconds per dataset: median " + fixed(quantile(seconds, 0.5), 2) + ", largest " +
            fixed(quantile(seconds, 1.0), 2) + "\n";
  return text;
}

}  // namespace blind
