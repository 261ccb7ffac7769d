#include "rhec/core/estimation/prior_smoothing.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include <fmt/format.h>

#include "law_search.hpp"
#include "node_log.hpp"
#include "process_problem.hpp"
#include "rhec/core/base/aligned.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/core/estimation/measurement.hpp"
#include "track_alignment.hpp"

namespace rhec {
namespace {

/// An initial guess: rows of the vehicle's states (N+1), inputs (N) and parameters at the nodes (N+1).
struct Track {
  std::vector<double> states, inputs, parameters;
};

Track track_of(const NodeLog& log, const BankEstimation::Setup& filters, const Model& model) {
  Track track{log.states, log.inputs, log.parameters};
  const int np = model.parameter_count();
  fill_gaps(track.states, model.state_count());
  fill_gaps(track.parameters, np);
  for (double& value : track.states) value = std::isfinite(value) ? value : 0.0;
  for (double& value : track.inputs) value = std::isnan(value) ? 0.0 : value;
  std::vector<double> start(Prior::max_states), covariance(std::size_t{Prior::max_states} * Prior::max_states);
  for (std::size_t e = 0; e < track.parameters.size(); ++e) {
    const std::size_t j = e % static_cast<std::size_t>(np);
    double& value = track.parameters[e];
    if (!std::isfinite(value)) {
      filters.bank.members.front()[j]->start(start.data(), covariance.data());
      value = start[0];
    }
    value = std::min(std::max(value, filters.parameter_lower[j]), filters.parameter_upper[j]);
  }
  return track;
}

/// Of intervals over which the bank knew no heading yet: what the track says.
void fill_distances(const Track& track, const NodeLog& log, const BankEstimation::Setup& filters, const Model& model,
                    std::vector<double>& distances) {
  const Roles& roles = model.description().roles;
  const std::ptrdiff_t nx = model.state_count();
  for (std::ptrdiff_t i = 0; i < log.intervals(); ++i) {
    double& distance = distances[static_cast<std::size_t>(i)];
    if (std::isfinite(distance)) continue;
    distance = filters.bank.least_speed * log.durations[static_cast<std::size_t>(i)];
    if (roles.position_x < 0 || roles.position_y < 0) continue;
    const double *from = track.states.data() + i * nx, *to = from + nx;
    const double covered =
        std::hypot(to[roles.position_x] - from[roles.position_x], to[roles.position_y] - from[roles.position_y]);
    if (covered > distance) distance = covered;
  }
}

/// The problem of a whole log for one law.
class LawProblem {
 public:
  LawProblem(const std::shared_ptr<const Model>& model, const PriorSmoothing::Setup& setup, const PriorCombination& law,
             const NodeLog& log)
      : bank_(model, bank_setup(setup, law)),
        model_(make_process_model(model, bank_)),
        problem_(make_process_problem(model_, problem_setup(setup, log))) {
    problem_.set_intervals(log.intervals());
    fill_data(log, model->input_count(), problem_);
    AlignedDoubles start(bank_.state_size());
    bank_.reset(setup.filters.initial_state, setup.filters.initial_covariance);
    bank_.save(start.data());
    Eigen::MatrixXd covariance = problem_.arrival_information;
    bank_.saved_moments(start.data(), 0, problem_.arrival_mean, covariance);
    InformationOf(covariance.rows()).find(covariance, problem_.arrival_information);
  }

  const RheProblem& problem() const noexcept { return problem_; }
  const Model& vehicle() const noexcept { return model_->vehicle(); }

  void set_distances(const std::vector<double>& distances) noexcept {
    for (int i = 0; i < problem_.intervals(); ++i)
      for (int j = 0; j < vehicle().parameter_count(); ++j)
        bank_.write_process(0, j, problem_.duration(i), distances[static_cast<std::size_t>(i)],
                            model_->process_data(j, problem_.interval_data(i)));
    problem_.finish();
  }

  /// The processes have the parameters of the track, and no more is known of them.
  Iterate guess(const Track& track) const {
    const std::ptrdiff_t nx = vehicle().state_count(), nu = vehicle().input_count(), np = vehicle().parameter_count();
    Iterate guess(problem_.capacity());
    for (std::ptrdiff_t i = 0; i <= problem_.intervals(); ++i) {
      double* const state = guess.state(static_cast<int>(i));
      std::copy_n(problem_.arrival_mean.data(), problem_.arrival_mean.size(), state);
      std::copy_n(track.states.data() + i * nx, nx, state);
      for (std::ptrdiff_t j = 0; j < np; ++j)
        state[model_->first_state(static_cast<int>(j))] = track.parameters[i * np + j];
      if (i == problem_.intervals()) break;
      double* const control = guess.control(static_cast<int>(i));
      std::copy_n(track.inputs.data() + i * nu, nu, control);
      std::fill(control + nu, control + model_->input_count(), 0.0);
    }
    return guess;
  }

  Track track_of(const Iterate& iterate) const {
    const std::ptrdiff_t nx = vehicle().state_count(), nu = vehicle().input_count();
    Track track;
    for (int i = 0; i <= problem_.intervals(); ++i) {
      const double* const state = iterate.state(i);
      track.states.insert(track.states.end(), state, state + nx);
      for (int j = 0; j < vehicle().parameter_count(); ++j) track.parameters.push_back(state[model_->first_state(j)]);
      if (i < problem_.intervals())
        track.inputs.insert(track.inputs.end(), iterate.control(i), iterate.control(i) + nu);
    }
    return track;
  }

  /// Adds a solution to a mixture, with a share of it.
  void add_to(SmoothedRun& run, const Iterate& iterate, const std::vector<double>& covariances, double share) const {
    const std::ptrdiff_t nx = vehicle().state_count(), nu = vehicle().input_count(), np = vehicle().parameter_count();
    const auto add = [share](std::vector<double>& to, std::ptrdiff_t row, const double* values, std::ptrdiff_t count) {
      for (std::ptrdiff_t j = 0; j < count; ++j) to[row * count + j] += share * values[j];
    };
    Eigen::VectorXd mean, p(np);
    Eigen::MatrixXd covariance;
    for (int i = 0; i <= problem_.intervals(); ++i) {
      find_moments(iterate, covariances, i, mean, covariance);
      add(run.states, i, mean.data(), nx);
      add(run.node_parameters, i, mean.data() + nx, np);
      if (!run.covariances.empty()) add(run.covariances, i, covariance.data(), covariance.size());
      if (i == problem_.intervals()) break;
      add(run.inputs, i, iterate.control(i), nu);
      for (int j = 0; j < np; ++j) p[j] = value(iterate, i, j);
      add(run.start_parameters, i, p.data(), np);
      for (int j = 0; j < np; ++j)
        if (is_ramp(i, j)) p[j] = value(iterate, i + 1, j);
      add(run.parameters, i, p.data(), np);
    }
  }

  /// Adds how far the solution is from the mixture's mean.
  void add_spread_to(SmoothedRun& run, const Iterate& iterate, double share) const {
    const std::ptrdiff_t nx = vehicle().state_count(), np = vehicle().parameter_count(), n = nx + np;
    Eigen::VectorXd mean;
    Eigen::MatrixXd none;
    for (int i = 0; i <= problem_.intervals(); ++i) {
      find_moments(iterate, {}, i, mean, none);
      mean.head(nx) -= Eigen::Map<const Eigen::VectorXd>(run.states.data() + i * nx, nx);
      mean.tail(np) -= Eigen::Map<const Eigen::VectorXd>(run.node_parameters.data() + i * np, np);
      Eigen::Map<Eigen::MatrixXd>(run.covariances.data() + i * n * n, n, n) += share * mean * mean.transpose();
    }
  }

 private:
  static PriorBank::Setup bank_setup(const PriorSmoothing::Setup& setup, const PriorCombination& law) {
    PriorBank::Setup bank = setup.filters.bank;
    bank.members = {law};
    return bank;
  }
  static RheProblem::Setup problem_setup(const PriorSmoothing::Setup& setup, const NodeLog& log) {
    RheProblem::Setup problem = setup.problem;
    problem.max_intervals = log.intervals();
    return problem;
  }
  /// Of [x; p] in the stage state.
  std::ptrdiff_t entry(std::ptrdiff_t k) const noexcept {
    const std::ptrdiff_t nx = vehicle().state_count();
    return k < nx ? k : model_->first_state(static_cast<int>(k - nx));
  }
  double value(const Iterate& iterate, int node, int parameter) const noexcept {
    return iterate.state(node)[model_->first_state(parameter)];
  }
  bool is_ramp(int interval, int parameter) const noexcept {
    return model_->process_data(parameter, problem_.interval_data(interval))[0] != 0.0;
  }

  /// Moments of [x; p] at a node. A parameter that is held changes somewhere near the node: it is that of the interval
  /// before or that of the interval behind, both equally probable. `covariances` may be empty.
  void find_moments(const Iterate& iterate, const std::vector<double>& covariances, int node, Eigen::VectorXd& mean,
                    Eigen::MatrixXd& covariance) const {
    const std::ptrdiff_t nx = vehicle().state_count(), np = vehicle().parameter_count(), n = nx + np;
    const std::ptrdiff_t ns = model_->state_count();
    const auto covariance_at = [&](std::ptrdiff_t i, std::ptrdiff_t r, std::ptrdiff_t c) {
      return covariances[static_cast<std::size_t>((i * ns + entry(c)) * ns + entry(r))];
    };
    const auto changes = [&](std::ptrdiff_t k) {
      return k >= nx && node > 0 && !is_ramp(node - 1, static_cast<int>(k - nx));
    };
    mean.resize(n);
    for (std::ptrdiff_t k = 0; k < n; ++k) mean[k] = iterate.state(node)[entry(k)];
    if (!covariances.empty()) {
      covariance.resize(n, n);
      for (std::ptrdiff_t c = 0; c < n; ++c)
        for (std::ptrdiff_t r = 0; r < n; ++r) covariance(r, c) = covariance_at(node, r, c);
      // The parameters before are not correlated with the state here, as far as is known.
      for (std::ptrdiff_t c = 0; c < n; ++c)
        for (std::ptrdiff_t r = 0; r < n; ++r)
          if (changes(r) || changes(c))
            covariance(r, c) =
                0.5 * (covariance(r, c) + (changes(r) && changes(c) ? covariance_at(node - 1, r, c) : 0.0));
    }
    for (std::ptrdiff_t k = nx; k < n; ++k) {
      if (!changes(k)) continue;
      const double half = 0.5 * (mean[k] - iterate.state(node - 1)[entry(k)]);
      mean[k] -= half;
      if (!covariances.empty()) covariance(k, k) += half * half;
    }
  }

  PriorBank bank_;  ///< of this law alone: knows its processes
  std::shared_ptr<const ProcessModel> model_;
  RheProblem problem_;
};

struct Solution {
  std::unique_ptr<LawProblem> of;
  Iterate iterate;
  std::vector<double> covariances;  ///< of the stage states; empty if the solver gives none
};

SmoothedRun mixture(const NodeLog& log, const Model& model, const std::vector<SmoothedRun::Law>& laws,
                    const std::vector<Solution>& solutions) {
  const auto nx = static_cast<std::size_t>(model.state_count()), nu = static_cast<std::size_t>(model.input_count()),
             np = static_cast<std::size_t>(model.parameter_count()), N = static_cast<std::size_t>(log.intervals());
  SmoothedRun run;
  run.laws = laws;
  run.times.assign(1, 0.0);
  for (const double duration : log.durations) run.times.push_back(run.times.back() + duration);
  run.states.assign((N + 1) * nx, 0.0);
  run.node_parameters.assign((N + 1) * np, 0.0);
  run.inputs.assign(N * nu, 0.0);
  run.parameters.assign(N * np, 0.0);
  run.start_parameters = run.parameters;
  const bool has_covariances =
      std::none_of(solutions.begin(), solutions.end(), [](const Solution& each) { return each.covariances.empty(); });
  if (has_covariances) run.covariances.assign((N + 1) * (nx + np) * (nx + np), 0.0);
  for (std::size_t k = 0; k < solutions.size(); ++k)
    solutions[k].of->add_to(run, solutions[k].iterate,
                            has_covariances ? solutions[k].covariances : std::vector<double>{}, laws[k].probability);
  if (has_covariances && solutions.size() > 1)
    for (std::size_t k = 0; k < solutions.size(); ++k)
      solutions[k].of->add_spread_to(run, solutions[k].iterate, laws[k].probability);
  return run;
}

}  // namespace

PriorSmoothing::PriorSmoothing(std::shared_ptr<const Model> model, std::shared_ptr<Solver> solver, Setup setup)
    : model_(std::move(model)), solver_(std::move(solver)), setup_(std::move(setup)) {
  BankEstimation(model_, setup_.filters);  // reports mistakes now
  const auto np = static_cast<std::size_t>(model_->parameter_count());
  if (setup_.filters.parameter_lower.size() != np || setup_.filters.parameter_upper.size() != np)
    throw Error(fmt::format("smoother: expected {} lower and upper bounds, one a parameter", np));
}

SmoothedRun PriorSmoothing::estimate(NodeLog log, Clock::time_point deadline) const {
  for (auto* rows : {&log.outputs, &log.inputs}) std::ranges::transform(*rows, rows->begin(), cleaned);
  if (log.intervals() < 1)
    throw Error("smoother: the log has fewer than two nodes; there is nothing between them to estimate");
  Setup setup = setup_;
  const Passage passage = pass(model_, setup.filters, log);
  if (setup.filters.bank.adapts_noise) {
    // Laws are compared with the noise that the whole log tells.
    setup.filters.bank.adapts_noise = false;
    setup.filters.bank.output_variances = passage.output_variances;
    for (std::size_t j = 0; j < passage.output_variances.size(); ++j)
      setup.problem.output_weights[j] = 1.0 / passage.output_variances[j];
  }
  const std::vector<WeighedLaws> laws =
      search_laws(model_, setup.filters, setup.priors, log, setup.most_laws, setup.least_probability);
  // Of the law that the solution follows; all problems have the same.
  setup.filters.bank.members = {laws.front().priors};
  std::vector<double> distances = pass(model_, setup.filters, log).distances;

  Track track = track_of(log, setup.filters, *model_);
  std::vector<Solution> solutions;
  std::vector<SmoothedRun::Law> solved;
  Report report;
  double seconds = 0.0;
  for (const WeighedLaws& law : laws) {
    auto of = std::make_unique<LawProblem>(model_, setup, law.priors, log);
    const bool is_first = solutions.empty();
    if (is_first) {
      // Of an interval, what its end says.
      std::vector<double> ends(track.parameters.begin() + model_->parameter_count(), track.parameters.end());
      align_track(of->problem(), *model_, track.states, track.inputs, ends);
      fill_distances(track, log, setup.filters, *model_, distances);
    }
    of->set_distances(distances);
    if (const std::string reason = solver_->why_not(of->problem()); !reason.empty())
      throw Error("smoother: the solver cannot take this problem: " + reason);
    solver_->setup(of->problem());
    Iterate iterate = of->guess(track);
    const auto start = Clock::now();
    const Report of_law = solver_->solve(iterate, deadline);
    seconds += 1e-6 * microseconds_since(start);
    const int iterations = report.iterations, factorisations = report.factorisations;
    if (is_first) report = of_law;
    report.iterations = iterations + of_law.iterations;
    report.factorisations = factorisations + of_law.factorisations;
    if (!is_first && of_law.status != Status::solved) continue;
    const auto ns = static_cast<std::size_t>(of->problem().capacity().states);
    std::vector<double> covariances((static_cast<std::size_t>(log.intervals()) + 1) * ns * ns);
    if (!solver_->covariances(iterate, all_stages(of->problem()), covariances)) covariances.clear();
    track = of->track_of(iterate);
    solved.push_back({law.texts, law.probability});
    solutions.push_back({std::move(of), std::move(iterate), std::move(covariances)});
    if (of_law.status != Status::solved) break;
  }
  double sum = 0.0;
  for (const SmoothedRun::Law& law : solved) sum += law.probability;
  for (SmoothedRun::Law& law : solved) law.probability /= sum;
  SmoothedRun run = mixture(log, *model_, solved, solutions);
  run.report = report;
  run.solve_seconds = seconds;
  return run;
}

}  // namespace rhec
