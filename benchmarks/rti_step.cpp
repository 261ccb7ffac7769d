// One real-time iteration of gn_rti, over sequences of problems, each sample once per pass: setting the data, shift,
// preparation, step and assessment. For each sample the median over the passes is taken; of these medians the median,
// 99th percentile and maximum over the sequence are reported. Passes alternate between timing whole steps and timing
// the feedback within them.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <memory>

#include "program.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "rhec/sim/numbers/spread.hpp"
#include "rti_loop.hpp"

namespace rhec::bench {
namespace {

/// The times of each sample over the passes.
class PassTimes {
 public:
  explicit PassTimes(std::size_t samples) : of_sample_(samples) {}
  void add(std::size_t sample, double value) { of_sample_[sample].push_back(value); }
  /// Leaves out the first sample, which has no solution before it.
  sim::Spread spread() const {
    std::vector<double> medians;
    for (std::size_t k = 1; k < of_sample_.size(); ++k) medians.push_back(sim::spread_of(of_sample_[k]).median);
    return sim::spread_of(medians);
  }
  double first() const { return sim::spread_of(of_sample_[0]).median; }
  double worst() const {
    double largest = 0.0;
    for (std::size_t k = 1; k < of_sample_.size(); ++k)
      largest = std::max(largest, *std::max_element(of_sample_[k].begin(), of_sample_[k].end()));
    return largest;
  }

 private:
  std::vector<std::vector<double>> of_sample_;
};

void run(benchmark::State& state, const Host& host, const Sequence& sequence) {
  const auto make = [&](const char* options) { return host.make_solver("gn_rti", parse_yaml(options, "benchmark")); };
  const std::size_t count = sequence.samples.size();
  RtiLoop loop(sequence, make("{mode: rti}"));
  PassTimes total(count), feedback(count);
  int refactored = 0, fallbacks = 0;
  const auto pass = [&](bool looks_inside) {
    loop.restart();
    loop.looks_inside = looks_inside;
    refactored = fallbacks = 0;
    for (std::size_t k = 0; k < count; ++k) {
      const Report& report = loop.step();
      if (!is_usable(report.status)) throw Error(sequence.name + ": a step failed: " + name_of(report.status));
      if (looks_inside) {
        feedback.add(k, loop.times().feedback_us());
      } else {
        total.add(k, loop.times().total_us());
      }
      if (k == 0) continue;
      refactored += report.factorisations > 1;
      fallbacks += report.fallback_used;
    }
  };
  while (state.KeepRunning()) {
    pass(false);
    pass(true);
  }
  const auto excess = sim::spread_of(
      excess_objectives(sequence, make("{mode: rti}"), make("{mode: converge, tolerance: 1e-9, max_iterations: 200}")));
  auto& counters = state.counters;
  counters["samples"] = static_cast<double>(count);
  counters["median_us"] = total.spread().median;
  counters["p99_us"] = total.spread().p99;
  counters["max_us"] = total.spread().max;
  counters["worst_us"] = total.worst();
  counters["first_us"] = total.first();
  counters["feedback_us"] = feedback.spread().median;
  counters["feedback_p99_us"] = feedback.spread().p99;
  counters["feedback_share"] = feedback.spread().median / total.spread().median;
  counters["factorised_again"] = refactored;
  counters["fallbacks"] = fallbacks;
  counters["excess_median"] = excess.median;
  counters["excess_p99"] = excess.p99;
  counters["excess_max"] = excess.max;
}

void add(const std::string& group, const Host& host, Sequence sequence) {
  const auto kept = std::make_shared<Sequence>(std::move(sequence));
  add_benchmark(group + "/" + kept->name, [host, kept](benchmark::State& state) { run(state, host, *kept); });
}

void register_all() {
  const Host host;
  for (Sequence& sequence : references_or_word(host)) add("rti_step", host, std::move(sequence));
  for (const Drive& how : usual_drives())
    for (Sequence& sequence : drive(host, how)) add("rti_step", host, std::move(sequence));
  for (const auto& records : record(host, usual_drives().front())) {
    const auto make = [&] { return host.make_model(records[0].model, records[0].model_options); };
    for (const std::string& instruction_set : make()->instruction_sets()) {
      const auto model = make();
      if (!model->use_instruction_set(instruction_set)) throw Error("the model does not take " + instruction_set);
      add("instruction_sets/" + instruction_set, host, sequence_of(records, model));
    }
  }
}

}  // namespace
}  // namespace rhec::bench

int main(int count, char** words) { return rhec::bench::run_program(count, words, rhec::bench::register_all); }
