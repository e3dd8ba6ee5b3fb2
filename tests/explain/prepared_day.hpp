/// @file
/// A day of planned runs on the rig of tied_data.hpp, prepared, with the baseline fitted to it: where tests of single steps begin.
#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "isac/explain/fit.hpp"
#include "tied_data.hpp"

namespace isac::test {

struct PreparedDay {
  explain::Prepared data;
  explain::Library library;
  explain::Predictor predictor;
  explain::Weights weights;
  explain::Fit baseline;

  PreparedDay(const TiedRig& rig, const std::vector<explain::PlannedRun>& runs, double block_seconds = 2.0,
              std::uint32_t first = 1)
      : data(explain::prepare(record_all(rig, runs, first), rig.facts(), {}, block_seconds)),
        library(explain::make_library(data)),
        predictor(data) {
    weights.sigma[0] = weights.sigma[3] = 0.003;
    weights.sigma[1] = weights.sigma[2] = 150;  // Pa
    baseline = explain::fit_baseline(predictor, library.tolerances, weights);
  }
  PreparedDay(const PreparedDay&) = delete;  // its parts point at one another
  PreparedDay& operator=(const PreparedDay&) = delete;

  [[nodiscard]] const explain::Hypothesis& hypothesis(std::string_view form) const {
    for (const explain::Hypothesis& h : library.hypotheses)
      if (h.info().id == form) return h;
    throw std::out_of_range(std::string(form));
  }
};

}  // namespace isac::test
