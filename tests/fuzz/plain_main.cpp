// A main for fuzzers where there is no libFuzzer: the corpus files given, then mutations of them from a fixed seed.
//
//   csv_fuzzer FILE…              a few thousand mutations (ISAC_FUZZ_RUNS says how many)
//
// A failure is an abort or a sanitizer's report; the input that did it is printed as C escapes, to be made a test.
#include <algorithm>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <vector>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace {

std::string current;  // for the signal handler

void show_input(int signal) {
  std::fprintf(stderr, "the input that failed (%zu bytes): \"", current.size());
  for (unsigned char c : current.substr(0, 4000)) {
    if (c >= 0x20 && c < 0x7F && c != '"' && c != '\\') {
      std::fputc(c, stderr);
    } else {
      std::fprintf(stderr, "\\%03o", c);
    }
  }
  std::fputs("\"\n", stderr);
  std::signal(signal, SIG_DFL);
  std::raise(signal);
}

void run(const std::string& input) {
  current = input;
  LLVMFuzzerTestOneInput(reinterpret_cast<const std::uint8_t*>(input.data()), input.size());
}

// One to eight small changes: bytes flipped, cut, doubled, spliced from another file, or replaced by tokens of the formats.
std::string mutated(std::string text, const std::vector<std::string>& corpus, std::mt19937& random) {
  static const std::string tokens[] = {"\n",
                                       "\r\n",
                                       "\r",
                                       ",",
                                       ";",
                                       "\t",
                                       "\"",
                                       "#",
                                       "# log: append-only\n",
                                       ":",
                                       "nan",
                                       "inf",
                                       "-",
                                       "+",
                                       "1e999",
                                       "1e-400",
                                       ".",
                                       "0",
                                       "[",
                                       "]",
                                       "[deg]",
                                       "[]",
                                       "=",
                                       "time [s]",
                                       "\xEF\xBB\xBF",
                                       "\xC2\xB2",
                                       "\xFF",
                                       std::string(1, '\0'),
                                       "99999999",
                                       "\"\""};
  const auto below = [&](std::size_t n) { return n == 0 ? 0 : random() % n; };
  const std::size_t changes = 1 + below(8);
  for (std::size_t i = 0; i < changes; ++i) {
    const std::size_t at = below(text.size() + 1);
    switch (below(6)) {
      case 0:
        if (at < text.size()) text[at] = static_cast<char>(random());
        break;
      case 1:
        text.erase(at, below(20));
        break;
      case 2:
        text.insert(at, tokens[below(std::size(tokens))]);
        break;
      case 3:
        text.insert(at, text.substr(below(text.size()), below(60)));
        break;
      case 4:
        text.resize(at);
        break;
      default: {
        const std::string& other = corpus[below(corpus.size())];
        text.insert(at, other.substr(below(other.size()), below(200)));
      }
    }
  }
  return text;
}

}  // namespace

int main(int argc, char** argv) {
  for (int signal : {SIGABRT, SIGSEGV, SIGFPE, SIGBUS, SIGILL}) std::signal(signal, show_input);
  std::vector<std::string> corpus{""};
  for (int i = 1; i < argc; ++i) {
    std::ifstream file(argv[i], std::ios::binary);
    if (!file) {
      std::fprintf(stderr, "%s cannot be read; give the files of the corpus\n", argv[i]);
      return 2;
    }
    corpus.emplace_back(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>());
    corpus.back().resize(
        std::min<std::size_t>(corpus.back().size(), 2000));  // short inputs find more per second
  }
  const char* wanted = std::getenv("ISAC_FUZZ_RUNS");
  const long runs = wanted != nullptr ? std::atol(wanted) : 6000;
  for (const std::string& input : corpus) run(input);
  std::mt19937 random(2003);
  for (long i = 0; i < runs; ++i) {
    std::string input = mutated(corpus[random() % corpus.size()], corpus, random);
    run(input);
    if (i % 64 == 0) corpus.push_back(std::move(input));  // mutations of mutations
  }
  std::printf("%zu corpus files and %ld mutations, seed 2003: nothing fell over\n",
              static_cast<std::size_t>(argc - 1), runs);
  return 0;
}
