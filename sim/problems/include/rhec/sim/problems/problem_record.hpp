#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "rhec/core/config/settings.hpp"
#include "rhec/core/horizon/blocking.hpp"
#include "rhec/core/horizon/horizon_problem.hpp"

namespace rhec::sim {

/// The newest version of the format of problem files; a line without `version` is of version 1.
constexpr int problem_format_version = 2;

/// One line of a problem file: a problem with every number that a solver needs, as JSON. What is written
/// there by name is kept by name; the model says later what the names mean. docs/problem_format.md describes the keys.
struct ProblemRecord {
  using Rows = std::vector<std::vector<double>>;
  using Interval = std::array<double, 2>;  ///< [lower, upper], infinite where there is none

  int version = 1;
  std::string where;              ///< "gentle-rhe.jsonl:3", for errors
  std::string id;                 ///< "gentle/rhe/fhb/19"
  std::string prefix;             ///< "gentle/rhe/fhb": of the sequence over time that it belongs to
  std::int64_t step = -1;         ///< 19: the place in that sequence; -1 where the id does not end in a number
  std::string kind = "rhe";       ///< HorizonProblem::kind of the problem: the name of its ProblemFormat
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
  RHEC_EXPORT std::int64_t first_interval() const;
};

/// The problem of a record, ready for a solver, with room for `max_intervals` (at least
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

}  // namespace rhec::sim
