#include "isac/report/pose_explain_report.hpp"

#include <algorithm>
#include <cmath>

#include "isac/core/error.hpp"
#include "isac/report/document.hpp"
#include "isac/report/parameters.hpp"
#include "isac/report/plotter.hpp"
#include "isac/report/report_head.hpp"
#include "isac/report/text.hpp"

namespace isac::report {
namespace {

using estimate::PoseExplanation;
using estimate::PoseFinding;
using estimate::PoseVerdict;

constexpr std::size_t kMostRejected = 12;  // rows of the table; the others are farther behind still

std::string names_of(const std::vector<PoseFinding>& findings) {
  std::string out;
  for (std::size_t i = 0; i < findings.size(); ++i)
    out += (i == 0 ? "" : i + 1 == findings.size() ? " or " : ", ") + findings[i].name;
  return out;
}

std::string joined(const std::vector<std::string>& names) {
  std::string out;
  for (std::size_t i = 0; i < names.size(); ++i)
    out += (i == 0 ? "" : i + 1 == names.size() ? " and " : ", ") + names[i];
  return out;
}

Figure residual_figure(const PoseExplainReportInput& input) {
  const PoseExplanation& answer = *input.answer;
  Figure figure{
      .caption =
          "Measured torque less gravity's, pose by pose: as the arm file has it (above), and with the best "
          "finding (below). The band is two standard deviations of the noise.",
      .panel_height = 220};
  for (const bool after : {false, true}) {
    const double end = static_cast<double>(answer.pose_names.size()) + 1;
    Panel panel{.x = {.label = "Pose", .low = 0, .high = end, .whole = true},
                .y = {.label = after ? "With the finding" : "As the file has it", .unit = "N m"},
                .lines = {{.at = 0}}};
    const double wide = 2 * answer.noise;
    panel.boxes.push_back({.x_low = 0, .x_high = end, .y_low = -wide, .y_high = wide});
    for (int joint = 0; joint < input.joints; ++joint) {
      std::vector<double> x, y;
      for (const estimate::PoseGap& row : answer.rows) {
        if (row.joint != joint) continue;
        x.push_back(static_cast<double>(row.pose + 1));
        y.push_back(after ? row.after : row.before);
      }
      if (x.empty()) continue;
      panel.curves.push_back(dots("joint " + whole(joint + 1),
                                  colour::category(static_cast<std::size_t>(joint)), x, y, 1500, 5));
    }
    figure.panels.push_back(std::move(panel));
  }
  return figure;
}

void add_findings(Document& page, const std::string& caption, const std::vector<PoseFinding>& findings) {
  if (findings.empty()) return;
  Table table{
      .caption = caption,
      .columns = {
          {"What"}, {"Amount"}, {"χ² left", true}, {"Behind the best", true}, {"What it leaves, p", true}}};
  for (std::size_t i = 0; i < findings.size() && i < kMostRejected; ++i) {
    const PoseFinding& f = findings[i];
    table.rows.push_back(
        {f.name, pose_amount(f), number(f.chi_square, 4), number(f.behind, 3), probability(f.left_p)});
  }
  page.table(table);
}

}  // namespace

std::string pose_amount(const PoseFinding& finding) {
  std::string out;
  for (const Estimated& e : finding.parameters) {
    const std::string unit = e.unit == "-" ? "" : " " + e.unit;
    out += (out.empty() ? "" : ", ") + number(e.value, 4) + " ± " + number(e.std_error, 2) + unit;
  }
  return out;
}

std::string pose_verdict_sentence(const PoseExplanation& answer) {
  switch (answer.verdict) {
    case PoseVerdict::kNone:
      return "These poses are what the arm file says, to within their noise.";
    case PoseVerdict::kNamed:
      return "Hidden in these poses: " + answer.findings[0].name + ", " + pose_amount(answer.findings[0]) +
             ".";
    case PoseVerdict::kNotSeparable:
      return "Something is hidden in these poses, and they do not tell which: " + names_of(answer.findings) +
             "; likeliest is the first, " + pose_amount(answer.findings[0]) + ".";
    case PoseVerdict::kUnknown:
      return "Something is hidden in these poses, and none of the things looked for explains it" +
             (answer.rejected.empty()
                  ? std::string(".")
                  : "; nearest comes " + answer.rejected[0].name + ", which leaves more than noise.");
  }
  return {};
}

std::string pose_next_sentence(const PoseExplanation& answer) {
  switch (answer.verdict) {
    case PoseVerdict::kNone:
      return {};
    case PoseVerdict::kNamed:
      if (!answer.lookalikes.empty())
        return "A wrong " + joined(answer.lookalikes) +
               " would leave the same torques in any pose: weigh it, or trust its identification.";
      return {};
    case PoseVerdict::kNotSeparable: {
      for (const PoseFinding& f : answer.findings)
        if (f.id == "hand_load") return "Hold the same poses with an empty hand and compare.";
      const int joint = answer.findings[0].joint;
      return joint < 0 ? "Hold more poses, far apart from each other."
                       : "Hold more poses that turn joint " + whole(joint + 1) +
                             " and those before it over their whole range, each from both sides.";
    }
    case PoseVerdict::kUnknown:
      return "Hold poses that turn one joint at a time, from both sides, and look at the joints with the "
             "largest "
             "remainder: two things at once, something that hangs across two joints, or more noise than was "
             "told.";
  }
  return {};
}

std::string render_pose_explain_report(const PoseExplainReportInput& input) {
  if (input.answer == nullptr)
    throw Error(ErrorKind::kUsage, "answer_missing",
                "a report of hidden things needs the answer it reports on");
  require_gnuplot();
  const PoseExplanation& answer = *input.answer;
  Document page = open_page(input.head, "What is hidden in the poses");
  page.cards({{"Poses", whole(static_cast<double>(answer.poses)),
               whole(static_cast<double>(answer.torques)) + " torques"},
              {"Before", number(answer.before, 3) + " N m", "rms of what gravity does not explain"},
              {"After", number(answer.after, 3) + " N m", "with the best finding"},
              {"Noise", number(answer.noise, 3) + " N m", answer.noise_told ? "told" : "from the poses"},
              {"p", probability(answer.p_value), "that nothing is hidden"}});
  page.paragraph(pose_verdict_sentence(answer));
  std::vector<std::string> warnings = warning_texts(answer.warnings);
  if (!answer.outliers.empty())
    warnings.push_back("Left out, because nothing explains them: " + joined(answer.outliers) + ".");
  page.box(BoxKind::kWarning, "Before you use this", warnings);
  const std::string next = pose_next_sentence(answer);
  if (!next.empty()) page.box(BoxKind::kNext, "Next", {next});
  page.heading("Where it sits");
  Table joints{.caption = "Residual torques by joint, N m rms.",
               .columns = {{"Joint", true}, {"Before", true}, {"After", true}, {"Noise", true}}};
  for (const estimate::PoseJointGap& gap : answer.gaps)
    joints.rows.push_back(
        {whole(gap.joint + 1), number(gap.before, 3), number(gap.after, 3), number(gap.noise, 3)});
  page.table(joints);
  page.add_figure(residual_figure(input));
  page.heading("What was tried");
  add_findings(page, "What explains these poses.", answer.findings);
  add_findings(page, "What does not, the nearest first: more than 9 behind is three standard deviations.",
               answer.rejected);
  if (!answer.could_hide.empty()) {
    Table hide{.caption = "What could be there unseen: three standard errors.",
               .columns = {{"What"}, {"At most", true}, {"Unit"}}};
    for (const PoseFinding& f : answer.could_hide)
      hide.rows.push_back({f.name, number(f.parameters[0].value, 3), f.parameters[0].unit});
    page.table(hide);
  }
  if (!answer.not_testable.empty())
    page.paragraph("Not shown by these poses, neither found nor excluded: " + joined(answer.not_testable) +
                   ".");
  close_page(page, input.head);
  return page.html();
}

}  // namespace isac::report
