#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <random>
#include <vector>

#include "rhec/core/horizon/rhc_problem.hpp"
#include "rhec/core/horizon/rhe_problem.hpp"
#include "rhec/core/qp/kkt.hpp"

namespace rhec::testing {

/// Random but plausible problems for any model: a drive inside its bounds, measured with noise, or to be followed.
class RandomProblem {
 public:
  RandomProblem(std::shared_ptr<const Model> model, unsigned seed) : model_(std::move(model)), random_(seed) {}

  double uniform(double lower, double upper) { return std::uniform_real_distribution<double>(lower, upper)(random_); }
  double normal() { return std::normal_distribution<double>()(random_); }

  /// A value well inside the bounds of a variable; without bounds, one of its typical size.
  double typical(const Variable& v) {
    const double lower = std::isfinite(v.lower) ? v.lower : -v.scale,
                 upper = std::isfinite(v.upper) ? v.upper : v.scale;
    return uniform(0.8 * lower + 0.2 * upper, 0.2 * lower + 0.8 * upper);
  }

  struct Drive {
    std::vector<double> durations, states, inputs, parameters;  // N, (N+1) x n_x, N x n_u, N x n_p
  };
  /// Inputs and parameters vary a little from interval to interval; states stay inside their bounds.
  Drive drive(const std::vector<double>& durations, bool constant_parameters) {
    const auto& about = model_->description();
    const int nx = model_->state_count(), N = static_cast<int>(durations.size());
    Drive d;
    d.durations = durations;
    std::vector<double> x, u, p;
    for (const auto& v : about.states) x.push_back(typical(v));
    for (const auto& v : about.inputs) u.push_back(typical(v));
    for (const auto& v : about.parameters) p.push_back(typical(v));
    d.states = x;
    for (int i = 0; i < N; ++i) {
      const auto wander = [&](std::vector<double>& values, const std::vector<Variable>& variables, double share) {
        for (std::size_t j = 0; j < values.size(); ++j) {
          values[j] += share * variables[j].scale * normal();
          values[j] = std::min(std::max(values[j], std::isfinite(variables[j].lower) ? variables[j].lower : values[j]),
                               std::isfinite(variables[j].upper) ? variables[j].upper : values[j]);
        }
      };
      wander(u, about.inputs, 0.05);
      if (!constant_parameters) wander(p, about.parameters, 0.05);
      std::vector<double> next(nx);
      for (int attempt = 0;; ++attempt) {
        Model::Intervals request;
        request.count = 1;
        request.states = d.states.data() + static_cast<std::ptrdiff_t>(i) * nx;
        request.inputs = u.data();
        request.parameters = p.data();
        request.durations = d.durations.data() + i;
        request.next_states = next.data();
        model_->integrate(request);
        bool inside = true;
        for (int j = 0; j < nx; ++j)
          inside = inside && next[j] >= about.states[j].lower && next[j] <= about.states[j].upper;
        if (inside || attempt > 20) break;
        for (double& value : u) value *= -0.5;  // turn back
      }
      d.states.insert(d.states.end(), next.begin(), next.end());
      d.inputs.insert(d.inputs.end(), u.begin(), u.end());
      d.parameters.insert(d.parameters.end(), p.begin(), p.end());
    }
    return d;
  }

  /// Lengths of intervals: all `dt`, or random between dt and `longest` where that is more, evenly on a logarithmic
  /// scale.
  std::vector<double> durations(int N, double dt, double longest) {
    std::vector<double> all(N, dt);
    if (longest > dt)
      for (double& each : all) each = std::exp(uniform(std::log(dt), std::log(longest)));
    return all;
  }

  struct RheSpec {
    int intervals = 15;
    int room = 0;  ///< intervals of capacity, where that is more than are used
    double dt = 0.2;
    double longest = 0.0;         ///< if more than dt, intervals last from dt to this [s]
    double missing = 0.0;         ///< fraction of outputs that are masked
    double missing_inputs = 0.0;  ///< fraction of measured inputs that are masked
    bool robust = false;
    int block = 0;  ///< intervals per block; 0: one value for the horizon
    bool linked = true;
    Transition transition = Transition::step;
    double noise = 0.01;  ///< of all measurements, as a fraction of the scale
    /// Changes what is fixed once the problem is made: weights, losses and bounds. Receives the true drive.
    std::function<void(RheProblem::Setup&, const Drive&)> adjust;
  };
  std::unique_ptr<RheProblem> rhe(const RheSpec& spec) {
    const auto& about = model_->description();
    const int nx = model_->state_count(), nu = model_->input_count(), np = model_->parameter_count();
    const int ny = model_->output_count();
    RheProblem::Setup setup;
    setup.max_intervals = std::max({spec.intervals, spec.room, 1});
    for (const auto& v : about.outputs) setup.output_weights.push_back(1.0 / std::pow(spec.noise * v.scale, 2));
    for (const auto& v : about.inputs) setup.input_weights.push_back(1.0 / std::pow(spec.noise * v.scale, 2));
    if (spec.robust) {
      RobustLoss loss;
      for (int j = 0; j < std::min(2, ny); ++j) loss.outputs.push_back(j);
      loss.delta = 1.5;
      setup.robust.push_back(loss);
    }
    // A horizon of one node has the start of a drive.
    const Drive d = drive(durations(std::max(spec.intervals, 1), spec.dt, spec.longest), spec.block == 0);
    if (spec.adjust) spec.adjust(setup, d);
    auto problem = std::make_unique<RheProblem>(model_, setup);
    problem->set_intervals(spec.intervals);
    const double nan = std::numeric_limits<double>::quiet_NaN();
    std::vector<double> outputs(static_cast<std::size_t>(spec.intervals + 1) * ny);
    Model::Nodes nodes;
    nodes.count = spec.intervals + 1;
    nodes.states = d.states.data();
    nodes.outputs = outputs.data();
    model_->observe(nodes);
    for (int i = 0; i <= spec.intervals; ++i) {
      for (int j = 0; j < ny; ++j)
        problem->output(i)[j] = uniform(0.0, 1.0) < spec.missing
                                    ? nan
                                    : outputs[i * ny + j] + spec.noise * about.outputs[j].scale * normal();
      if (i == spec.intervals) break;
      problem->set_duration(i, d.durations[i]);
      for (int j = 0; j < nu; ++j) {
        problem->measured_input(i)[j] = d.inputs[i * nu + j] + spec.noise * about.inputs[j].scale * normal();
        if (spec.missing_inputs > 0.0 && uniform(0.0, 1.0) < spec.missing_inputs) problem->measured_input(i)[j] = nan;
      }
    }
    std::vector<std::uint8_t> begins(std::max(spec.intervals, 1), 0);
    begins[0] = 1;
    for (int i = 1; spec.block > 0 && i < spec.intervals; i += spec.block) begins[i] = 1;
    for (int j = 0; j < np; ++j) {
      problem->set_blocks(j, begins.data(), spec.transition);
      for (int i = 0; i < spec.intervals; ++i)
        if (begins[i] && spec.linked) problem->link(i, j, std::pow(0.2 * about.parameters[j].scale, 2));
    }
    problem->finish();
    for (int j = 0; j < nx; ++j) {
      const double sigma = 0.1 * about.states[j].scale;
      problem->arrival_mean[j] = d.states[j] + sigma * normal();
      problem->arrival_information(j, j) = 1.0 / (sigma * sigma);
    }
    for (int j = 0; j < np; ++j) {
      const double sigma = 0.3 * about.parameters[j].scale;
      problem->arrival_mean[nx + j] = d.parameters[j] + 0.3 * sigma * normal();
      problem->arrival_information(nx + j, nx + j) = 1.0 / (sigma * sigma);
    }
    return problem;
  }

  struct RhcSpec {
    int intervals = 15;
    int room = 0;  ///< intervals of capacity, where that is more than are used
    double dt = 0.2;
    double longest = 0.0;  ///< if more than dt, intervals last from dt to this [s]
    double off = 0.1;      ///< offset of the initial state from the drive to be followed, as a fraction of the scales
    std::vector<int> blocked_inputs;
    int block = 3;
    /// Changes what is fixed once the problem is made: weights and bounds. Receives the drive to be followed.
    std::function<void(RhcProblem::Setup&, const Drive&)> adjust;
  };
  std::unique_ptr<RhcProblem> rhc(const RhcSpec& spec) {
    const auto& about = model_->description();
    const int nx = model_->state_count(), nu = model_->input_count(), np = model_->parameter_count();
    RhcProblem::Setup setup;
    setup.max_intervals = std::max(spec.intervals, spec.room);
    for (const auto& v : about.states) setup.state_weights.push_back(1.0 / (v.scale * v.scale));
    for (const auto& v : about.inputs) setup.input_weights.push_back(0.5 / (v.scale * v.scale));
    for (const auto& v : about.states) setup.terminal_weights.push_back(5.0 / (v.scale * v.scale));
    setup.blocked_inputs = spec.blocked_inputs;
    const Drive d = drive(durations(spec.intervals, spec.dt, spec.longest), true);
    if (spec.adjust) spec.adjust(setup, d);
    auto problem = std::make_unique<RhcProblem>(model_, setup);
    problem->set_intervals(spec.intervals);
    std::vector<std::uint8_t> begins(spec.intervals, 0);
    for (int i = 0; i < spec.intervals; i += spec.block) begins[i] = 1;
    for (const int input : spec.blocked_inputs) problem->set_blocks(input, begins.data());
    for (int i = 0; i <= spec.intervals; ++i) {
      std::copy_n(d.states.data() + static_cast<std::ptrdiff_t>(i) * nx, nx, problem->state_reference(i));
      if (i == spec.intervals) break;
      problem->set_duration(i, d.durations[i]);
      std::copy_n(d.inputs.data() + static_cast<std::ptrdiff_t>(i) * nu, nu, problem->input_reference(i));
    }
    for (int j = 0; j < nx; ++j) {
      const double value = d.states[j] + spec.off * about.states[j].scale * normal();
      problem->given_state()[j] =
          std::min(std::max(value, problem->setup().state_lower[j]), problem->setup().state_upper[j]);
    }
    std::copy_n(d.parameters.data(), np, problem->given_parameters());
    std::vector<double> scratch(problem->scratch_size());
    problem->finish(scratch);
    return problem;
  }

  /// The usual cold start: prior or initial state, rolled out with measured or reference inputs.
  static Iterate cold_start(const HorizonProblem& problem) {
    Iterate point(problem.capacity());
    const int nx = problem.model().state_count(), nu = problem.model().input_count(),
              np = problem.model().parameter_count();
    std::vector<double> inputs, parameters;
    const auto* rhe = dynamic_cast<const RheProblem*>(&problem);
    const auto* rhc = dynamic_cast<const RhcProblem*>(&problem);
    for (int i = 0; i < problem.intervals(); ++i) {
      for (int j = 0; j < nu; ++j) {
        const double value = rhe ? rhe->measured_input(i)[j] : rhc->input_reference(i)[j];
        inputs.push_back(std::isnan(value) ? 0.0 : value);
      }
      for (int j = 0; j < np; ++j) parameters.push_back(rhe ? rhe->arrival_mean[nx + j] : rhc->initial_state()[nx + j]);
    }
    if (rhe) std::copy_n(rhe->arrival_mean.data(), nx, point.state(0));
    problem.structure().set_decisions(point, inputs.data(), parameters.data());
    std::vector<double> scratch(problem.scratch_size());
    roll_out(problem, point, scratch);
    return point;
  }

 private:
  std::shared_ptr<const Model> model_;
  std::mt19937 random_;
};

}  // namespace rhec::testing
