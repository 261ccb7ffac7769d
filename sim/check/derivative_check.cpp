#include "rhec/sim/check/derivative_check.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <fmt/format.h>

#include "differences.hpp"
#include "rhec/sim/numbers/random.hpp"

namespace rhec::sim {
namespace {

constexpr double none = std::numeric_limits<double>::quiet_NaN();
constexpr double margin = 0.02;  // of a variable's range; difference points stay inside it

/// Evaluates ranges of stages into arrays whose entries are NaN until the model writes them.
class Evaluation {
 public:
  Evaluation(const Model& model, bool ramp, int substeps) : model_(&model), ramp_(ramp), substeps_(substeps) {
    nx_ = model.state_count();
    ny_ = model.output_count();
    nz_ = nx_ + model.input_count() + (ramp ? 2 : 1) * model.parameter_count();
  }
  int entries() const { return nz_; }

  std::vector<double> next(const StagePoints& points) const {
    std::vector<double> out(points.count * nx_, none);
    auto request = intervals(points);
    request.next_states = out.data();
    model_->integrate(request);
    return out;
  }
  std::vector<double> jacobians(const StagePoints& points) const {
    std::vector<double> out(points.count * nx_ * nz_, none);
    auto request = intervals(points);
    request.jacobians = out.data();
    model_->integrate(request);
    return out;
  }
  std::vector<double> hessians(const StagePoints& points, const std::vector<double>& multipliers) const {
    std::vector<double> out(points.count * nz_ * nz_, none);
    auto request = intervals(points);
    request.multipliers = multipliers.data();
    request.hessians = out.data();
    model_->integrate(request);
    return out;
  }
  std::vector<double> outputs(const StagePoints& points) const {
    std::vector<double> out(points.count * ny_, none);
    model_->observe({.count = points.count, .states = points.states.data(), .outputs = out.data()});
    return out;
  }
  std::vector<double> output_jacobians(const StagePoints& points) const {
    std::vector<double> out(points.count * ny_ * nx_, none);
    model_->observe({.count = points.count, .states = points.states.data(), .jacobians = out.data()});
    return out;
  }
  std::vector<double> output_hessians(const StagePoints& points, const std::vector<double>& multipliers) const {
    std::vector<double> out(points.count * nx_ * nx_, none);
    model_->observe({.count = points.count,
                     .states = points.states.data(),
                     .multipliers = multipliers.data(),
                     .hessians = out.data()});
    return out;
  }

 private:
  Model::Intervals intervals(const StagePoints& points) const {
    return {.count = points.count,
            .states = points.states.data(),
            .inputs = points.inputs.data(),
            .parameters = points.parameters.data(),
            .parameters_end = ramp_ ? points.parameters_end.data() : nullptr,
            .durations = points.durations.data(),
            .substeps = substeps_};
  }

  const Model* model_;
  bool ramp_;
  int substeps_, nx_ = 0, ny_ = 0, nz_ = 0;
};
}  // namespace

std::pair<double, double> range_of(const Variable& variable, double scales) {
  const double reach =
      variable.unit == "rad" ? std::max(scales * variable.scale, std::numbers::pi) : scales * variable.scale;
  const bool below = std::isfinite(variable.lower), above = std::isfinite(variable.upper);
  return {below ? variable.lower : std::min(-reach, above ? variable.upper - reach : 0.0),
          above ? variable.upper : std::max(reach, below ? variable.lower + reach : 0.0)};
}

StagePoints random_stages(const ModelDescription& within, int count, std::uint64_t seed) {
  RandomStream random(seed, "stages of a model's check");
  StagePoints points;
  points.count = count;
  const auto draw = [&](const std::vector<Variable>& variables, bool zero, std::vector<double>& into) {
    for (const Variable& variable : variables) {
      const auto [lower, upper] = typical_range(variable);
      const double room = margin * (upper - lower);
      const double value = random.uniform(lower + room, upper - room);
      into.push_back(zero ? std::clamp(0.0, lower + room, upper - room) : value);
    }
  };
  for (int i = 0; i < count; ++i) {
    draw(within.states, i % 5 == 4, points.states);
    draw(within.inputs, i % 3 == 2, points.inputs);
    draw(within.parameters, false, points.parameters);
    draw(within.parameters, false, points.parameters_end);
    points.durations.push_back(random.uniform(0.05, 0.25));
  }
  return points;
}

DerivativeErrors derivative_errors(const Model& model, const ModelDescription& within, const StagePoints& stages,
                                   bool ramp, int substeps) {
  DerivativeErrors errors;
  const Evaluation evaluate(model, ramp, substeps);
  std::vector<DifferenceEntry> states, all;
  append_entries(states, within.states);
  all = states;
  append_entries(all, within.inputs);
  append_entries(all, within.parameters);
  if (ramp) append_entries(all, within.parameters, " at the interval's end");

  const DifferenceResults next{&within.states, "next "}, outputs{&within.outputs, ""};
  const auto jacobians = [&](const StagePoints& points) { return evaluate.jacobians(points); };
  const auto output_jacobians = [&](const StagePoints& points) { return evaluate.output_jacobians(points); };
  compare_first_derivatives(
      stages, within, all, next, [&](const StagePoints& points) { return evaluate.next(points); }, jacobians,
      errors.first, errors);
  compare_first_derivatives(
      stages, within, states, outputs, [&](const StagePoints& points) { return evaluate.outputs(points); },
      output_jacobians, errors.output_first, errors);
  if (!model.has_second_derivatives()) return errors;
  compare_second_derivatives(
      stages, within, all, next, jacobians,
      [&](const StagePoints& points, const std::vector<double>& weights) { return evaluate.hessians(points, weights); },
      errors.second, errors);
  compare_second_derivatives(
      stages, within, states, outputs, output_jacobians,
      [&](const StagePoints& points, const std::vector<double>& weights) {
        return evaluate.output_hessians(points, weights);
      },
      errors.output_second, errors);
  return errors;
}

WorstEntry integration_error(const Model& model, const ModelDescription& within, const StagePoints& stages, bool ramp,
                             int substeps) {
  const Evaluation evaluate(model, ramp, substeps);
  const std::vector<double> next = evaluate.next(stages);
  const int nx = model.state_count(), nu = model.input_count(), np = model.parameter_count();
  WorstEntry worst;
  for (int i = 0; i < stages.count; ++i) {
    const double h = stages.durations[i] / substeps;
    const auto rate = [&](const std::vector<double>& x, double steps_done) {
      std::vector<double> p(np), dxdt(nx, none);
      for (int j = 0; j < np; ++j) {
        const double from = stages.parameters[i * np + j], to = ramp ? stages.parameters_end[i * np + j] : from;
        p[j] = from + (to - from) * steps_done / substeps;
      }
      model.rates(x.data(), stages.inputs.data() + i * nu, p.data(), dxdt.data());
      return dxdt;
    };
    const auto moved = [&](std::vector<double> x, const std::vector<double>& dxdt, double time) {
      for (int j = 0; j < nx; ++j) x[j] += dxdt[j] * time;
      return x;
    };
    std::vector<double> x(stages.states.begin() + i * nx, stages.states.begin() + (i + 1) * nx);
    for (int n = 0; n < substeps; ++n) {
      const auto k1 = rate(x, n), k2 = rate(moved(x, k1, h / 2), n + 0.5), k3 = rate(moved(x, k2, h / 2), n + 0.5),
                 k4 = rate(moved(x, k3, h), n + 1);
      for (int j = 0; j < nx; ++j) x[j] += h / 6 * (k1[j] + 2 * k2[j] + 2 * k3[j] + k4[j]);
    }
    for (int j = 0; j < nx; ++j) {
      const double found = next[i * nx + j];
      if (!std::isfinite(x[j]) || !std::isfinite(found)) continue;
      const double error = std::abs(found - x[j]) / std::max(std::abs(x[j]), within.states[j].scale);
      if (error > worst.error || worst.where.empty())
        worst = {error, fmt::format("next {}", within.states[j].name), found, x[j]};
    }
  }
  return worst;
}

}  // namespace rhec::sim
