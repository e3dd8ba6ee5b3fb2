#include "explain/summary.hpp"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "common/summary.hpp"
#include "isac/report/explain_words.hpp"
#include "isac/report/text.hpp"

namespace isac::apps {
namespace {

using explain::Candidate;

constexpr std::size_t kMargin = 11;  // of the words at the left

std::size_t columns_of(int stream, std::size_t otherwise) {
  winsize window{};
  const bool known = ::ioctl(stream, TIOCGWINSZ, &window) == 0 && window.ws_col > 20;
  return known ? window.ws_col : otherwise;
}

/// `text` in lines of at most `width` glyphs, each after the first indented.
std::string wrapped(const std::string& text, std::size_t width, std::size_t indent) {
  std::string out, line;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(' ', begin), text.size());
    const std::string word = text.substr(begin, end - begin);
    if (!line.empty() && report::glyphs(line) + 1 + report::glyphs(word) > width) {
      out += line + "\n" + std::string(indent, ' ');
      line.clear();
    }
    line += (line.empty() ? "" : " ") + word;
    begin = end + 1;
  }
  return out + line;
}

class Sheet {
 public:
  Sheet() : width_(std::clamp<std::size_t>(columns_of(STDOUT_FILENO, 100), 40, 120) - kMargin) {}
  void row(const char* label, const std::string& text) const {
    if (!text.empty()) fmt::print("{:<{}}{}\n", label, kMargin, wrapped(text, width_, kMargin));
  }
  [[nodiscard]] std::size_t width() const { return width_; }

 private:
  std::size_t width_;
};

/// Names under each other, their confidence, and what was found of them.
void print_candidates(const Sheet& sheet, const char* label, const std::vector<Candidate>& candidates,
                      std::size_t most) {
  std::size_t wide = 0;
  for (const Candidate& candidate : candidates) wide = std::max(wide, report::glyphs(candidate.id));
  for (std::size_t i = 0; i < std::min(most, candidates.size()); ++i) {
    const Candidate& candidate = candidates[i];
    std::string text = candidate.id + std::string(wide - report::glyphs(candidate.id), ' ');
    text += fmt::format("  {:>6}", report::percent(candidate.confidence));
    if (const std::string found = report::parameters_in_words(candidate); !found.empty())
      text += "  " + found;
    fmt::print("{:<{}}{}\n", i == 0 ? label : "", kMargin, text);
  }
  if (candidates.size() > most) sheet.row("", fmt::format("… and {} more", candidates.size() - most));
}

void print_could_hide(const Sheet& sheet, const explain::Explanation& e) {
  std::vector<std::string> texts;
  constexpr std::size_t kMost = 4;
  for (std::size_t i = 0; i < std::min(kMost, e.could_hide.size()); ++i) {
    const explain::CouldHide& one = e.could_hide[i];
    texts.push_back(one.id + " up to " + report::number(one.size, 2) +
                    (one.unit == "-" ? "" : " " + report::pretty_unit(one.unit)));
  }
  if (!texts.empty()) sheet.row("could hide", report::joined(texts));
}

}  // namespace

Progress::Progress(bool verbose) : terminal_(::isatty(STDERR_FILENO) == 1), verbose_(verbose) {}

Progress::~Progress() {
  end();
}

void Progress::say(const std::string& line) {
  if (terminal_ && !verbose_) {
    // Cut between characters of UTF-8, one column short of the edge.
    std::string shown = line;
    const std::size_t most = columns_of(STDERR_FILENO, 80) - 3;
    while (report::glyphs(shown) > most) {
      do shown.pop_back();
      while (!shown.empty() && (static_cast<unsigned char>(shown.back()) & 0xC0) == 0x80);
    }
    fmt::print(stderr, "\r\033[K  {}", shown);
    std::fflush(stderr);
    drawn_ = true;
  } else if (verbose_) {
    fmt::print(stderr, "{}\n", line);
  }
}

void Progress::end() {
  if (!drawn_) return;
  fmt::print(stderr, "\r\033[K");
  std::fflush(stderr);
  drawn_ = false;
}

void print_explanation(const explain::Explanation& e, const std::vector<std::string>& compensation) {
  const Sheet sheet;
  const bool terminal = ::isatty(STDOUT_FILENO) == 1;
  fmt::print("{}{}{}\n\n", terminal ? "\033[1m" : "",
             wrapped(report::verdict_sentence(e), sheet.width() + kMargin, 0), terminal ? "\033[0m" : "");
  sheet.row("gap", report::gap_sentence(e));
  for (std::size_t i = 0; i < std::min<std::size_t>(3, e.where.size()); ++i)
    sheet.row(i == 0 ? "where" : "", report::region_sentence(e.where[i]));
  print_candidates(sheet, e.adds() ? "added" : "named", e.effects, 8);
  print_candidates(sheet, "or", e.alternatives, 6);
  print_candidates(sheet, "not", e.rejected, 3);
  for (std::size_t i = 0; i < compensation.size(); ++i) sheet.row(i == 0 ? "control" : "", compensation[i]);
  if (!e.base.empty()) {
    fmt::print("\n");
    print_parameters(e.base);
  }
  for (const explain::BaseChange& change : e.base_changes)
    sheet.row("", report::pretty_sentence(change.sentence));
  fmt::print("\n");
  if (e.next_experiment) sheet.row("next", e.next_experiment->sentence);
  print_could_hide(sheet, e);
  if (!e.not_testable.empty()) sheet.row("untested", report::joined(e.not_testable));
  print_warnings(e.warnings);
}

void print_plan(const explain::Explanation& answer, const std::string& path) {
  const Sheet sheet;
  if (!path.empty()) {
    sheet.row("plan", path + " holds it; isac-log --plan " + path + " --rig rig.toml -o DATASET records it");
  } else if (answer.next_experiment) {
    sheet.row("plan", "none was written: no run of this rig as it stands would settle it");
  } else {
    sheet.row("plan", "none was written: the answer asks for no experiment");
  }
}

}  // namespace isac::apps
