#include "sequences.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <limits>
#include <map>
#include <optional>
#include <utility>

#include "rhec/core/base/error.hpp"
#include "rhec/core/horizon/rhc_problem.hpp"
#include "rhec/core/horizon/rhe_problem.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "rhec/sim/files/csv.hpp"
#include "rhec/sim/loop/closed_loop.hpp"

namespace rhec::bench {
namespace {

using sim::ProblemRecord;

/// Groups records by prefix, in the order of the first record of each prefix.
std::vector<std::vector<ProblemRecord>> by_prefix(std::vector<ProblemRecord> records) {
  std::vector<std::vector<ProblemRecord>> groups;
  std::map<std::string, std::size_t> place;
  for (ProblemRecord& record : records) {
    const auto [at, is_new] = place.try_emplace(record.prefix, groups.size());
    if (is_new) groups.emplace_back();
    groups[at->second].push_back(std::move(record));
  }
  return groups;
}

std::filesystem::path reference_folder() {
  if (const char* given = std::getenv("RHEC_REFERENCE_PROBLEMS")) return given;
  return RHEC_SOURCE_DIRECTORY "/../shared/data/problems";
}

void set_blocks(const RheProblem& from, RheProblem& to) noexcept {
  const bool has_weights = !from.model().description().blocked_noises.empty();  // as an estimator sets them
  std::array<std::uint8_t, longest_horizon> begins;
  for (int j = 0; j < from.structure().lifted_count(); ++j) {
    for (int i = 0; i < from.intervals(); ++i) begins[i] = from.structure().starts_block(i, j);
    to.set_blocks(j, begins.data(), from.structure().is_ramp(j) ? Transition::ramp : Transition::step);
    for (int i = 0; i < from.intervals(); ++i)
      if (begins[i]) to.link(i, j, from.link_variance(i, j));
    for (int i = 0; has_weights && i < from.intervals(); ++i) to.set_block_weight(i, j, from.block_weight(i, j));
  }
}

void set_known(const RheProblem& from, bool slides, RheProblem& to) noexcept {
  const int N = from.intervals(), ny = from.model().output_count(), nu = from.model().input_count();
  to.set_intervals(N);
  to.arrival_mean = from.arrival_mean;
  to.arrival_information = from.arrival_information;
  if (slides) to.drop_first_interval();
  for (int i = slides ? N - 1 : 0; i < N; ++i) {
    std::copy_n(from.output(i), ny, to.output(i));
    std::copy_n(from.measured_input(i), nu, to.measured_input(i));
    if (from.setup().most_between > 0) to.between(i).assign(from.between(i));
    to.set_duration(i, from.duration(i));
  }
  set_blocks(from, to);
  to.finish();
  // The newest measurement is not known yet, only which of its outputs will be measured.
  for (int j = 0; j < ny; ++j)
    to.output(N)[j] = std::isnan(from.output(N)[j]) ? std::numeric_limits<double>::quiet_NaN() : to.output(N - 1)[j];
}

void set_newest(const RhcProblem& from, RhcProblem& to, std::span<double> scratch) noexcept {
  const int N = from.intervals(), nx = from.model().state_count(), nu = from.model().input_count();
  std::copy_n(from.initial_state(), nx + from.model().parameter_count(), to.given_state());
  for (int i = 0; i <= N; ++i) std::copy_n(from.state_reference(i), nx, to.state_reference(i));
  for (int i = 0; i < N; ++i) {
    std::copy_n(from.input_reference(i), nu, to.input_reference(i));
    for (int j = 0; j < nu; ++j) {
      to.input_lower(i, j) = from.input_lower(i, j);
      to.input_upper(i, j) = from.input_upper(i, j);
    }
  }
  to.terms().take_data(from.terms());
  to.finish(scratch);
}

/// See Sequence::Sample.
bool slides(const HorizonProblem& before, const HorizonProblem& after) {
  const auto* from = dynamic_cast<const RheProblem*>(&before);
  const auto* to = dynamic_cast<const RheProblem*>(&after);
  if (!from || !to || from->intervals() != to->intervals()) return false;
  const int N = from->intervals(), ny = from->model().output_count(), nu = from->model().input_count();
  const auto same = [](const double* a, const double* b, int count) {
    return std::memcmp(a, b, static_cast<std::size_t>(count) * sizeof(double)) == 0;
  };
  const auto same_between = [&](const BetweenNodes& a, const BetweenNodes& b) {
    if (a.count() != b.count()) return false;
    for (int k = 0; k < a.count(); ++k)
      if (a.time(k) != b.time(k) || !same(a.outputs(k), b.outputs(k), ny)) return false;
    return true;
  };
  for (int i = 0; i < N; ++i)
    if (!same(from->output(i + 1), to->output(i), ny)) return false;
  for (int i = 0; i + 1 < N; ++i)
    if (!same(from->measured_input(i + 1), to->measured_input(i), nu) || from->duration(i + 1) != to->duration(i) ||
        !same_between(from->between(i + 1), to->between(i)))
      return false;
  return true;
}

}  // namespace

void set_known(const Sequence::Sample& sample, HorizonProblem& to) noexcept {
  const HorizonProblem& from = *sample.problem;
  if (from.kind() == "rhe") {
    set_known(static_cast<const RheProblem&>(from), sample.slides, static_cast<RheProblem&>(to));
    return;
  }
  // The controller keeps its references until the vehicle's position is known.
  auto& control = static_cast<RhcProblem&>(to);
  control.set_intervals(from.intervals());
  for (int i = 0; i < from.intervals(); ++i) control.set_duration(i, from.duration(i));
}

void set_newest(const HorizonProblem& from, HorizonProblem& to, std::span<double> scratch) noexcept {
  if (from.kind() == "rhc") {
    set_newest(static_cast<const RhcProblem&>(from), static_cast<RhcProblem&>(to), scratch);
    return;
  }
  const int N = from.intervals();
  std::copy_n(static_cast<const RheProblem&>(from).output(N), from.model().output_count(),
              static_cast<RheProblem&>(to).output(N));
}

Sequence sequence_of(const std::vector<ProblemRecord>& records, const std::shared_ptr<const Model>& model) {
  Sequence made;
  made.name = records.front().prefix;
  made.kind = records.front().kind;
  made.model = model;
  int longest = 0;
  for (const ProblemRecord& record : records) longest = std::max(longest, record.intervals);
  std::int64_t before = records.front().first_interval();
  for (const ProblemRecord& record : records) {
    const std::int64_t first = record.first_interval();
    Sequence::Sample next{sim::build(record, model, longest), static_cast<int>(first - before)};
    if (!made.samples.empty()) next.slides = next.steps == 1 && slides(*made.samples.back().problem, *next.problem);
    made.samples.push_back(std::move(next));
    before = first;
  }
  made.workspace = sim::build(records.front(), model, longest, sim::one_block_parameters(records, *model));
  if (const auto* control = dynamic_cast<const RhcProblem*>(made.workspace.get());
      control && !control->setup().blocked_inputs.empty())
    throw Error(made.name + ": inputs are blocked, which benchmarks cannot set");
  made.start = Iterate(made.workspace->capacity());
  sim::start(records.front(), *made.workspace, made.start);
  return made;
}

std::vector<Sequence> reference_sequences(const Host& host) {
  std::vector<Sequence> made;
  const std::filesystem::path folder = reference_folder();
  for (const char* name : {"gentle-rhe", "tight-rhe", "lag-rhc", "tight-rhc"}) {
    const std::filesystem::path file = folder / (std::string(name) + ".jsonl");
    if (!std::filesystem::exists(file)) continue;
    for (const auto& records : by_prefix(sim::read_problems(sim::read_text(file.string()), file.string())))
      made.push_back(sequence_of(records, host.make_model(records[0].model, records[0].model_options)));
  }
  return made;
}

std::vector<std::vector<ProblemRecord>> record(const Host& host, const Drive& how) {
  Settings settings = load_yaml(how.scenario);
  for (const std::string& assignment : how.assignments) apply_assignment(settings, assignment);
  const sim::Scenario scenario(host, settings);
  const PluginChoice model = scenario.robot().model_choice();

  std::map<std::string, std::vector<ProblemRecord>> records;
  std::optional<Error> failure;
  sim::LoopHooks hooks;
  hooks.solved = [&](std::int64_t step, const HorizonProblem& problem, const Iterate& guess, const Iterate&,
                     const Report&) {
    if (step < problem.capacity().intervals) return;
    try {
      const std::string kind = problem.kind() == "rhe" ? "rhe" : "rhc";
      auto& kept = records[kind];
      if (!kept.empty() && kept.back().step == step)
        kept.pop_back();  // of several solves in a step the last one counts
      const std::string id = how.name + "/" + kind + "/" + std::to_string(step);
      kept.push_back(sim::record_of(problem, &guess, id, model.name, model.options));
    } catch (const Error& mistake) {
      failure = mistake;  // a solver must not throw
    }
  };
  const sim::RunLog log = sim::run_closed_loop(scenario, hooks);
  if (failure) throw Error(how.name + ": " + failure->what());
  if (!log.completed) throw Error(how.name + ": the drive ended early: " + log.ended);

  std::vector<std::vector<ProblemRecord>> made;
  made.reserve(records.size());
  for (auto& [kind, kept] : records) made.push_back(std::move(kept));
  return made;
}

std::vector<Sequence> drive(const Host& host, const Drive& how) {
  std::vector<Sequence> made;
  for (const auto& records : record(host, how))
    made.push_back(sequence_of(records, host.make_model(records[0].model, records[0].model_options)));
  return made;
}

const std::vector<Drive>& usual_drives() {
  static const std::string full = "{name: full_horizon}", blocks = "{name: structured, size: 5, overlap: 3}";
  static const std::string figure8 = RHEC_SOURCE_DIRECTORY "/scenarios/figure8.yaml";
  static const std::string zigzag = RHEC_SOURCE_DIRECTORY "/scenarios/zigzag.yaml";
  static const std::string obstacles = RHEC_SOURCE_DIRECTORY "/scenarios/obstacles.yaml";
  static const std::string limits =
      "[{name: corridor, left: 4, right: 4, margin: 0.5}, {name: obstacles, vehicle_radius: 1, obstacles: ["
      "{x: 19.6, y: 30.7, radius: 1, velocity_x: 0.1, velocity_y: -0.3},"
      "{x: -18.5, y: -5.5, radius: 1.2, velocity_x: 0.2, velocity_y: 0.3},"
      "{x: 30.7, y: -38, length: 4, width: 1.5, heading: 0.2, velocity_x: -0.5, velocity_y: -0.1}]}]";
  static const std::vector<Drive> drives = {
      {"figure8/fhb", figure8, {"path.laps=1", without_rates, "blocking.kappa=" + full}},
      {"figure8/rates", figure8, {"path.laps=1", "blocking.kappa=" + full}},
      {"figure8/sbo_5_3", figure8, {"path.laps=1", without_rates, "blocking.kappa=" + blocks}},
      {"figure8/sbo_5_3_both",
       figure8,
       {"path.laps=1", without_rates, "blocking.kappa=" + blocks, "blocking.mu=" + blocks}},
      {"figure8/often",
       figure8,
       {"path.laps=1", without_rates, "blocking.kappa=" + full,
        "sensors={x_gps: {rate: 100}, y_gps: {rate: 100}, delta: {rate: 100}}"}},
      {"figure8/noise_one",
       figure8,
       {"path.laps=1", without_rates, "blocking.kappa=" + full, "noise.states.y_pos=0.02"}},
      {"figure8/noise_two",
       figure8,
       {"path.laps=1", without_rates, "blocking.kappa=" + full, "noise.states={x_pos: 0.02, y_pos: 0.02}"}},
      {"figure8/noise_all",
       figure8,
       {"path.laps=1", without_rates, "blocking.kappa=" + full,
        "noise.states={x_pos: 0.02, y_pos: 0.02, beta: 0.005, delta: 0.005}"}},
      {"figure8/noise_blocks",
       figure8,
       {"path.laps=1", without_rates, "blocking.kappa=" + full, "noise.states={x_pos: 0.02, y_pos: 0.02}",
        "blocking.x_pos_noise=" + blocks, "blocking.y_pos_noise=" + blocks}},
      {"zigzag/fhb", zigzag, {"path.legs=4", without_rates, "path.turn_radius=3", "speed=4", "blocking.kappa=" + full}},
      {"zigzag/sbo_2_4", zigzag, {"path.legs=4", without_rates, "path.turn_radius=3", "speed=4"}},
      {"obstacles/free", obstacles, {"estimator={name: truth}", without_rates, "controller.terms=[]"}},
      {"obstacles/limits", obstacles, {"estimator={name: truth}", without_rates, "controller.terms=" + limits}},
  };
  return drives;
}

}  // namespace rhec::bench
