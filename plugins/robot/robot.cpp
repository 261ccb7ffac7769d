#include "rhec/plugins/robot/robot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <string>
#include <utility>
#include <vector>

#include "rhec/core/model/step_requirement.hpp"
#include "rhec/plugins/robot/bounds_section.hpp"
#include "rhec/plugins/robot/integration.hpp"
#include "rhec/plugins/robot/sensors.hpp"
#include "rhec/plugins/yaml/yaml.hpp"

namespace rhec {
namespace {

bool is_among(const std::vector<Variable>& variables, const std::string& name) {
  return std::ranges::any_of(variables, [&](const Variable& variable) { return variable.name == name; });
}

/// What is said of a sensor that the vehicle could have, where `model.outputs` is not given and the usual ones are
/// taken.
void refuse_unusual_outputs(const Host& host, const RobotOptions& options, const ModelDescription& about) {
  if (options.model.find("outputs")) return;
  for (const char* const key : {"outputs", "biases", "scales"}) {
    const Settings* const map = options.noise.find(key);
    if (!map || map->kind() != Settings::Kind::map) continue;
    for (const auto& [name, value] : map->members()) {
      if (is_among(about.outputs, name)) continue;
      Settings all = options.model;
      if (all.kind() == Settings::Kind::scalar) {
        all = Settings::map(options.model.origin());
        all.set("name", options.model);
      } else if (all.is_null()) {
        all = Settings::map();
      }
      all.set("outputs", Settings::scalar("all"));
      if (is_among(ModelSection(host, all).model()->description().outputs, name))
        throw value.error(
            "the vehicle could have this sensor, but only its usual ones are measured where model.outputs "
            "is not given; name it there");
    }
  }
}

std::shared_ptr<const RobotContext> context_of(const Host& host, const RobotOptions& options,
                                               const ModelSection& section) {
  const std::shared_ptr<const Model>& model = section.model();
  refuse_unusual_outputs(host, options, model->description());
  const NoiseSection noise(options.noise, model->description(), section.left_out());
  const BoundsSection bounds(options.bounds, model->description());
  return std::make_shared<const RobotContext>(RobotContext{host, options.step, model, bounds.bounded(), noise});
}

constexpr double longest_usual_step = 1.0;  // [s]
/// More explicit steps of an interval are noted: a solve then takes tens of times as long as with one.
constexpr int most_usual_substeps = 16;

/// Says that explicit steps cost much in these sections ("estimator, controller"); empty if they do not.
std::string costly_steps_note(const RobotContext& context, const std::string& sections) {
  const Model& model = *context.model;
  if (sections.empty() || !model.graph()) return {};
  std::vector<double> parameters;
  for (const Variable& parameter : context.about.parameters) parameters.push_back(middle_value(parameter));
  const StepRequirement needed =
      step_requirement(model, operating_points(model, context.about, parameters), context.step);
  if (needed.mode_substeps <= most_usual_substeps || needed.state < 0) return {};
  return fmt::format(
      "{}: an interval of {:g} s takes {} Runge-Kutta steps, since the model '{}' has a time constant of {:.3g} s, in "
      "the state '{}'; a solve takes many times as long as with integrator: implicit, which follows it in a few steps",
      sections, context.step, needed.mode_substeps, context.about.name, needed.time_constant,
      context.about.states[static_cast<std::size_t>(needed.state)].name);
}

}  // namespace

const OptionTable<RobotOptions>& RobotOptions::table() {
  static const auto rows = [] {
    OptionTable<RobotOptions> table;
    add_to(table);
    return table;
  }();
  return rows;
}

std::vector<OptionSection> robot_sections(const EstimatorMakers& estimators) {
  return {ModelSection::documentation(),
          NoiseSection::documentation(),
          BoundsSection::documentation(),
          BlockingSection::documentation(),
          EstimatorSection::documentation(estimators),
          ControllerSection::documentation(),
          SmootherSection::documentation()};
}

Robot::Robot(const Host& host, const RobotOptions& options, EstimatorMakers estimators)
    : model_(host, options.model),
      context_(context_of(host, options, model_)),
      estimated_(with_sensor_errors(*context_)),
      blocking_(context_, options.blocking),
      estimator_(context_, blocking_, options.estimator, std::move(estimators)),
      controller_(context_, options.controller),
      smoother_(context_, options.smoother) {}

Robot Robot::from_file(const Host& host, const std::string& yaml_file) {
  return {host, RobotOptions::table().parse(load_yaml(yaml_file), yaml_file)};
}

PluginChoice Robot::solver_choice(std::string_view kind) const {
  return kind == "rhe" ? estimator_.solver_choice() : controller_.solver_choice();
}

void Robot::use_estimators(EstimatorMakers estimators) { estimator_.use(std::move(estimators)); }

void Robot::add_hooks(std::shared_ptr<const RobotHooks> hooks) { hooks_.add(std::move(hooks)); }

std::vector<std::string> Robot::notes() const {
  std::vector<std::string> notes = context_->noise.notes;
  if (step() > longest_usual_step)
    notes.push_back(fmt::format(
        "step: {} s from node to node is long: what happens between is not seen, and inputs do not change; most robots "
        "take 0.05 to 0.5 s",
        step()));
  std::string explicit_sections;
  if (estimator_options().integrator == Integrator::runge_kutta) explicit_sections = "estimator";
  if (controller_.options().integrator == Integrator::runge_kutta)
    explicit_sections += explicit_sections.empty() ? "controller" : ", controller";
  if (std::string note = costly_steps_note(*context_, explicit_sections); !note.empty())
    notes.push_back(std::move(note));
  std::ranges::move(controller_.notes(), std::back_inserter(notes));
  return notes;
}

std::unique_ptr<Estimator> Robot::make_estimator(const std::optional<Eigen::VectorXd>& initial_state) const {
  return estimator_.make(initial_state, hooks_);
}

std::unique_ptr<Controller> Robot::make_controller(const Path& path, std::shared_ptr<const SlipAhead> ahead) const {
  return controller_.make(path, hooks_, std::move(ahead));
}

std::unique_ptr<Smoother> Robot::make_smoother(const std::optional<Eigen::VectorXd>& initial_state) const {
  return smoother_.make(estimator_.parts(initial_state));
}

}  // namespace rhec
