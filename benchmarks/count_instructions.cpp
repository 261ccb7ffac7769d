// Takes a number of steps over a recorded drive, for callgrind to count their instructions, in `counted_step` only.
// scripts/measure/instructions runs it.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <string>
#include <vector>

#if __has_include(<valgrind/callgrind.h>)
#include <valgrind/callgrind.h>
#else
#define CALLGRIND_START_INSTRUMENTATION
#endif

#include "rhec/core/base/error.hpp"
#include "rti_loop.hpp"

namespace {

constexpr int uncounted_steps = 5, counted_steps = 100;

}  // namespace

extern "C" [[gnu::noinline]] void counted_step(rhec::bench::RtiLoop& loop);
void counted_step(rhec::bench::RtiLoop& loop) { loop.step(); }

namespace rhec::bench {
namespace {

/// `assignments` are those of another drive, as after --set. Steps: none are those of the whole drive.
void count(const std::string& name, int steps, const std::vector<std::string>& assignments) {
  const Host host;
  for (Drive how : usual_drives()) {
    if (!name.starts_with(how.name + "/")) continue;
    how.assignments.insert(how.assignments.end(), assignments.begin(), assignments.end());
    for (const Sequence& sequence : drive(host, how)) {
      if (sequence.name != name) continue;
      RtiLoop loop(sequence, host.make_solver("gn_rti"));
      if (steps == 0) steps = static_cast<int>(sequence.samples.size()) - uncounted_steps;
      if (steps < 1 || uncounted_steps + steps > static_cast<int>(sequence.samples.size()))
        throw Error("the sequence '" + name + "' has " + std::to_string(sequence.samples.size()) +
                    " samples, of which " + std::to_string(uncounted_steps) + " are not counted");
      // With --instr-atstart=no the drive until here takes less time.
      CALLGRIND_START_INSTRUMENTATION;
      loop.restart();
      for (int k = 0; k < uncounted_steps; ++k) loop.step();
      for (int k = 0; k < steps; ++k) counted_step(loop);
      std::printf("%d steps; %s, %s\n", steps, RHEC_COMPILER, sequence.model->instruction_sets().back().c_str());
      return;
    }
  }
  throw Error("there is no sequence '" + name + "'");
}

}  // namespace
}  // namespace rhec::bench

int main(int argument_count, char** words) try {
  if (argument_count < 2) {
    std::fprintf(stderr,
                 "usage: count_instructions SEQUENCE [STEPS [KEY=VALUE ...]], such as figure8/fhb/rhe 100, or "
                 "obstacles/limits/rhc 0 seed=2 (0 steps: all)\n");
    return 2;
  }
  rhec::bench::count(words[1], argument_count > 2 ? std::atoi(words[2]) : counted_steps,
                     {words + std::min(argument_count, 3), words + argument_count});
  return 0;
} catch (const std::exception& mistake) {
  std::fprintf(stderr, "%s\n", mistake.what());
  return 1;
}
