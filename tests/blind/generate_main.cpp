// blind_generate: writes one dataset and, outside of it, its label.
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <optional>
#include <stdexcept>
#include <string>

#include "label.hpp"

namespace {

constexpr const char* kUsage =
    "blind_generate --out FOLDER --label FILE [--seed N] [--effect ID[,ID]] [--ratio X] [--noise KIND] "
    "[--day DAY] [--oracle]\n"
    "blind_generate --list\n"
    "  KIND is white, coloured, quantised or real (real reads the folder ISAC_REAL_DATA)\n"
    "  DAY is drawn (default) or protocol: another joint, strokes all alike, sines, levels out of a table\n"
    "  without --effect, or with --effect none, nothing is hidden\n"
    "ends with 0: written; 1: the effect cannot reach the ratio with a plausible size, only the label is "
    "written;\n"
    "2: wrong words; 3: a file cannot be read or written\n";

struct Words {
  blind::Request request;
  std::filesystem::path out, label;
  bool oracle = false, list = false;
};

std::vector<std::string> split(const std::string& text) {
  std::vector<std::string> parts;
  for (std::size_t from = 0; from <= text.size();) {
    const std::size_t comma = std::min(text.find(',', from), text.size());
    if (comma > from) parts.push_back(text.substr(from, comma - from));
    from = comma + 1;
  }
  return parts;
}

Words read_words(int count, char** words) {
  Words w;
  for (int i = 1; i < count; ++i) {
    const std::string word = words[i];
    const auto next = [&]() -> std::string {
      if (i + 1 >= count) throw std::invalid_argument(word + " needs a value");
      return words[++i];
    };
    if (word == "--list")
      w.list = true;
    else if (word == "--oracle")
      w.oracle = true;
    else if (word == "--out")
      w.out = next();
    else if (word == "--label")
      w.label = next();
    else if (word == "--seed")
      w.request.seed = std::stoull(next());
    else if (word == "--ratio")
      w.request.ratio = std::stod(next());
    else if (word == "--noise")
      w.request.noise = next();
    else if (word == "--day")
      w.request.day = next();
    else if (word == "--effect")
      w.request.ids = split(next());
    else
      throw std::invalid_argument("unknown word '" + word + "'");
  }
  if (w.request.ids == std::vector<std::string>{"none"}) w.request.ids.clear();
  if (!w.list && (w.out.empty() || w.label.empty()))
    throw std::invalid_argument("--out and --label are needed");
  if (const char* folder = std::getenv("ISAC_REAL_DATA")) w.request.recordings = folder;
  return w;
}

int generate(const Words& words) {
  const blind::Dataset dataset = blind::make_dataset(words.request);
  const bool testable = dataset.not_testable.empty();
  std::optional<blind::Verdict> verdict;
  if (words.oracle && testable && !dataset.hidings.empty()) verdict = blind::judge(dataset);
  blind::Gap noise, closes;
  if (testable) {
    const std::vector<blind::Signals> noisy = blind::write_dataset(dataset, words.out);
    noise = blind::heldout_noise(dataset, noisy);
    closes = blind::heldout_closes(dataset, noisy);
  }
  std::ofstream label(words.label);
  label << blind::label_of(dataset, noise, closes, verdict ? &*verdict : nullptr);
  if (!label.flush()) throw std::runtime_error("cannot write " + words.label.string());
  return testable ? 0 : 1;
}

}  // namespace

int main(int count, char** list) {
  try {
    const Words words = read_words(count, list);
    if (!words.list) return generate(words);
    for (const blind::Effect& one : blind::effects())
      std::cout << one.id << ' ' << one.subsystem << (one.catalogued ? "" : " outside") << '\n';
    return 0;
  } catch (const std::invalid_argument& wrong) {
    std::cerr << wrong.what() << '\n' << kUsage;
    return 2;
  } catch (const std::exception& failure) {
    std::cerr << failure.what() << '\n';
    return 3;
  }
}
