#include "isac/record/model_file.hpp"

#include <algorithm>
#include <string_view>

#include "isac/models/effects.hpp"
#include "isac/record/toml_document.hpp"
#include "isac/record/toml_quantity.hpp"

namespace isac::record {
namespace {

std::vector<std::string_view> known_terms() {
  std::vector<std::string_view> ids = {"A", "B", "C", "D"};
  for (const models::EffectInfo& effect : models::effect_catalogue()) ids.emplace_back(effect.id);
  return ids;
}

void read_output(const toml::table& table, const std::string& file, ModelFile& model) {
  const TomlSection section(table, "output", file, {"signal", "unit"});
  const auto signal = section.text("signal");
  const auto unit = section.text("unit");
  if (!signal || signal->empty()) {
    section.fail("signal", "value_missing",
                 "'output' names no signal; write output = { signal = \"torque\", unit = \"N m\" }");
  }
  if (!unit)
    section.fail("unit", "unit_missing",
                 "'output' has no unit; write output = { signal = \"torque\", unit = \"N m\" }");
  if (!parse_compound_unit(*unit)) {
    section.fail(
        "unit", "unit_unknown",
        "'unit' is " + toml_string(*unit) + ", which is not a known unit; write one like \"N m\" or \"N\"");
  }
  model.output_signal = *signal;
  model.output_unit = *unit;
}

void read_terms(const TomlSection& top, const std::string& file, ModelFile& model) {
  model.terms = top.texts("terms");
  if (model.terms.empty()) {
    top.fail("terms", "value_missing",
             "a model needs 'terms'; name at least one, like terms = [\"inertia\", \"viscous_damping\"]");
  }
  const toml::array& array = *top.raw().get_as<toml::array>("terms");
  for (std::size_t i = 0; i < model.terms.size(); ++i) {
    const std::string& term = model.terms[i];
    if (std::ranges::count(model.terms.begin(), model.terms.begin() + static_cast<std::ptrdiff_t>(i), term) >
        0) {
      fail_at(array[i], file, "term_twice", "names the term '" + term + "' a second time; keep one of them");
    }
    if (models::find_effect(term) >= 0) continue;
    const std::string nearest = nearest_word(term, known_terms());
    fail_at(array[i], file, "term_unknown",
            "'" + term + "' is not a term of the catalogue; " +
                (nearest.empty() ? "docs/effects.md lists them, and A, B, C, D are the seed's"
                                 : "did you mean '" + nearest + "'?"));
  }
}

}  // namespace

ModelFile parse_model(const std::string& text, const std::string& file) {
  const toml::table root = parse_toml(text, file);
  const TomlSection top(root, "", file, {"format", "name", "output", "position", "terms"});
  top.require_format("isac.model/1");
  ModelFile model;
  model.name = top.text("name").value_or("");
  if (const auto* output = top.table("output")) read_output(*output, file, model);
  model.position = top.text("position").value_or(model.position);
  if (model.position.empty())
    top.fail("position", "value_missing",
             "'position' is empty; name the column of the coordinate, like \"angle\"");
  read_terms(top, file, model);
  return model;
}

ModelFile read_model(const std::filesystem::path& path) {
  return parse_model(read_text_file(path), path.string());
}

std::string format_model(const ModelFile& model) {
  std::string out = "format = \"isac.model/1\"\n";
  if (!model.name.empty()) out += "name = " + toml_string(model.name) + "\n";
  out += "output = { signal = " + toml_string(model.output_signal) +
         ", unit = " + toml_string(model.output_unit) + " }\n";
  out += "position = " + toml_string(model.position) + "\nterms = [";
  for (std::size_t i = 0; i < model.terms.size(); ++i)
    out += (i == 0 ? "" : ", ") + toml_string(model.terms[i]);
  return out + "]\n";
}

}  // namespace isac::record
