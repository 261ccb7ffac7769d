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

/// A solver plugin with options, under the name that it has in a comparison.
struct Backend {
  std::string label;
  std::string solver;
  Settings options;  ///< a map, or null for defaults
};

struct ComparisonOptions {
  std::vector<Backend> backends;   ///< at least one; labels differ
  Backend reference;               ///< drives the scenario for the problems that all of them solve
  int seeds = 1;                   ///< the scenario's seed and those that follow it
  int every = 0;                   ///< problems of every n-th step; 0: as many as leave about 400 of each kind
  bool closed_loop = true;         ///< let each backend drive the scenario, too
  std::optional<double> accuracy;  ///< KKT residual that each is tightened to
  std::function<void(double share)> progress;
};

/// What a backend made of one problem, as the core assesses it. An estimate is assessed as it was returned; a plan
/// after its states have been simulated with its inputs, so that no defect flatters it.
struct Answer {
  Status status = Status::bad_input;
  bool usable = false;  ///< by its status, and all numbers are finite
  int iterations = 0;
  double kkt = 0.0;        ///< the largest part of the KKT residual of the point as it was returned
  double defect = 0.0;     ///< max |F_i(s_i, w_i) - s_{i+1}| of the point as it was returned
  double violation = 0.0;  ///< max of what bounds are violated by, of the assessed point
  double objective = 0.0;  ///< of the assessed point
  /// Objective of the assessed point, its defects and violations charged at the multipliers of the answer with the
  /// least KKT residual, less that of the best answer, relative to max(1, |the best|). The best is the least such sum
  /// of a point with defects and violations of at most 1e-6, of all backends and the reference. NaN where none is.
  double gap = std::numeric_limits<double>::quiet_NaN();
  /// Of states, inputs and parameters, the largest difference from the best answer in units of the model's scales.
  double distance = std::numeric_limits<double>::quiet_NaN();
  double time_us = 0.0;  ///< of `prepare` and `solve`
};

/// The answers of a backend to problems of one kind.
struct BackendAnswers {
  std::string refusal;             ///< why_not of the first problem that it does not take; empty: it takes all
  std::int64_t refused = 0;        ///< problems that it does not take
  std::vector<Answer> answers;     ///< to those that it takes, in the order of the problems
  std::vector<std::size_t> taken;  ///< which those are
  std::map<std::string, std::int64_t> statuses;
  std::string tuning;               ///< at equal accuracy: what came of it, in words
  std::optional<double> tolerance;  ///< at equal accuracy: the value of that option
  bool accuracy_reached = true;
};

/// Problems of one kind along the reference's trajectories, which every backend solves from the same guesses.
struct SameProblems {
  std::string kind = "rhe";
  struct Place {
    std::int64_t seed = 0, step = 0;
  };
  std::vector<Place> problems;
  std::int64_t without_best = 0;         ///< problems to which no answer was feasible
  std::vector<BackendAnswers> backends;  ///< in the order of the comparison's
};

/// A backend in the closed loop.
struct BackendRuns {
  std::string refusal;           ///< why it cannot drive; empty: it did
  std::vector<RunSummary> runs;  ///< one a seed
};

struct Comparison {
  std::string scenario;
  std::vector<std::int64_t> seeds;
  int every = 1;
  std::optional<double> accuracy;
  Backend reference;
  std::vector<RunSummary> reference_runs;  ///< one a seed
  std::vector<Backend> backends;
  std::vector<SameProblems> problems;  ///< of the kinds that the scenario has
  std::vector<BackendRuns> loops;      ///< in the order of the backends; empty where they were not asked for

  /// Every backend has a usable answer to every problem, and every run was completed.
  RHEC_EXPORT bool all_usable() const;
};

/// Compares solvers on a scenario. First the reference drives it, and every backend solves the recorded problems from
/// the recorded guesses in the order of time, with one instance for each kind and seed that is never reset in between;
/// then each drives by itself, over the same ground and with the same noise. But for times the result repeats itself.
/// Throws Error for whatever is wrong in the settings or with a backend; one that refuses a problem (`why_not`) is no
/// error.
RHEC_EXPORT Comparison compare(const Host& host, const Settings& scenario, const ComparisonOptions& options);

/// Of one number of all answers.
RHEC_EXPORT Spread spread_of(const std::vector<Answer>& answers, double Answer::*number);
RHEC_EXPORT Spread spread_of(const std::vector<Answer>& answers, int Answer::*number);

/// Mean of a number of each run, and of what it differs by from the same seed's run of another backend, with the
/// standard error of that mean (NaN for a single run). Both are NaN where the other has not as many runs.
struct Mean {
  double mean = 0.0, difference = 0.0, standard_error = 0.0;
};
RHEC_EXPORT Mean paired_mean(const std::vector<RunSummary>& runs, const std::vector<RunSummary>& others,
                             const std::function<double(const RunSummary&)>& number);

/// compare.json, described in docs/compare.md: the same bytes for the same arguments, but for what stands under keys
/// `time_us`.
RHEC_EXPORT std::string comparison_json(const Comparison& comparison);
/// The cumulative distributions of solve times.
RHEC_EXPORT std::string comparison_svg(const Comparison& comparison);

}  // namespace rhec::sim
