#include <charconv>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <stdexcept>

#include "dataset.hpp"

namespace blind {
namespace {

constexpr std::size_t kCell = 40;  // characters that a number may need

/// Writes x with `digits` decimals (at most 9) to `at`, as std::to_chars does, and returns the end. Millions of cells are
/// written for a dataset: where the rounding is beyond doubt, the digits come from an integer.
char* put(char* at, double x, int digits) {
  constexpr double kTens[] = {1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9};
  const double scaled = std::abs(x) * kTens[digits];
  if (!(scaled < 1e12)) return std::to_chars(at, at + kCell, x, std::chars_format::fixed, digits).ptr;
  auto whole = static_cast<std::uint64_t>(scaled);
  const double rest = scaled - static_cast<double>(whole);
  // The product is off by at most 6e-5 (half a last place below 1e12), so only next to a half could it mislead.
  if (std::abs(rest - 0.5) < 1e-3)
    return std::to_chars(at, at + kCell, x, std::chars_format::fixed, digits).ptr;
  if (rest > 0.5) ++whole;
  char backwards[kCell];
  int count = 0;
  for (; count < digits; whole /= 10) backwards[count++] = static_cast<char>('0' + whole % 10);
  if (digits > 0) backwards[count++] = '.';
  do {
    backwards[count++] = static_cast<char>('0' + whole % 10);
    whole /= 10;
  } while (whole > 0);
  if (std::signbit(x)) *at++ = '-';
  while (count > 0) *at++ = backwards[--count];
  return at;
}

void put(std::string& text, double x, int digits) {
  char cell[kCell];
  text.append(cell, put(cell, x, digits));
}

/// Seconds of the day as hh:mm:ss, from nine in the morning on.
std::string clock_of(double started) {
  const int s = 9 * 3600 + static_cast<int>(std::lround(started));
  const auto two = [](int n) { return (n < 10 ? "0" : "") + std::to_string(n); };
  return two(s / 3600) + ":" + two(s / 60 % 60) + ":" + two(s % 60);
}

void save(const std::filesystem::path& file, const std::string& text) {
  std::ofstream out(file, std::ios::binary);
  out.write(text.data(), static_cast<std::streamsize>(text.size()));
  if (!out.flush()) throw std::runtime_error("cannot write " + file.string());
}

std::string rig_toml(const Dataset& d) {
  std::string text = "format = \"isac.rig/1\"\nname = \"testbed\"\n\n[joint]\nchain_wheel_diameter = \"";
  // To a tenth of a millimetre and of a unit of pressure, as the rigs are drawn: 38 and 3.0 of the seed's.
  put(text, 2000.0 * d.rig.r, d.rig.r == 0.019 ? 0 : 1);
  text += " mm\"\ninitial_pressure = \"";
  put(text, d.rig.p0, 1);
  text += " kg/cm2\"\ninertia = \"";
  put(text, d.rig.inertia, 9);
  text += " kg m2\"\n\n[encoder]\nsteps_per_turn = 8000\n\n[sensors]\nforce_noise = \"";
  put(text, d.noise.force_white, 3);
  text += " N\"\npressure_noise = \"";
  put(text, d.noise.pressure_white, 5);
  text += " kg/cm2\"\n";
  return text;
}

std::string csv(const RunPlan& run, const Signals& s, bool jitter, Random& random) {
  std::string text =
      "# experiment: " + run.experiment + "\n# started: 2003-05-14T" + clock_of(run.started) +
      "\ntime [s],angle [rad],p1 [kg/cm2],p2 [kg/cm2],p1_cmd [kg/cm2],p2_cmd [kg/cm2],F1 [N],F2 [N]\n";
  text.reserve(text.size() + s.angle.size() * 80);
  for (std::size_t k = 0; k < s.angle.size(); ++k) {
    const double t = static_cast<double>(k) * kRowTime;
    char line[8 * (kCell + 1)];
    char* at = put(line, jitter ? t + 5e-6 * (random.normal() + 4.0) : t, 6);
    const double cells[] = {s.angle[k],       s.p1[k], s.p2[k], run.command_1[k],
                            run.command_2[k], s.F1[k], s.F2[k]};
    const int digits[] = {8, 6, 6, 5, 5, 4, 4};
    for (int i = 0; i < 7; ++i) {
      *at++ = ',';
      at = put(at, cells[i], digits[i]);
    }
    *at++ = '\n';
    text.append(line, at);
  }
  return text;
}

}  // namespace

std::vector<Signals> write_dataset(const Dataset& d, const std::filesystem::path& folder) {
  std::filesystem::create_directories(folder / "heldout");
  save(folder / "rig.toml", rig_toml(d));
  Random random(d.request.seed ^ 0x5bf03635aca3e1f1ull);
  std::vector<Signals> noisy;
  for (std::size_t i = 0; i < d.runs.size(); ++i) {
    noisy.push_back(add_noise(d.clean[i], d.noise, d.rig, random));
    const auto file = (d.runs[i].heldout ? folder / "heldout" : folder) / (d.runs[i].name + ".csv");
    save(file, csv(d.runs[i], noisy.back(), d.noise.jitter, random));
  }
  return noisy;
}

}  // namespace blind
