#include "isac/estimate/pose_explain.hpp"

#include <algorithm>
#include <boost/math/distributions/fisher_f.hpp>
#include <cmath>

#include "isac/core/error.hpp"
#include "isac/estimate/linear_algebra.hpp"
#include "isac/estimate/pose_hypotheses.hpp"
#include "isac/series/statistics.hpp"

namespace isac::estimate {
namespace {

using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;

constexpr double kSeen = 0.01;          // of the best gain by chance, over all hypotheses
constexpr double kSeenAsWhole = 0.005;  // of χ² as a whole
constexpr double kLeftOver = 0.001;     // of what the best hypothesis leaves: below, it is not the answer
constexpr double kApart = 9;            // χ² + k ln n: three standard deviations
constexpr double kReading = 0.001;      // of the gain of a second parameter, to be needed
constexpr double kGross = 1e-4;         // of a pose that no hypothesis explains, over all poses
constexpr double kMostLeftOut = 0.2;    // of the poses
constexpr double kAssumed = 0.1;        // N m, where nothing is told and nothing left over (seed 3.4)
constexpr double kDependent = 1e-6;     // pivot, of the largest: columns that others make up
constexpr long kFewest = 8;             // torques left over, to estimate noise from
constexpr double kTwoSided = 1.959964;
constexpr const char* kLoadName = "a load in the hand";
constexpr double kAlike = 0.995;  // cosine between two columns that nobody tells apart

double f_upper(double ratio, double k, double freedom) {
  if (!(ratio > 0)) return 1;
  return boost::math::cdf(boost::math::complement(boost::math::fisher_f(k, freedom), ratio));
}

/// How large an effect may be before it is beyond belief: poses that do not show that much show nothing of it.
double plausible(const PoseHypothesis& h, const MassProblem& problem, double largest_torque) {
  if (h.id == "hand_load") return 2;
  if (h.id == "link_length") return 0.1;
  if (h.id == "angle_zero") return 0.2;
  if (h.id == "torque_gain") return 0.5;
  if (h.id == "mass") return 1;
  double largest = 0;
  for (Eigen::Index i = 0; i < h.columns.rows(); ++i)
    largest = std::max(largest, std::abs(h.columns(i, 0)) * problem.data[static_cast<std::size_t>(i)].noise);
  return largest > 0 ? largest_torque / largest : 0;
}

struct Tried {
  const PoseHypothesis* hypothesis = nullptr;
  Vector beta, left;  ///< left: residuals not whitened, over the noise
  Matrix covariance;
  double chi_square = 0, score = 0;
};

class Explainer {
 public:
  Explainer(const MassArm& arm, std::span<const MassPose> poses, const PoseExplainOptions& options)
      : options_(options), problem_(arm, options.fit) {
    const ArmVector& noise = options.fit.torque_noise;
    told_ = std::any_of(noise.begin(), noise.end(), [](double n) { return std::isfinite(n); });
    MassReading reading = read_mass_poses(problem_, poses, options.fit, told_);
    out_.warnings = std::move(reading.warnings);
    problem_.unknowns.clear();
    masses_.resize(static_cast<Eigen::Index>(arm.mass_names.size()));
    bool known = masses_.size() > 0;
    for (Eigen::Index k = 0; k < masses_.size(); ++k) {
      masses_[k] = arm.chain.masses[static_cast<std::size_t>(k)].mass;
      known = known && masses_[k] > 0;
      problem_.unknowns.push_back({MassUnknown::Kind::kMass, static_cast<std::size_t>(k),
                                   arm.mass_names[static_cast<std::size_t>(k)], "kg"});
    }
    if (!known) {
      throw Error(
          ErrorKind::kBadInput, "masses_unknown",
          "an arm is explained by what its masses should weigh: give every [[mass]] its value, or the masses "
          "that isac-identify masses found with --masses params.toml");
    }
  }

  PoseExplanation run() {
    settle_noise();
    whiten();
    try_all();
    conclude();
    return std::move(out_);
  }

 private:
  void take_hypotheses() {
    hypotheses_ = pose_hypotheses(problem_, masses_, options_);
    residual_ = pose_residual(problem_, masses_);
    nuisances_ = pose_nuisances(problem_, masses_, options_.mass_errors);
  }
  void settle_noise();
  bool leave_out_worst(const Vector& left, const Matrix& basis, double scale, double freedom);
  void whiten();
  void try_all();
  [[nodiscard]] Tried fit(const PoseHypothesis& h) const;
  [[nodiscard]] double gain_p(double gain, double k) const {
    return told_ ? series::chi_square_upper(std::max(gain, 0.0), k) : f_upper(gain / k, k, freedom_);
  }
  [[nodiscard]] double left_p(double chi_square, double k) const;
  void drop_needless_readings();
  [[nodiscard]] PoseFinding finding(const Tried& tried) const;
  void find_lookalikes(const Tried& best);
  void conclude();
  void fill_gaps(const Tried* best);

  PoseExplainOptions options_;
  MassProblem problem_;
  bool told_ = false;
  Vector masses_, residual_, white_residual_;
  Matrix nuisances_;
  Cholesky root_;
  std::vector<PoseHypothesis> hypotheses_;
  std::vector<Tried> tried_;
  double freedom_ = 0, rank_ = 0,
         rich_ = 0;        ///< of the fit of all hypotheses at once: left over, used, χ² left
  double chi_square_ = 0;  ///< of nothing missing
  std::vector<bool> left_out_;
  PoseExplanation out_;
};

/// All hypotheses at once explain more than any of them: what they leave is noise, and a pose that stands out there is a bad pose.
void Explainer::settle_noise() {
  left_out_.assign(problem_.poses.size(), false);
  for (;;) {
    take_hypotheses();
    Eigen::Index columns = nuisances_.cols();
    for (const PoseHypothesis& h : hypotheses_) columns += h.columns.cols();
    const Eigen::Index rows = residual_.size(), priors = nuisances_.cols();
    Matrix all = Matrix::Zero(rows + priors, columns);
    all.topLeftCorner(rows, priors) = nuisances_;
    all.bottomLeftCorner(priors, priors).setIdentity();
    Eigen::Index at = priors;
    for (const PoseHypothesis& h : hypotheses_) {
      all.block(0, at, rows, h.columns.cols()) = h.columns;
      at += h.columns.cols();
    }
    for (Eigen::Index c = 0; c < columns; ++c)
      if (all.col(c).norm() > 0) all.col(c).normalize();
    const Matrix basis = column_basis(all, kDependent);
    Vector longer = Vector::Zero(rows + priors);
    longer.head(rows) = residual_;
    const Vector left = longer - basis * (basis.transpose() * longer);
    rank_ = static_cast<double>(basis.cols() - priors);
    freedom_ = static_cast<double>(rows) - rank_;
    rich_ = left.squaredNorm();
    if (freedom_ < static_cast<double>(kFewest)) {
      if (!told_) {
        for (MassDatum& row : problem_.data) row.noise *= kAssumed;
        told_ = true;
        out_.warnings.push_back(
            {"noise_assumed",
             "Nothing is told of the torques' noise and these poses leave too little over to "
             "estimate it: 0.1 N m is taken; give --torque-noise, or record more poses."});
      }
      return;
    }
    double scale = 1;
    if (!told_) {
      std::vector<double> sizes;
      for (Eigen::Index i = 0; i < rows; ++i) sizes.push_back(std::abs(left[i]));
      scale = 1.4826 * series::median(sizes) * std::sqrt(static_cast<double>(rows) / freedom_);
    }
    if (scale > 0 && leave_out_worst(left, basis, scale, freedom_)) continue;
    if (!told_) {
      const double noise = std::max(std::sqrt(rich_ / freedom_), 1e-9);
      for (MassDatum& row : problem_.data) row.noise *= noise;
      rich_ = freedom_;
    }
    return;
  }
}

bool Explainer::leave_out_worst(const Vector& left, const Matrix& basis, double scale, double freedom) {
  std::vector<double> sum(problem_.poses.size(), 0), count(problem_.poses.size(), 0);
  for (std::size_t i = 0; i < problem_.data.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(i);
    const double share = 1 - basis.row(row).squaredNorm();
    if (share < 0.05) continue;
    sum[problem_.data[i].pose] += std::pow(left[row] / scale, 2) / share;
    count[problem_.data[i].pose] += 1;
  }
  std::size_t worst = 0;
  double least = 1;
  for (std::size_t p = 0; p < sum.size(); ++p) {
    if (!(count[p] > 0)) continue;
    const double value =
        told_ ? series::chi_square_upper(sum[p], count[p]) : f_upper(sum[p] / count[p], count[p], freedom);
    if (value < least) {
      least = value;
      worst = p;
    }
  }
  const auto poses = static_cast<double>(problem_.poses.size());
  const auto out = static_cast<double>(std::count(left_out_.begin(), left_out_.end(), true));
  if (least * poses >= kGross || out + 1 > kMostLeftOut * poses) return false;
  left_out_[worst] = true;
  out_.outliers.push_back(problem_.poses[worst].name);
  std::erase_if(problem_.data, [worst](const MassDatum& row) { return row.pose == worst; });
  return true;
}

void Explainer::whiten() {
  take_hypotheses();  // over the noise as it is now known
  const Eigen::Index n = residual_.size();
  root_ = cholesky(Matrix::Identity(n, n) + nuisances_ * nuisances_.transpose());
  white_residual_ = root_.whiten(residual_);
  chi_square_ = white_residual_.squaredNorm();
}

Tried Explainer::fit(const PoseHypothesis& h) const {
  Tried t;
  t.hypothesis = &h;
  t.beta = Vector::Zero(h.columns.cols());
  t.left = residual_;
  Matrix columns = h.columns;
  const int turns = h.is_zero ? 20 : 1;
  for (int turn = 0; turn < turns; ++turn) {
    const Matrix white = root_.whiten_each(columns);
    const Vector step = least_squares(white, root_.whiten(t.left));
    t.beta += step;
    t.covariance = inverse_symmetric(white.transpose() * white);
    if (!h.is_zero) {
      t.left -= columns * step;
      break;
    }
    Vector column;
    moved_residual(problem_, masses_, h.zero, t.beta[0], t.left, column);
    columns.col(0) = column;
    if (std::abs(step[0]) < 1e-6) break;
  }
  t.chi_square = root_.whiten(t.left).squaredNorm();
  t.score = t.chi_square + static_cast<double>(t.beta.size()) * std::log(static_cast<double>(t.left.size()));
  return t;
}

void Explainer::try_all() {
  double largest = 0;
  for (const MassDatum& row : problem_.data) largest = std::max(largest, std::abs(row.gravity));
  for (const PoseHypothesis& h : hypotheses_) {
    const Matrix white = root_.whiten_each(h.columns);
    const double seen = white.col(0).norm() * plausible(h, problem_, largest);
    if (!(seen > std::sqrt(kApart)) || column_basis(white, kDependent).cols() < white.cols()) {
      if (h.columns.cols() == 1) out_.not_testable.push_back(h.name);
      continue;
    }
    tried_.push_back(fit(h));
  }
  drop_needless_readings();
  std::sort(tried_.begin(), tried_.end(), [](const Tried& a, const Tried& b) { return a.score < b.score; });
}

/// Constant and growing pull together only where each of them is needed beside the other.
void Explainer::drop_needless_readings() {
  const auto alone = [this](const Tried& both, const char* id) {
    for (const Tried& t : tried_)
      if (t.beta.size() == 1 && t.hypothesis->id == id && t.hypothesis->joint == both.hypothesis->joint)
        return t.chi_square;
    return chi_square_;
  };
  std::vector<Tried> kept;
  for (const Tried& t : tried_) {
    if (t.beta.size() == 1 || (gain_p(alone(t, "joint_pull") - t.chi_square, 1) < kReading &&
                               gain_p(alone(t, "joint_spring") - t.chi_square, 1) < kReading))
      kept.push_back(t);
  }
  tried_ = std::move(kept);
}

double Explainer::left_p(double chi_square, double k) const {
  if (told_)
    return series::chi_square_upper(chi_square, std::max(static_cast<double>(residual_.size()) - k, 1.0));
  const double used = std::max(rank_ - k, 1.0);
  return f_upper((chi_square - rich_) / used, used, freedom_);
}

PoseFinding Explainer::finding(const Tried& t) const {
  PoseFinding out;
  out.id = t.hypothesis->id;
  out.name = t.hypothesis->name;
  if (out.id == "hand_load" && t.beta[0] < 0) out.name = "less weight in the hand than the arm file has";
  out.joint = t.hypothesis->joint;
  out.chi_square = t.chi_square;
  out.behind = t.score - tried_.front().score;
  const auto k = static_cast<double>(t.beta.size());
  out.p_value = std::min(1.0, gain_p(chi_square_ - t.chi_square, k) * static_cast<double>(tried_.size()));
  out.left_p = left_p(t.chi_square, k);
  for (Eigen::Index i = 0; i < t.beta.size(); ++i) {
    Estimated e;
    e.name = t.hypothesis->parameters[static_cast<std::size_t>(i)];
    e.unit = t.hypothesis->units[static_cast<std::size_t>(i)];
    e.value = t.beta[i];
    e.std_error = std::sqrt(std::max(t.covariance(i, i), 0.0));
    e.ci_low = e.value - kTwoSided * e.std_error;
    e.ci_high = e.value + kTwoSided * e.std_error;
    out.parameters.push_back(e);
  }
  return out;
}

/// Masses that would leave the same torques: only their own identification rules them out.
void Explainer::find_lookalikes(const Tried& best) {
  if (options_.doubt_masses || best.beta.size() != 1) return;
  const Vector mine = root_.whiten(best.hypothesis->columns.col(0));
  for (std::size_t k = 0; k < problem_.arm.mass_names.size(); ++k) {
    const Vector other = root_.whiten(problem_.column({MassUnknown::Kind::kMass, k, "", "kg"}, masses_));
    if (std::abs(mine.dot(other)) > kAlike * mine.norm() * other.norm())
      out_.lookalikes.push_back(problem_.arm.mass_names[k]);
  }
}

void Explainer::fill_gaps(const Tried* best) {
  const Vector& after = best != nullptr ? best->left : residual_;
  std::array<double, kArmJoints> before_sum{}, after_sum{}, noise_sum{}, count{};
  for (std::size_t i = 0; i < problem_.data.size(); ++i) {
    const MassDatum& row = problem_.data[i];
    const auto at = static_cast<Eigen::Index>(i);
    before_sum[row.joint] += std::pow(residual_[at] * row.noise, 2);
    after_sum[row.joint] += std::pow(after[at] * row.noise, 2);
    noise_sum[row.joint] += row.noise * row.noise;
    count[row.joint] += 1;
    out_.rows.push_back(
        {row.pose, static_cast<int>(row.joint), residual_[at] * row.noise, after[at] * row.noise});
  }
  for (const MassPose& pose : problem_.poses) out_.pose_names.push_back(pose.name);
  double all = 0;
  for (std::size_t j = 0; j < kArmJoints; ++j) {
    if (!(count[j] > 0)) continue;
    out_.gaps.push_back({static_cast<int>(j), std::sqrt(before_sum[j] / count[j]),
                         std::sqrt(after_sum[j] / count[j]), std::sqrt(noise_sum[j] / count[j])});
    out_.before += before_sum[j];
    out_.after += after_sum[j];
    out_.noise += noise_sum[j];
    all += count[j];
  }
  for (double* sum : {&out_.before, &out_.after, &out_.noise}) *sum = std::sqrt(*sum / all);
}

void Explainer::conclude() {
  const ArmVector& noise = options_.fit.torque_noise;
  out_.noise_told = std::any_of(noise.begin(), noise.end(), [](double n) { return std::isfinite(n); });
  out_.torques = problem_.data.size();
  out_.poses = problem_.poses.size() - out_.outliers.size();
  const double whole = left_p(chi_square_, 0);
  double total = 0;
  std::vector<PoseFinding> all;
  for (const Tried& t : tried_) {
    all.push_back(finding(t));
    all.back().confidence = std::exp(-0.5 * all.back().behind);
    total += all.back().confidence;
  }
  for (PoseFinding& f : all) f.confidence /= total;
  double least = 1;
  for (const PoseFinding& f : all) least = std::min(least, f.p_value);
  out_.p_value = std::min(least, whole);
  const bool seen = least < kSeen || whole < kSeenAsWhole;
  if (!seen) {
    for (PoseFinding& f : all) {
      if (f.parameters.size() != 1) continue;
      f.parameters[0].value = 3 * f.parameters[0].std_error;
      if (f.id == "hand_load") f.name = kLoadName;
      out_.could_hide.push_back(f);
    }
    fill_gaps(nullptr);
    return;
  }
  const bool enough = !all.empty() && least < kSeen && all.front().left_p >= kLeftOver;
  fill_gaps(tried_.empty() ? nullptr : &tried_.front());
  if (!enough) {
    out_.verdict = PoseVerdict::kUnknown;
    out_.rejected = std::move(all);
    return;
  }
  for (PoseFinding& f : all) (f.behind < kApart ? out_.findings : out_.rejected).push_back(std::move(f));
  out_.verdict = out_.findings.size() == 1 ? PoseVerdict::kNamed : PoseVerdict::kNotSeparable;
  find_lookalikes(tried_.front());
}

}  // namespace

PoseExplanation explain_poses(const MassArm& arm, std::span<const MassPose> poses,
                              const PoseExplainOptions& options) {
  return Explainer(arm, poses, options).run();
}

}  // namespace isac::estimate
