// What reading a recording costs per row, whole and block by block, from 1e4 to 1e6 rows of eight columns.
#include <benchmark/benchmark.h>

#include <cmath>
#include <cstdio>
#include <string>

#include "isac/record/csv_reader.hpp"

namespace {

std::string make_text(std::size_t rows) {
  std::string text = "time [s],angle [rad],p1 [Pa],p2 [Pa],F1 [N],F2 [N],p1_cmd [Pa],p2_cmd [Pa]\n";
  char line[160];
  for (std::size_t i = 0; i < rows; ++i) {
    const double t = 5e-4 * static_cast<double>(i), s = std::sin(t);
    const int size = std::snprintf(line, sizeof line, "%.4f,%.6f,%.1f,%.1f,%.3f,%.3f,%.1f,%.1f\n", t, s,
                                   3e5 + 1e4 * s, 3e5 - 1e4 * s, 95 + 20 * s, 95 - 20 * s, 3e5, 3e5);
    text.append(line, static_cast<std::size_t>(size));
  }
  return text;
}

isac::record::ReadOptions unhashed() {
  isac::record::ReadOptions options;
  options.hash = false;
  return options;
}

void read_whole(benchmark::State& state) {
  const std::string text = make_text(static_cast<std::size_t>(state.range(0)));
  for (auto _ : state)
    benchmark::DoNotOptimize(isac::record::parse_recording(text, "bench.csv", unhashed()).rows());
  state.SetItemsProcessed(state.iterations() * state.range(0));
  state.SetBytesProcessed(state.iterations() * static_cast<std::int64_t>(text.size()));
}

void read_in_blocks(benchmark::State& state) {
  const std::string text = make_text(static_cast<std::size_t>(state.range(0)));
  for (auto _ : state) {
    auto reader = isac::record::BlockReader::of_bytes(text, "bench.csv", unhashed());
    isac::series::Recording block;
    while (reader.next(block)) benchmark::DoNotOptimize(block.rows());
  }
  state.SetItemsProcessed(state.iterations() * state.range(0));
  state.SetBytesProcessed(state.iterations() * static_cast<std::int64_t>(text.size()));
}

BENCHMARK(read_whole)->RangeMultiplier(10)->Range(10000, 1000000)->Unit(benchmark::kMillisecond);
BENCHMARK(read_in_blocks)->RangeMultiplier(10)->Range(10000, 1000000)->Unit(benchmark::kMillisecond);

}  // namespace

BENCHMARK_MAIN();
