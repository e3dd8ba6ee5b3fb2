/// @file
/// From the words of a call to what explain() is asked with: runs, held-out runs, rig, baseline.
///
/// Columns that explain() never reads are freed as soon as a file is read. Throws isac::Error: usage, bad input.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "isac/explain/explain.hpp"
#include "isac/record/rig.hpp"
#include "isac/series/recording.hpp"

namespace isac::apps {

struct ExplainWords {
  std::vector<std::string> dataset, heldout, maps, excluded;
  std::string rig, model;
  bool hash = false;  ///< digits of every file, for params.toml
};

struct ExplainInputs {
  record::Rig rig;
  std::string rig_file;  ///< empty: none
  std::string title;     ///< the model's or the rig's name
  explain::RigFacts facts;
  explain::BaselineModel baseline;
  series::ExcitationOptions limits;  ///< of the rig file, for the experiment that is asked for
  std::vector<series::Recording> runs;
  explain::HeldOut heldout;
  std::vector<std::string> sources;  ///< "sha256:<digits> name" of the runs that are fitted
};

[[nodiscard]] ExplainInputs read_inputs(const ExplainWords& words);

}  // namespace isac::apps
