#include "rhec/plugins/robot/estimator_section.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <numbers>
#include <span>
#include <utility>

#include <fmt/format.h>

#include "rhec/plugins/robot/by_name.hpp"
#include "rhec/plugins/robot/integration.hpp"
#include "rhec/plugins/robot/memory_need.hpp"
#include "rhec/plugins/robot/plugin_option.hpp"
#include "rhec/plugins/robot/robust_losses.hpp"
#include "rhec/plugins/robot/sensors.hpp"
#include "rhec/plugins/robot/spans.hpp"
#include "rhec/plugins/robot/state_noise.hpp"

#include "default_solver.hpp"

namespace rhec {
namespace {

constexpr double state_share = 0.1, parameter_share = 1.0;  // of a variable's typical magnitude
constexpr double farthest_start = BoundsValue::farthest;

struct ArrivalOptions {
  ArrivalKind name = RecedingHorizonEstimation::Setup{}.arrival;

  static const OptionTable<ArrivalOptions>& table() {
    static const auto rows = OptionTable<ArrivalOptions>().choice("name", &ArrivalOptions::name,
                                                                  {{"ekf", ArrivalKind::ekf},
                                                                   {"smoothing", ArrivalKind::smoothing},
                                                                   {"constant", ArrivalKind::constant},
                                                                   {"off", ArrivalKind::off}},
                                                                  "how what has left the window is remembered");
    return rows;
  }
};

const SigmasByName& process_noise_by_name() {
  static const SigmasByName map(
      "process_noise", {at_least(0.0)},
      {{"PARAMETER", &ModelDescription::parameters, constant_default(ParameterWalk{}.process_noise),
        "standard deviation per square root of a step, added at each slide"}});
  return map;
}

const SigmasByName& restart_sigma_by_name() {
  static const SigmasByName map(
      "restart_sigma", {greater_than(0.0)},
      {{"PARAMETER", &ModelDescription::parameters, constant_default(ParameterWalk{}.restart_sigma),
        "standard deviation with which an unlinked block starts once it is the window's first"}});
  return map;
}

const ByName<NumberValue>& block_sigma_by_name() {
  static const ByName<NumberValue> map(
      "block_sigma", {or_infinite(greater_than(0.0))},
      {{"PARAMETER", &ModelDescription::parameters, constant_default(ParameterWalk{}.block_sigma),
        "standard deviation of an unlinked block inside the window about the block before; .inf: none, as in the "
        "paper"}});
  return map;
}

const NumbersByName& delays_by_name() {
  static const NumbersByName map("delays", {between(0.0, 1000.0)},
                                 {{"OUTPUT", &ModelDescription::outputs, constant_default(0.0),
                                   "how much later than it was measured it is stamped [s]"}});
  return map;
}

// Of an angle that may be any, all alike [rad^2].
constexpr double variance_of_any_angle = std::numbers::pi * std::numbers::pi / 3.0;
constexpr int starts_of_any_heading = 12;

DefaultByName<double> at_the_origin() {
  DefaultByName<double> origin = constant_default(0.0);
  origin.text += "; in a simulation the true start";
  return origin;
}

const NumbersByName& initial_state_by_name() {
  static const NumbersByName map("initial state", {between(-farthest_start, farthest_start)},
                                 {{"STATE", &ModelDescription::states, at_the_origin(), "mean at the start"}});
  return map;
}

DefaultByName<double> middle_of_bounds() {
  return {"the middle of its bounds, else where nothing slips",
          [](const ModelDescription&, const Variable& parameter, std::size_t) { return middle_value(parameter); }};
}

const NumbersByName& initial_parameters_by_name() {
  static const NumbersByName map(
      "initial parameters", {between(-farthest_start, farthest_start)},
      {{"PARAMETER", &ModelDescription::parameters, middle_of_bounds(), "mean at the start"}});
  return map;
}

DefaultByName<double> shared_among_states() {
  DefaultByName<double> share = scaled_default(state_share);
  share.text += "; of a heading that nothing tells: any is as probable";
  return share;
}

const SigmasByName& initial_sigma_by_name() {
  constexpr const char* meaning = "standard deviation at the start";
  static const SigmasByName map(
      "initial sigma", {greater_than(0.0)},
      {{"STATE", &ModelDescription::states, shared_among_states(), meaning},
       {"PARAMETER", &ModelDescription::parameters, scaled_default(parameter_share), meaning}});
  return map;
}

struct InitialOptions {
  Settings state, parameters, sigma;

  static const OptionTable<InitialOptions>& table() {
    static const auto rows = OptionTable<InitialOptions>()
                                 .map("state", &InitialOptions::state, initial_state_by_name().rows())
                                 .map("parameters", &InitialOptions::parameters, initial_parameters_by_name().rows())
                                 .map("sigma", &InitialOptions::sigma, initial_sigma_by_name().rows());
    return rows;
  }
};

/// Of a start so far outside of its bounds every estimate is one that no measurement agrees with. A log's first
/// measurements may be wrong, so that of a start that nobody gave the position alone counts.
void require_start_within_bounds(const EstimatorParts& parts) {
  constexpr double most_sigmas = 10.0;
  const Settings* const initial = parts.section.find("initial");
  const Settings* const given = initial ? initial->find("state") : nullptr;
  const std::vector<Variable>& states = parts.context->about.states;
  const Roles& roles = parts.context->about.roles;
  for (int j = 0; j < std::ssize(states); ++j) {
    const Variable& state = states[static_cast<std::size_t>(j)];
    const Settings* const place = given ? given->find(state.name) : nullptr;
    const double start = parts.initial_mean[j], sigma = std::sqrt(parts.initial_covariance(j, j)),
                 outside = std::max(state.lower - start, start - state.upper);
    if (!place && roles.position_x != j && roles.position_y != j) continue;
    if (!(outside > most_sigmas * sigma)) continue;
    throw(place ? *place : parts.section)
        .error(fmt::format(
            "bounds.{0}: [{1:.6g}, {2:.6g}] leave out the start, {3:.6g} {4}, whose standard deviation is {5:.3g} {4}; "
            "expected bounds that hold it, or estimator.initial.state.{0} between them",
            state.name, state.lower, state.upper, start, state.unit, sigma));
  }
}

}  // namespace

OptionTable<EstimatorOptions> EstimatorOptions::table(const EstimatorMakers& makers) {
  std::vector<std::pair<std::string, std::string>> names;
  std::string meanings;
  for (const EstimatorMaker& maker : makers.all()) {
    names.emplace_back(maker.name, maker.name);
    meanings += fmt::format("{}{}: {}", meanings.empty() ? "" : "; ", maker.name, maker.meaning);
  }
  using E = EstimatorOptions;
  return OptionTable<E>()
      .choice("name", &E::name, std::move(names), std::move(meanings))
      .integer("horizon", &E::horizon, "N_e, intervals; or a time such as 3 s, which as many intervals of `step` cover",
               between(1, 100000))
      .choice("integrator", &E::integrator, integrator_choices(), integrator_meaning)
      .automatic_integer("substeps", &E::substeps,
                         "integration steps per interval; auto: as many as the model's time constants ask for",
                         between(1, 1000))
      .integer("between", &E::most_between,
               "measurements that an interval has room for between its two nodes, each at its own time; if there are "
               "more, it ends early, in a further node",
               between(0, 10000))
      .integer(
          "heading_starts", &E::heading_starts,
          "starts around the circle while the heading is unknown, as it is at the start if this is above 1 or nothing "
          "tells it; with health.watch, filters search it instead",
          between(1, 64))
      .choice("covariance", &E::covariance, {{"bank", BlockCovariance::bank}, {"blocks", BlockCovariance::blocks}},
              "of a window with blocks: that of a bank of filters beside it, with the difference of the two estimates, "
              "which holds; or that of the block model, which leaves out that parameters vary within a block")
      .map("delays", &E::delays, delays_by_name().rows())
      .map("arrival", &E::arrival, ArrivalOptions::table().schema())
      .map("process_noise", &E::process_noise, process_noise_by_name().rows())
      .map("restart_sigma", &E::restart_sigma, restart_sigma_by_name().rows())
      .map("block_sigma", &E::block_sigma, block_sigma_by_name().rows())
      .map("priors", &E::priors, PriorsSection::rows())
      .map("bank", &E::bank, BankOptions::table().schema())
      .map("memory", &E::memory, MemorySection::rows())
      .group("health", &E::health, HealthOptions::table())
      .map("initial", &E::initial, InitialOptions::table().schema())
      .map("robust", &E::robust, robust_rows("[]"))
      .map("solver", &E::solver, {default_solver.row()})
      .renamed("forgetting", "process_noise");
}

EstimatorSection::EstimatorSection(std::shared_ptr<const RobotContext> context, BlockingSection blocking,
                                   const Settings& section, EstimatorMakers makers)
    : makers_(std::move(makers)),
      options_(EstimatorOptions::table(makers_).parse(with_span_in_intervals(section, "horizon", context->step),
                                                      "estimator")),
      parts_{.context = std::move(context),
             .section = section,
             .horizon = options_.horizon,
             .substeps = 1,  // until the parameters at the start are known
             .heading_starts = options_.heading_starts,
             .most_between = options_.most_between,
             .arrival = ArrivalOptions::table().parse(options_.arrival, "estimator: arrival").name,
             .robust = {},
             .walks = {},
             .initial_mean = {},
             .initial_covariance = {},
             .initial_parameters = {},
             .priors = PriorsSection(parts_.context, options_.priors),
             .bank = BankOptions::table().parse(options_.bank, "estimator: bank"),
             .memory = MemorySection(parts_.context, options_.memory),
             .has_bank_beside_blocks = options_.covariance == BlockCovariance::bank,
             .blocking = std::move(blocking),
             .make_solver = {},
             .make_map = {}} {
  const ModelDescription& about = parts_.context->about;
  parts_.robust = robust_losses(options_.robust, about, "estimator");
  delays_ = delays_by_name().read(options_.delays, about);
  const auto process_noise = process_noise_by_name().read(options_.process_noise, about);
  const auto restart = restart_sigma_by_name().read(options_.restart_sigma, about);
  const auto alone = block_sigma_by_name().read(options_.block_sigma, about);
  for (std::size_t j = 0; j < about.parameters.size(); ++j)
    parts_.walks.push_back({process_noise[j], restart[j], alone[j]});

  const InitialOptions initial = InitialOptions::table().parse(options_.initial, "estimator: initial");
  std::vector<double> mean = initial_state_by_name().read(initial.state, about);
  for (const double value : initial_parameters_by_name().read(initial.parameters, about)) mean.push_back(value);
  Integration integration = integration_of(options_.integrator, options_.substeps, section, parts_.context,
                                           std::span(mean).subspan(about.states.size()));
  parts_.substeps = integration.substeps;
  const std::vector<double> sigma = initial_sigma_by_name().read(initial.sigma, about);
  const auto size = static_cast<Eigen::Index>(mean.size());
  parts_.initial_mean = Eigen::Map<const Eigen::VectorXd>(mean.data(), size);
  parts_.initial_covariance.setZero(size, size);
  for (Eigen::Index j = 0; j < size; ++j) parts_.initial_covariance(j, j) = sigma[j] * sigma[j];
  // A bank's priors have starts of their own; what the section says of a parameter's start is added to them.
  const std::size_t nx = about.states.size();
  for (std::size_t j = 0; j < about.parameters.size(); ++j) {
    const bool is_given = initial.parameters.find(about.parameters[j].name) != nullptr;
    parts_.initial_parameters.push_back(is_given
                                            ? PriorBank::Setup::Knowledge{mean[nx + j], sigma[nx + j] * sigma[nx + j]}
                                            : PriorBank::Setup::Knowledge{});
  }
  parts_.make_solver = [host = parts_.context->host, named = options_.solver] {
    return default_solver.make(host, named);
  };
  parts_.make_map = [memory = parts_.memory] { return memory.make_map(); };
  const std::shared_ptr<const RobotContext> vehicle = std::move(integration.context), sensing = with_sensors(vehicle);
  add_states(initial_sensor_sigmas(*vehicle, *sensing));
  parts_.context = with_state_noise(sensing);
}

/// Behind the vehicle's states, with a mean of 0.
void EstimatorSection::add_states(const std::vector<double>& sigmas) {
  if (sigmas.empty()) return;
  const Eigen::Index nx = parts_.context->model->state_count(), np = parts_.context->model->parameter_count(),
                     more = std::ssize(sigmas);
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(nx + more + np);
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(mean.size(), mean.size());
  mean.head(nx) = parts_.initial_mean.head(nx);
  mean.tail(np) = parts_.initial_mean.tail(np);
  covariance.topLeftCorner(nx, nx) = parts_.initial_covariance.topLeftCorner(nx, nx);
  covariance.bottomRightCorner(np, np) = parts_.initial_covariance.bottomRightCorner(np, np);
  for (Eigen::Index j = 0; j < more; ++j) covariance(nx + j, nx + j) = sigmas[j] * sigmas[j];
  parts_.initial_mean = std::move(mean);
  parts_.initial_covariance = std::move(covariance);
}

OptionSection EstimatorSection::documentation(const EstimatorMakers& makers) {
  return {"estimator", "How state and parameters are estimated.", EstimatorOptions::table(makers).schema()};
}

PluginChoice EstimatorSection::solver_choice() const { return default_solver.choice(options_.solver); }

EstimatorParts EstimatorSection::parts(const std::optional<Eigen::VectorXd>& initial_state) const {
  EstimatorParts parts = parts_;
  const Settings* const initial = parts_.section.find("initial");
  const auto is_stated = [&](const char* what, int state) {
    const Settings* const section = initial ? initial->find(what) : nullptr;
    return section && section->find(parts_.context->about.states[static_cast<std::size_t>(state)].name);
  };
  const auto is_known = [&](int state) { return initial_state && std::isfinite((*initial_state)[state]); };
  for (int j = 0; initial_state && j < initial_state->size(); ++j)
    if (!is_stated("state", j) && is_known(j)) parts.initial_mean[j] = (*initial_state)[j];
  // A heading that nobody has said anything of may be any, as one that is to be searched, and whatever else turns with
  // the vehicle is as unknown.
  const Roles& roles = parts_.context->about.roles;
  const auto is_open = [&](int state) {
    const bool is_said = is_stated("state", state) || is_stated("sigma", state) || is_known(state);
    return !is_said || parts_.heading_starts > 1;
  };
  if (roles.heading >= 0 && is_open(roles.heading)) {
    std::vector<int> turned{roles.heading};
    std::ranges::copy_if(roles.other_headings, std::back_inserter(turned), is_open);
    const double said = parts.initial_covariance(roles.heading, roles.heading);
    const double unsaid = std::max(0.0, variance_of_any_angle - said);
    for (const int a : turned)
      for (const int b : turned) parts.initial_covariance(a, b) += unsaid;
    if (parts_.heading_starts == 1) parts.heading_starts = starts_of_any_heading;
  }
  require_start_within_bounds(parts);
  return parts;
}

/// A covariance that leaves something out is no measure of what sensors may say, unless somebody asks for it.
std::unique_ptr<SensorWatch> EstimatorSection::make_watch_for(const EstimatorMaker& maker,
                                                              const EstimatorParts& parts) const {
  const bool is_honest = !parts.blocking.is_given() || options_.covariance == BlockCovariance::bank;
  const Settings* health = parts.section.find("health");
  if (!maker.is_watched || (!is_honest && !(health && health->find("watch")))) return nullptr;
  return make_watch(options_.health, parts);
}

/// A window needs memory for each interval, and a filter for each node that it remembers.
void EstimatorSection::require_memory_for(const EstimatorMaker& maker) const {
  EstimatorParts fewer = parts_;
  if (fewer.memory.is_given()) fewer.make_map = [map = parts_.make_map()] { return map; };
  const Settings& section = parts_.section;
  const Settings *horizon = section.find("horizon"), *between = section.find("between");
  const bool is_long = parts_.horizon > EstimatorOptions{}.horizon || !between;
  const Settings& place = is_long && horizon ? *horizon : between ? *between : section;
  require_memory(place, {parts_.horizon, parts_.most_between, "estimator.between"},
                 [&](int intervals) -> std::shared_ptr<const void> {
                   fewer.horizon = intervals;
                   return maker.make(fewer);
                 });
}

std::unique_ptr<Estimator> EstimatorSection::make(const std::optional<Eigen::VectorXd>& initial_state,
                                                  const RobotHooks& hooks) const {
  EstimatorParts with_hooks = parts(initial_state);
  with_hooks.make_solver = [&] { return hooks.wrap_solver("rhe", parts_.make_solver()); };
  with_hooks.make_map = [&] { return hooks.provide_map(parts_.memory, parts_.make_map()); };
  Estimator::Timeline timeline;
  timeline.longest_interval = parts_.context->step;
  timeline.delays = delays_;
  timeline.output_sigmas = parts_.context->noise.output_sigmas;
  timeline.input_hold = options_.health.inputs_hold;
  const EstimatorMaker& maker = makers_.named(options_.name);
  require_memory_for(maker);
  auto watch = make_watch_for(maker, with_hooks);
  // Who judges measurements searches the heading, too, and says so.
  if (watch) with_hooks.heading_starts = 1;
  auto method = hooks.wrap_method(maker.make(with_hooks));
  if (!watch) return std::make_unique<Estimator>(std::move(method), timeline);
  return std::make_unique<Estimator>(std::move(method), timeline, std::move(watch));
}

}  // namespace rhec
