#include "rhec/core/estimation/prior_smoothing.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include <fmt/format.h>

#include "input_walks.hpp"
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

Track track_of(const NodeLog& log, const Passage& passage, const BankEstimation::Setup& filters, const Model& model) {
  Track track{log.states, passage.inputs, log.parameters};
  const int np = model.parameter_count();
  fill_gaps(track.states, model.state_count());
  fill_gaps(track.parameters, np);
  for (double& value : track.states) value = std::isfinite(value) ? value : 0.0;
  fill_columns(track.inputs, model.input_count());
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
  /// Keeps a reference to `walks`, those of the log.
  LawProblem(InputWalks& walks, const PriorSmoothing::Setup& setup, const PriorCombination& law, const NodeLog& log)
      : walks_(walks),
        bank_(walks_.vehicle(), bank_setup(setup, law)),
        model_(make_process_model(walks_.model(), bank_)),
        problem_(make_process_problem(model_, walks_.setup(problem_setup(setup, log)))) {
    problem_.set_intervals(log.intervals());
    fill_data(log, vehicle().input_count(), problem_);
    AlignedDoubles start(bank_.state_size());
    bank_.reset(setup.filters.initial_state, setup.filters.initial_covariance);
    bank_.save(start.data());
    Eigen::Index n = vehicle().state_count();
    for (int j = 0; j < vehicle().parameter_count(); ++j) n += bank_.process_states(j);
    Eigen::VectorXd mean(n);
    Eigen::MatrixXd covariance(n, n), information(n, n);
    bank_.saved_moments(start.data(), 0, mean, covariance);
    InformationOf(n).find(covariance, information);
    walks_.add_start(mean, information);
    problem_.arrival_mean = mean;
    problem_.arrival_information = information;
  }

  const RheProblem& problem() const noexcept { return problem_; }
  const Model& vehicle() const noexcept { return *walks_.vehicle(); }

  /// With the ground covered on each interval, and parameters as in the track where they are held.
  void set_intervals(const std::vector<double>& distances, const Track& track) noexcept {
    for (int i = 0; i < problem_.intervals(); ++i) {
      walks_.write(i, track.parameters.data() + static_cast<std::ptrdiff_t>(i) * vehicle().parameter_count(),
                   model_->vehicle_data(problem_.interval_data(i)), problem_.measured_input(i));
      for (int j = 0; j < vehicle().parameter_count(); ++j)
        bank_.write_process(0, j, {problem_.duration(i), distances[static_cast<std::size_t>(i)]},
                            model_->process_data(j, problem_.interval_data(i)));
    }
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
      walks_.write_kept(track.inputs, static_cast<int>(i), state + nx);
      for (std::ptrdiff_t j = 0; j < np; ++j)
        state[model_->first_state(static_cast<int>(j))] = track.parameters[i * np + j];
      if (i == problem_.intervals()) break;
      double* const control = guess.control(static_cast<int>(i));
      std::copy_n(track.inputs.data() + i * nu, nu, control);
      walks_.to_own(static_cast<int>(i), state + nx, control);
      std::fill(control + nu, control + model_->input_count(), 0.0);
    }
    return guess;
  }

  /// What acts on an interval (n_u).
  std::vector<double> inputs_on(const Iterate& iterate, int interval) const {
    std::vector<double> inputs(iterate.control(interval), iterate.control(interval) + vehicle().input_count());
    walks_.to_acting(iterate.state(interval + 1) + vehicle().state_count(), inputs.data());
    return inputs;
  }

  Track track_of(const Iterate& iterate) const {
    const std::ptrdiff_t nx = vehicle().state_count();
    Track track;
    for (int i = 0; i <= problem_.intervals(); ++i) {
      const double* const state = iterate.state(i);
      track.states.insert(track.states.end(), state, state + nx);
      for (int j = 0; j < vehicle().parameter_count(); ++j) track.parameters.push_back(state[model_->first_state(j)]);
      if (i == problem_.intervals()) break;
      const std::vector<double> inputs = inputs_on(iterate, i);
      track.inputs.insert(track.inputs.end(), inputs.begin(), inputs.end());
    }
    return track;
  }

  /// Moments of [x; p] at a node. A parameter that is held changes somewhere near the node: it is that of the interval
  /// before or that of the interval behind, both equally probable. `covariances` of the stage states may be empty.
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

  /// Values of the parameters on an interval: at its start, and at its end.
  void parameters_on(const Iterate& iterate, int interval, double* start, double* end) const {
    for (int j = 0; j < vehicle().parameter_count(); ++j) {
      start[j] = value(iterate, interval, j);
      end[j] = is_ramp(interval, j) ? value(iterate, interval + 1, j) : start[j];
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
    problem.most_between = log.most_between();
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

  InputWalks& walks_;
  PriorBank bank_;  ///< of this law alone: knows its processes
  std::shared_ptr<const ProcessModel> model_;
  RheProblem problem_;
};

/// Sums up the solutions for single laws. Covariances are summed about the first solution, which is near to all.
class Mixture {
 public:
  Mixture(const NodeLog& log, const Model& model)
      : nx_(model.state_count()), nu_(model.input_count()), np_(model.parameter_count()), N_(log.intervals()) {
    run_.times.assign(1, 0.0);
    for (const double duration : log.durations) run_.times.push_back(run_.times.back() + duration);
    const auto rows = [](std::ptrdiff_t count, std::ptrdiff_t width) {
      return std::vector<double>(static_cast<std::size_t>(count * width), 0.0);
    };
    run_.states = rows(N_ + 1, nx_);
    run_.node_parameters = rows(N_ + 1, np_);
    run_.inputs = rows(N_, nu_);
    run_.parameters = run_.start_parameters = rows(N_, np_);
    run_.covariances = rows(N_ + 1, (nx_ + np_) * (nx_ + np_));
    origin_ = rows(N_ + 1, nx_ + np_);
  }
  bool is_empty() const noexcept { return run_.laws.empty(); }

  /// `covariances` are those of the stage states; empty if the solver gives none: then the mixture has none.
  void add(const LawProblem& problem, const Iterate& iterate, const std::vector<double>& covariances,
           const WeighedLaws& laws) {
    const double share = laws.probability;
    const auto sum = [share](std::vector<double>& to, std::ptrdiff_t row, const double* values, std::ptrdiff_t count) {
      for (std::ptrdiff_t j = 0; j < count; ++j) to[static_cast<std::size_t>(row * count + j)] += share * values[j];
    };
    const std::ptrdiff_t n = nx_ + np_;
    const bool is_first = is_empty();
    if (covariances.empty()) run_.covariances.clear();
    Eigen::VectorXd mean(n), start(np_), end(np_);
    Eigen::MatrixXd covariance;
    for (std::ptrdiff_t i = 0; i <= N_; ++i) {
      const int node = static_cast<int>(i);
      problem.find_moments(iterate, covariances, node, mean, covariance);
      sum(run_.states, i, mean.data(), nx_);
      sum(run_.node_parameters, i, mean.data() + nx_, np_);
      Eigen::Map<Eigen::VectorXd> origin(origin_.data() + i * n, n);
      if (is_first) origin = mean;
      mean -= origin;
      if (!run_.covariances.empty()) {
        covariance += mean * mean.transpose();
        sum(run_.covariances, i, covariance.data(), n * n);
      }
      if (i == N_) break;
      sum(run_.inputs, i, problem.inputs_on(iterate, node).data(), nu_);
      problem.parameters_on(iterate, node, start.data(), end.data());
      sum(run_.start_parameters, i, start.data(), np_);
      sum(run_.parameters, i, end.data(), np_);
    }
    run_.laws.push_back({laws.texts, laws.probability});
  }

  SmoothedRun finish() {
    double total = 0.0;
    for (const SmoothedRun::Law& law : run_.laws) total += law.probability;
    for (SmoothedRun::Law& law : run_.laws) law.probability /= total;
    for (auto* rows : {&run_.states, &run_.node_parameters, &run_.inputs, &run_.parameters, &run_.start_parameters,
                       &run_.covariances})
      for (double& value : *rows) value /= total;
    const std::ptrdiff_t n = nx_ + np_;
    Eigen::VectorXd mean(n);
    for (std::ptrdiff_t i = 0; i <= N_ && !run_.covariances.empty(); ++i) {
      for (std::ptrdiff_t k = 0; k < n; ++k)
        mean[k] = (k < nx_ ? run_.states[static_cast<std::size_t>(i * nx_ + k)]
                           : run_.node_parameters[static_cast<std::size_t>(i * np_ + k - nx_)]) -
                  origin_[static_cast<std::size_t>(i * n + k)];
      Eigen::Map<Eigen::MatrixXd>(run_.covariances.data() + i * n * n, n, n) -= mean * mean.transpose();
    }
    return std::move(run_);
  }

 private:
  std::ptrdiff_t nx_, nu_, np_, N_;
  std::vector<double> origin_;  ///< [x; p] of the first solution
  SmoothedRun run_;
};

}  // namespace

PriorSmoothing::PriorSmoothing(std::shared_ptr<const Model> model, std::shared_ptr<Solver> solver, Setup setup)
    : model_(std::move(model)), solver_(std::move(solver)), setup_(std::move(setup)) {
  [[maybe_unused]] const BankEstimation checked(model_, setup_.filters);  // reports mistakes now
  const auto np = static_cast<std::size_t>(model_->parameter_count());
  if (setup_.filters.parameter_lower.size() != np || setup_.filters.parameter_upper.size() != np)
    throw Error(fmt::format("smoother: expected {} lower and upper bounds, one a parameter", np));
}

SmoothedRun PriorSmoothing::estimate(NodeLog log, Clock::time_point deadline) const {
  clean(log);
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
  const Passage followed = pass(model_, setup.filters, log);
  std::vector<double> distances = followed.distances;

  Track track = track_of(log, followed, setup.filters, *model_);
  InputWalks walks(model_, setup.problem, log);
  Mixture mixture(log, *model_);
  Report report;
  double seconds = 0.0;
  for (const WeighedLaws& law : laws) {
    LawProblem problem(walks, setup, law.priors, log);
    const bool is_first = mixture.is_empty();
    if (is_first) {
      // Of an interval, what its end says.
      const std::vector<double> ends(track.parameters.begin() + model_->parameter_count(), track.parameters.end());
      align_track(problem.problem(), *model_, track.states, track.inputs, ends);
      fill_distances(track, log, setup.filters, *model_, distances);
    }
    problem.set_intervals(distances, track);
    if (const std::string reason = solver_->why_not(problem.problem()); !reason.empty())
      throw Error("smoother: the solver cannot take this problem: " + reason);
    solver_->setup(problem.problem());
    Iterate iterate = problem.guess(track);
    const auto start = Clock::now();
    const Report of_law = solver_->solve(iterate, deadline);
    seconds += 1e-6 * microseconds_since(start);
    const int iterations = report.iterations, factorisations = report.factorisations;
    if (is_first) report = of_law;
    report.iterations = iterations + of_law.iterations;
    report.factorisations = factorisations + of_law.factorisations;
    if (!is_first && of_law.status != Status::solved) continue;
    const auto ns = static_cast<std::size_t>(problem.problem().capacity().states);
    std::vector<double> covariances((static_cast<std::size_t>(log.intervals()) + 1) * ns * ns);
    if (!solver_->covariances(iterate, all_stages(problem.problem()), covariances)) covariances.clear();
    mixture.add(problem, iterate, covariances, law);
    if (of_law.status != Status::solved) break;
    track = problem.track_of(iterate);
  }
  SmoothedRun run = mixture.finish();
  run.report = report;
  run.solve_seconds = seconds;
  return run;
}

}  // namespace rhec
