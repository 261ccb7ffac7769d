#pragma once

// How the problems of the families are made.

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <tuple>
#include <utility>
#include <vector>

#include "families.hpp"
#include "rhec/core/control/input_rate_model.hpp"
#include "support/random_problem.hpp"
#include "support/test_models.hpp"

namespace rhec::conformance {

using testing::RandomProblem;
using testing::WithoutSecondDerivatives;
using Drive = RandomProblem::Drive;
using RheSpec = RandomProblem::RheSpec;
using RhcSpec = RandomProblem::RhcSpec;
using ModelPointer = std::shared_ptr<const Model>;

constexpr double infinity = std::numeric_limits<double>::infinity();

inline Problem cold(std::unique_ptr<HorizonProblem> ocp) {
  Iterate guess = RandomProblem::cold_start(*ocp);
  return {std::move(ocp), std::move(guess), nullptr};
}

using Make = std::function<Problem(ModelPointer, unsigned)>;
/// Problems that differ in their specification alone. Seeds start where those of other tests do not.
template <class Spec>
inline Make random(Spec spec) {
  return [spec](const ModelPointer& model, unsigned seed) {
    RandomProblem problems(model, 1000 + seed);
    if constexpr (std::is_same_v<Spec, RheSpec>)
      return cold(problems.rhe(spec));
    else
      return cold(problems.rhc(spec));
  };
}
/// Estimation problems that are changed after they are made.
using ChangeRhe = std::function<void(RheProblem&, RandomProblem&)>;
inline Make changed(RheSpec spec, ChangeRhe change) {
  return [spec = std::move(spec), change = std::move(change)](const ModelPointer& model, unsigned seed) {
    RandomProblem problems(model, 2000 + seed);
    auto problem = problems.rhe(spec);
    change(*problem, problems);
    return cold(std::move(problem));
  };
}
using ChangeRhc = std::function<void(RhcProblem&, RandomProblem&)>;
inline Make changed(RhcSpec spec, ChangeRhc change) {
  return [spec = std::move(spec), change = std::move(change)](const ModelPointer& model, unsigned seed) {
    RandomProblem problems(model, 3000 + seed);
    auto problem = problems.rhc(spec);
    change(*problem, problems);
    std::vector<double> scratch(problem->scratch_size());
    problem->finish(scratch);
    return cold(std::move(problem));
  };
}

template <class Spec>
Spec with(const std::function<void(Spec&)>& set) {
  Spec spec;
  set(spec);
  return spec;
}
inline RheSpec rhe(const std::function<void(RheSpec&)>& set) { return with<RheSpec>(set); }
inline RhcSpec rhc(const std::function<void(RhcSpec&)>& set) { return with<RhcSpec>(set); }

/// Every parameter gets blocks that start where `starts(interval, parameter)` says.
inline void set_blocks(RheProblem& problem, Transition transition, double variance,
                       const std::function<bool(int, int)>& starts) {
  for (int j = 0; j < problem.model().parameter_count(); ++j) {
    std::vector<std::uint8_t> begins(problem.intervals(), 0);
    for (int i = 0; i < problem.intervals(); ++i) begins[i] = i == 0 || starts(i, j);
    problem.set_blocks(j, begins.data(), transition);
    for (int i = 0; i < problem.intervals(); ++i)
      if (begins[i]) problem.link(i, j, variance);
  }
  problem.finish();
}

/// Smallest and largest value of each of `width` columns, with a margin of `share` of the variables' scales beyond.
inline std::pair<std::vector<double>, std::vector<double>> hull(const std::vector<double>& rows,
                                                                const std::vector<Variable>& variables, double share) {
  const std::size_t width = variables.size();
  std::vector<double> lower(width, infinity), upper(width, -infinity);
  for (std::size_t k = 0; k < rows.size(); ++k) {
    lower[k % width] = std::min(lower[k % width], rows[k]);
    upper[k % width] = std::max(upper[k % width], rows[k]);
  }
  for (std::size_t j = 0; j < width; ++j) {
    lower[j] -= share * variables[j].scale;
    upper[j] += share * variables[j].scale;
  }
  return {lower, upper};
}

/// A drive from the same start with inputs and parameters that are `share` of the given one's; bounds that hold it cut
/// off parts of the given one, and are known to leave a point.
inline Drive gentler(const Model& model, const Drive& d, double share) {
  Drive other = d;
  for (double& u : other.inputs) u *= share;
  const auto& parameters = model.description().parameters;
  for (std::size_t k = 0; k < other.parameters.size(); ++k) {
    const Variable& v = parameters[k % parameters.size()];
    other.parameters[k] = std::min(std::max(share * other.parameters[k], v.lower), v.upper);
  }
  const int nx = model.state_count(), nu = model.input_count(), np = model.parameter_count();
  for (std::size_t i = 0; i < d.durations.size(); ++i) {
    Model::Intervals request;
    request.count = 1;
    request.states = other.states.data() + i * nx;
    request.inputs = other.inputs.data() + i * nu;
    request.parameters = other.parameters.data() + i * np;
    request.durations = other.durations.data() + i;
    request.next_states = other.states.data() + (i + 1) * nx;
    model.integrate(request);
  }
  return other;
}

/// Control of a vehicle all of whose inputs are states with rates, within bounds of both that its path leaves; or
/// without bounds of rates.
inline Make with_rates(bool are_bounded) {
  return [=](const ModelPointer& vehicle, unsigned seed) {
    std::vector<int> rated;
    RhcSpec spec;
    for (int j = 0; j < vehicle->input_count(); ++j) rated.push_back(j);
    const auto model = std::make_shared<InputRateModel>(vehicle, rated);
    spec.off = 0.05;
    spec.adjust = [&](RhcProblem::Setup& setup, const Drive& d) {
      for (const int j : rated) setup.rates.push_back({j, vehicle->state_count() + j});
      if (!are_bounded) return;
      const Drive inner = gentler(*model, d, 0.7);
      std::tie(setup.input_lower, setup.input_upper) = hull(inner.inputs, model->description().inputs, 0.01);
      const auto held = hull(inner.states, model->description().states, 0.01);
      for (const RhcProblem::Rate& rate : setup.rates) {
        setup.state_lower.resize(model->state_count(), -infinity);
        setup.state_upper.resize(model->state_count(), infinity);
        setup.state_lower[rate.state] = held.first[rate.state];
        setup.state_upper[rate.state] = held.second[rate.state];
      }
    };
    RandomProblem problems(model, 9000 + seed);
    return cold(problems.rhc(spec));
  };
}

enum Bounded : unsigned { states = 1, inputs = 2, parameters = 4 };
/// Estimation whose truth lies beyond bounds, so that they are active.
inline Make beyond_bounds(unsigned which, bool unlinked_blocks) {
  return [=](const ModelPointer& model, unsigned seed) {
    RheSpec spec;
    spec.block = unlinked_blocks ? 5 : 0;
    spec.linked = !unlinked_blocks;
    const auto& about = model->description();
    spec.adjust = [&](RheProblem::Setup& setup, const Drive& d) {
      const Drive inner = gentler(*model, d, 0.8);
      if (which & states) std::tie(setup.state_lower, setup.state_upper) = hull(inner.states, about.states, 0.01);
      if (which & inputs) std::tie(setup.input_lower, setup.input_upper) = hull(inner.inputs, about.inputs, 0.01);
      if (which & parameters)
        std::tie(setup.parameter_lower, setup.parameter_upper) = hull(inner.parameters, about.parameters, 0.01);
    };
    RandomProblem problems(model, 4000 + seed);
    return cold(problems.rhe(spec));
  };
}

/// Standing still, measured with noise: no input says anything about how it is scaled.
inline void stand_still(RheProblem& problem, RandomProblem& random) {
  const Model& model = problem.model();
  const auto& about = model.description();
  std::vector<double> here(model.output_count());
  Model::Nodes request;
  request.count = 1;
  request.states = problem.arrival_mean.data();
  request.outputs = here.data();
  model.observe(request);
  for (int i = 0; i <= problem.intervals(); ++i) {
    for (int j = 0; j < model.output_count(); ++j)
      problem.output(i)[j] = here[j] + 0.01 * about.outputs[j].scale * random.normal();
    if (i < problem.intervals()) std::fill_n(problem.measured_input(i), model.input_count(), 0.0);
  }
}

/// Information matrix with correlations: the diagonal one is kept on its scale.
inline void correlate(RheProblem& problem, RandomProblem& random, int rank) {
  const Eigen::VectorXd scale = problem.arrival_information.diagonal().cwiseSqrt();
  const auto n = scale.size();
  Eigen::MatrixXd factor(std::min<Eigen::Index>(rank, n), n);
  for (Eigen::Index k = 0; k < factor.size(); ++k) factor.data()[k] = random.normal();
  factor = factor * scale.asDiagonal();
  problem.arrival_information = factor.transpose() * factor;
}

/// Moves a guess far off, and clips what is clipped by bounds: each state by up to `share` of its scale, each input
/// too; parameters anywhere in their bounds. It is no trajectory any more.
inline void scatter(const HorizonProblem& problem, RandomProblem& random, double share, Iterate& guess) {
  const auto& about = problem.model().description();
  const int nx = problem.model().state_count(), nu = problem.model().input_count(),
            np = problem.model().parameter_count();
  std::vector<double> u(static_cast<std::size_t>(problem.intervals()) * nu), p(problem.intervals() * np);
  for (int i = 0; i < problem.intervals(); ++i) {
    problem.structure().inputs_on(guess, i, u.data() + i * nu);
    problem.structure().parameters_on(guess, i, p.data() + i * np);
    for (int j = 0; j < nu; ++j) u[i * nu + j] += random.uniform(-share, share) * about.inputs[j].scale;
    if (problem.kind() == "rhe")
      for (int j = 0; j < np; ++j) p[i * np + j] = random.typical(about.parameters[j]);
  }
  problem.structure().set_decisions(guess, u.data(), p.data());
  for (int i = 0; i <= problem.intervals(); ++i)
    for (int j = 0; j < nx; ++j) guess.state(i)[j] += random.uniform(-share, share) * about.states[j].scale;
}

template <class Spec>
inline Make scattered(Spec spec, double share) {
  return [=, make = random(spec)](const ModelPointer& model, unsigned seed) {
    Problem problem = make(model, seed);
    RandomProblem noise(model, 5000 + seed);
    scatter(*problem.ocp, noise, share, problem.guess);
    return problem;
  };
}

/// All states in a box around the start, a twentieth as wide as the vehicle moves on the first interval, and inputs
/// and parameters that are all but those of the drive: it has to move, and may not.
inline Problem no_room_to_move(const ModelPointer& model, unsigned seed) {
  RheSpec spec;
  spec.intervals = 5;
  const auto& about = model->description();
  spec.adjust = [&](RheProblem::Setup& setup, const Drive& d) {
    const std::size_t nx = about.states.size();
    double moved = 0.0;
    for (std::size_t j = 0; j < nx; ++j)
      moved = std::max(moved, std::abs(d.states[nx + j] - d.states[j]) / about.states[j].scale);
    std::tie(setup.state_lower, setup.state_upper) =
        hull({d.states.begin(), d.states.begin() + static_cast<std::ptrdiff_t>(nx)}, about.states, 0.025 * moved);
    std::tie(setup.input_lower, setup.input_upper) = hull(
        {d.inputs.begin(), d.inputs.begin() + static_cast<std::ptrdiff_t>(about.inputs.size())}, about.inputs, 1e-4);
    std::tie(setup.parameter_lower, setup.parameter_upper) =
        hull({d.parameters.begin(), d.parameters.begin() + static_cast<std::ptrdiff_t>(about.parameters.size())},
             about.parameters, 1e-4);
  };
  RandomProblem problems(model, 6000 + seed);
  return cold(problems.rhe(spec));
}

/// Whether nothing moves without input.
inline bool can_stand_still(const Model& model) {
  const auto& about = model.description();
  std::vector<double> x, u(about.inputs.size(), 0.0), p, rates(about.states.size());
  for (const Variable& v : about.states) x.push_back(std::min(std::max(0.5 * v.scale, v.lower), v.upper));
  for (const Variable& v : about.parameters) p.push_back(std::min(std::max(0.5 * v.scale, v.lower), v.upper));
  model.rates(x.data(), u.data(), p.data(), rates.data());
  return std::all_of(rates.begin(), rates.end(), [](double rate) { return rate == 0.0; });
}

inline Problem fixed_state(const ModelPointer& model, unsigned seed) {
  RhcSpec spec;
  spec.off = 0.0;
  spec.adjust = [&](RhcProblem::Setup& setup, const Drive& d) {
    for (const Variable& v : model->description().states) {
      setup.state_lower.push_back(v.lower);
      setup.state_upper.push_back(v.upper);
    }
    setup.state_lower.back() = setup.state_upper.back() = d.states[setup.state_lower.size() - 1];
  };
  RandomProblem problems(model, 7000 + seed);
  return cold(problems.rhc(spec));
}

inline Make without_second_derivatives(Make make) {
  return [make = std::move(make)](ModelPointer model, unsigned seed) {
    return make(std::make_shared<WithoutSecondDerivatives>(std::move(model)), seed);
  };
}

inline double uneven_variance(RandomProblem& random, const Variable& v) {
  return std::pow(v.scale * std::pow(10.0, random.uniform(-4.0, 1.0)), 2);
}

}  // namespace rhec::conformance
