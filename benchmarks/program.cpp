#include "program.hpp"

#include <benchmark/benchmark.h>

#include <cstdio>
#include <exception>
#include <fstream>
#include <string>

namespace rhec::bench {
namespace {

std::string processor() {
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);)
    if (line.starts_with("model name")) return line.substr(line.find(':') + 2);
  return "unknown";
}

}  // namespace

int run_program(int count, char** words, const std::function<void()>& register_all) try {
  benchmark::Initialize(&count, words);
  if (benchmark::ReportUnrecognizedArguments(count, words)) return 2;
  benchmark::AddCustomContext("processor", processor());
  benchmark::AddCustomContext("compiler", RHEC_COMPILER);
  register_all();
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
  return 0;
} catch (const std::exception& mistake) {
  std::fprintf(stderr, "%s\n", mistake.what());
  return 1;
}

void add_benchmark(const std::string& name, const std::function<void(benchmark::State&)>& run, int iterations) {
#ifndef __clang_analyzer__  // it reports Google Benchmark's list of benchmarks as a leak
  auto* made = benchmark::RegisterBenchmark(name.c_str(), run);
  made->UseRealTime()->Unit(benchmark::kMicrosecond);
  if (iterations > 0) made->Iterations(iterations);
#endif
}

std::vector<Sequence> references_or_word(const Host& host) {
  auto sequences = reference_sequences(host);
  benchmark::AddCustomContext("reference_problems", sequences.empty() ? "skipped: not there" : "there");
  return sequences;
}

}  // namespace rhec::bench
