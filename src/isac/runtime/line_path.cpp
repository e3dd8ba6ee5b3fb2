#include "isac/runtime/line_path.hpp"

#include <fmt/format.h>

#include "isac/core/error.hpp"

namespace isac::runtime {
namespace {

using models::Vec3;

std::string place(const Vec3<double>& p) {
  return fmt::format("({:.3f}, {:.3f}, {:.3f}) m", p.x, p.y, p.z);
}

[[noreturn]] void refuse(std::size_t piece, const control::LineCheck<double>& check) {
  std::string why = describe(check.refusal);
  if (check.refusal == control::LineRefusal::kUnreachable) why += std::string(": ") + describe(check.reach);
  if (check.joint >= 0) why += fmt::format(" (joint {})", check.joint + 1);
  throw Error(
      ErrorKind::kUsage, "line_refused",
      fmt::format("piece {} of the way, at its point {}, {}: {}; nothing has moved. Take another way, a "
                  "smaller speed or another start",
                  piece + 1, check.point + 1, place(check.position), why));
}

}  // namespace

LinePath::LinePath(const control::ArmReach<double>& arm, const models::JointVector<double, 6>& start,
                   const std::vector<LinePiece>& pieces, double speed)
    : start_(start), legs_(pieces.size()) {
  const models::Chain<double, 6> chain = models::soft_arm_chain(arm.geometry);
  models::JointVector<double, 6> from = start;
  for (std::size_t k = 0; k < pieces.size(); ++k) {
    models::JointVector<double, 6> theta = models::multiply<double, 6>(arm.coupling, from);
    for (std::size_t i = 0; i < theta.size(); ++i) theta[i] += arm.middle[i];
    const Vec3<double> goal =
        pieces[k].by ? models::tool_position(chain, theta) + pieces[k].target : pieces[k].target;
    Leg& leg = legs_[k];
    const control::LineCheck<double> check = leg.line.plan(arm, from, goal, speed);
    if (check.refusal != control::LineRefusal::kNone) refuse(k, check);
    leg.begin = k == 0 ? 0 : duration_ + kPause;
    duration_ = leg.begin + leg.line.duration();
    points_ += leg.line.count();
    from = leg.line.point(leg.line.count() - 1);
  }
}

control::LinePoint<double> LinePath::at(double time) const noexcept {
  std::size_t k = 0;
  while (k + 1 < legs_.size() && legs_[k + 1].begin <= time) ++k;
  return legs_[k].line.at(time - legs_[k].begin);
}

}  // namespace isac::runtime
