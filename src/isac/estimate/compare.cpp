#include "isac/estimate/compare.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <boost/math/distributions/normal.hpp>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <optional>

#include "isac/core/units.hpp"

namespace isac::estimate {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNormalQuantile = 1.959963984540054;  // of 97.5 %

struct Known {
  double value = 0, std_error = 0, half_width = std::numeric_limits<double>::quiet_NaN();
};

/// `estimate` in the unit of `reference`; nothing when the dimensions differ.
std::optional<Known> in_unit_of(const Estimated& estimate, const Estimated& reference) {
  Known known{estimate.value, estimate.std_error, (estimate.ci_high - estimate.ci_low) / 2};
  if (estimate.unit == reference.unit) return known;
  const auto from = parse_unit(estimate.unit), to = parse_unit(reference.unit);
  if (!from || !to || from->dimension != to->dimension) return std::nullopt;
  const double factor = from->scale / to->scale;
  return Known{(known.value * from->scale + from->offset - to->offset) / to->scale, known.std_error * factor,
               known.half_width * factor};
}

double quantile(double freedom) {
  return boost::math::quantile(boost::math::students_t(freedom), 0.975);
}

/// Degrees of freedom whose 97.5 % quantile is half width / standard error, by bisection over log ν.
double freedom_of(const Known& known) {
  const double ratio = known.half_width / known.std_error;
  // Written numbers carry rounding: a ratio within 1e-3 of the normal one (ν > 1300) is taken as normal.
  if (!std::isfinite(ratio) || ratio <= kNormalQuantile + 1e-3) return kInfinity;
  double low = 0, high = std::log(2e3);
  if (ratio >= quantile(1.0)) return 1.0;
  for (int i = 0; i < 60; ++i) {
    const double middle = (low + high) / 2;
    (quantile(std::exp(middle)) > ratio ? low : high) = middle;
  }
  return std::exp((low + high) / 2);
}

double two_sided_p(double t, double freedom) {
  const double size = std::abs(t);
  if (std::isinf(freedom)) return 2 * boost::math::cdf(boost::math::complement(boost::math::normal(), size));
  return 2 * boost::math::cdf(boost::math::complement(boost::math::students_t(freedom), size));
}

/// A standard error that is not known counts as zero beside one that is; both unknown is no basis for a test.
double known_or_zero(double std_error) {
  return std::isfinite(std_error) && std_error > 0 ? std_error : 0.0;
}

ParameterChange change_of(const Estimated& before, const Estimated& after) {
  ParameterChange change;
  change.name = before.name;
  change.unit = before.unit;
  change.before = before.value;
  const auto late = in_unit_of(after, before);
  if (!late) {
    change.sentence = fmt::format("{} cannot be compared: its units {} and {} are of different kinds.",
                                  before.name, before.unit, after.unit);
    return change;
  }
  change.after = late->value;
  if (!std::isfinite(before.value) || !std::isfinite(late->value)) {
    change.sentence = fmt::format("{} cannot be compared: it is not known in {} file.", before.name,
                                  !std::isfinite(before.value) && !std::isfinite(late->value) ? "either"
                                  : std::isfinite(late->value)                                ? "the first"
                                                                                              : "the second");
    return change;
  }
  const Known early{before.value, known_or_zero(before.std_error), (before.ci_high - before.ci_low) / 2};
  const double s1 = early.std_error, s2 = known_or_zero(late->std_error);
  change.std_error = std::hypot(s1, s2);
  if (!(change.std_error > 0)) {
    change.sentence =
        fmt::format("{} cannot be compared: neither file gives its standard error.", before.name);
    return change;
  }
  const double nu1 = s1 > 0 ? freedom_of(early) : kInfinity, nu2 = s2 > 0 ? freedom_of(*late) : kInfinity;
  const double share1 = s1 * s1 / (change.std_error * change.std_error), share2 = 1 - share1;
  const double inverse = share1 * share1 / nu1 + share2 * share2 / nu2;  // 1/ν of Welch and Satterthwaite
  change.freedom = inverse > 0 ? 1 / inverse : kInfinity;
  change.z = (change.after - change.before) / change.std_error;
  change.p_raw = two_sided_p(change.z, change.freedom);
  change.comparable = true;
  return change;
}

/// Holm: the k-th smallest of m p-values times m − k + 1, never below its predecessor, never above one.
void correct_by_holm(std::vector<ParameterChange>& changes, double alpha) {
  std::vector<ParameterChange*> tested;
  for (ParameterChange& change : changes) {
    if (change.comparable) tested.push_back(&change);
  }
  std::ranges::stable_sort(tested, {}, [](const ParameterChange* change) { return change->p_raw; });
  double least = 0;
  for (std::size_t k = 0; k < tested.size(); ++k) {
    least = std::max(least, std::min(1.0, tested[k]->p_raw * static_cast<double>(tested.size() - k)));
    tested[k]->p_value = least;
    tested[k]->significant = least < alpha;
  }
}

void write_sentence(ParameterChange& change) {
  if (!change.comparable) return;
  const double difference = change.after - change.before;
  if (difference == 0) {
    change.sentence = fmt::format("{} is the same in both files.", change.name);
    return;
  }
  // Of the size, so that −23450 → −24000 N/m "grew in size by 2.3 %" and no sign is lost.
  const bool same_sign = change.before * change.after > 0;
  std::string how;
  if (same_sign) {
    const double percent = 100 * (std::abs(change.after) / std::abs(change.before) - 1);
    const char* verb = percent > 0 ? (change.before > 0 ? "rose" : "grew in size")
                                   : (change.before > 0 ? "fell" : "shrank in size");
    how = fmt::format("{} by {:.3g} %", verb, std::abs(percent));
  } else {
    how = fmt::format("went from {:.4g} to {:.4g} {}", change.before, change.after, change.unit);
  }
  const double size = std::abs(change.z);
  const std::string judged = !change.significant ? "which is within its uncertainty"
                             : size > 4          ? "far more than its uncertainty"
                                                 : "more than its uncertainty";
  const std::string p = change.p_value < 1e-15 ? "p < 1e-15" : fmt::format("p = {:.1g}", change.p_value);
  change.sentence = fmt::format("{} {}, {} ({}).", change.name, how, judged, p);
}

}  // namespace

std::vector<ParameterChange> compare(std::span<const Estimated> before, std::span<const Estimated> after,
                                     double alpha) {
  std::vector<ParameterChange> changes;
  const auto find = [](std::span<const Estimated> list, const std::string& name) {
    return std::ranges::find(list, name, &Estimated::name);
  };
  for (const Estimated& early : before) {
    const auto late = find(after, early.name);
    if (late != after.end()) {
      changes.push_back(change_of(early, *late));
      continue;
    }
    ParameterChange gone;
    gone.name = early.name;
    gone.unit = early.unit;
    gone.before = early.value;
    gone.sentence = fmt::format("{} stands only in the first file.", early.name);
    changes.push_back(std::move(gone));
  }
  for (const Estimated& late : after) {
    if (find(before, late.name) != before.end()) continue;
    ParameterChange fresh;
    fresh.name = late.name;
    fresh.unit = late.unit;
    fresh.after = late.value;
    fresh.sentence = fmt::format("{} stands only in the second file.", late.name);
    changes.push_back(std::move(fresh));
  }
  correct_by_holm(changes, alpha);
  for (ParameterChange& change : changes) write_sentence(change);
  return changes;
}

}  // namespace isac::estimate
