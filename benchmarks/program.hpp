#pragma once

#include <benchmark/benchmark.h>

#include <functional>
#include <string>
#include <vector>

#include "sequences.hpp"

namespace rhec::bench {

/// The main function of a benchmark: registers, then runs what Google Benchmark's arguments ask for, with machine and
/// compiler in the context of its output. Exit codes: 0 fine, 1 an Error, whose text is printed, 2 wrong arguments.
int run_program(int count, char** words, const std::function<void()>& register_all);

/// What matters is in the counters that `run` sets, not in the time that Google Benchmark takes of an iteration. A
/// number of iterations of 0 is left to it.
void add_benchmark(const std::string& name, const std::function<void(benchmark::State&)>& run, int iterations = 0);

/// The reference sequences; where there are none the output's context says that they were skipped.
std::vector<Sequence> references_or_word(const Host& host);

}  // namespace rhec::bench
