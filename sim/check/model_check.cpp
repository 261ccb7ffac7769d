#include "rhec/sim/check/model_check.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "model_checks.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/core/model/implicit_model.hpp"
#include "rhec/sim/check/derivative_check.hpp"

namespace rhec::sim {

int ModelCheck::count(Verdict verdict) const { return count_of(findings, verdict); }

Verdict ModelCheck::verdict() const { return verdict_of(findings); }

namespace {

/// Restores the fastest instruction set, the default of models, at the end.
class FastestAtTheEnd {
 public:
  explicit FastestAtTheEnd(Model& model) : model_(&model) {}
  FastestAtTheEnd(const FastestAtTheEnd&) = delete;
  FastestAtTheEnd& operator=(const FastestAtTheEnd&) = delete;
  ~FastestAtTheEnd() {
    const std::vector<std::string> sets = model_->instruction_sets();
    if (!sets.empty()) model_->use_instruction_set(sets.back());
  }

 private:
  Model* model_;
};

std::vector<double> sigmas_or_default(const std::vector<double>& given, const std::vector<Variable>& variables,
                                      const char* kind) {
  if (given.empty()) return default_sigmas(variables);
  if (given.size() != variables.size())
    throw Error(fmt::format("check of a model: {} standard deviations of {}s; it has {}", given.size(), kind,
                            variables.size()));
  for (std::size_t j = 0; j < given.size(); ++j)
    if (!(given[j] > 0.0))
      throw Error(fmt::format("check of a model: the standard deviation of {} '{}' is {}; expected more than 0", kind,
                              variables[j].name, given[j]));
  return given;
}

void require_fitting(const Model& model, const ModelDescription& within, const ModelCheckOptions& options) {
  const ModelDescription& own = model.description();
  if (names_of(own.states) != names_of(within.states) || names_of(own.inputs) != names_of(within.inputs) ||
      names_of(own.parameters) != names_of(within.parameters) || names_of(own.outputs) != names_of(within.outputs))
    throw Error(fmt::format("check of model '{}': the bounds to keep to are those of other variables", own.name));
  if (!(options.interval > 0.0 && std::isfinite(options.interval)) || options.horizon < 1 ||
      options.substeps.value_or(1) < 1 || options.samples < 1)
    throw Error("check of a model: interval, horizon, substeps and samples are to be greater than 0");
  if (options.speed && !(*options.speed > 0.0 && std::isfinite(*options.speed)))
    throw Error("check of a model: the speed is to be greater than 0");
  for (const auto* which : {&options.biased, &options.scaled})
    for (const int j : *which)
      if (j < 0 || j >= std::ssize(within.outputs))
        throw Error(fmt::format("check of a model: an error of output {}; it has {} outputs, from 0 on", j,
                                within.outputs.size()));
  const auto is_partial = [](const std::vector<int>& which, const std::vector<double>& sigmas) {
    return !sigmas.empty() && sigmas.size() != which.size();
  };
  if (is_partial(options.biased, options.bias_sigmas) || is_partial(options.scaled, options.scale_sigmas))
    throw Error("check of a model: give a standard deviation for each of the biases and scale errors, or none");
  if (!options.blockings.empty() && options.blockings.size() != within.parameters.size())
    throw Error(fmt::format("check of a model: {} blockings for {} parameters", options.blockings.size(),
                            within.parameters.size()));
}

/// The worst of several comparisons, with a description of the circumstances.
struct WorstOfAll {
  WorstEntry entry;
  std::string circumstances;
  void take(const WorstEntry& other, const std::string& under) {
    if (other.where.empty() || (!entry.where.empty() && other.error <= entry.error)) return;
    entry = other;
    circumstances = under;
  }
};

constexpr double integration_tolerance = 1e-10;

}  // namespace

std::vector<Finding> check_derivatives(const CheckedModel& checked) {
  FindingList findings("derivatives");
  const FastestAtTheEnd restore(checked.model);
  const StagePoints stages = random_stages(checked.about, stages_of_a_range, checked.options.seed);
  WorstOfAll first, second, output_first, output_second, integration;
  int compared = 0, skipped = 0;
  // Explicit steps that are long against what is fast in a vehicle grow without bound, and so do the errors of rounding
  // in them: they are looked at in steps that do not.
  const auto shortened = [&, of_the_model = required_steps(checked).time_constant](double constants) {
    StagePoints made = stages;
    const double share = std::min(constants * of_the_model / checked.options.interval, 1.0);
    for (double& duration : made.durations) duration *= share;
    return made;
  };
  // Implicit steps are those of the vehicle's formula, whose explicit steps are held against its rates.
  const auto* const implicit = dynamic_cast<const ImplicitModel*>(&checked.model);
  const Model& of_rates = implicit ? *implicit->vehicle() : checked.model;
  const StagePoints short_stages = shortened(implicit ? 0.1 : 0.5);
  const StagePoints& compared_at = implicit ? stages : short_stages;
  const std::vector<std::string> sets = checked.model.instruction_sets();
  for (const std::string& set : sets) {
    if (!checked.model.use_instruction_set(set)) {
      findings.fail(set, "instruction_sets() names it, use_instruction_set() refuses it",
                    "let both know the same names");
      continue;
    }
    for (const int substeps : {1, 3}) {
      for (const bool ramp : {false, true}) {
        const std::string under = fmt::format("instruction set {}, {} substep{}{}", set, substeps,
                                              substeps > 1 ? "s" : "", ramp ? ", parameters on a ramp" : "");
        const DerivativeErrors errors = derivative_errors(checked.model, checked.about, compared_at, ramp, substeps);
        first.take(errors.first, under);
        second.take(errors.second, under);
        output_first.take(errors.output_first, fmt::format("instruction set {}", set));
        output_second.take(errors.output_second, fmt::format("instruction set {}", set));
        integration.take(integration_error(of_rates, checked.about, short_stages, ramp, substeps), under);
        compared += errors.compared;
        skipped += errors.skipped;
      }
    }
  }
  const auto report_worst = [&](const WorstOfAll& worst, double tolerance, const char* what, const char* against,
                                const char* advice) {
    if (!(worst.entry.error > tolerance)) return;
    findings.fail(worst.entry.where,
                  fmt::format("{}: {:.6g} by the model, {:.6g} by {}; relative error {:.2g} ({})", what,
                              worst.entry.given, worst.entry.expected, against, worst.entry.error, worst.circumstances),
                  advice,
                  {{"error", worst.entry.error}, {"given", worst.entry.given}, {"expected", worst.entry.expected}});
  };
  constexpr const char *differences = "differences", *steps = "Runge-Kutta steps of rates()";
  report_worst(integration, integration_tolerance, "values of F", steps,
               "let integrate() and rates() be of one formula");
  report_worst(first, derivative_tolerance, "first derivative of F", differences, "mend `jacobians` of integrate()");
  report_worst(second, derivative_tolerance, "second derivative of F", differences, "mend `hessians` of integrate()");
  report_worst(output_first, derivative_tolerance, "first derivative of h", differences,
               "mend `jacobians` of observe()");
  report_worst(output_second, derivative_tolerance, "second derivative of h", differences,
               "mend `hessians` of observe()");
  if (compared == 0 && findings.empty() && skipped > 0)
    findings.skip("no derivative is finite at random points inside the bounds; see 'numbers'");
  if (findings.empty()) {
    const double worst_first = std::max(first.entry.error, output_first.entry.error),
                 worst_second = std::max(second.entry.error, output_second.entry.error);
    findings.pass(
        fmt::format("{} entries on {}: largest relative error beyond rounding {:.1g} of first{} derivatives{}",
                    compared, fmt::join(sets, ", "), worst_first,
                    checked.model.has_second_derivatives() ? fmt::format(", {:.1g} of second", worst_second) : "",
                    checked.model.has_second_derivatives() ? "" : "; no second ones: for Gauss-Newton only"),
        {{"first", worst_first}, {"second", worst_second}, {"compared", compared}, {"skipped", skipped}});
  }
  return findings.take();
}

std::vector<Finding> measure_times(const CheckedModel& checked, std::vector<EvaluationTimes>& times) {
  constexpr int range = 16;
  FindingList findings("time");
  const FastestAtTheEnd restore(checked.model);
  Model& model = checked.model;
  const int nx = model.state_count(), nz = nx + model.input_count() + model.parameter_count(),
            ny = model.output_count();
  const StagePoints stages = random_stages(checked.about, range, checked.options.seed);
  std::vector<double> next(range * nx), jacobians(range * nx * nz), hessians(range * nz * nz), outputs(range * ny),
      output_jacobians(range * ny * nx);
  const std::vector<double> multipliers(range * nx, 1.0);
  const auto spread = [](const auto& call) { return time_of_calls(range, call); };
  for (const std::string& set : model.instruction_sets()) {
    if (!model.use_instruction_set(set)) continue;
    Model::Intervals request{.count = range,
                             .states = stages.states.data(),
                             .inputs = stages.inputs.data(),
                             .parameters = stages.parameters.data(),
                             .durations = stages.durations.data(),
                             .substeps = checked.substeps,
                             .next_states = next.data()};
    EvaluationTimes found;
    found.instruction_set = set;
    found.values = spread([&] { model.integrate(request); });
    request.jacobians = jacobians.data();
    found.jacobians = spread([&] { model.integrate(request); });
    if (model.has_second_derivatives()) {
      request.multipliers = multipliers.data();
      request.hessians = hessians.data();
      found.hessians = spread([&] { model.integrate(request); });
    }
    found.outputs = spread([&] {
      model.observe({.count = range,
                     .states = stages.states.data(),
                     .outputs = outputs.data(),
                     .jacobians = output_jacobians.data()});
    });
    times.push_back(std::move(found));
  }
  if (times.empty()) {
    findings.skip("the model names no instruction set");
    return findings.take();
  }
  const EvaluationTimes& used = times.back();
  findings.pass(fmt::format("{:.0f} ns a stage with Jacobian on {} ({:.0f} ns without, {})", used.jacobians.median,
                            used.instruction_set, used.values.median,
                            model.has_second_derivatives() ? fmt::format("{:.0f} ns with Hessian", used.hessians.median)
                                                           : "no second derivatives"));
  return findings.take();
}

ModelCheck check_model(Model& model, const ModelDescription& within, const ModelCheckOptions& options) {
  require_fitting(model, within, options);
  ModelCheck check;
  check.model = within.name;
  check.seed = options.seed;
  check.parameters = names_of(within.parameters);
  check.states = names_of(within.states);
  const auto add = [&](std::vector<Finding> found) {
    for (Finding& finding : found) check.findings.push_back(std::move(finding));
  };
  bool can_go_on = true;
  add(check_description(within, can_go_on));
  if (!can_go_on) {
    for (const char* skipped :
         {"symmetry", "straight_motion", "integration", "derivatives", "numbers", "scaling", "observability", "time"}) {
      FindingList findings(skipped);
      findings.skip("the description has to be mended first");
      add(findings.take());
    }
    return check;
  }
  CheckedModel checked{model, within, options, sigmas_or_default(options.output_sigmas, within.outputs, "output"),
                       sigmas_or_default(options.input_sigmas, within.inputs, "input")};
  add(check_symmetry(checked));
  add(check_straight_motion(checked));
  const StepRequirement needed = required_steps(checked);
  checked.substeps = options.substeps.value_or(std::max(1, needed.substeps));
  add(check_integration(checked, needed));
  add(check_derivatives(checked));
  add(check_numbers(checked));
  add(check_drives(checked, check.drives));
  add(measure_times(checked, check.times));
  return check;
}

ModelCheck check_model(Model& model, const ModelCheckOptions& options) {
  return check_model(model, model.description(), options);
}

ModelCheck check_model(const Host& host, const Robot& robot, ModelCheckOptions options) {
  options.interval = robot.step();
  options.horizon = robot.estimator_options().horizon;
  options.substeps = robot.estimator_options().substeps;
  options.output_sigmas = robot.output_sigmas();
  options.input_sigmas = robot.input_sigmas();
  options.blockings = robot.make_blockings();
  for (std::size_t j = 0; j < robot.output_biases().size(); ++j)
    if (robot.output_biases()[j].sigma > 0.0) {
      options.biased.push_back(static_cast<int>(j));
      options.bias_sigmas.push_back(robot.output_biases()[j].sigma);
    }
  for (std::size_t j = 0; j < robot.output_scales().size(); ++j)
    if (robot.output_scales()[j].sigma > 0.0) {
      options.scaled.push_back(static_cast<int>(j));
      options.scale_sigmas.push_back(robot.output_scales()[j].sigma);
    }
  // The robot's own model is shared; its instruction set must not change.
  const PluginChoice choice = robot.model_choice();
  std::shared_ptr<Model> model = host.make_model(choice.name, choice.options);
  if (is_implicit(*robot.estimator_model())) model = std::make_shared<ImplicitModel>(std::move(model));
  return check_model(*model, robot.bounded_description(), options);
}

}  // namespace rhec::sim
