// The time of a gn_rti step against the length of the horizon, with a changing block structure against a constant one,
// and the memory that the solver allocates. Every allocation of this program is counted.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdlib>
#include <memory>
#include <optional>
#include <utility>

#include "long_problems.hpp"
#include "program.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/sim/numbers/spread.hpp"
#include "rti_loop.hpp"

// The C library's functions behind malloc and the like. This program replaces malloc and the like, also for every
// library that it loads.
extern "C" {
void* __libc_malloc(std::size_t size);                           // NOLINT(bugprone-reserved-identifier)
void* __libc_calloc(std::size_t count, std::size_t size);        // NOLINT(bugprone-reserved-identifier)
void* __libc_realloc(void* memory, std::size_t size);            // NOLINT(bugprone-reserved-identifier)
void* __libc_memalign(std::size_t alignment, std::size_t size);  // NOLINT(bugprone-reserved-identifier)
}

namespace {
std::atomic<long> allocations{0};
std::atomic<long> allocated_bytes{0};

std::size_t counted(std::size_t size) {
  ++allocations;
  allocated_bytes += static_cast<long>(size);
  return size;
}
}  // namespace

extern "C" {
[[gnu::visibility("default")]] void* malloc(std::size_t size) { return __libc_malloc(counted(size)); }
[[gnu::visibility("default")]] void* calloc(std::size_t count, std::size_t size) {
  counted(count * size);
  return __libc_calloc(count, size);
}
[[gnu::visibility("default")]] void* realloc(void* memory, std::size_t size) {
  return __libc_realloc(memory, counted(size));
}
[[gnu::visibility("default")]] void* aligned_alloc(std::size_t alignment, std::size_t size) {
  return __libc_memalign(alignment, counted(size));
}
}

namespace rhec::bench {
namespace {

constexpr int samples = 20;
constexpr int block = 2;  // with size 5 and overlap 3, a block starts every 2 intervals
constexpr int lengths[] = {15, 30, 60, 125, 250, 500, 1000};

/// Steps of one sequence, from its second sample on. Each step's time is its minimum over the passes, since long passes
/// are always interrupted somewhere.
class Steps {
 public:
  Steps(const Host& host, Sequence sequence) : sequence_(std::move(sequence)) {
    const auto solver = host.make_solver("gn_rti");
    const long before = allocated_bytes;
    solver->setup(*sequence_.workspace);
    solver_bytes_ = allocated_bytes - before;
    if (solver_bytes_ == 0) throw Error("allocations are not counted");
    loop_.emplace(sequence_, solver);
    least_.assign(sequence_.samples.size(), INFINITY);
  }

  void pass() {
    loop_->restart();
    loop_->step();
    for (std::size_t k = 1; k < sequence_.samples.size(); ++k) {
      const long before = allocations;
      const Report& report = loop_->step();
      if (allocations != before) throw Error(sequence_.name + ": a step allocated memory");
      if (!is_usable(report.status)) throw Error(sequence_.name + ": a step failed: " + name_of(report.status));
      least_[k] = std::min(least_[k], loop_->times().total_us());
    }
  }

  sim::Spread spread() const { return sim::spread_of({least_.begin() + 1, least_.end()}); }
  int intervals() const { return sequence_.workspace->intervals(); }
  long solver_bytes() const { return solver_bytes_; }

 private:
  Sequence sequence_;
  std::optional<RtiLoop> loop_;
  std::vector<double> least_;
  long solver_bytes_ = 0;
};

void add_length(const Host& host, const std::string& kind, Sequence sequence) {
  const auto steps = std::make_shared<Steps>(host, std::move(sequence));
  const auto run = [steps](benchmark::State& state) {
    while (state.KeepRunning()) steps->pass();
    state.counters["intervals"] = steps->intervals();
    state.counters["median_us"] = steps->spread().median;
    state.counters["max_us"] = steps->spread().max;
    state.counters["solver_bytes"] = static_cast<double>(steps->solver_bytes());
  };
  add_benchmark("horizons/" + kind + "/" + std::to_string(steps->intervals()), run);
}

/// A structure that changes at every sample against a constant one, in alternating passes.
void add_changing_structure(const Host& host, int intervals) {
  const auto make = [&](Blocks blocks) {
    return std::make_shared<Steps>(host, long_estimation(host, intervals, samples, block, blocks));
  };
  const auto run = [moving = make(Blocks::moving), fixed = make(Blocks::fixed)](benchmark::State& state) {
    while (state.KeepRunning()) {
      moving->pass();
      fixed->pass();
    }
    state.counters["moving_us"] = moving->spread().median;
    state.counters["fixed_us"] = fixed->spread().median;
    state.counters["ratio"] = moving->spread().median / fixed->spread().median;
  };
  add_benchmark("changing_structure/" + std::to_string(intervals), run);
}

void register_all() {
  const Host host;
  for (const int intervals : lengths) {
    add_length(host, "rhe", long_estimation(host, intervals, samples, block, Blocks::moving));
    add_length(host, "rhc", long_control(host, intervals, samples));
  }
  for (const int intervals : {16, 250})
    add_changing_structure(host, intervals);  // even: the same number of starts in both
}

}  // namespace
}  // namespace rhec::bench

int main(int count, char** words) { return rhec::bench::run_program(count, words, rhec::bench::register_all); }
