#pragma once

#include <benchmark/benchmark.h>

#include <functional>
#include <string>
#include <vector>

#include "sequences.hpp"

namespace rhec::bench {

/// The main function of a benchmark: registers the benchmarks and runs those selected by Google Benchmark's arguments,
/// with machine and compiler in the output's context. Exit codes: 0 success, 1 an Error, whose text is printed, 2 wrong
/// arguments.
int run_program(int count, char** words, const std::function<void()>& register_all);

/// The results are the counters that `run` sets, not Google Benchmark's time of an iteration. With `iterations` 0
/// Google Benchmark chooses the number.
void add_benchmark(const std::string& name, const std::function<void(benchmark::State&)>& run, int iterations = 0);

/// The reference sequences; if there are none, the output's context says that they were skipped.
std::vector<Sequence> references_or_word(const Host& host);

}  // namespace rhec::bench
