// blind_score: tables from the results of blind_run, from ledgers, or from label and answer files.
#include <fstream>
#include <iostream>
#include <iterator>
#include <set>
#include <sstream>
#include <stdexcept>

#include "ledger.hpp"
#include "page/page.hpp"
#include "score.hpp"

namespace {

constexpr const char* kUsage =
    "blind_score [--seed N[,N]] [--into PAGE.md] RESULTS.jsonl [RESULTS.jsonl …]\n"
    "blind_score --pair LABEL.json ANSWER.json [--pair …]\n"
    "blind_score --ledger PROGRAM RESULTS.jsonl [RESULTS.jsonl …]\n"
    "writes Markdown tables to standard output, with --seed of those datasets only; with --into into "
    "PAGE.md, between "
    "its lines\n'<!-- blind_score: tables -->' and '<!-- blind_score: end -->', and the reliability diagram "
    "into "
    "PAGE/reliability.svg; with --ledger a\nshort line for each dataset, which says that PROGRAM answered "
    "and is read like "
    "results\n";

std::ifstream open_file(const std::string& file) {
  std::ifstream in(file);
  if (!in) throw std::runtime_error("cannot read " + file);
  return in;
}

std::string read_text(const std::string& file) {
  std::ifstream in = open_file(file);
  return {std::istreambuf_iterator<char>(in), {}};
}

}  // namespace

int main(int count, char** words) {
  std::vector<blind::Case> cases;
  std::string program, page;
  std::set<std::string> seeds;
  try {
    for (int i = 1; i < count; ++i) {
      if (std::string(words[i]) == "--ledger" && i + 1 < count) {
        program = words[++i];
        continue;
      }
      if (std::string(words[i]) == "--into" && i + 1 < count) {
        page = words[++i];
        continue;
      }
      if (std::string(words[i]) == "--seed" && i + 1 < count) {
        std::istringstream list(words[++i]);
        for (std::string seed; std::getline(list, seed, ',');) seeds.insert(seed);
        continue;
      }
      if (std::string(words[i]) == "--pair" && i + 2 < count) {
        cases.push_back(blind::read_pair(read_text(words[i + 1]), read_text(words[i + 2])));
        i += 2;
        continue;
      }
      std::ifstream in = open_file(words[i]);
      for (std::string line; std::getline(in, line);) {
        if (line.empty()) continue;
        // A run that was stopped leaves a line that was cut off; blind_run does that dataset again.
        if (line.back() == '}')
          cases.push_back(blind::read_case(line));
        else
          std::cerr << words[i] << ": a line that was cut off is left out\n";
      }
    }
    if (!seeds.empty())
      std::erase_if(
          cases, [&](const blind::Case& one) { return !seeds.contains(blind::seed_of_key(one.truth.key)); });
    blind::join_asked_alone(cases);
  } catch (const std::exception& failure) {
    std::cerr << failure.what() << '\n';
    return 3;
  }
  if (cases.empty()) {
    std::cerr << kUsage;
    return 2;
  }
  if (!page.empty()) {
    try {
      blind::write_page(page, cases);
    } catch (const std::exception& failure) {
      std::cerr << page << ": " << failure.what() << '\n';
      return 3;
    }
    return 0;
  }
  if (program.empty()) {
    std::cout << blind::report(cases);
    return 0;
  }
  for (const blind::Case& one : cases) std::cout << blind::ledger_line(one, program) << '\n';
  return 0;
}
