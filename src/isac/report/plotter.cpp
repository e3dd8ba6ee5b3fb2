#include "isac/report/plotter.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <gnuplot-iostream.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <tuple>
#include <utility>

#include "isac/core/error.hpp"
#include "isac/report/plot_layout.hpp"
#include "isac/report/text.hpp"

extern char** environ;

namespace isac::report {
namespace {

namespace fs = std::filesystem;

constexpr const char* kBandColour = "#c9d8e6";

/// A folder of its own under the temporary directory, gone when the scope is left.
class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::string pattern = (fs::temp_directory_path() / "isac-report-XXXXXX").string();
    if (mkdtemp(pattern.data()) == nullptr)
      throw Error(ErrorKind::kStopped, "temporary_folder",
                  "cannot make a temporary folder for the figures; free some space or set TMPDIR to a "
                  "writable folder");
    path_ = pattern;
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  [[nodiscard]] const fs::path& path() const noexcept { return path_; }

 private:
  fs::path path_;
};

fs::path find_gnuplot() {
  const char* variable = std::getenv("PATH");
  std::istringstream folders(variable == nullptr ? "" : variable);
  for (std::string folder; std::getline(folders, folder, ':');) {
    const fs::path candidate = fs::path(folder.empty() ? "." : folder) / "gnuplot";
    std::error_code ignored;
    if (fs::is_regular_file(candidate, ignored) && access(candidate.c_str(), X_OK) == 0) return candidate;
  }
  throw Error(ErrorKind::kStopped, "gnuplot_missing",
              "the report needs gnuplot, and none is on the PATH; install it with `apt-get install "
              "gnuplot-nox`, or call "
              "without --report");
}

std::string read_all(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  std::ostringstream out;
  out << in.rdbuf();
  return out.str();
}

/// Runs `gnuplot -d script`, its words into `log`; true when it ended well.
bool run(const fs::path& program, const fs::path& script, const fs::path& log) {
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&actions, 1, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_addopen(&actions, 2, log.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
  std::string name = "gnuplot";
  std::string option = "-d";  // no ~/.gnuplot: the same picture on every machine
  std::string file = script.string();
  char* const arguments[] = {name.data(), option.data(), file.data(), nullptr};
  pid_t child = 0;
  const int failed = posix_spawn(&child, program.c_str(), &actions, nullptr, arguments, environ);
  posix_spawn_file_actions_destroy(&actions);
  if (failed != 0) return false;
  int status = 0;
  while (waitpid(child, &status, 0) < 0) {
    if (errno != EINTR) return false;
  }
  return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

std::string quoted(const std::string& text) {
  std::string out = "'";
  for (const char c : clean_utf8(text)) {
    out += c;
    if (c == '\'') out += c;
  }
  return out + "'";
}

std::string axis_text(const Axis& axis) {
  const std::string unit = pretty_unit(axis.unit);
  return unit.empty() ? axis.label : axis.label + " (" + unit + ")";
}

std::string dash_type(Dash dash) {
  if (dash == Dash::kDashed) return "dt (8,5)";
  if (dash == Dash::kDotted) return "dt (2,4)";
  return "dt 1";
}

std::string stroke(const Curve& curve) {
  return fmt::format("lc rgb '{}' lw {:.2f} {}", curve.colour, curve.size, dash_type(curve.dash));
}

std::string plot_clause(const Curve& curve) {
  switch (curve.mark) {
    case Mark::kLine:
      return "'-' using 1:2 with lines " + stroke(curve) + " notitle";
    case Mark::kSteps:
      return "'-' using 1:2 with steps " + stroke(curve) + " notitle";
    case Mark::kPoints:
    case Mark::kRuns:
      return "'-' using 1:2 with lines " + stroke(curve) + " notitle";
    case Mark::kErrorBars:  // whiskers, then dots
      return fmt::format(
          "'-' using 1:2 with lines lc rgb '{0}' lw 1 notitle, '-' using 1:2 with lines lc rgb '{0}' lw 5 "
          "notitle",
          curve.colour);
    case Mark::kBand:
      return fmt::format("'-' using 1:2:3 with filledcurves fs solid noborder lc rgb '{}' notitle",
                         kBandColour);
    case Mark::kBars:
      return fmt::format("'-' using 1:2 with boxes fs solid noborder lc rgb '{}' notitle", curve.colour);
  }
  return {};
}

void send_strokes(Gnuplot& gnuplot, const std::vector<double>& left, const std::vector<double>& right,
                  const std::vector<double>& y, double least) {
  gnuplot << std::defaultfloat << std::setprecision(9);
  for (std::size_t i = 0; i < y.size(); ++i) {
    if (!std::isfinite(left[i]) || !std::isfinite(y[i])) continue;
    gnuplot << left[i] << ' ' << y[i] << '\n' << std::max(right[i], left[i] + least) << ' ' << y[i] << "\n\n";
  }
  gnuplot << "e\n";
}

void send_whiskers(Gnuplot& gnuplot, const Curve& curve) {
  gnuplot << std::defaultfloat << std::setprecision(9);
  for (std::size_t i = 0; i < curve.x.size(); ++i) {
    if (!std::isfinite(curve.x[i]) || !std::isfinite(curve.low[i] + curve.high[i])) continue;
    gnuplot << curve.x[i] << ' ' << curve.low[i] << '\n' << curve.x[i] << ' ' << curve.high[i] << "\n\n";
  }
  gnuplot << "e\n";
}

/// `least`: the shortest stroke that the SVG's two decimals still show, in units of x.
void send_data(Gnuplot& gnuplot, const Curve& curve, double least) {
  switch (curve.mark) {
    case Mark::kLine:
    case Mark::kSteps:
    case Mark::kBars:
      gnuplot.send1d(std::make_tuple(curve.x, curve.y));
      return;
    case Mark::kErrorBars:
      send_whiskers(gnuplot, curve);
      send_strokes(gnuplot, curve.x, curve.x, curve.y, least);
      return;
    case Mark::kBand:
      gnuplot.send1d(std::make_tuple(curve.x, curve.low, curve.high));
      return;
    // A dot is a stroke too short to be seen as one, with round ends: a tenth of the bytes of gnuplot's symbols.
    case Mark::kPoints:
      send_strokes(gnuplot, curve.x, curve.x, curve.y, least);
      return;
    case Mark::kRuns:
      send_strokes(gnuplot, curve.low, curve.high, curve.y, least);
      return;
  }
}

void send_ticks(Gnuplot& gnuplot, char axis, const Axis& description, Range range, double pixels,
                double per_tick, bool labelled) {
  if (description.log) {
    gnuplot << "set logscale " << axis << "\nset " << axis << "tics autofreq\nset format " << axis
            << (labelled ? " '%g'\n" : " ''\n");
    return;
  }
  gnuplot << "unset logscale " << axis << "\n";
  double step = tick_step(range.span(), std::max(3.0, std::floor(pixels / per_tick)));
  if (description.whole) step = std::max(1.0, step);
  gnuplot << fmt::format("set {}tics {:.12g}{}\n", axis, step, axis == 'x' ? " offset 0,0.4" : "");
  gnuplot << fmt::format("set format {} '{}'\n", axis, labelled ? tick_format(step, range) : "");
}

std::string sample_stroke(const Curve& curve) {
  if (curve.mark == Mark::kBand) return fmt::format("lc rgb '{}' lw 8", kBandColour);
  if (curve.mark == Mark::kBars || curve.mark == Mark::kRuns)
    return fmt::format("lc rgb '{}' lw 8", curve.colour);
  return stroke(curve);
}

void send_decorations(Gnuplot& gnuplot, const Panel& panel, const PlacedPanel& placed, const Layout& layout,
                      const std::string& letter) {
  gnuplot << "unset label\nunset arrow\nunset object\n";
  const auto screen_y = [&](double pixels) { return 1 - pixels / layout.height; };
  const auto screen_x = [&](double pixels) { return pixels / layout.width; };
  const auto text = [&](const std::string& words, double x, double y, const std::string& rest) {
    gnuplot << fmt::format("set label {} at screen {:.6f},{:.6f} {} front tc rgb '#222222'\n", quoted(words),
                           screen_x(x), screen_y(y), rest);
  };
  if (!panel.title.empty())
    text(letter + panel.title, placed.left, placed.title_y,
         fmt::format("left font 'Arial Bold,{}'", kFontSize));
  text(axis_text(panel.y), placed.left - kLeftMargin + 14, placed.top + 0.5 * placed.height,
       "center rotate by 90");
  if (placed.x_labelled)
    text(axis_text(panel.x), placed.left + 0.5 * placed.width, placed.top + placed.height + 34, "center");
  for (const LegendEntry& entry : placed.legend) {
    const double middle = entry.left + 0.5 * kSampleWidth;
    if (entry.curve->mark == Mark::kPoints || entry.curve->mark == Mark::kErrorBars) {
      gnuplot << fmt::format("set label '' at screen {:.6f},{:.6f} front point pt 7 ps 0.6 lc rgb '{}'\n",
                             screen_x(middle), screen_y(entry.y), entry.curve->colour);
    } else {
      gnuplot << fmt::format(
          "set arrow from screen {0:.6f},{1:.6f} to screen {2:.6f},{1:.6f} nohead front {3}\n",
          screen_x(entry.left), screen_y(entry.y), screen_x(entry.left + kSampleWidth),
          sample_stroke(*entry.curve));
    }
    text(entry.curve->label, entry.left + kSampleWidth + 6, entry.y, "left");
  }
  for (std::size_t i = 0; i < panel.notes.size(); ++i) {
    gnuplot << fmt::format(
        "set label {} at screen {:.6f},{:.6f} left front tc rgb '#222222' font 'Arial,{}'\n",
        quoted(panel.notes[i]), (placed.left + 8) / layout.width,
        screen_y(placed.top + 13 + 16 * static_cast<double>(i)), kFontSize - 1);
  }
  for (const ReferenceLine& mark : panel.lines) {
    if (mark.vertical) {
      gnuplot << fmt::format("set arrow from first {0:.12g}, graph 0 to first {0:.12g}, graph 1", mark.at);
    } else {
      gnuplot << fmt::format("set arrow from graph 0, first {0:.12g} to graph 1, first {0:.12g}", mark.at);
    }
    gnuplot << " nohead front lc rgb '" << colour::kReference << "' lw 1 dt (5,4)\n";
    if (mark.label.empty()) continue;
    const std::string at =
        mark.vertical ? fmt::format("first {:.12g}, graph 0.96 left offset character 0.4,0", mark.at)
                      : fmt::format("graph 0.995, first {:.12g} right offset character 0,0.5", mark.at);
    gnuplot << fmt::format("set label {} at {} front tc rgb '#555555' font 'Arial,{}'\n", quoted(mark.label),
                           at, kFontSize - 1);
  }
  for (const Box& box : panel.boxes) {
    gnuplot << fmt::format(
        "set object rectangle from first {:.12g}, first {:.12g} to first {:.12g}, first {:.12g} front fs "
        "empty border rgb "
        "'{}' lw 1.6\n",
        box.x_low, box.y_low, box.x_high, box.y_high, box.colour);
  }
}

void send_panel(Gnuplot& gnuplot, const Panel& panel, const PlacedPanel& placed, const Layout& layout,
                const std::string& letter) {
  Range data_x = data_range_x(panel);
  Range data_y = data_range_y(panel);
  for (const Box& box : panel.boxes) {
    data_x = united(data_x, {box.x_low, box.x_high});
    data_y = united(data_y, {box.y_low, box.y_high});
  }
  const Range x = axis_range(panel.x, data_x);
  Range y = axis_range(panel.y, data_y);
  if (!panel.notes.empty() && !std::isfinite(panel.y.high))  // room for the notes above the data
    y.high += y.span() * 17 * static_cast<double>(panel.notes.size()) / placed.height;
  gnuplot << fmt::format("set lmargin at screen {:.6f}\nset rmargin at screen {:.6f}\n",
                         placed.left / layout.width, (placed.left + placed.width) / layout.width);
  gnuplot << fmt::format("set tmargin at screen {:.6f}\nset bmargin at screen {:.6f}\n",
                         1 - placed.top / layout.height, 1 - (placed.top + placed.height) / layout.height);
  gnuplot << fmt::format("set xrange [{:.12g}:{:.12g}]\nset yrange [{:.12g}:{:.12g}]\n", x.low, x.high, y.low,
                         y.high);
  send_ticks(gnuplot, 'x', panel.x, x, placed.width, placed.width < 250 ? 34 : 60, placed.x_labelled);
  send_ticks(gnuplot, 'y', panel.y, y, placed.height, placed.height < 150 ? 20 : 27, true);
  send_decorations(gnuplot, panel, placed, layout, letter);
  gnuplot << "plot ";
  const char* separator = "";
  for (const Curve& curve : panel.curves) {
    gnuplot << separator << plot_clause(curve);
    separator = ", ";
  }
  gnuplot << "\n";
  for (const Curve& curve : panel.curves) send_data(gnuplot, curve, 0.03 / placed.width * x.span());
}

void send_figure(Gnuplot& gnuplot, const Figure& figure, const fs::path& file) {
  const Layout layout = lay_out(figure);
  gnuplot << fmt::format(
      "set terminal svg size {:.0f},{:.0f} dynamic noenhanced rounded font 'Arial,{}' name 'p'\n",
      layout.width, layout.height, kFontSize);
  gnuplot << "set encoding utf8\nset minussign\nset output " << quoted(file.string()) << "\n";
  gnuplot << "set border 3 lw 0.9 lc rgb '#555555'\nset tics out nomirror scale "
             "0.5 tc rgb "
             "'#222222'\nset grid xtics ytics back lc rgb '#e4e4e4' lw 0.8 dt "
             "1\nset bars "
             "0.5\nset boxwidth 1 relative\n";
  gnuplot << "unset key\nset multiplot\n";
  const std::size_t titled = static_cast<std::size_t>(std::count_if(
      figure.panels.begin(), figure.panels.end(), [](const Panel& panel) { return !panel.title.empty(); }));
  for (std::size_t k = 0; k < figure.panels.size(); ++k) {
    const bool lettered = titled > 1 && k < 26;
    send_panel(gnuplot, figure.panels[k], layout.panels[k], layout,
               lettered ? fmt::format("({}) ", static_cast<char>('a' + k)) : "");
  }
  gnuplot << "unset multiplot\nset output\nreset\n";
}

}  // namespace

void require_gnuplot() {
  static_cast<void>(find_gnuplot());
}

std::vector<std::string> render_svg(std::span<const Figure> figures) {
  if (figures.empty()) return {};
  const fs::path program = find_gnuplot();
  for (const Figure& figure : figures) {
    if (is_empty(figure))
      throw Error(ErrorKind::kUsage, "figure_empty",
                  "figure \"" + figure.id + "\" has a panel without a point to draw");
  }
  const TemporaryFolder folder;
  const fs::path script = folder.path() / "figures.gp";
  const auto svg_file = [&](std::size_t k) { return folder.path() / fmt::format("{}.svg", k); };
  {
    Gnuplot gnuplot(
        ">" + script.string());  // a file, not a pipe: gnuplot's exit status is seen, no signal is raised
    for (std::size_t k = 0; k < figures.size(); ++k) send_figure(gnuplot, figures[k], svg_file(k));
  }
  const fs::path log = folder.path() / "log";
  if (!run(program, script, log)) {
    std::string words = clean_utf8(read_all(log));
    if (words.size() > 400) words.resize(400);
    throw Error(ErrorKind::kStopped, "gnuplot_failed",
                "gnuplot could not draw the report's figures (" + program.string() + "): " + words);
  }
  std::vector<std::string> out;
  for (std::size_t k = 0; k < figures.size(); ++k)
    out.push_back(embeddable_svg(read_all(svg_file(k)), figures[k].id, figures[k].alt));
  return out;
}

}  // namespace isac::report
