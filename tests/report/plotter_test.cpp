#include "isac/report/plotter.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <random>

#include "isac/core/error.hpp"
#include "isac/report/document.hpp"
#include "svg_check.hpp"

namespace {
using namespace isac::report;
using isac::report::testing::occurrences;
using isac::report::testing::xml_fault;

/// An environment variable for the length of a scope.
class Environment {
 public:
  Environment(const char* name, const std::string& value)
      : name_(name), before_(std::getenv(name) == nullptr ? "" : std::getenv(name)) {
    setenv(name, value.c_str(), 1);
  }
  ~Environment() { before_.empty() ? unsetenv(name_) : setenv(name_, before_.c_str(), 1); }

 private:
  const char* name_;
  std::string before_;
};

Figure every_mark(const std::string& id) {
  const std::vector<double> x = {0, 1, 2, 3}, y = {1, 3, 2, std::nan("")}, low = {0, 1, 1, 1},
                            high = {2, 4, 3, 3};
  const std::vector<double> half = {0.1, 0.2, 0.3, 0.1};
  Panel panel{.title = "It's {a} <test> & more_1",
              .x = {.label = "Angle φ", .unit = "rad"},
              .y = {.label = "Torque T", .unit = "N m"},
              .lines = {{.at = 1, .label = "it's"}, {.vertical = true, .at = 2}},
              .boxes = {{.x_low = 0, .x_high = 1, .y_low = 0, .y_high = 1}},
              .notes = {"a < b"}};
  panel.curves = {band("band", "", x, low, high), line("line", colour::kModel, x, y),
                  steps("steps", colour::kSecond, x, y), dots("dots", colour::kThird, x, y),
                  error_bars("bars", colour::kFourth, x, y, half)};
  panel.curves.push_back({.label = "counts", .mark = Mark::kBars, .x = x, .y = low});
  for (Curve& shade : scatter(x, y, 100, 100)) panel.curves.push_back(shade);
  return {.id = id, .alt = "A \"test\" <figure>", .columns = 2, .panels = {panel, panel}};
}

TEST(Plotter, draws_every_mark_as_well_formed_svg_with_unique_ids) {
  const std::vector<Figure> figures = {every_mark("fig1"), every_mark("fig2")};
  const auto svg = render_svg(figures);
  ASSERT_EQ(svg.size(), 2U);
  EXPECT_EQ(xml_fault(svg[0] + svg[1]), "");
  for (const char* word : {"Torque T (N\u00A0m)", "(a) It's {a} &lt;test", "Angle φ (rad)"})
    EXPECT_NE(svg[0].find(word), std::string::npos) << word;
  for (const char* label : {"band", "line", "steps", "dots", "bars", "counts"})
    EXPECT_EQ(occurrences(svg[0], ">" + std::string(label) + "<"), 2U)
        << label;  // one legend entry in each panel
}

TEST(Plotter, gives_the_same_bytes_for_the_same_figure) {
  EXPECT_EQ(render_svg(std::vector{every_mark("f")}), render_svg(std::vector{every_mark("f")}));
}

TEST(Plotter, leaves_a_gap_and_a_spike_in_the_picture) {
  const std::vector<double> x = {0, 1, 2, 3, 4, 5, 6}, y = {0, 0, std::nan(""), 0, 9, 0, 0};
  Figure figure{.id = "f", .panels = {{.curves = {line("", colour::kModel, x, y)}}}};
  const std::string svg = render_svg(std::vector{figure}).front();
  const auto path = svg.find("rgb(213,  94,   0)");
  ASSERT_NE(path, std::string::npos);
  const std::string data = svg.substr(path, svg.find("/>", path) - path);
  EXPECT_EQ(occurrences(data, "M"), 2U) << data;  // two pieces of line: before and behind the gap
}

TEST(Plotter, keeps_the_picture_of_ten_million_rows_below_300_kilobytes) {
  // A picture's size depends on its pixels; ten million rows are made from a million by writing each ten times, which
  // costs the test a tenth of the noise.
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  std::vector<double> t(10'000'000), v(t.size()), w(t.size());
  for (std::size_t i = 0; i < t.size(); ++i) {
    t[i] = 0.001 * static_cast<double>(i);
    v[i] = i % 10 == 0 ? normal(random) : v[i - 1];
    w[i] = i % 10 == 0 ? normal(random) : w[i - 1];
  }
  Figure figure{.id = "f", .panels = {Panel{}, Panel{}, Panel{}}};
  figure.panels[0].curves = {line("a", colour::kModel, t, v)};
  figure.panels[1].curves = scatter(v, w, kPixelColumns, 220);
  figure.panels[2].curves = {dots("c", colour::kSecond, v, w)};
  EXPECT_LT(render_svg(std::vector{figure}).front().size(), 300'000U);
}

TEST(Plotter, says_how_to_install_gnuplot_when_there_is_none) {
  const Environment path("PATH", "/nonexistent");
  try {
    static_cast<void>(render_svg(std::vector{every_mark("f")}));
    FAIL() << "no error";
  } catch (const isac::Error& error) {
    EXPECT_EQ(error.code(), "gnuplot_missing");
    EXPECT_NE(error.text().find("apt-get install gnuplot-nox"), std::string::npos);
  }
}

TEST(Plotter, reports_gnuplots_own_words_and_leaves_no_file_behind) {
  const auto folder =
      std::filesystem::temp_directory_path() / ("isac-plotter-test-" + std::to_string(getpid()));
  std::filesystem::create_directories(folder);
  {
    const Environment temporary("TMPDIR", folder.string());
    Figure broken = every_mark("f");
    broken.panels[0].curves[1].colour = "no-such-colour";
    try {
      static_cast<void>(render_svg(std::vector{broken}));
      ADD_FAILURE() << "no error";
    } catch (const isac::Error& error) {
      EXPECT_EQ(error.code(), "gnuplot_failed");
      EXPECT_NE(error.text().find("color"), std::string::npos) << error.text();
    }
    static_cast<void>(render_svg(std::vector{every_mark("f")}));
    EXPECT_TRUE(std::filesystem::is_empty(folder));
  }
  std::filesystem::remove_all(folder);
}

TEST(Plotter, refuses_a_figure_without_a_point) {
  const std::vector<double> nothing = {std::nan("")};
  Figure figure{.id = "f", .panels = {{.curves = {line("", colour::kModel, nothing, nothing)}}}};
  EXPECT_THROW(static_cast<void>(render_svg(std::vector{figure})), isac::Error);
}

TEST(Document, escapes_every_text_and_stays_well_formed) {
  const std::string nasty = "<script>alert(\"1\")</script> & 'x' \xFF";
  Document page(nasty, nasty);
  page.heading(nasty);
  page.paragraph(nasty);
  page.equation({nasty});
  page.bullets({nasty});
  page.cards({{nasty, nasty, nasty}});
  page.table({.caption = nasty, .columns = {{nasty}, {nasty, true}}, .rows = {{nasty, "1.5"}, {"a", nasty}}});
  page.correlation(nasty, {nasty, "b"}, {1, -0.5, -0.5, 1});
  page.box(BoxKind::kWarning, nasty, {nasty, nasty});
  Figure figure = every_mark("any");
  figure.caption = nasty;
  EXPECT_TRUE(page.add_figure(figure));
  const std::string html = page.html();
  EXPECT_EQ(xml_fault(html, true), "");
  EXPECT_EQ(html.find("<script"), std::string::npos);
}

TEST(Document, aligns_numbers_at_the_decimal_point) {
  Document page("t", "");
  page.table({.columns = {{"v", true}}, .rows = {{"1.25"}, {"−10"}, {"3.5"}}});
  const std::string html = page.html();
  EXPECT_NE(html.find(">−10\u2008\u2007\u2007<"), std::string::npos);
  EXPECT_NE(html.find(">3.5\u2007<"), std::string::npos);
}

TEST(Document, leaves_out_panels_without_a_point_and_says_when_nothing_is_left) {
  Document page("t", "");
  Figure figure = every_mark("f");
  figure.panels.push_back(Panel{});
  EXPECT_TRUE(page.add_figure(figure));
  EXPECT_FALSE(page.add_figure({.panels = {Panel{}}}));
  EXPECT_EQ(page.figures(), 1U);
  EXPECT_EQ(occurrences(page.html(), "<svg"), 1U);
}

}  // namespace
