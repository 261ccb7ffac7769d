#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "rhec/core/config/settings.hpp"
#include "rhec/core/ocp/solver.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/sim/loop/closed_loop.hpp"
#include "rhec/sim/numbers/spread.hpp"

namespace rhec::sim {

/// A solver plugin with options and its label in a comparison.
struct Backend {
  std::string label;
  std::string solver;
  Settings options;  ///< a map, or null for defaults
};

struct ComparisonOptions {
  std::vector<Backend> backends;   ///< at least one; labels differ
  Backend reference;               ///< drives the scenario to record the problems that all solve
  int seeds = 1;                   ///< the scenario's seed and its successors
  int every = 0;                   ///< record every n-th step; 0: chosen to give about 400 problems of each kind
  bool closed_loop = true;         ///< also run each backend in closed loop
  std::optional<double> accuracy;  ///< target KKT residual of every backend
  std::function<void(double share)> progress;
};

/// A backend's solution of one problem, as evaluated by the core. An estimate is evaluated as returned; a plan after
/// its states have been simulated with its inputs, so that defects cannot improve its objective.
struct Answer {
  Status status = Status::bad_input;
  bool usable = false;  ///< by its status, with all numbers finite
  int iterations = 0;
  double kkt = 0.0;        ///< largest component of the KKT residual of the returned point
  double defect = 0.0;     ///< max |F_i(s_i, w_i) - s_{i+1}| of the returned point
  double violation = 0.0;  ///< largest bound violation of the evaluated point
  double objective = 0.0;  ///< of the evaluated point
  /// Objective of the evaluated point, plus its defects and violations weighted with the multipliers of the solution
  /// with the smallest KKT residual, minus the best such sum, relative to max(1, |best|). The best is the smallest over
  /// all backends and the reference, among points with defects and violations of at most 1e-6. NaN if there is none.
  double gap = std::numeric_limits<double>::quiet_NaN();
  /// Largest difference from the best solution in states, inputs and parameters, in units of the model's scales.
  double distance = std::numeric_limits<double>::quiet_NaN();
  double time_us = 0.0;  ///< of `prepare` and `solve`
};

/// A backend's solutions of problems of one kind.
struct BackendAnswers {
  std::string refusal;             ///< why_not of the first refused problem; empty: it accepts all
  std::int64_t refused = 0;        ///< number of refused problems
  std::vector<Answer> answers;     ///< to the accepted problems, in order
  std::vector<std::size_t> taken;  ///< indices of the accepted problems
  std::map<std::string, std::int64_t> statuses;
  std::string tuning;               ///< at equal accuracy: the outcome, in words
  std::optional<double> tolerance;  ///< at equal accuracy: the tolerance used
  bool accuracy_reached = true;
};

/// Problems of one kind along the reference's trajectories. Every backend solves them from the same initial guesses.
struct SameProblems {
  std::string kind = "rhe";
  struct Place {
    std::int64_t seed = 0, step = 0;
  };
  std::vector<Place> problems;
  std::int64_t without_best = 0;         ///< problems without a feasible solution
  std::vector<BackendAnswers> backends;  ///< in the comparison's order
};

/// A backend in the closed loop.
struct BackendRuns {
  std::string refusal;           ///< why it could not run; empty: it ran
  std::vector<RunSummary> runs;  ///< one per seed
};

struct Comparison {
  std::string scenario;
  std::vector<std::int64_t> seeds;
  int every = 1;
  std::optional<double> accuracy;
  Backend reference;
  std::vector<RunSummary> reference_runs;  ///< one per seed
  std::vector<Backend> backends;
  std::vector<SameProblems> problems;  ///< of the kinds that the scenario has
  std::vector<BackendRuns> loops;      ///< in the order of the backends; empty if not requested

  /// Every backend has a usable solution of every problem, and every run was completed.
  RHEC_EXPORT bool all_usable() const;
};

/// Compares solvers on a scenario. First the reference runs in closed loop, and every backend solves the recorded
/// problems from the recorded guesses in chronological order, with one instance per kind and seed that is never reset.
/// Then each backend runs in closed loop, on the same ground and with the same noise. Except for times, the result is
/// reproducible. Throws Error if settings or a backend are invalid; a backend that refuses a problem (`why_not`) is not
/// an error.
RHEC_EXPORT Comparison compare(const Host& host, const Settings& scenario, const ComparisonOptions& options);

/// Spread of one member over all answers.
RHEC_EXPORT Spread spread_of(const std::vector<Answer>& answers, double Answer::*number);
RHEC_EXPORT Spread spread_of(const std::vector<Answer>& answers, int Answer::*number);

/// Mean of a number over the runs, and mean difference from another backend's run with the same seed, with its standard
/// error (NaN for a single run). Both are NaN if the other backend has a different number of runs.
struct Mean {
  double mean = 0.0, difference = 0.0, standard_error = 0.0;
};
RHEC_EXPORT Mean paired_mean(const std::vector<RunSummary>& runs, const std::vector<RunSummary>& others,
                             const std::function<double(const RunSummary&)>& number);

/// compare.json, described in docs/compare.md: byte-identical for the same arguments, except under the keys `time_us`.
RHEC_EXPORT std::string comparison_json(const Comparison& comparison);
/// The cumulative distributions of solve times.
RHEC_EXPORT std::string comparison_svg(const Comparison& comparison);

}  // namespace rhec::sim
