#include "isac/card/sim_options.hpp"

#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>

#include "isac/card/sim_params.hpp"
#include "isac/core/error.hpp"
#include "isac/core/units.hpp"

namespace isac::card {

namespace {

using simulate::RigConfig;

[[noreturn]] void refuse(std::string_view option, std::string_view value, const std::string& expected) {
  throw Error(ErrorKind::kUsage, "sim_option_value",
              "sim: option '" + std::string(option) + "' has '" + std::string(value) + "'; it needs " +
                  expected + ".");
}

double number(std::string_view option, std::string_view text, double low, double high) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  const bool whole = error == std::errc() && end == text.data() + text.size();
  if (!whole || !std::isfinite(value) || value < low || value > high) {
    std::array<char, 96> range{};
    std::snprintf(range.data(), range.size(), "a number from %g to %g", low, high);
    refuse(option, text, range.data());
  }
  return value;
}

bool on_off(std::string_view option, std::string_view text) {
  if (text != "on" && text != "off") refuse(option, text, "'on' or 'off'");
  return text == "on";
}

struct Option {
  const char* name;
  const char* help;
  void (*apply)(RigConfig& config, std::string_view name, std::string_view value);
};

void set_seed(RigConfig& config, std::string_view name, std::string_view value) {
  const auto [end, error] = std::from_chars(value.data(), value.data() + value.size(), config.seed);
  if (error != std::errc() || end != value.data() + value.size())
    refuse(name, value, "a whole number not below 0");
}

void set_noise(RigConfig& config, std::string_view name, std::string_view value) {
  using simulate::NoiseKind;
  if (value == "none") {
    config.sensors.noise = NoiseKind::kNone;
  } else if (value == "white") {
    config.sensors.noise = NoiseKind::kWhite;
  } else if (value == "coloured") {
    config.sensors.noise = NoiseKind::kColoured;
  } else {
    refuse(name, value, "'none', 'white' or 'coloured'");
  }
}

void add_effect(RigConfig& config, std::string_view name, std::string_view value) {
  simulate::HiddenEffect effect;
  const auto colon = value.find(':');
  effect.id = std::string(value.substr(0, colon));
  while (value.find(':') != std::string_view::npos) {
    value.remove_prefix(value.find(':') + 1);
    effect.parameters.push_back(number(name, value.substr(0, value.find(':')), -1e9, 1e9));
  }
  config.effects.push_back(std::move(effect));
}

void set_force_range(RigConfig& config, std::string_view name, std::string_view value) {
  const double range = number(name, value, 1, 1e5);
  config.joint.pretension *= range / config.sensors.force_range;
  config.sensors.force_range = range;
}

template <typename Set>
void both_valves(RigConfig& config, Set set) {
  for (auto& valve : config.valves) set(valve);
}

constexpr double kP = kPascalPerKgfCm2;
using Text = std::string_view;

constexpr std::array kOptions{
    Option{"seed", "whole number, 1: the same seed gives the same codes", set_seed},
    Option{"noise", "none, white or coloured (coloured)", set_noise},
    Option{"force_noise", "N, standard deviation (0.3)",
           [](RigConfig& c, Text n, Text v) { c.sensors.force_noise = number(n, v, 0, 1e3); }},
    Option{"pressure_noise", "kg/cm2, standard deviation (0.004)",
           [](RigConfig& c, Text n, Text v) { c.sensors.pressure_noise = kP * number(n, v, 0, 5); }},
    Option{"hum", "N, amplitude of the 60 Hz mains hum on the forces (0)",
           [](RigConfig& c, Text n, Text v) { c.sensors.force_hum = number(n, v, 0, 1e3); }},
    Option{"force_range", "N over 0 to 10 V (200)", set_force_range},
    Option{"jitter", "on or off: late sampling instants and noisy stamps (on)",
           [](RigConfig& c, Text n, Text v) { c.timing.jitter = on_off(n, v); }},
    Option{"drop", "chance of a wake-up one period late (0)",
           [](RigConfig& c, Text n, Text v) { c.timing.drop_chance = number(n, v, 0, 1); }},
    Option{"miscalibrated", "on or off: gains, zeros and encoder middle off the data sheet (off)",
           [](RigConfig& c, Text n, Text v) { c.miscalibrated = on_off(n, v); }},
    Option{"params", "FILE: parameters and effects of a params.toml; later words win",
           [](RigConfig& c, Text, Text v) { apply_params(c, std::string(v)); }},
    Option{"effect", "ID:X:...: a hidden effect, its parameters in SI; may be repeated", add_effect},
    Option{"A", "N/m (-23450)", [](RigConfig& c, Text n, Text v) { c.joint.A = number(n, v, -1e8, 0); }},
    Option{"B", "N cm2/kg (174.2)",
           [](RigConfig& c, Text n, Text v) { c.joint.B = number(n, v, 0, 1e6) / kP; }},
    Option{"C", "N m s3 (0.0026)", [](RigConfig& c, Text n, Text v) { c.joint.C = number(n, v, 0, 1e3); }},
    Option{"D", "N m s (0.14)", [](RigConfig& c, Text n, Text v) { c.joint.D = number(n, v, 0, 1e3); }},
    Option{"radius", "m, of the chain wheel (0.019)",
           [](RigConfig& c, Text n, Text v) { c.joint.wheel_radius = number(n, v, 1e-4, 1); }},
    Option{"inertia", "kg m2 (0.0085)",
           [](RigConfig& c, Text n, Text v) { c.joint.inertia = number(n, v, 1e-6, 100); }},
    Option{"p0", "kg/cm2, initial pressure (3)",
           [](RigConfig& c, Text n, Text v) { c.joint.initial_pressure = kP * number(n, v, 0, 10); }},
    Option{"K_C", "gain of the valve units (1)",
           [](RigConfig& c, Text n, Text v) {
             both_valves(c, [x = number(n, v, 0.01, 10)](auto& valve) { valve.gain = x; });
           }},
    Option{"T_C", "s, lag of the valve units (0.17)",
           [](RigConfig& c, Text n, Text v) {
             both_valves(c,
                         [x = number(n, v, 1e-3, 100)](auto& valve) { valve.fill_lag = valve.vent_lag = x; });
           }},
    Option{"T_fill", "s, lag while filling (0.17)",
           [](RigConfig& c, Text n, Text v) {
             both_valves(c, [x = number(n, v, 1e-3, 100)](auto& valve) { valve.fill_lag = x; });
           }},
    Option{"T_vent", "s, lag while venting (0.17)",
           [](RigConfig& c, Text n, Text v) {
             both_valves(c, [x = number(n, v, 1e-3, 100)](auto& valve) { valve.vent_lag = x; });
           }},
    Option{"dead_time", "s, of the tubes (0)",
           [](RigConfig& c, Text n, Text v) {
             both_valves(c, [x = number(n, v, 0, 5)](auto& valve) { valve.dead_time = x; });
           }},
};

std::string known_names() {
  std::string names;
  for (const auto& option : kOptions) names += (names.empty() ? "" : ", ") + std::string(option.name);
  return names;
}

void apply(RigConfig& config, std::string_view word) {
  const auto equals = word.find('=');
  std::string_view name = word.substr(0, equals);
  // A bare word is a switch: "sim:miscalibrated".
  const std::string_view value = equals == std::string_view::npos ? "on" : word.substr(equals + 1);
  for (const auto& option : kOptions) {
    if (name == option.name) return option.apply(config, name, value);
  }
  throw Error(ErrorKind::kUsage, "sim_option_unknown",
              "sim: has no option '" + std::string(name) + "'; it knows " + known_names() + ".");
}

}  // namespace

simulate::RigConfig parse_sim(std::string_view text) {
  RigConfig config;
  config.timing.jitter = true;
  while (!text.empty()) {
    const auto comma = text.find(',');
    apply(config, text.substr(0, comma));
    text.remove_prefix(comma == std::string_view::npos ? text.size() : comma + 1);
  }
  return config;
}

std::string sim_help() {
  std::string help;
  for (const auto& option : kOptions) help += "  " + std::string(option.name) + "=  " + option.help + "\n";
  return help;
}

}  // namespace isac::card
