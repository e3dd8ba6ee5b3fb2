#include "isac/report/explain_words.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <string_view>
#include <utility>
#include <vector>

#include "isac/explain/variable_words.hpp"
#include "isac/explain/where.hpp"
#include "isac/report/parameters.hpp"
#include "isac/report/text.hpp"

namespace isac::report {
namespace {

using explain::Explanation;
using explain::Verdict;

std::vector<std::string> names_of(const std::vector<explain::Candidate>& candidates) {
  std::vector<std::string> names;
  for (const explain::Candidate& candidate : candidates) names.push_back(candidate.name);
  return names;
}

std::string with_unit(double value, const std::string& unit) {
  const std::string pretty = pretty_unit(unit);
  return number(value, 3) + (pretty.empty() ? "" : " " + pretty);
}

std::string named(const Explanation& e) {
  const bool many = e.effects.size() > 1;
  std::string text =
      upper_first(joined(names_of(e.effects))) + (many ? " are" : " is") + " missing from the model";
  if (!many) {
    text += " of the " + subsystem_in_words(e.effects.front().subsystem);
    if (std::isfinite(e.effects.front().confidence))
      text += " (confidence " + percent(e.effects.front().confidence) + ")";
  }
  return text + ".";
}

std::string tied(const Explanation& e) {
  std::string text = e.verdict == Verdict::kFamily
                         ? "Something is missing, and its kind is known: "
                         : "Something is missing, and these data cannot tell what: ";
  std::vector<std::string> names = names_of(e.effects);
  const std::size_t most_others = 3;
  for (std::size_t i = 0; i < std::min(most_others, e.alternatives.size()); ++i)
    names.push_back(e.alternatives[i].name);
  if (e.alternatives.size() > most_others) names.push_back("others");
  text +=
      joined(names) + (e.verdict == Verdict::kFamily ? " are not told apart by these data." : " fit alike.");
  return text;
}

std::string unknown(const Explanation& e) {
  std::string text = "Something is missing that is no effect of the catalogue";
  if (!e.unknown) return text + ".";
  text += "; it sits in the " + subsystem_in_words(e.unknown->subsystem);
  const std::vector<std::string> on =
      explain::variables_in_words(e.unknown->depends_on, explain::of_linear_axis(e.gap.unit));
  if (!on.empty()) text += " and depends on " + joined(on);
  return text + ".";
}

}  // namespace

std::string verdict_sentence(const Explanation& e) {
  if (!e.summary.empty()) return pretty_sentence(e.summary);
  switch (e.verdict) {
    case Verdict::kNone:
      return "Nothing is missing: what the model leaves over cannot be told from noise.";
    case Verdict::kImmaterial:
      return "Something is there, but too small against the noise floor to matter; nothing was added.";
    case Verdict::kNamed:
      return e.effects.empty() ? "Nothing was added." : named(e);
    case Verdict::kFamily:
    case Verdict::kNotSeparable:
      return e.effects.empty() ? "These data cannot tell what is missing." : tied(e);
    case Verdict::kUnknown:
      return unknown(e);
  }
  return {};
}

std::string gap_sentence(const Explanation& e) {
  const explain::Gap& gap = e.gap;
  const bool heldout = std::isfinite(gap.heldout_before);
  const double before = heldout ? gap.heldout_before : gap.before,
               after = heldout ? gap.heldout_after : gap.after;
  if (!std::isfinite(before)) return {};
  std::string text =
      heldout
          ? "On " + whole(static_cast<double>(e.heldout_runs)) + " held-out " +
                (e.heldout_runs == 1 ? "run" : "runs") + ", which nothing was fitted to, the "
          : std::string("On the fitted runs (") +
                (e.heldout_runs > 0 ? "the held-out ones do not show it" : "none was held out") + ") the ";
  text += signal_in_words(gap.signal) + " is " + with_unit(before, gap.unit) + " rms off";
  if (std::isfinite(after) && e.adds()) text += " before and " + with_unit(after, gap.unit) + " after";
  constexpr double kRemembers = 1.25;  // of the floor: nothing is missing, and yet so much more is left
  const bool nothing = e.verdict == Verdict::kNone || e.verdict == Verdict::kImmaterial;
  if (nothing && before > kRemembers * gap.noise_floor)
    text += "; from sample to sample noise makes " + with_unit(gap.noise_floor, gap.unit) +
            " of it, and the rest is noise that remembers";
  else if (std::isfinite(gap.noise_floor))
    text += "; the noise floor is " + with_unit(gap.noise_floor, gap.unit);
  if (std::isfinite(gap.freed_before))
    text += "; the noise's slow part decides which is larger: freed of it, " +
            with_unit(gap.freed_before, gap.unit) + " before and " + with_unit(gap.freed_after, gap.unit) +
            " after";
  if (std::isfinite(gap.share_closed) && e.adds())
    text += ", so " + share_closed_in_words(gap.share_closed) + " of what can be explained is closed";
  return text + ".";
}

std::string share_closed_in_words(double share) {
  return share > 1 ? "all" : share < 0.005 ? "none" : percent(share);
}

std::string region_sentence(const explain::Region& region) {
  std::string text = subsystem_in_words(region.subsystem) + ", " + signal_in_words(region.signal);
  if (std::isfinite(region.low) && std::isfinite(region.high)) {
    const std::string unit = pretty_unit(region.unit);
    if (region.variable == "direction")
      text += ": " + explain::in_words(region);
    else
      text += ": " + explain::variable_in_words(region.variable, explain::of_linear_axis(region.unit)) +
              (region.low == region.high ? " " : " from " + number(region.low, 3) + " to ") +
              number(region.high, 3) + (unit.empty() ? "" : " " + unit);
  } else if (!region.variable.empty()) {
    text += ": " + explain::variable_in_words(region.variable, explain::of_linear_axis(region.unit));
  }
  if (std::isfinite(region.share)) text += " holds " + percent(region.share) + " of what can be explained";
  return text;
}

std::string parameters_in_words(const explain::Candidate& candidate) {
  std::string text;
  for (const Estimated& parameter : candidate.parameters)
    text += (text.empty() ? "" : ", ") + parameter.name + " = " + in_words(parameter);
  return text;
}

std::string subsystem_in_words(const std::string& subsystem) {
  if (subsystem == "pcu") return "valve unit";
  return subsystem.empty() ? "rig" : subsystem;
}

std::string signal_in_words(const std::string& signal) {
  return signal == "motion" ? "motion (I φ̈ = T)" : signal;
}

std::string equation_in_words(const std::string& equation) {
  static const std::map<std::string, std::string> kLetters{
      {"w", "φ̇"}, {"phi", "φ"}, {"dp", "Δp"}, {"psi", "ψ"}, {"alpha", "α"}, {"pi", "π"}, {"kappa", "κ"}};
  const auto letter = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_' || (c >= '0' && c <= '9');
  };
  static constexpr std::pair<std::string_view, std::string_view> kSigns[] = {
      {"->", "→"}, {"<=", "≤"}, {">=", "≥"}, {"+-", "±"}, {"^2", "²"}, {"^3", "³"}, {"^n", "ⁿ"}};
  std::string out;
  for (std::size_t i = 0; i < equation.size();) {
    const auto sign = std::find_if(std::begin(kSigns), std::end(kSigns), [&](const auto& s) {
      return equation.compare(i, s.first.size(), s.first) == 0;
    });
    if (sign != std::end(kSigns)) {
      out += sign->second;
      i += sign->first.size();
      continue;
    }
    if (!letter(equation[i])) {
      out += equation[i] == '-' ? std::string("−") : std::string(1, equation[i]);
      ++i;
      continue;
    }
    std::size_t end = i;
    while (end < equation.size() && letter(equation[end])) ++end;
    const std::string word = equation.substr(i, end - i);
    const auto known = kLetters.find(word);
    if (word == "w" && end < equation.size() && equation[end] == '\'') {  // the speed's rate
      out += "φ̈";
      ++end;
    } else {
      out += known == kLetters.end() ? word : known->second;
    }
    i = end;
  }
  return out;
}

std::string percent(double share) {
  if (!std::isfinite(share)) return "–";
  const double value = 100 * share;
  if (value > 99 && value <= 100) return "> 99 %";
  if (value >= 0 && value < 1) return "< 1 %";
  return fixed_decimals(value, 0) + " %";
}

std::string joined(const std::vector<std::string>& words) {
  std::string text;
  for (std::size_t i = 0; i < words.size(); ++i)
    text += (i == 0 ? "" : i + 1 == words.size() ? " and " : ", ") + words[i];
  return text;
}

std::string upper_first(std::string text) {
  if (!text.empty() && text[0] >= 'a' && text[0] <= 'z') text[0] = static_cast<char>(text[0] - 'a' + 'A');
  return text;
}

}  // namespace isac::report
