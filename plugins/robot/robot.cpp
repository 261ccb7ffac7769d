#include "rhec/plugins/robot/robot.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <tuple>
#include <utility>

#include <fmt/format.h>

#include "rhec/core/base/error.hpp"
#include "rhec/core/estimation/filter_estimation.hpp"
#include "rhec/core/estimation/receding_horizon_estimation.hpp"
#include "rhec/plugins/yaml/yaml.hpp"

namespace rhec {
namespace {

const Settings& member_or_null(const Settings& map, std::string_view key) {
  static const Settings nothing;
  const Settings* member = map.find(key);
  return member ? *member : nothing;
}

/// The plugin named by `name` in a section, or by the section itself where that is only a word, or the default.
std::string plugin_name(const Settings& section, std::string_view otherwise) {
  if (section.is_null()) return std::string(otherwise);
  if (section.kind() == Settings::Kind::scalar) return section.text();
  if (section.kind() != Settings::Kind::map)
    throw section.mismatch("the name of a plugin, or a map with the key 'name' and the plugin's options");
  const Settings* name = section.find("name");
  return name ? name->as_text() : std::string(otherwise);
}

/// The options beside a plugin's name.
Settings plugin_options(const Settings& section) {
  return section.kind() == Settings::Kind::scalar ? Settings::map(section.origin()) : section;
}

constexpr double infinity = std::numeric_limits<double>::infinity();

// Defaults of what is given by the names of variables; the documentation is made of them too.
constexpr double noise_share = 0.01, initial_share = 0.1, parameter_share = 1.0;  // of a variable's typical magnitude
constexpr double position_weight = 1.0, terminal_weight = 10.0, input_weight = 5.0;
constexpr const char *default_model = "bicycle_slip", *default_solver = "gn_rti", *default_blocking = "full_horizon",
                     *default_input_blocking = "unblocked", *default_smoothing_solver = "sparse_sqp";

/// True where a message begins with a place that is written in this part of the settings.
bool names_place_of(const Settings& settings, std::string_view message) {
  const std::string& file = settings.origin().file;
  if (!file.empty() && message.starts_with(file + ":")) return true;
  const auto in_item = [&](const Settings& item) { return names_place_of(item, message); };
  const auto in_member = [&](const auto& member) { return names_place_of(member.second, message); };
  return std::any_of(settings.items().begin(), settings.items().end(), in_item) ||
         std::any_of(settings.members().begin(), settings.members().end(), in_member);
}

/// What `make` makes of a section. A plugin that finds its options at odds with each other does not know where they are
/// written: its error gets the section's place.
template <class Make>
auto made_from(const Settings& section, const Make& make) {
  try {
    return make();
  } catch (const Error& mistake) {
    if (section.is_null() || names_place_of(section, mistake.what())) throw;
    throw section.error(mistake.what());
  }
}

std::shared_ptr<Blocking> blocking_of(const Host& host, const Settings& section, std::string_view otherwise) {
  return made_from(section,
                   [&] { return host.make_blocking(plugin_name(section, otherwise), plugin_options(section)); });
}

PluginChoice choice_of(const Settings& section, std::string_view otherwise) {
  PluginChoice choice{plugin_name(section, otherwise), Settings::map(section.origin())};
  for (const auto& [key, value] : section.members())
    if (key != "name") choice.options.add(key, value);
  return choice;
}

struct ArrivalOptions {
  ArrivalKind name = ArrivalKind::ekf;

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

}  // namespace

void require_known_keys(const Settings& map, const std::vector<std::string>& known, const std::string& owner) {
  check_keys(map, known, owner, {});
}

std::vector<double> numbers_by_name(const Settings& map, const std::vector<Variable>& variables,
                                    std::vector<double> defaults, const Range& range, const std::string& owner,
                                    bool may_be_infinite) {
  require_known_keys(map, names_of(variables), owner);
  for (std::size_t j = 0; j < variables.size(); ++j) {
    const Settings* value = map.find(variables[j].name);
    if (!value) continue;
    defaults[j] = NumberValue{range}.read(*value, OptionContext{owner, variables[j].unit});
    if (!may_be_infinite && !std::isfinite(defaults[j])) throw value->mismatch("a finite number");
  }
  return defaults;
}

std::pair<double, double> bounds_in(const Settings& pair) {
  if (pair.kind() != Settings::Kind::list || pair.items().size() != 2)
    throw pair.mismatch("a list [lower, upper]; null for no bound");
  const Settings &first = pair.items()[0], &second = pair.items()[1];
  const double low = first.is_null() ? -infinity : first.as_number();
  const double high = second.is_null() ? infinity : second.as_number();
  if (!(low <= high)) throw pair.error(fmt::format("found [{}, {}], expected lower <= upper", low, high));
  return {low, high};
}

std::vector<double> default_sigmas(const std::vector<Variable>& variables) {
  std::vector<double> sigmas;
  sigmas.reserve(variables.size());
  for (const Variable& variable : variables) sigmas.push_back(noise_share * variable.scale);
  return sigmas;
}

const OptionTable<RobotOptions>& RobotOptions::table() {
  static const auto rows = [] {
    OptionTable<RobotOptions> table;
    add_to(table);
    return table;
  }();
  return rows;
}

const OptionTable<SmootherOptions>& SmootherOptions::table() {
  static const auto rows =
      OptionTable<SmootherOptions>()
          .subtree("blocking", &SmootherOptions::blocking,
                   "by parameter: name and options of a blocking plugin; as in `blocking` where none is given")
          .subtree("robust", &SmootherOptions::robust, "as in `estimator`, whose loss is used where none is given")
          .number("deadline", &SmootherOptions::deadline,
                  "the solver stops after so long, with the best that it has; .inf: never [s]", greater_than(0.0))
          .subtree("solver", &SmootherOptions::solver, "name and options of a solver plugin");
  return rows;
}

const OptionTable<EstimatorOptions>& EstimatorOptions::table() {
  static const auto rows =
      OptionTable<EstimatorOptions>()
          .choice("name", &EstimatorOptions::name, {{"rhe", Name::rhe}, {"ekf", Name::ekf}, {"truth", Name::truth}},
                  "rhe: receding horizon; ekf: extended Kalman filter; truth: what the simulation knows")
          .integer("horizon", &EstimatorOptions::horizon, "N_e, intervals", between(1, 100000))
          .integer("substeps", &EstimatorOptions::substeps, "Runge-Kutta steps per interval", between(1, 1000))
          .subtree("arrival", &EstimatorOptions::arrival, "name: ekf | smoothing | constant | off")
          .subtree("forgetting", &EstimatorOptions::forgetting,
                   "by parameter: standard deviation per square root of a step, added at each slide (0.03)")
          .subtree(
              "restart_sigma", &EstimatorOptions::restart_sigma,
              "by parameter: standard deviation with which an unlinked block starts once it is the window's first (1)")
          .subtree("block_sigma", &EstimatorOptions::block_sigma,
                   "by parameter: the same for a block inside the window; .inf: none, as in the paper (0.25)")
          .subtree("initial", &EstimatorOptions::initial,
                   "state, parameters: means by name; sigma: standard deviations by name")
          .subtree("robust", &EstimatorOptions::robust,
                   "outputs: names that share one pseudo-Huber loss; delta: where it turns linear, in sigmas")
          .integer("heading_starts", &EstimatorOptions::heading_starts,
                   "starts around the circle while the heading is unknown; 1: the initial mean is trusted",
                   between(1, 64))
          .subtree("solver", &EstimatorOptions::solver, "name and options of a solver plugin");
  return rows;
}

const OptionTable<ControllerOptions>& ControllerOptions::table() {
  static const auto rows =
      OptionTable<ControllerOptions>()
          .integer("horizon", &ControllerOptions::horizon, "N_c, intervals", between(1, 100000))
          .integer("substeps", &ControllerOptions::substeps, "Runge-Kutta steps per interval", between(1, 1000))
          .choice("reference_speed", &ControllerOptions::reference_speed,
                  {{"ground", ReferenceSpeed::ground}, {"literal", ReferenceSpeed::literal}},
                  "ground: wheels turn faster by the estimated slip; literal: the path's speed is the wheels'")
          .number("least_speed_factor", &ControllerOptions::least_speed_factor,
                  "the estimated speed factor is not trusted below this", greater_than(0.0))
          .number("speed_bound_factor", &ControllerOptions::speed_bound_factor,
                  "a wheel speed that is an input is at most this times the reference plus speed_bound_offset",
                  at_least(0.0))
          .number("speed_bound_offset", &ControllerOptions::speed_bound_offset, "[m/s]", at_least(0.0))
          .subtree("weights", &ControllerOptions::weights, "stage and terminal: weights by the variable's name")
          .subtree("blocking", &ControllerOptions::blocking, "by input: name and options of a blocking plugin")
          .subtree("solver", &ControllerOptions::solver, "name and options of a solver plugin");
  return rows;
}

std::vector<OptionSection> robot_sections() {
  const auto number = [](double value) { return fmt::format("{}", value); };
  // The rows of a table, those of its maps spelt out.
  const auto spelt_out = [](std::vector<OptionRow> rows, const std::vector<OptionRow>& details) {
    std::erase_if(rows, [](const OptionRow& row) { return row.type == SubtreeValue{}.type(); });
    rows.insert(rows.end(), details.begin(), details.end());
    return rows;
  };
  std::vector<OptionRow> estimator = ArrivalOptions::table().schema();
  for (OptionRow& row : estimator) row.name = "arrival." + row.name;
  const std::vector<OptionRow> by_name = {
      {"forgetting.PARAMETER", "number", number(ParameterWalk{}.forgetting), at_least(0.0).text(),
       "standard deviation per square root of a step, added at each slide"},
      {"restart_sigma.PARAMETER", "number", number(ParameterWalk{}.restart_sigma), greater_than(0.0).text(),
       "standard deviation with which an unlinked block starts once it is the window's first"},
      {"block_sigma.PARAMETER", "number", number(ParameterWalk{}.block_sigma), greater_than(0.0).text(),
       "standard deviation of an unlinked block inside the window about the block before; .inf: none, as in the paper"},
      {"initial.state.STATE", "number", "0; in a simulation the true start", "", "mean at the start"},
      {"initial.parameters.PARAMETER", "number", "the middle of its bounds, else where nothing slips", "",
       "mean at the start"},
      {"initial.sigma.STATE", "number", number(initial_share) + " x its typical magnitude", greater_than(0.0).text(),
       "standard deviation at the start"},
      {"initial.sigma.PARAMETER", "number", number(parameter_share) + " x its typical magnitude",
       greater_than(0.0).text(), "standard deviation at the start"},
      {"robust.outputs", "list of texts", "[]", "outputs", "these share one pseudo-Huber loss"},
      {"robust.delta", "number", number(RobustLoss{}.delta), greater_than(0.0).text(),
       "where that loss turns from quadratic to linear, in standard deviations"},
      {"solver.name", "text", default_solver, "a solver plugin", "its options stand beside the name"},
  };
  estimator.insert(estimator.end(), by_name.begin(), by_name.end());
  const std::vector<OptionRow> controller = {
      {"weights.stage.STATE", "number",
       fmt::format("{} for the position, {} for a speed, else 0", position_weight, input_weight), at_least(0.0).text(),
       "of the squared distance from the reference at a node"},
      {"weights.stage.INPUT", "number", number(input_weight), at_least(0.0).text(),
       "of the squared distance from the reference on an interval"},
      {"weights.terminal.STATE", "number", fmt::format("{} for the position, else 0", terminal_weight),
       at_least(0.0).text(), "of the squared distance from the reference at the last node"},
      {"blocking.INPUT.name", "text", default_input_blocking, "a blocking plugin",
       "move blocking; its options stand beside the name; an input that is not named is free on every interval"},
      {"solver.name", "text", default_solver, "a solver plugin", "its options stand beside the name"},
  };
  const std::vector<OptionRow> smoother = {
      {"blocking.PARAMETER.name", "text", "as in `blocking`", "a blocking plugin", "its options stand beside the name"},
      {"robust.outputs", "list of texts", "as in `estimator`", "outputs", "these share one pseudo-Huber loss"},
      {"robust.delta", "number", number(RobustLoss{}.delta), greater_than(0.0).text(),
       "where that loss turns from quadratic to linear, in standard deviations"},
      {"solver.name", "text", default_smoothing_solver, "a solver plugin", "its options stand beside the name"},
  };
  const std::string noise_default = number(noise_share) + " x its typical magnitude";
  return {
      {"model",
       "The vehicle.",
       {{"name", "text", default_model, "a model plugin", "its options stand beside the name"},
        {"outputs", "list of texts", "the usual ones", "all, or outputs of the model", "what is measured"}}},
      {"noise",
       "Standard deviations of what is measured, in the variable's unit; a simulation draws its noise from them too.",
       {{"outputs.OUTPUT", "number", noise_default, greater_than(0.0).text(), "of a measured output"},
        {"inputs.INPUT", "number", noise_default, greater_than(0.0).text(), "of a measured input"}}},
      {"bounds",
       "Lower and upper bounds. Those of states hold for estimator and controller, those of parameters for the "
       "estimator, "
       "those of inputs for the controller.",
       {{"STATE, INPUT or PARAMETER", "list of 2 numbers", "the model's own", "lower <= upper; null for none",
         "[lower, upper]"}}},
      {"blocking",
       "Which intervals of the estimator share one value of a parameter.",
       {{"PARAMETER.name", "text", default_blocking, "a blocking plugin", "its options stand beside the name"}}},
      {"estimator", "How state and parameters are estimated.",
       spelt_out(EstimatorOptions::table().schema(), estimator)},
      {"controller", "How the path is followed.", spelt_out(ControllerOptions::table().schema(), controller)},
      {"smoother",
       "How a whole log is estimated at once. What is not here is as in `estimator`; its own estimates are the start.",
       spelt_out(SmootherOptions::table().schema(), smoother)},
  };
}

Robot::Robot(const Host& host, const RobotOptions& options)
    : host_(host),
      options_(options),
      estimator_(EstimatorOptions::table().parse(options.estimator, "estimator")),
      controller_(ControllerOptions::table().parse(options.controller, "controller")),
      smoother_(SmootherOptions::table().parse(options.smoother, "smoother")) {
  model_ = made_from(options.model, [&] {
    return host.make_model(plugin_name(options.model, default_model), plugin_options(options.model));
  });
  const ModelDescription& about = model_->description();
  require_known_keys(options.noise, {"outputs", "inputs"}, "noise");
  output_sigmas_ = numbers_by_name(member_or_null(options.noise, "outputs"), about.outputs,
                                   default_sigmas(about.outputs), greater_than(0.0), "noise of outputs");
  input_sigmas_ = numbers_by_name(member_or_null(options.noise, "inputs"), about.inputs, default_sigmas(about.inputs),
                                  greater_than(0.0), "noise of inputs");
  read_bounds();
  require_known_keys(options.blocking, names_of(about.parameters), "blocking");
  check_estimator();
}

/// Also what the estimator of this name does not use: a mistake there would show only once another one is chosen.
void Robot::check_estimator() const {
  const ModelDescription& about = model_->description();
  const std::vector<double> none(about.parameters.size(), 0.0);
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;
  read_initial({}, mean, covariance);
  read_robust(estimator_.robust, "estimator");
  read_robust(smoother_.robust, "smoother");
  ArrivalOptions::table().parse(estimator_.arrival, "estimator: arrival");
  numbers_by_name(estimator_.forgetting, about.parameters, none, at_least(0.0), "forgetting");
  numbers_by_name(estimator_.restart_sigma, about.parameters, none, greater_than(0.0), "restart_sigma");
  numbers_by_name(estimator_.block_sigma, about.parameters, none, greater_than(0.0), "block_sigma", true);
  for (const Variable& parameter : about.parameters)
    blocking_of(host_, member_or_null(options_.blocking, parameter.name), default_blocking);
}

Robot Robot::from_file(const Host& host, const std::string& yaml_file) {
  return {host, RobotOptions::table().parse(load_yaml(yaml_file), yaml_file)};
}

void Robot::read_bounds() {
  const ModelDescription& about = model_->description();
  std::vector<std::string> known;
  for (const auto* variables : {&about.states, &about.inputs, &about.parameters})
    for (const Variable& variable : *variables) known.push_back(variable.name);
  require_known_keys(options_.bounds, known, "bounds");
  const auto read = [&](const std::vector<Variable>& variables, std::vector<double>& lower,
                        std::vector<double>& upper) {
    for (const Variable& variable : variables) {
      double low = variable.lower, high = variable.upper;
      if (const Settings* pair = options_.bounds.find(variable.name)) std::tie(low, high) = bounds_in(*pair);
      lower.push_back(low);
      upper.push_back(high);
    }
  };
  read(about.states, state_lower_, state_upper_);
  read(about.inputs, input_lower_, input_upper_);
  read(about.parameters, parameter_lower_, parameter_upper_);
}

ModelDescription Robot::bounded_description() const {
  ModelDescription about = model_->description();
  const auto bound = [](std::vector<Variable>& variables, const std::vector<double>& lower,
                        const std::vector<double>& upper) {
    for (std::size_t j = 0; j < variables.size(); ++j) {
      variables[j].lower = lower[j];
      variables[j].upper = upper[j];
    }
  };
  bound(about.states, state_lower_, state_upper_);
  bound(about.inputs, input_lower_, input_upper_);
  bound(about.parameters, parameter_lower_, parameter_upper_);
  return about;
}

std::vector<std::shared_ptr<const Blocking>> Robot::make_blockings() const {
  std::vector<std::shared_ptr<const Blocking>> blockings;
  for (const Variable& parameter : model_->description().parameters)
    blockings.push_back(blocking_of(host_, member_or_null(options_.blocking, parameter.name), default_blocking));
  return blockings;
}

void Robot::read_initial(const std::optional<Eigen::VectorXd>& initial_state, Eigen::VectorXd& mean,
                         Eigen::MatrixXd& covariance) const {
  const ModelDescription& about = model_->description();
  require_known_keys(estimator_.initial, {"state", "parameters", "sigma"}, "estimator: initial");
  const int nx = model_->state_count(), np = model_->parameter_count();
  std::vector<double> state(nx, 0.0), parameters(np, 0.0);
  for (int j = 0; j < np; ++j) {
    const double middle = 0.5 * (parameter_lower_[j] + parameter_upper_[j]);
    parameters[j] = std::isfinite(middle) ? middle : about.parameters[j].nominal;
  }
  state = numbers_by_name(member_or_null(estimator_.initial, "state"), about.states, state, any(), "initial state");
  parameters = numbers_by_name(member_or_null(estimator_.initial, "parameters"), about.parameters, parameters, any(),
                               "initial parameters");
  if (initial_state && !estimator_.initial.find("state"))
    for (int j = 0; j < nx; ++j) state[j] = (*initial_state)[j];
  std::vector<Variable> both = about.states;
  both.insert(both.end(), about.parameters.begin(), about.parameters.end());
  std::vector<double> sigma;
  for (const Variable& variable : about.states) sigma.push_back(initial_share * variable.scale);
  for (const Variable& variable : about.parameters) sigma.push_back(parameter_share * variable.scale);
  sigma = numbers_by_name(member_or_null(estimator_.initial, "sigma"), both, sigma, greater_than(0.0), "initial sigma");
  mean.resize(nx + np);
  covariance.setZero(nx + np, nx + np);
  for (int j = 0; j < nx + np; ++j) {
    mean[j] = j < nx ? state[j] : parameters[j - nx];
    covariance(j, j) = sigma[j] * sigma[j];
  }
}

std::vector<RobustLoss> Robot::read_robust(const Settings& section, const std::string& owner) const {
  if (section.is_null()) return {};
  require_known_keys(section, {"outputs", "delta"}, owner + ": robust");
  RobustLoss loss;
  if (const Settings* delta = section.find("delta"))
    loss.delta = NumberValue{greater_than(0.0)}.read(*delta, OptionContext{"robust", "in standard deviations"});
  const Settings* outputs = section.find("outputs");
  if (!outputs) throw section.error("expected the key 'outputs', a list of outputs that share the loss");
  const auto known = names_of(model_->description().outputs);
  for (const Settings& item : outputs->items()) {
    const auto found = std::find(known.begin(), known.end(), item.as_text());
    if (found == known.end()) throw item.mismatch(fmt::format("one of {}", fmt::join(known, ", ")));
    loss.outputs.push_back(static_cast<int>(found - known.begin()));
  }
  if (loss.outputs.empty()) throw outputs->mismatch("a list of at least one output");
  return {loss};
}

PluginChoice Robot::model_choice() const { return choice_of(options_.model, default_model); }

PluginChoice Robot::solver_choice(std::string_view kind) const {
  return choice_of(kind == "rhe" ? estimator_.solver : controller_.solver, default_solver);
}

PluginChoice Robot::blocking_choice(int parameter) const {
  const std::string& name = model_->description().parameters[static_cast<std::size_t>(parameter)].name;
  return choice_of(member_or_null(options_.blocking, name), default_blocking);
}

void Robot::wrap_solvers(SolverWrap wrap) {
  if (!wrap_) {
    wrap_ = std::move(wrap);
    return;
  }
  wrap_ = [inner = std::move(wrap_), outer = std::move(wrap)](std::string_view kind, std::shared_ptr<Solver> solver) {
    return outer(kind, inner(kind, std::move(solver)));
  };
}

std::shared_ptr<Solver> Robot::make_solver(std::string_view kind) const {
  const Settings& section = kind == "rhe" ? estimator_.solver : controller_.solver;
  auto solver = made_from(
      section, [&] { return host_.make_solver(plugin_name(section, default_solver), plugin_options(section)); });
  return wrap_ ? wrap_(kind, std::move(solver)) : solver;
}

FullInformationEstimation::Setup Robot::estimation_setup(int horizon, const Settings& blocking) const {
  const ModelDescription& about = model_->description();
  FullInformationEstimation::Setup setup;
  setup.problem.max_intervals = horizon;
  setup.problem.substeps = estimator_.substeps;
  for (const double sigma : output_sigmas_) setup.problem.output_weights.push_back(1.0 / (sigma * sigma));
  for (const double sigma : input_sigmas_) setup.problem.input_weights.push_back(1.0 / (sigma * sigma));
  setup.problem.robust = read_robust(estimator_.robust, "estimator");
  setup.problem.state_lower = state_lower_;
  setup.problem.state_upper = state_upper_;
  setup.problem.parameter_lower = parameter_lower_;
  setup.problem.parameter_upper = parameter_upper_;
  const std::size_t np = about.parameters.size();
  const auto forgetting =
      numbers_by_name(estimator_.forgetting, about.parameters, std::vector<double>(np, ParameterWalk{}.forgetting),
                      at_least(0.0), "forgetting");
  const auto restart =
      numbers_by_name(estimator_.restart_sigma, about.parameters,
                      std::vector<double>(np, ParameterWalk{}.restart_sigma), greater_than(0.0), "restart_sigma");
  const auto alone =
      numbers_by_name(estimator_.block_sigma, about.parameters, std::vector<double>(np, ParameterWalk{}.block_sigma),
                      greater_than(0.0), "block_sigma", true);
  require_known_keys(blocking, names_of(about.parameters), "blocking");
  for (std::size_t j = 0; j < np; ++j) {
    setup.walks.push_back({forgetting[j], restart[j], alone[j]});
    setup.blockings.push_back(blocking_of(host_, member_or_null(blocking, about.parameters[j].name), default_blocking));
  }
  return setup;
}

std::unique_ptr<EstimationMethod> Robot::make_receding_horizon(const Eigen::VectorXd& mean,
                                                               const Eigen::MatrixXd& covariance) const {
  const ModelDescription& about = model_->description();
  auto common = estimation_setup(estimator_.horizon, options_.blocking);
  for (std::size_t j = 0; j < about.parameters.size(); ++j)
    if (const std::string reason = common.blockings[j]->why_not(estimator_.horizon); !reason.empty())
      throw member_or_null(options_.blocking, about.parameters[j].name)
          .error(fmt::format("{}; change it or estimator.horizon", reason));
  RecedingHorizonEstimation::Setup setup;
  setup.problem = std::move(common.problem);
  setup.blockings = std::move(common.blockings);
  setup.walks = std::move(common.walks);
  setup.arrival = ArrivalOptions::table().parse(estimator_.arrival, "estimator: arrival").name;
  setup.initial_mean = mean;
  setup.initial_covariance = covariance;
  setup.heading_starts = estimator_.heading_starts;
  auto solver = make_solver("rhe");
  return std::make_unique<RecedingHorizonEstimation>(model_, std::move(solver), std::move(setup));
}

FullInformationEstimation Robot::make_smoother(const std::optional<Eigen::VectorXd>& initial_state) const {
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;
  read_initial(initial_state, mean, covariance);
  // The horizon is that of the log, once it is there.
  auto setup =
      estimation_setup(estimator_.horizon, smoother_.blocking.is_null() ? options_.blocking : smoother_.blocking);
  if (!smoother_.robust.is_null()) setup.problem.robust = read_robust(smoother_.robust, "smoother");
  setup.initial_mean = std::move(mean);
  setup.initial_covariance = std::move(covariance);
  auto solver = made_from(smoother_.solver, [&] {
    return host_.make_solver(plugin_name(smoother_.solver, default_smoothing_solver), plugin_options(smoother_.solver));
  });
  return {model_, std::move(solver), std::move(setup)};
}

std::unique_ptr<Estimator> Robot::make_estimator(const std::optional<Eigen::VectorXd>& initial_state) const {
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;
  read_initial(initial_state, mean, covariance);
  std::unique_ptr<EstimationMethod> method;
  switch (estimator_.name) {
    case EstimatorOptions::Name::rhe:
      method = make_receding_horizon(mean, covariance);
      break;
    case EstimatorOptions::Name::ekf: {
      FilterEstimation::Setup setup;
      for (const double sigma : output_sigmas_) setup.noise.output_variances.push_back(sigma * sigma);
      for (const double sigma : input_sigmas_) setup.noise.input_variances.push_back(sigma * sigma);
      setup.noise.parameter_lower = parameter_lower_;
      setup.noise.parameter_upper = parameter_upper_;
      setup.walk = numbers_by_name(estimator_.forgetting, model_->description().parameters,
                                   std::vector<double>(model_->parameter_count(), ParameterWalk{}.forgetting),
                                   at_least(0.0), "forgetting");
      setup.initial_mean = mean;
      setup.initial_covariance = covariance;
      setup.substeps = estimator_.substeps;
      setup.heading_starts = estimator_.heading_starts;
      method = std::make_unique<FilterEstimation>(model_, std::move(setup));
      break;
    }
    case EstimatorOptions::Name::truth:
      throw options_.estimator.error("name: 'truth' is known to a simulation only; choose rhe or ekf");
  }
  if (method_wrap_) method = method_wrap_(std::move(method));
  Estimator::Timeline timeline;
  timeline.longest_interval = options_.step;
  return std::make_unique<Estimator>(std::move(method), timeline);
}

std::unique_ptr<Controller> Robot::make_controller(const Path& path) const {
  const ModelDescription& about = model_->description();
  const int nx = model_->state_count(), nu = model_->input_count();
  Controller::Setup setup;
  setup.problem.max_intervals = controller_.horizon;
  setup.problem.substeps = controller_.substeps;
  std::vector<double> position(nx, 0.0), terminal(nx, 0.0), inputs(nu, input_weight);
  for (const int j : {about.roles.position_x, about.roles.position_y}) {
    if (j < 0) continue;
    position[j] = position_weight;
    terminal[j] = terminal_weight;
  }
  if (about.roles.speed_state >= 0) position[about.roles.speed_state] = input_weight;
  require_known_keys(controller_.weights, {"stage", "terminal"}, "controller: weights");
  std::vector<Variable> both = about.states;
  both.insert(both.end(), about.inputs.begin(), about.inputs.end());
  std::vector<double> stage = position;
  stage.insert(stage.end(), inputs.begin(), inputs.end());
  stage = numbers_by_name(member_or_null(controller_.weights, "stage"), both, stage, at_least(0.0), "weights: stage");
  setup.problem.state_weights.assign(stage.begin(), stage.begin() + nx);
  setup.problem.input_weights.assign(stage.begin() + nx, stage.end());
  setup.problem.terminal_weights = numbers_by_name(member_or_null(controller_.weights, "terminal"), about.states,
                                                   terminal, at_least(0.0), "weights: terminal");
  setup.problem.state_lower = state_lower_;
  setup.problem.state_upper = state_upper_;
  setup.problem.input_lower = input_lower_;
  setup.problem.input_upper = input_upper_;
  setup.interval = options_.step;
  setup.reference_speed = controller_.reference_speed;
  setup.least_speed_factor = controller_.least_speed_factor;
  setup.speed_bound_factor = controller_.speed_bound_factor;
  setup.speed_bound_offset = controller_.speed_bound_offset;
  require_known_keys(controller_.blocking, names_of(about.inputs), "controller: blocking");
  for (int j = 0; j < nu; ++j) {
    const Settings* section = controller_.blocking.find(about.inputs[j].name);
    if (!section) continue;
    setup.problem.blocked_inputs.push_back(j);
    auto blocking = blocking_of(host_, *section, default_input_blocking);
    if (const std::string reason = blocking->why_not(controller_.horizon); !reason.empty())
      throw section->error(fmt::format("{}; change it or controller.horizon", reason));
    if (blocking->transition() != Transition::step || blocking->neighbour_sigma())
      throw section->error(
          "an input jumps from block to block and no walk links its blocks; drop transition and neighbour_sigma");
    setup.blockings.push_back(std::move(blocking));
  }
  auto solver = make_solver("rhc");
  return std::make_unique<Controller>(model_, std::move(solver), path, std::move(setup));
}

}  // namespace rhec
