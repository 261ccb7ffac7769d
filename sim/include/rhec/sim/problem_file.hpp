#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "rhec/core/config/settings.hpp"
#include "rhec/core/horizon/blocking.hpp"
#include "rhec/core/horizon/horizon_problem.hpp"
#include "rhec/core/ocp/solver.hpp"

namespace rhec::sim {

/// The newest version of the format of problem files; a line without `version` is of version 1.
constexpr int problem_format_version = 2;

/// One line of a problem file: an RHE or RHC problem with every number that a solver needs, as JSON. What is written
/// there by name is kept by name; the model says later what the names mean. docs/problem_format.md describes the keys.
struct ProblemRecord {
  using Rows = std::vector<std::vector<double>>;
  using Interval = std::array<double, 2>;  ///< [lower, upper], infinite where there is none

  int version = 1;
  std::string where;       ///< "gentle-rhe.jsonl:3", for errors
  std::string id;          ///< "gentle/rhe/fhb/19"
  std::string prefix;      ///< "gentle/rhe/fhb": of the sequence over time that it belongs to
  std::int64_t step = -1;  ///< 19: the place in that sequence; -1 where the id does not end in a number
  std::string kind = "rhe";
  std::string model;              ///< name of the plugin
  Settings model_options;         ///< a map
  int intervals = 0;              ///< N
  std::vector<double> durations;  ///< of each interval [s]
  int substeps = 1;
  std::map<std::string, Interval> bounds;
  std::map<std::string, std::vector<int>> block_starts;  ///< RHE: by parameter. RHC: by input that is blocked
  std::map<std::string, std::string> origin;             ///< where it comes from; means nothing to solvers
  /// A primal-dual point in the stage layout of Ocp: states, costates and state_bounds have N+1 rows, controls and
  /// control_bounds N, as long as their stages; multipliers that are empty are zero.
  struct Guess {
    Rows states, controls, costates, state_bounds, control_bounds;
  };
  std::optional<Guess> guess;

  // RHE
  std::vector<double> arrival_state, arrival_parameters;
  Rows arrival_information;
  Rows outputs;  ///< N+1 rows, NaN where missing
  Rows inputs;   ///< N rows, as measured, NaN where missing
  std::vector<double> output_weights, input_weights;
  struct Robust {
    std::vector<std::string> outputs;
    double delta = 0.0;  ///< infinite: quadratic
  };
  std::vector<Robust> robust;
  std::map<std::string, Transition> transition;  ///< by parameter; step where there is none
  /// By parameter, for each of its block_starts: of the jump from the block before; infinite where nothing links them.
  std::map<std::string, std::vector<double>> neighbour_variance;

  // RHC
  std::vector<double> initial_state, parameters;
  std::map<std::string, std::vector<double>> reference;  ///< N+1 values of a state, N of an input
  std::map<std::string, double> stage_weights, terminal_weights;
  std::map<std::string, std::vector<Interval>> interval_bounds;  ///< of inputs whose bounds are not the same on all N

  /// Takes an id, and prefix and step from it.
  RHEC_EXPORT void set_id(std::string text);
  /// Absolute index of the window's first interval, for a sequence: RHE looks back from `step`, RHC ahead.
  std::int64_t first_interval() const noexcept { return kind == "rhe" ? step - intervals : step; }
};

/// Reads a line. Throws Error naming file, line and key: no JSON, a key that is unknown (with the nearest one that is
/// known), missing or written twice, a value of the wrong type, a list of the wrong length, an arrival information that
/// is not symmetric positive semidefinite, a version that is not known.
RHEC_EXPORT ProblemRecord read_problem(std::string_view text, const std::string& file, int line);

/// Reads the lines of a file; blank lines are passed over.
RHEC_EXPORT std::vector<ProblemRecord> read_problems(std::string_view text, const std::string& file);

/// The problem of a record, ready for a solver: an RheProblem or an RhcProblem with room for `max_intervals` (at least
/// the record's own, and 1); of an estimation, `one_block` are parameters that stay one block whatever comes after.
/// What has no entry under `bounds` has no bound. Throws Error as above, where names or
/// shapes do not fit the model.
RHEC_EXPORT std::unique_ptr<HorizonProblem> build(const ProblemRecord& record, std::shared_ptr<const Model> model,
                                                  int max_intervals = 0, std::vector<int> one_block = {});

/// The parameters that have one value over the horizon in each of these estimations, for `build`.
RHEC_EXPORT std::vector<int> one_block_parameters(std::span<const ProblemRecord> records, const Model& model);

/// Fills a problem that `build` made for an earlier record anew. False, with the problem left as it was, where it has
/// no room or differs in what cannot be changed: kind, weights, robust losses, bounds (but for RHC's of inputs),
/// substeps, which inputs are blocked. The model must be the same; records tell by name and options.
RHEC_EXPORT bool refill(const ProblemRecord& record, HorizonProblem& problem);

/// The guess without a history: the prior (RHE) or the initial state (RHC), rolled out with the measured or reference
/// inputs, clipped to bounds. An input that was not measured is 0.
RHEC_EXPORT void cold_start(const ProblemRecord& record, const HorizonProblem& problem, Iterate& guess);

/// Where a solver starts: the record's guess to the bit, or where it has none a cold start. The guess keeps to the
/// problem's capacity.
RHEC_EXPORT void start(const ProblemRecord& record, const HorizonProblem& problem, Iterate& guess);

/// The record of a problem, of the newest version: reading its line and building it gives a problem with the same bits
/// in its objective and its linearisations. `guess` may be null. Throws Error where the format has no words for it:
/// blocked inputs that are not in the model's order, or have no block at interval 0.
RHEC_EXPORT ProblemRecord record_of(const HorizonProblem& problem, const Iterate* guess, std::string id,
                                    std::string model, Settings model_options);

/// A record as a line of a problem file of the newest version (without the line end). Numbers are written so that
/// reading them gives the same bits; one that is not finite where the format demands it is written as null, which
/// reading then refuses.
RHEC_EXPORT std::string problem_line(const ProblemRecord& record);

/// Settings as JSON, which is YAML too; what reads as a number or a truth value is written as one.
RHEC_EXPORT std::string json_text(const Settings& settings);

/// What a solver made of a problem, beside the point.
struct Outcome {
  std::string solver;
  Status status = Status::bad_input;
  int iterations = 0;
  double objective = 0.0;
  double kkt_residual = 0.0;  ///< the largest part of it
  double solve_time_us = 0.0;
};

/// A line of a solution file (without the line end): the problem's id, the point in the vehicle's terms, the outcome.
/// Numbers are written so that reading them gives the same bits.
RHEC_EXPORT std::string solution_line(const ProblemRecord& record, const HorizonProblem& problem, const Iterate& point,
                                      const Outcome& outcome);

}  // namespace rhec::sim
