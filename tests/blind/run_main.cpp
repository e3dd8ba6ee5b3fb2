// blind_run: generates the datasets of a plan one after another, has isac-explain judge each, and keeps one line per
// dataset. Started again with the same results file it goes on where it stopped.
#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <stdlib.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <fstream>
#include <iostream>
#include <iterator>
#include <mutex>
#include <optional>
#include <set>
#include <stdexcept>
#include <thread>

#include "json.hpp"
#include "label.hpp"

extern char** environ;

namespace {

constexpr const char* kUsage =
    "blind_run --results FILE --explain PROGRAM [--tier NAMES] [--noise KINDS] [--day DAY] [--effect IDS] "
    "[--count N] [--seed N]\n"
    "          [--jobs N] [--timeout S] [--oracle] [--twin] [--baselines PROGRAM] [-- WORDS FOR PROGRAM]\n"
    "  NAMES of none, strong, clear, faint, pair, outside (also called unknown), leave-one-out (comma "
    "between;\n"
    "  default all but the last); KINDS as in blind_generate\n"
    "  leave-one-out: the datasets of clear again, judged with '--exclude ID' of what is hidden\n"
    "  --count: datasets per kind of noise, where one effect is hidden also per effect (default 1)\n"
    "  --oracle: where one of the catalogue is hidden the label says what nobody can tell "
    "apart\n"
    "  --twin: the program is also asked about the same day with nothing hidden: the floor of the gap that "
    "it closes\n"
    "  --baselines: blind_baselines, asked about the same datasets; without --explain it is asked alone\n"
    "  among WORDS, {ids} stands for what is hidden, for a test that takes the truth out of the catalogue\n";

struct Plan {
  std::filesystem::path results, program, baselines, recordings;
  std::vector<std::string> tiers = {"none", "strong", "clear", "faint", "pair", "outside"};
  std::vector<std::string> noises = {"white", "coloured", "quantised", "real"};
  std::vector<std::string> only, words;
  std::string day = "drawn";
  int count = 1, jobs = 1;
  std::uint64_t seed = 1;
  double timeout = 120.0;
  bool oracle = false, twin = false;
};

struct Task {
  std::string key;
  blind::Request request;
  bool left_out = false;  ///< what is hidden is taken out of the program's catalogue
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

Plan read_plan(int count, char** list) {
  Plan plan;
  for (int i = 1; i < count; ++i) {
    const std::string word = list[i];
    if (word == "--") {
      plan.words.assign(list + i + 1, list + count);
      break;
    }
    if (word == "--oracle") {
      plan.oracle = true;
      continue;
    }
    if (word == "--twin") {
      plan.twin = true;
      continue;
    }
    if (i + 1 >= count) throw std::invalid_argument(word + " needs a value, or is unknown");
    const std::string value = list[++i];
    if (word == "--results")
      plan.results = value;
    else if (word == "--explain")
      plan.program = value;
    else if (word == "--baselines")
      plan.baselines = value;
    else if (word == "--tier")
      plan.tiers = split(value);
    else if (word == "--noise")
      plan.noises = split(value);
    else if (word == "--day")
      plan.day = value;
    else if (word == "--effect")
      plan.only = split(value);
    else if (word == "--count")
      plan.count = std::stoi(value);
    else if (word == "--jobs")
      plan.jobs = std::max(1, std::stoi(value));
    else if (word == "--seed")
      plan.seed = std::stoull(value);
    else if (word == "--timeout")
      plan.timeout = std::stod(value);
    else
      throw std::invalid_argument("unknown word '" + word + "'");
  }
  if (plan.results.empty() || (plan.program.empty() && plan.baselines.empty()))
    throw std::invalid_argument("--results and --explain (or --baselines) are needed");
  if (const char* folder = std::getenv("ISAC_REAL_DATA")) plan.recordings = folder;
  return plan;
}

/// The same key gives the same dataset, whatever else is in the plan.
std::uint64_t seed_of(const std::string& key) {
  std::uint64_t hash = 0xcbf29ce484222325ull;
  for (const char c : key) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3ull;
  return hash >> 1;
}

constexpr const char* kLeftOut = "leave-one-out";

class Tasks {
 public:
  explicit Tasks(const Plan& plan) : plan_(plan) {
    for (const std::string& tier : plan.tiers) {
      const std::size_t before = list.size();
      for (const std::string& noise : plan.noises) {
        if (noise == "real" && plan.recordings.empty()) continue;
        for (int i = 0; i < plan.count; ++i) add_tier(tier, noise, i);
      }
      if (list.size() == before)
        throw std::invalid_argument("no dataset comes out of tier '" + tier +
                                    "' (real noise needs ISAC_REAL_DATA)");
    }
  }

  std::vector<Task> list;

 private:
  void add_tier(const std::string& tier, const std::string& noise, int i) {
    if (tier == "none") {
      add(tier, noise, {}, 0.75, i);
    } else if (tier == "pair") {
      blind::Random random(seed_of("pair " + noise + std::to_string(i) + " " + std::to_string(plan_.seed)));
      std::vector<std::string> known;
      for (const blind::Effect& one : blind::effects())
        if (one.catalogued && one.id != "viscous_damping" && one.id != "cubic_damping")
          known.push_back(one.id);
      const int count = static_cast<int>(known.size()), a = random.index(count), b = random.index(count - 1);
      add(tier, noise,
          {known[static_cast<std::size_t>(a)], known[static_cast<std::size_t>(b < a ? b : b + 1)]}, 0.75, i);
    } else {
      const double ratio = tier == "strong" ? 2.0 : tier == "faint" ? 0.25 : 0.75;
      const bool outside = tier == "outside" || tier == "unknown";
      if (tier != "strong" && tier != "faint" && tier != "clear" && tier != kLeftOut && !outside)
        throw std::invalid_argument("no tier is called '" + tier + "'");
      for (const blind::Effect& one : blind::effects()) {
        if (one.catalogued == outside) continue;
        if (plan_.only.empty() || std::find(plan_.only.begin(), plan_.only.end(), one.id) != plan_.only.end())
          add(outside ? "unknown" : tier, noise, {one.id}, ratio, i);
      }
    }
  }
  void add(const std::string& tier, const std::string& noise, std::vector<std::string> ids, double ratio,
           int i) {
    std::string rest = "/" + noise + "/";
    for (std::size_t k = 0; k < ids.size(); ++k) rest += (k > 0 ? "+" : "") + ids[k];
    rest += "/" + std::to_string(plan_.seed) + "." + std::to_string(i);
    if (plan_.day != "drawn") rest += "/" + plan_.day;
    blind::Request request;
    const bool left_out = tier == kLeftOut;
    request.seed = seed_of((left_out ? "clear" : tier) + rest);  // the very dataset, now without its name
    request.ids = std::move(ids);
    request.ratio = ratio;
    request.noise = noise;
    request.recordings = plan_.recordings;
    request.day = plan_.day;
    list.push_back({tier + rest, std::move(request), left_out});
  }

  const Plan& plan_;
};

/// The keys that the results file holds already: every line begins with {"key":"…".
std::set<std::string> keys_of(const std::filesystem::path& results) {
  constexpr std::string_view kBegin = "{\"key\":\"";
  std::set<std::string> keys;
  std::ifstream in(results);
  for (std::string line; std::getline(in, line);)
    if (line.starts_with(kBegin) && line.ends_with('}'))
      keys.insert(line.substr(kBegin.size(), line.find('"', kBegin.size()) - kBegin.size()));
  return keys;
}

struct Outcome {
  int exit_code = -1;  ///< −1: ended by a signal, −2: killed because it took too long
  double seconds = 0;
  std::string out, err;
};

std::string read_text(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

double now() {
  timespec t{};
  clock_gettime(CLOCK_MONOTONIC, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

Outcome run_program(std::vector<std::string> words, const std::filesystem::path& folder, double timeout) {
  const std::string out = folder / "out", err = folder / "err";
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&actions, 1, out.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
  posix_spawn_file_actions_addopen(&actions, 2, err.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  Outcome outcome;
  const double start = now();
  pid_t child = 0;
  const int failed = posix_spawn(&child, argv[0], &actions, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (failed != 0) throw std::runtime_error("cannot start " + words[0]);
  int status = 0;
  while (waitpid(child, &status, WNOHANG) == 0) {
    if (now() - start > timeout) {
      kill(child, SIGKILL);
      waitpid(child, &status, 0);
      outcome.exit_code = -2;
      break;
    }
    usleep(5000);
  }
  outcome.seconds = now() - start;
  if (WIFEXITED(status)) outcome.exit_code = WEXITSTATUS(status);
  outcome.out = read_text(out);
  outcome.err = read_text(err);
  return outcome;
}

/// A folder of its own, removed at the end.
class Scratch {
 public:
  Scratch() {
    // A dataset is 20 MB that live for seconds: in memory, where the system has a place for that and nobody asked for another.
    const bool memory = std::getenv("TMPDIR") == nullptr && access("/dev/shm", W_OK | X_OK) == 0;
    const std::filesystem::path place = memory ? "/dev/shm" : std::filesystem::temp_directory_path();
    std::string pattern = (place / "isac-blind-XXXXXX").string();
    if (mkdtemp(pattern.data()) == nullptr) throw std::runtime_error("cannot make a temporary folder");
    path = pattern;
  }
  ~Scratch() {
    std::error_code ignored;
    std::filesystem::remove_all(path, ignored);
  }
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;
  std::filesystem::path path;
};

/// What the program says of the same rig, day and noise with nothing hidden.
std::string answer_to_twin(const Plan& plan, blind::Request request, const std::filesystem::path& folder) {
  request.ids.clear();
  request.ratio = 0;
  blind::write_dataset(blind::make_dataset(request), folder / "twin");
  return run_program({plan.program.string(), (folder / "twin").string(), "--json", "-"}, folder, plan.timeout)
      .out;
}

std::string line_of(const Plan& plan, const Task& task) {
  const Scratch scratch;
  const blind::Dataset dataset = blind::make_dataset(task.request);
  const bool testable = dataset.not_testable.empty();
  blind::Gap noise, closes;
  std::optional<blind::Verdict> verdict;
  std::optional<Outcome> outcome, baselines;
  if (testable) {
    const std::vector<blind::Signals> noisy = blind::write_dataset(dataset, scratch.path / "dataset");
    noise = blind::heldout_noise(dataset, noisy);
    closes = blind::heldout_closes(dataset, noisy);
    // Only a name can be tied with another: where none can be, nobody asks the oracle.
    const bool names = !dataset.hidings.empty() && dataset.hidings.front().effect->catalogued;
    if (plan.oracle && names) verdict = blind::judge(dataset);
    std::vector<std::string> words = {plan.program.string(), (scratch.path / "dataset").string(), "--json",
                                      "-"};
    std::string ids;
    for (const std::string& id : task.request.ids) ids += (ids.empty() ? "" : ",") + id;
    for (std::string word : plan.words) {
      if (const std::size_t at = word.find("{ids}"); at != std::string::npos) word.replace(at, 5, ids);
      words.push_back(std::move(word));
    }
    if (task.left_out)
      for (const std::string& id : task.request.ids) words.insert(words.end(), {"--exclude", id});
    if (!plan.program.empty()) outcome = run_program(std::move(words), scratch.path, plan.timeout);
    if (!plan.baselines.empty() && !task.left_out)  // they take nothing out of their dictionary
      baselines = run_program({plan.baselines.string(), (scratch.path / "dataset").string()}, scratch.path,
                              plan.timeout);
  }
  std::string label = blind::label_of(dataset, noise, closes, verdict ? &*verdict : nullptr);
  label.pop_back();  // its line end
  blind::JsonWriter json;
  json.open('{').field("key", task.key).key("label").raw(label);
  if (task.left_out) json.list("excluded", task.request.ids);
  if (outcome) {
    json.field("exit", static_cast<double>(outcome->exit_code)).field("seconds", outcome->seconds);
    json.field("answer", outcome->out).field("error", outcome->err.substr(0, 500));
    if (plan.twin && !task.request.ids.empty() && !task.left_out)
      json.field("bare", answer_to_twin(plan, task.request, scratch.path));
  }
  if (baselines && baselines->exit_code == 0) {
    while (!baselines->out.empty() && baselines->out.back() == '\n') baselines->out.pop_back();
    json.key("baselines").raw(baselines->out);
  }
  return json.close('}').text() + "\n";
}

int run(const Plan& plan) {
  const Tasks tasks(plan);
  const std::set<std::string> done = keys_of(plan.results);
  std::ofstream results(plan.results, std::ios::app);
  if (!results) throw std::runtime_error("cannot write " + plan.results.string());
  if (const std::string before = read_text(plan.results); !before.empty() && before.back() != '\n')
    results << '\n';  // the last line was cut off when the program was stopped
  std::atomic<std::size_t> next{0};
  std::atomic<bool> failed{false};
  std::mutex mutex;
  const auto work = [&] {
    for (std::size_t i = next++; i < tasks.list.size() && !failed; i = next++) {
      const Task& task = tasks.list[i];
      if (done.contains(task.key)) continue;
      try {
        const std::string line = line_of(plan, task);
        const std::lock_guard lock(mutex);
        results << line << std::flush;
        std::cerr << "\r" << i + 1 << "/" << tasks.list.size() << " " << task.key << "          "
                  << std::flush;
      } catch (const std::exception& problem) {
        const std::lock_guard lock(mutex);
        std::cerr << "\n" << task.key << ": " << problem.what() << "\n";
        failed = true;
      }
    }
  };
  std::vector<std::thread> threads;
  for (int i = 0; i < plan.jobs; ++i) threads.emplace_back(work);
  for (std::thread& thread : threads) thread.join();
  std::cerr << "\n";
  return failed ? 3 : 0;
}

}  // namespace

int main(int count, char** list) {
  try {
    return run(read_plan(count, list));
  } catch (const std::invalid_argument& wrong) {
    std::cerr << wrong.what() << '\n' << kUsage;
    return 2;
  } catch (const std::exception& failure) {
    std::cerr << failure.what() << '\n';
    return 3;
  }
}
