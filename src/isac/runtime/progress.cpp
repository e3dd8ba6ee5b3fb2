#include "isac/runtime/progress.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "isac/core/units.hpp"

namespace isac::runtime {

namespace {

/// "p1 2.503 kg/cm2 (scatter 0.004)"
std::string level_words(const series::SweepFacts::Level& level) {
  const bool force = level.column[0] == 'F', pressure = level.column[0] == 'p';
  const double unit = pressure ? kPascalPerKgfCm2 : 1.0;
  return fmt::format("{} {:.{}f} {} (scatter {:.{}f})", level.column, level.mean / unit, force ? 2 : 4,
                     force      ? "N"
                     : pressure ? "kg/cm2"
                                : "rad",
                     level.scatter / unit, force ? 2 : 4);
}

}  // namespace

std::string progress_line(const series::Program& program, const RecordingLive& live, int columns) {
  const double elapsed = live.elapsed.load(std::memory_order_relaxed);
  if (!live.recording.load(std::memory_order_relaxed) && live.rows.load(std::memory_order_relaxed) == 0) {
    return fmt::format("getting ready  angle {:+.2f} rad  dp {:+.2f} kg/cm2", live.angle.load(),
                       live.delta_pressure.load() / kPascalPerKgfCm2);
  }
  const double share = std::clamp(elapsed / program.duration, 0.0, 1.0);
  const std::string clock = fmt::format("{:5.1f} of {:.1f} s", elapsed, program.duration);
  const std::string facts = fmt::format("speed to {:.2f} rad/s  dp {:+.2f} kg/cm2  F {:.0f} to {:.0f} N",
                                        live.peak_speed.load(), live.delta_pressure.load() / kPascalPerKgfCm2,
                                        live.force_low.load(), live.force_high.load());
  const int room = columns - static_cast<int>(clock.size() + facts.size()) - 6;
  if (room < 8)
    return (clock + "  " + facts)
        .substr(0, columns > 0 ? static_cast<std::size_t>(columns) : std::string::npos);
  const int cells = std::min(room, 30);
  const int full = static_cast<int>(std::lround(share * cells));
  return clock + " [" + std::string(static_cast<std::size_t>(full), '#') +
         std::string(static_cast<std::size_t>(cells - full), '-') + "]  " + facts;
}

std::string wrapped(const std::string& text, int columns, int indent) {
  if (columns <= indent + 20) return text;
  std::string out;
  int used = 0;
  for (std::size_t begin = 0; begin < text.size();) {
    std::size_t end = text.find(' ', begin);
    end = end == std::string::npos ? text.size() : end;
    const int word = static_cast<int>(end - begin);
    if (used > indent && used + 1 + word > columns) {
      out += "\n" + std::string(static_cast<std::size_t>(indent), ' ');
      used = indent;
    } else if (begin > 0) {
      out += ' ';
      ++used;
    }
    out.append(text, begin, end - begin);
    used += word;
    begin = end + 1;
  }
  return out;
}

std::string verdict_lines(const RecordingOutcome& outcome, bool colour, int columns) {
  const bool keep = outcome.verdict.keep();
  const series::SweepFacts& facts = outcome.verdict.facts;
  const char* on = !colour ? "" : keep ? "\033[1;32m" : "\033[1;31m";
  const char* off = colour ? "\033[0m" : "";
  std::string covered = fmt::format(
      "          {} samples, angle {:+.2f} to {:+.2f} rad, speed {:+.2f} to {:+.2f} rad/s, dp {:+.2f} to "
      "{:+.2f} kg/cm2, "
      "F {:.0f} to {:.0f} N",
      facts.rows, facts.angle_low, facts.angle_high, -facts.speed_backward, facts.speed_forward,
      facts.delta_pressure_low / kPascalPerKgfCm2, facts.delta_pressure_high / kPascalPerKgfCm2,
      facts.force_low, facts.force_high);
  if (!facts.levels.empty()) {
    covered = fmt::format("          {} samples", facts.rows);
    for (const auto& level : facts.levels) covered += ", " + level_words(level);
  }
  std::string text = fmt::format("  {}{:<6}{}  {}\n{}\n", on, keep ? "keep" : "repeat", off,
                                 outcome.file.filename().string(), wrapped(covered, columns, 10));
  for (const series::SweepRemark& remark : outcome.verdict.remarks) {
    text +=
        wrapped(fmt::format("          - {}{}", remark.repeat ? "" : "note: ", remark.text), columns, 12) +
        "\n";
  }
  return text;
}

std::string summary_line(const std::vector<RecordingOutcome>& outcomes, std::size_t asked) {
  const auto plural = [](std::size_t count) {
    return fmt::format("{} recording{}", count, count == 1 ? "" : "s");
  };
  std::string repeats;
  std::size_t kept = 0;
  for (const RecordingOutcome& outcome : outcomes) {
    if (outcome.verdict.keep()) {
      ++kept;
    } else {
      repeats += (repeats.empty() ? "" : ", ") + outcome.file.filename().string();
    }
  }
  std::string text = fmt::format("{} made, {} to keep", plural(outcomes.size()), kept);
  if (!repeats.empty()) text += "; repeat " + repeats + " (with --overwrite)";
  if (outcomes.size() < asked) text += fmt::format("; {} of {} not made", asked - outcomes.size(), asked);
  return text + ".";
}

}  // namespace isac::runtime
