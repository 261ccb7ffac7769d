// gn_rti and bicycle_slip as plugins against the same sources linked into this program, in alternating passes.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <array>
#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "program.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/core/model/chosen_outputs.hpp"
#include "rhec/plugins/kit/manifest.hpp"
#include "rhec/sim/numbers/spread.hpp"
#include "rti_loop.hpp"

// The manifests of the linked-in sources; CMakeLists.txt renames their symbol.
extern "C" {
extern const rhec::Manifest linked_gn_rti;
extern const rhec::Manifest linked_bicycle_slip;
}

namespace rhec::bench {
namespace {

template <class Interface>
std::shared_ptr<Interface> make(const Manifest& manifest, const Settings& settings) {
  std::array<char, 1000> error{};
  void* made = manifest.create(&settings, error.data(), error.size());
  if (!made) throw Error(error.data());
  return {static_cast<Interface*>(made), [&manifest](Interface* object) { manifest.destroy(object); }};
}

/// The host wraps the model to select its outputs, so the same is done here.
std::shared_ptr<Model> make_linked_model(const Settings& settings) {
  const auto model = make<Model>(linked_bicycle_slip, settings);
  return with_outputs(model, usual_outputs(model->description()));
}

/// One side of the comparison; a pass returns the median time of a step.
struct Side {
  Sequence sequence;
  RtiLoop loop;
  Side(Sequence of, std::shared_ptr<Solver> solver) : sequence(std::move(of)), loop(sequence, std::move(solver)) {}

  double pass() {
    std::vector<double> times;
    loop.restart();
    for (std::size_t k = 0; k < sequence.samples.size(); ++k) {
      if (!is_usable(loop.step().status)) throw Error(sequence.name + ": a step failed");
      times.push_back(loop.times().total_us());
    }
    return sim::spread_of(times).median;
  }
};

double quantile(std::vector<double> values, double share) {
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1))];
}

constexpr int passes_a_place = 20;

void add(const Host& host, const std::vector<sim::ProblemRecord>& records) {
  const auto run = [host, records](benchmark::State& state) {
    const Settings& options = records.front().model_options;
    std::vector<double> of_plugin, of_linked, ratios;
    // Memory layout makes a step a few per cent faster or slower by chance, so both sides are recreated again and again
    // at other addresses.
    std::mt19937 random(1);  // NOLINT(cert-msc32-c,cert-msc51-cpp): the same places each time
    std::vector<std::vector<char>> spacers;
    const auto make_side = [&](bool is_plugin) {
      spacers.emplace_back(std::uniform_int_distribution<int>(1, 1 << 16)(random));
      return is_plugin ? std::make_unique<Side>(sequence_of(records, host.make_model("bicycle_slip", options)),
                                                host.make_solver("gn_rti"))
                       : std::make_unique<Side>(sequence_of(records, make_linked_model(options)),
                                                make<Solver>(linked_gn_rti, {}));
    };
    while (state.KeepRunning()) {
      const bool plugin_first = spacers.size() % 4 == 0;
      auto first = make_side(plugin_first), second = make_side(!plugin_first);
      Side &plugin = plugin_first ? *first : *second, &linked = plugin_first ? *second : *first;
      for (int pass = 0; pass < passes_a_place; ++pass) {
        if (pass % 2 == 0) of_plugin.push_back(plugin.pass());
        of_linked.push_back(linked.pass());
        if (pass % 2 != 0) of_plugin.push_back(plugin.pass());
        ratios.push_back(of_plugin.back() / of_linked.back());
      }
    }
    state.counters["plugin_us"] = sim::spread_of(of_plugin).median;
    state.counters["linked_us"] = sim::spread_of(of_linked).median;
    state.counters["ratio"] = sim::spread_of(ratios).median;
    state.counters["ratio_lower_quartile"] = quantile(ratios, 0.25);
    state.counters["ratio_upper_quartile"] = quantile(ratios, 0.75);
  };
  const std::string name = sequence_of(records, host.make_model("bicycle_slip", records.front().model_options)).name;
  add_benchmark("plugin_boundary/" + name, run);
}

void register_all() {
  const Host host;
  for (const auto& records : record(host, usual_drives().front())) add(host, records);
}

}  // namespace
}  // namespace rhec::bench

int main(int count, char** words) { return rhec::bench::run_program(count, words, rhec::bench::register_all); }
