#include "label.hpp"

#include "json.hpp"

namespace blind {
namespace {

void write_hiding(JsonWriter& json, const Hiding& h) {
  json.open('{').field("id", h.effect->id).field("subsystem", h.effect->subsystem);
  json.field("amplitude", h.amplitude)
      .field("amplitude_name", h.effect->amplitude)
      .field("unit", h.effect->unit);
  json.key("shape").open('{');
  for (const auto& [name, value] : h.shape) json.field(name, value);
  json.close('}').field("ratio", h.ratio).field("signal", h.signal).close('}');
}

void write_gap(JsonWriter& json, const char* name, const char* unit, double fitted, double heldout,
               double noise, double closes) {
  // The true model leaves nothing of a gap that is free of noise.
  json.key(name)
      .open('{')
      .field("unit", unit)
      .field("fitted_before", fitted)
      .field("heldout_before", heldout);
  json.field("heldout_after", 0.0).field("heldout_noise", noise).field("heldout_closes", closes).close('}');
}

}  // namespace

std::string label_of(const Dataset& d, const Gap& noise, const Gap& closes, const Verdict* oracle) {
  const bool unknown = !d.hidings.empty() && !d.hidings.front().effect->catalogued;
  const char* kinds[] = {"none", "single", "pair"};
  JsonWriter json;
  json.open('{').field("schema", "isac.blind/1").field("seed", std::to_string(d.request.seed));
  json.field("kind", unknown ? "unknown" : kinds[std::min<std::size_t>(2, d.hidings.size())]);
  json.field("noise", d.noise.kind)
      .field("day", d.request.day)
      .field("ratio_asked", d.request.ratio)
      .field("testable", d.not_testable.empty());
  if (!d.not_testable.empty()) json.field("not_testable", d.not_testable);
  std::vector<std::string> ids, subsystems;
  bool sensor = false;
  for (const Hiding& h : d.hidings) {
    ids.push_back(h.effect->id);
    subsystems.push_back(h.effect->subsystem);
    sensor = sensor || h.effect->subsystem == "sensor";
  }
  json.list("ids", ids)
      .list("subsystems", subsystems)
      .field("side", d.hidings.empty() ? ""
                     : sensor          ? "sensor"
                                       : "process");
  json.list("depends_on", unknown ? d.hidings.front().effect->depends_on : std::vector<std::string>{});
  json.key("hidden").open('[');
  for (const Hiding& h : d.hidings) write_hiding(json, h);
  json.close(']');
  const auto base = [&](const char* name, double A, double B, double C, double D, double K_C, double T_C) {
    json.key(name).open('{').field("A", A).field("B", B).field("C", C).field("D", D).field("K_C", K_C);
    json.field("T_C", T_C).close('}');
  };
  base("rig", d.rig.A, d.rig.B, d.rig.C, d.rig.D, d.rig.K_C, d.rig.T_C);
  base("baseline", d.base.A, d.base.B, d.base.C, d.base.D, d.base.K_C, d.base.T_C);
  const double floors[] = {d.noise.torque_floor(d.rig.r), d.noise.pressure_floor(),
                           d.noise.balance_floor(d.rig)};
  json.key("floor")
      .open('{')
      .field("torque", floors[0])
      .field("pressure", floors[1])
      .field("balance", floors[2]);
  json.close('}');
  if (d.not_testable.empty()) {
    const Strength s = strength_of(d.gap, d.noise, d.rig);
    json.field("ratio", s.ratio).field("signal", s.signal);
  }
  json.key("gap").open('{');
  write_gap(json, "torque", "N m", d.gap.torque, d.heldout_gap.torque, noise.torque, closes.torque);
  write_gap(json, "pressure", "kg/cm2", d.gap.pressure, d.heldout_gap.pressure, noise.pressure,
            closes.pressure);
  write_gap(json, "balance", "N m", d.gap.balance, d.heldout_gap.balance, noise.balance, closes.balance);
  // What an answer's gap is counted on: the torque without the free runs, each pressure by itself.
  write_gap(json, "driven", "N m", d.gap.driven, d.heldout_gap.driven, noise.driven, closes.driven);
  write_gap(json, "p1", "kg/cm2", d.gap.p1, d.heldout_gap.p1, noise.p1, closes.p1);
  write_gap(json, "p2", "kg/cm2", d.gap.p2, d.heldout_gap.p2, noise.p2, closes.p2);
  json.close('}');
  if (oracle == nullptr) {
    json.key("oracle").null();
  } else {
    json.key("oracle")
        .open('{')
        .field("self", oracle->self)
        .field("none", oracle->none)
        .key("rivals")
        .open('{');
    for (const auto& [id, sigma] : oracle->rivals) json.field(id, sigma);
    json.close('}').list("class", oracle->equals);
    if (!oracle->alone.empty()) {
      json.key("alone").open('{');
      for (const auto& [id, sigma] : oracle->alone) json.field(id, sigma);
      json.close('}');
    }
    json.close('}');
  }
  return json.close('}').text() + "\n";
}

}  // namespace blind
