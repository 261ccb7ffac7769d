// Takes a number of steps over a drive, for callgrind to count their instructions, in `counted_step` only. The drive is
// recorded into a file before, as it takes a hundred times as long where callgrind looks on.
// scripts/measure/instructions runs it.
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <fstream>
#include <string>
#include <vector>

#if __has_include(<valgrind/callgrind.h>)
#include <valgrind/callgrind.h>
#else
#define CALLGRIND_START_INSTRUMENTATION
#endif

#include "rhec/core/base/error.hpp"
#include "rhec/sim/files/csv.hpp"
#include "rhec/sim/problems/problem_file.hpp"
#include "rti_loop.hpp"

namespace {

constexpr int uncounted_steps = 5, counted_steps = 100;

}  // namespace

extern "C" [[gnu::noinline]] void counted_step(rhec::bench::RtiLoop& loop);
void counted_step(rhec::bench::RtiLoop& loop) { loop.step(); }

namespace rhec::bench {
namespace {

/// Writes the problems of a sequence, one a line. `assignments` are those of another drive, as after --set.
void record_sequence(const std::string& name, const std::string& file, const std::vector<std::string>& assignments) {
  const Host host;
  for (Drive how : usual_drives()) {
    if (!name.starts_with(how.name + "/")) continue;
    how.assignments.insert(how.assignments.end(), assignments.begin(), assignments.end());
    for (const std::vector<sim::ProblemRecord>& records : record(host, how)) {
      if (how.name + "/" + records.front().kind != name) continue;
      std::ofstream stream(file);
      for (const sim::ProblemRecord& record : records) stream << sim::problem_line(record) << '\n';
      if (!stream.flush()) throw Error(file + ": cannot be written");
      return;
    }
  }
  throw Error("there is no sequence '" + name + "'");
}

/// Steps: none are those of the whole drive.
void count(const std::string& file, int steps) {
  std::vector<sim::ProblemRecord> records = sim::read_problems(sim::read_text(file), file);
  if (records.empty()) throw Error(file + ": has no problem");
  const int count = static_cast<int>(records.size());
  if (steps == 0) steps = count - uncounted_steps;
  if (steps < 1 || uncounted_steps + steps > count)
    throw Error(file + ": has " + std::to_string(count) + " problems, of which " + std::to_string(uncounted_steps) +
                " are not counted");
  records.resize(static_cast<std::size_t>(uncounted_steps) + static_cast<std::size_t>(steps));
  const Host host;
  sim::make_terms(records, host);
  const Sequence sequence = sequence_of(records, host.make_model(records.front().model, records.front().model_options));
  RtiLoop loop(sequence, host.make_solver("gn_rti"));
  // With --instr-atstart=no what comes before takes less time.
  CALLGRIND_START_INSTRUMENTATION;
  loop.restart();
  for (int k = 0; k < uncounted_steps; ++k) loop.step();
  for (int k = 0; k < steps; ++k) counted_step(loop);
  std::printf("%d steps; %s, %s\n", steps, RHEC_COMPILER, sequence.model->instruction_sets().back().c_str());
}

}  // namespace
}  // namespace rhec::bench

int main(int argument_count, char** words) try {
  const std::vector<std::string> given(words + 1, words + argument_count);
  if (given.size() > 2 && given[0] == "record") {
    rhec::bench::record_sequence(given[1], given[2], {given.begin() + 3, given.end()});
  } else if (given.size() == 2 && given[0] == "count") {
    rhec::bench::count(given[1], counted_steps);
  } else if (given.size() == 3 && given[0] == "count") {
    rhec::bench::count(given[1], std::atoi(given[2].c_str()));
  } else {
    std::fprintf(stderr,
                 "usage: count_instructions record SEQUENCE FILE [KEY=VALUE ...], such as obstacles/limits/rhc "
                 "drive.jsonl seed=2\n"
                 "       count_instructions count FILE [STEPS], such as drive.jsonl 100 (0 steps: all)\n");
    return 2;
  }
  return 0;
} catch (const std::exception& mistake) {
  std::fprintf(stderr, "%s\n", mistake.what());
  return 1;
}
