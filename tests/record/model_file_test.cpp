#include "isac/record/model_file.hpp"

#include <gtest/gtest.h>

#include <filesystem>

#include "isac/core/error.hpp"
#include "isac/models/effects.hpp"

namespace isac::record {
namespace {

TEST(ModelFile, reads_an_axis_with_a_motor) {
  const ModelFile model = read_model(std::filesystem::path(ISAC_SOURCE_DIR) / "fixtures/rig/axis_model.toml");
  EXPECT_EQ(model.output_signal, "force_motor");
  EXPECT_EQ(model.output_unit, "N");
  EXPECT_EQ(model.position, "position");
  EXPECT_EQ(model.terms,
            (std::vector<std::string>{"inertia", "viscous_damping", "coulomb_friction", "offset"}));
}

TEST(ModelFile, without_output_speaks_of_torque_and_angle) {
  const ModelFile model =
      parse_model("format = \"isac.model/1\"\nterms = [\"A\", \"B\", \"C\", \"D\"]\n", "x.toml");
  EXPECT_EQ(model.output_signal, "torque");
  EXPECT_EQ(model.output_unit, "N m");
  EXPECT_EQ(model.position, "angle");
}

TEST(ModelFile, knows_every_term_of_the_catalogue_and_writes_what_it_reads) {
  ModelFile model;
  model.name = "all terms";
  model.output_signal = "force_motor";
  model.output_unit = "N";
  model.position = "x";
  for (const models::EffectInfo& effect : models::effect_catalogue()) model.terms.emplace_back(effect.id);
  ASSERT_GT(model.terms.size(), 30u);
  const ModelFile back = parse_model(format_model(model), "x.toml");
  EXPECT_EQ(back.terms, model.terms);
  EXPECT_EQ(back.name, model.name);
  EXPECT_EQ(back.output_signal, model.output_signal);
  EXPECT_EQ(back.output_unit, model.output_unit);
  EXPECT_EQ(back.position, model.position);
}

}  // namespace
}  // namespace isac::record
