// blind_baselines: what the usual methods say of a dataset, one answer of schema isac.explain/1 each, as one JSON object.
#include <iostream>

#include "isac/core/error.hpp"
#include "json.hpp"
#include "methods.hpp"

namespace {

/// As much of isac.explain/1 as the scorer reads.
void write_answer(blind::JsonWriter& json, const baselines::Said& said) {
  json.key(said.method).open('{').field("schema", "isac.explain/1");
  json.field("verdict", said.ids.empty() ? "none" : "named").field("seconds", said.seconds);
  json.key("disagreement").open('{').field("detected", !said.ids.empty()).key("signals").open('[').close(']');
  json.key("where").open('[').close(']').close('}');
  json.key("effects").open('[');
  for (std::size_t i = 0; i < said.ids.size(); ++i)
    json.open('{')
        .field("id", said.ids[i])
        .field("subsystem", said.subsystems[i])
        .field("confidence", said.confidence[i])
        .close('}');
  json.close(']').key("alternatives").open('[').close(']').key("unknown").null();
  json.key("gap").open('{').field("signal", said.signal).field("unit", said.unit);
  json.field("heldout_before", said.heldout_before).field("heldout_after", said.heldout_after).close('}');
  json.close('}');
}

}  // namespace

int main(int count, char** words) {
  if (count != 2) {
    std::cerr << "blind_baselines DATASET\nwrites what each baseline says, as one JSON object\n";
    return 2;
  }
  try {
    baselines::Bench bench;
    baselines::open_bench(words[1], bench);
    blind::JsonWriter json;
    json.open('{');
    for (const baselines::Said& said : baselines::all_methods(bench)) write_answer(json, said);
    std::cout << json.close('}').text() << '\n';
  } catch (const isac::Error& error) {
    std::cerr << "blind_baselines: " << error.what() << '\n';
    return 3;
  }
  return 0;
}
