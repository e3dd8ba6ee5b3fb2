#include <algorithm>

#include "numbers.hpp"
#include "score.hpp"

namespace blind {
namespace {

constexpr const char* kOurs = "isac-explain";

/// One method over all datasets that it was given.
struct Row {
  double none = 0, quiet = 0;  // nothing hidden, nothing named
  double single = 0, detected = 0, first = 0, in_set = 0, wrong = 0, names = 0;
  double unknown = 0, unknown_named = 0;
  std::vector<double> closed, seconds;
};

void count(const Case& one, Row& row) {
  const Answer& a = one.answer;
  if (!a.failed.empty()) return;
  row.seconds.push_back(a.seconds);
  const Judgement j = judge_case(one);
  const bool asserts = a.verdict == "named" && !a.effects.empty() && a.alternatives.empty();
  const std::string& kind = one.truth.kind;
  if (kind == "none") {
    row.none += 1;
    row.quiet += a.effects.empty() && a.alternatives.empty() ? 1 : 0;
  } else if (kind == "single") {
    const std::string& truth = one.truth.ids.front();
    row.single += 1;
    row.detected += a.detected ? 1 : 0;
    row.first += j.first ? 1 : 0;
    row.in_set += j.in_set ? 1 : 0;
    row.names += static_cast<double>(a.effects.size() + a.alternatives.size());
    row.wrong += asserts && a.effects.front() != truth &&
                         std::find(one.truth.equals.begin(), one.truth.equals.end(), a.effects.front()) ==
                             one.truth.equals.end()
                     ? 1
                     : 0;
    if (j.closed > -1) row.closed.push_back(j.closed);
  } else if (kind == "unknown") {
    row.unknown += 1;
    row.unknown_named += asserts ? 1 : 0;
  }
}

}  // namespace

std::string methods_table(const std::vector<Case>& cases) {
  std::map<std::string, Row> rows;
  for (const Case& one : cases) {
    if (!one.truth.testable || one.baselines.empty()) continue;
    if (one.answer.failed != kNotAsked) count(one, rows[kOurs]);
    for (const auto& [method, answer] : one.baselines) count({one.truth, answer}, rows[method]);
  }
  if (rows.empty()) return "";
  std::string text =
      "## Baselines on the same datasets\n\nNames are counted as in the tables above; wrong, not flagged: "
      "the first name is another's and "
      "nothing beside it says that it might be.\n\n| method | nothing hidden: nothing named | detected | "
      "named first | in the set | names "
      "on average | wrong, not flagged | outside the catalogue: named all the same | gap closed, median | "
      "seconds, median "
      "|\n|---|---|---|---|---|---|---|---|---|---|\n";
  const auto add = [&](const std::string& method, const Row& r) {
    text += "| " + method + " | " + share(r.quiet, r.none) + " | " + share(r.detected, r.single) + " | " +
            share(r.first, r.single) + " | " + share(r.in_set, r.single) + " | " +
            (r.single > 0 ? fixed(r.names / r.single, 1) : "–") + " | " + share(r.wrong, r.single) + " | " +
            share(r.unknown_named, r.unknown) + " | " +
            (r.closed.empty() ? "–" : fixed(100 * quantile(r.closed, 0.5), 1) + " %") + " | " +
            (r.seconds.empty() ? "–" : fixed(quantile(r.seconds, 0.5), 1)) + " |\n";
  };
  if (rows.contains(kOurs)) add(kOurs, rows[kOurs]);
  for (const auto& [method, row] : rows)
    if (method != kOurs) add(method, row);
  return text + "\n";
}

}  // namespace blind
