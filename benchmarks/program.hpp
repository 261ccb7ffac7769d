#pragma once

#include <functional>
#include <vector>

#include "sequences.hpp"

namespace rhec::bench {

/// The main function of a benchmark: registers, then runs what Google Benchmark's arguments ask for, with machine and
/// compiler in the context of its output. Exit codes: 0 fine, 1 an Error, whose text is printed, 2 wrong arguments.
int run_program(int count, char** words, const std::function<void()>& register_all);

/// The reference sequences; where there are none the output's context says that they were skipped.
std::vector<Sequence> references_or_word(const Host& host);

}  // namespace rhec::bench
