// Takes a number of steps over a recorded drive, for callgrind to count their instructions, in `counted_step` only.
// scripts/measure/instructions runs it.
#include <cstdio>
#include <exception>
#include <string>

#include "rhec/core/base/error.hpp"
#include "rti_loop.hpp"

namespace {

constexpr int uncounted_steps = 5, counted_steps = 100;

}  // namespace

extern "C" [[gnu::noinline]] void counted_step(rhec::bench::RtiLoop& loop);
void counted_step(rhec::bench::RtiLoop& loop) { loop.step(); }

namespace rhec::bench {
namespace {

void count(const std::string& name) {
  const Host host;
  for (const Drive& how : usual_drives()) {
    if (!name.starts_with(how.name + "/")) continue;
    for (const Sequence& sequence : drive(host, how)) {
      if (sequence.name != name) continue;
      RtiLoop loop(sequence, host.make_solver("gn_rti"));
      loop.restart();
      for (int k = 0; k < uncounted_steps; ++k) loop.step();
      for (int k = 0; k < counted_steps; ++k) counted_step(loop);
      std::printf("%d steps; %s, %s\n", counted_steps, RHEC_COMPILER,
                  sequence.model->instruction_sets().back().c_str());
      return;
    }
  }
  throw Error("there is no sequence '" + name + "'");
}

}  // namespace
}  // namespace rhec::bench

int main(int argument_count, char** words) try {
  if (argument_count != 2) {
    std::fprintf(stderr, "usage: count_instructions SEQUENCE, such as figure8/fhb/rhe\n");
    return 2;
  }
  rhec::bench::count(words[1]);
  return 0;
} catch (const std::exception& mistake) {
  std::fprintf(stderr, "%s\n", mistake.what());
  return 1;
}
