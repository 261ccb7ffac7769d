#include "rhec/plugins/robot/controller_section.hpp"

#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "rhec/core/base/infinity.hpp"
#include "rhec/core/term/term.hpp"
#include "rhec/plugins/robot/bounds_section.hpp"
#include "rhec/plugins/robot/by_name.hpp"
#include "rhec/plugins/robot/integration.hpp"
#include "rhec/plugins/robot/memory_need.hpp"
#include "rhec/plugins/robot/spans.hpp"

#include "default_solver.hpp"

namespace rhec {
namespace {

constexpr double position_weight = 1.0, terminal_weight = 10.0, speed_weight = 5.0;
// Of an input's typical magnitude: little, for else a vehicle rather leaves its path than steers.
constexpr double effort_weight = 0.02;
constexpr PluginOption<Blocking> of_input{.otherwise = "unblocked"};
constexpr PluginOption<Term> in_list{.otherwise = ""};

bool is_position(const ModelDescription& about, std::size_t state) {
  const int j = static_cast<int>(state);
  return j == about.roles.position_x || j == about.roles.position_y;
}

DefaultByName<double> stage_default() {
  return {fmt::format("{} for the position, {} for a speed, else 0", position_weight, speed_weight),
          [](const ModelDescription& about, const Variable&, std::size_t j) {
            if (static_cast<int>(j) == about.roles.speed_state) return speed_weight;
            return is_position(about, j) ? position_weight : 0.0;
          }};
}

DefaultByName<double> input_default() {
  return {fmt::format("{} for a speed, else {} / typical^2", speed_weight, effort_weight),
          [](const ModelDescription& about, const Variable& input, std::size_t j) {
            return static_cast<int>(j) == about.roles.speed ? speed_weight
                                                            : effort_weight / (input.scale * input.scale);
          }};
}

const NumbersByName& stage_by_name() {
  static const NumbersByName map(
      "weights: stage", {at_least(0.0)},
      {{"STATE", &ModelDescription::states, stage_default(), "of the squared distance from the reference at a node"},
       {"INPUT", &ModelDescription::inputs, input_default(),
        "of the squared distance from the reference on an interval"}});
  return map;
}

DefaultByName<double> terminal_default() {
  return {fmt::format("{} for the position, else 0", terminal_weight),
          [](const ModelDescription& about, const Variable&, std::size_t j) {
            return is_position(about, j) ? terminal_weight : 0.0;
          }};
}

const NumbersByName& terminal_by_name() {
  static const NumbersByName map("weights: terminal", {at_least(0.0)},
                                 {{"STATE", &ModelDescription::states, terminal_default(),
                                   "of the squared distance from the reference at the last node"}});
  return map;
}

const NumbersByName& rates_by_name() {
  static const NumbersByName map("weights: rates", {at_least(0.0)},
                                 {{"INPUT", &ModelDescription::inputs, constant_default(0.0),
                                   "of the squared rate of change [unit of the input / s] on an interval, from the "
                                   "input on the interval before; on the first one from the input applied last"}});
  return map;
}

const ByName<BoundsValue>& rate_bounds_by_name() {
  static const ByName<BoundsValue> map(
      "rate_bounds", {},
      {{"INPUT",
        &ModelDescription::inputs,
        {"none", [](const ModelDescription&, const Variable&, std::size_t) { return std::pair(-infinity, infinity); }},
        "[lower, upper] of the rate of change from interval to interval [unit of the input / s], 0 between them"}});
  return map;
}

struct WeightOptions {
  Settings stage, terminal, rates;

  static const OptionTable<WeightOptions>& table() {
    static const auto rows = OptionTable<WeightOptions>()
                                 .map("stage", &WeightOptions::stage, stage_by_name().rows())
                                 .map("terminal", &WeightOptions::terminal, terminal_by_name().rows())
                                 .map("rates", &WeightOptions::rates, rates_by_name().rows());
    return rows;
  }
};

OptionRow terms_row() {
  OptionRow row = in_list.row(
      "limits and further costs, each a map of its name and its options; see docs/terms.md and 'rhec plugins'");
  row.name = "";
  row.type = "list of maps";
  row.default_value = "[]";
  row.constraint = "terms by name";
  return row;
}

OptionRow blocking_row() {
  OptionRow row = of_input.row(
      "move blocking; its options stand beside the name; an input that is not named is free on every interval");
  row.name = "INPUT." + row.name;
  return row;
}

}  // namespace

const OptionTable<PaceOptions>& PaceOptions::table() {
  using P = PaceOptions;
  static const auto rows =
      OptionTable<P>()
          .number("degraded", &P::degraded, "share of the path's speed while an estimate's health is degraded",
                  between(0.0, 1.0))
          .number("lost", &P::lost, "the same while the vehicle is lost; 0: it stops on the path", between(0.0, 1.0))
          .number("heading", &P::heading,
                  "the same while it is known where the vehicle is, but not where it heads, which only motion tells; "
                  "0: it stands until somebody says it",
                  between(0.0, 1.0))
          .number("seconds", &P::seconds, "from the full speed to a stop, and back [s]", greater_than(0.0));
  return rows;
}

const OptionTable<ControllerOptions>& ControllerOptions::table() {
  using C = ControllerOptions;
  static const auto rows =
      OptionTable<C>()
          .integer("horizon", &C::horizon,
                   "N_c, intervals; or a time such as 3 s, which as many intervals of `step` cover", between(1, 100000))
          .choice("integrator", &C::integrator, integrator_choices(), integrator_meaning)
          .automatic_integer(
              "substeps", &C::substeps,
              "integration steps per interval; auto: as many as the model's time constants ask for at the "
              "path's speed",
              between(1, 1000))
          .choice("reference_speed", &C::reference_speed,
                  {{"ground", ReferenceSpeed::ground}, {"literal", ReferenceSpeed::literal}},
                  "ground: wheels turn faster by the estimated slip; literal: the path's speed is the wheels'")
          .number("least_speed_factor", &C::least_speed_factor, "the estimated speed factor is not trusted below this",
                  greater_than(0.0))
          .number("speed_bound_factor", &C::speed_bound_factor,
                  "a wheel speed that is an input is at most this times the reference plus speed_bound_offset",
                  or_infinite(at_least(0.0)))
          .number("speed_bound_offset", &C::speed_bound_offset, "[m/s]", or_infinite(at_least(0.0)))
          .flag(
              "turn_around", &C::turn_around,
              "a vehicle that stands, since it looks away from the path and no plan turns it, or since limits keep it "
              "from going on, goes round, turns in several moves, or goes back along the path; without this it stands "
              "until somebody moves it")
          .map("weights", &C::weights, WeightOptions::table().schema())
          .map("rate_bounds", &C::rate_bounds, rate_bounds_by_name().rows())
          .group("health", &C::health, PaceOptions::table())
          .map("terms", &C::terms, {terms_row()})
          .map("blocking", &C::blocking, {blocking_row()})
          .map("solver", &C::solver,
               {default_solver.row(
                   "its options stand beside the name; without this section {name: gn_rti, iterations: 5, "
                   "residual: 0.01}, since one step a sample is too few where slip jumps")});
  return rows;
}

ControllerSection::ControllerSection(std::shared_ptr<const RobotContext> context, const Settings& section)
    : context_(std::move(context)),
      section_(with_span_in_intervals(section, "horizon", context_->step)),
      options_(ControllerOptions::table().parse(section_, "controller")) {
  options_.blocking = all_spans_in_intervals(options_.blocking, context_->step);
  if (!options_.solver.is_null()) return;
  options_.solver = Settings::map();
  options_.solver.add("name", Settings::scalar(default_solver.otherwise));
  options_.solver.add("iterations", Settings::scalar("5"));
  options_.solver.add("residual", Settings::scalar("0.01"));
}

OptionSection ControllerSection::documentation() {
  return {"controller", "How the path is followed.", ControllerOptions::table().schema()};
}

PluginChoice ControllerSection::solver_choice() const { return default_solver.choice(options_.solver); }

void ControllerSection::add_problem(Controller::Setup& setup, int intervals) const {
  const ModelDescription& about = context_->about;
  RhcProblem::Setup& problem = setup.problem;
  problem.max_intervals = intervals;
  const WeightOptions weights = WeightOptions::table().parse(options_.weights, "controller: weights");
  const std::vector<double> stage = stage_by_name().read(weights.stage, about);
  const auto first_input = stage.begin() + static_cast<std::ptrdiff_t>(about.states.size());
  problem.state_weights.assign(stage.begin(), first_input);
  problem.input_weights.assign(first_input, stage.end());
  problem.terminal_weights = terminal_by_name().read(weights.terminal, about);
  setup.rate_weights = rates_by_name().read(weights.rates, about);
  problem.state_lower = lower_bounds_of(about.states);
  problem.state_upper = upper_bounds_of(about.states);
  problem.input_lower = lower_bounds_of(about.inputs);
  problem.input_upper = upper_bounds_of(about.inputs);
  for (const auto& [lower, upper] : rate_bounds_by_name().read(options_.rate_bounds, about)) {
    if (!(lower <= 0.0 && upper >= 0.0))
      throw options_.rate_bounds.find(about.inputs[setup.rate_lower.size()].name)
          ->error(fmt::format("found [{}, {}], expected 0 between them: an input must be able to stay as it is", lower,
                              upper));
    setup.rate_lower.push_back(lower);
    setup.rate_upper.push_back(upper);
  }
}

void ControllerSection::add_blockings(Controller::Setup& setup, int intervals) const {
  const std::vector<Variable>& inputs = context_->about.inputs;
  check_keys(options_.blocking, names_of(inputs), "controller: blocking");
  for (std::size_t j = 0; j < inputs.size(); ++j) {
    const Settings* section = options_.blocking.find(inputs[j].name);
    if (!section) continue;
    auto blocking = of_input.make(context_->host, *section);
    if (const std::string reason = blocking->why_not(intervals); !reason.empty())
      throw section->error(fmt::format("{}; change it or controller.horizon", reason));
    if (blocking->transition() != Transition::step || blocking->neighbour_sigma())
      throw section->error(
          "an input jumps from block to block and no walk links its blocks; drop transition and neighbour_sigma");
    setup.problem.blocked_inputs.push_back(static_cast<int>(j));
    setup.blockings.push_back(std::move(blocking));
  }
}

/// One by one, so that a vehicle that does not suit is told where the term stands.
TermFunctions ControllerSection::functions_of(const Settings& item) const {
  const PluginChoice choice = in_list.choice(item);
  if (choice.name.empty()) throw item.error("a term without a name; expected the key 'name' with that of a term");
  const std::shared_ptr<const Term> term = in_list.make(context_->host, item);
  try {
    return {*context_->model, {{choice.name, term, choice.options}}};
  } catch (const Error& mistake) {
    throw item.error(mistake.what());
  }
}

const std::vector<Settings>& ControllerSection::terms() const {
  const Settings& list = options_.terms;
  if (!list.is_null() && list.kind() != Settings::Kind::list)
    throw list.mismatch("a list of terms, e.g. [{name: corridor, left: 1.5}]");
  return list.items();
}

void ControllerSection::add_terms(Controller::Setup& setup) const {
  for (const Settings& item : terms()) setup.problem.terms.push_back(functions_of(item).terms().front());
}

std::vector<std::string> ControllerSection::notes() const {
  std::vector<std::string> notes;
  for (const Settings& item : terms()) {
    const Settings *const hard = item.find("hard"), *const soft = item.find("soft");
    if (hard && soft && hard->flag() == true)
      notes.emplace_back(soft->error("limits that are hard have no cost, and this says nothing; expected one of `hard: "
                                     "true` and `soft`")
                             .what());
    const TermFunctions functions = functions_of(item);
    if (functions.limit_count() > 0 || functions.has_residuals()) continue;
    const Error note = item.error(fmt::format(
        "the term '{}' has neither a limit nor a cost with these options, and does nothing; 'rhec plugins {}' says "
        "what it takes",
        functions.terms().front().name, functions.terms().front().name));
    notes.emplace_back(note.what());
  }
  return notes;
}

std::unique_ptr<Controller> ControllerSection::make(const Path& path, const RobotHooks& hooks,
                                                    std::shared_ptr<const SlipAhead> ahead) const {
  std::vector<double> parameters;
  for (const Variable& parameter : context_->about.parameters) parameters.push_back(middle_value(parameter));
  const Integration integration =
      integration_of(options_.integrator, options_.substeps, section_, context_, parameters, path.top_speed());
  const auto make_for = [&](int intervals, std::shared_ptr<Solver> solver) {
    Controller::Setup setup;
    setup.problem.substeps = integration.substeps;
    add_problem(setup, intervals);
    setup.interval = context_->step;
    setup.search.stop_time = context_->step;
    setup.pace = {options_.health.degraded, options_.health.lost, options_.health.heading, options_.health.seconds};
    setup.reference_speed = options_.reference_speed;
    setup.least_speed_factor = options_.least_speed_factor;
    setup.speed_bound_factor = options_.speed_bound_factor;
    setup.speed_bound_offset = options_.speed_bound_offset;
    setup.turns_around = options_.turn_around;
    setup.ahead = ahead;
    add_blockings(setup, intervals);
    add_terms(setup);
    return std::make_unique<Controller>(integration.context->model, std::move(solver), path, std::move(setup));
  };
  const auto make_solver = [&] { return default_solver.make(context_->host, options_.solver); };
  const Settings* const horizon = section_.find("horizon");
  require_memory(horizon ? *horizon : section_, {.intervals = options_.horizon},
                 [&](int intervals) -> std::shared_ptr<const void> { return make_for(intervals, make_solver()); });
  return make_for(options_.horizon, hooks.wrap_solver("rhc", make_solver()));
}

}  // namespace rhec
