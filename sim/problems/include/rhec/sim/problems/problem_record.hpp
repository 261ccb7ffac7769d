#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "rhec/core/config/settings.hpp"
#include "rhec/core/horizon/blocking.hpp"
#include "rhec/core/horizon/horizon_problem.hpp"
#include "rhec/plugins/host/host.hpp"

namespace rhec::sim {

/// The newest version of the format of problem files; a line without `version` is of version 1.
constexpr int problem_format_version = 5;

/// One line of a problem file: a problem with every number that a solver needs, as JSON. Values are stored by name and
/// resolved later with the model. docs/problem_format.md describes the keys.
struct ProblemRecord {
  using Rows = std::vector<std::vector<double>>;
  using Interval = std::array<double, 2>;  ///< [lower, upper], infinite if unbounded

  int version = 1;
  std::string where;              ///< "gentle-rhe.jsonl:3", for errors
  std::string id;                 ///< "gentle/rhe/fhb/19"
  std::string prefix;             ///< "gentle/rhe/fhb": name of its sequence over time
  std::int64_t step = -1;         ///< 19: position in that sequence; -1 if the id does not end in a number
  std::string kind = "rhe";       ///< HorizonProblem::kind of the problem: the name of its ProblemFormat
  std::string model;              ///< name of the plugin
  Settings model_options;         ///< a map
  int intervals = 0;              ///< N
  std::vector<double> durations;  ///< of each interval [s]
  int substeps = 1;
  bool is_implicit = false;  ///< since version 4: integrated by implicit steps (ImplicitModel)
  std::map<std::string, Interval> bounds;
  std::map<std::string, std::vector<int>> block_starts;  ///< RHE: by parameter. RHC: by blocked input
  std::map<std::string, std::string> origin;             ///< where it comes from; solvers ignore it
  /// A primal-dual point in the stage layout of Ocp: states, costates and state_bounds have N+1 rows, controls and
  /// control_bounds N, each as long as its stage; empty multipliers are zero.
  struct Guess {
    Rows states, controls, costates, state_bounds, control_bounds;
    Rows limit_bounds;  ///< N+1 rows, or empty
  };
  std::optional<Guess> guess;

  // RHE
  std::vector<double> arrival_state, arrival_parameters;
  Rows arrival_information;
  Rows outputs;  ///< N+1 rows, NaN if missing
  Rows inputs;   ///< N rows, measured, NaN if missing
  /// By interval, rows of a time within it [s] and what was measured then, NaN if missing; or empty.
  std::vector<Rows> between;
  std::vector<double> output_weights, input_weights;
  struct Robust {
    std::vector<std::string> outputs;
    double delta = 0.0;  ///< infinite: quadratic
  };
  std::vector<Robust> robust;
  std::map<std::string, Transition> transition;  ///< by parameter; default: step
  /// By parameter, for each of its block_starts: variance of the jump from the previous block; infinite if unlinked.
  std::map<std::string, std::vector<double>> neighbour_variance;

  /// By parameter that is a process (ProcessModel): its number of states. Then arrival, weights and bounds are those of
  /// [x; z] and [u; w], and `data` has the processes of each interval (N rows).
  std::map<std::string, int> processes;
  /// Since version 5: how much single measurements count, relative to `output_weights` (Measured): as `outputs`, and as
  /// `between` without the times; none: 1.
  Rows relative_weights;
  std::vector<Rows> relative_weights_between;
  /// Since version 4: the states with process noise (StateNoiseModel), in the model's order. Then `inputs` and their
  /// weights are about [u; xi] or [u; xi; w].
  std::vector<std::string> state_noise;
  /// Since version 4: the states whose process noise is a parameter, in the model's order. Then parameters are [p; w].
  std::vector<std::string> blocked_noise;
  /// By parameter, for each of its block_starts: the weight of the block's squared value.
  std::map<std::string, std::vector<double>> block_weights;
  Rows data;

  // RHC
  std::vector<double> initial_state, parameters;
  std::map<std::string, std::vector<double>> reference;  ///< N+1 values per state, N per input
  std::map<std::string, double> stage_weights, terminal_weights;
  std::map<std::string, std::vector<Interval>> interval_bounds;  ///< for inputs whose bounds vary over the N intervals
  /// Inputs that are states, with their rates as inputs (InputRateModel). Then states, inputs, reference, weights and
  /// bounds are those of that model.
  std::vector<std::string> rates;
  /// Terms with their data and the bounds of their limits at each node (N+1 rows), in their own order.
  struct PosedTerm {
    NamedTerm made;  ///< without a term until `make_terms`
    Rows data, lower, upper;
  };
  std::vector<PosedTerm> terms;
  /// Since version 5: what hard limits of the terms cost by the unit that they are violated by; infinite: they are
  /// hard.
  double limit_price = std::numeric_limits<double>::infinity();

  /// Sets the id, and derives prefix and step from it.
  RHEC_EXPORT void set_id(std::string text);
  /// Absolute index of the window's first interval, for a sequence: RHE looks back from `step`, RHC ahead.
  RHEC_EXPORT std::int64_t first_interval() const;
};

/// The model with the integrator of a record: an ImplicitModel, or none. Throws Error if there is none.
RHEC_EXPORT std::shared_ptr<const Model> as_integrated(const ProblemRecord& record, std::shared_ptr<const Model> model);
/// Makes the terms of records that were read; those with the same name and options are one. Throws Error with the line
/// of a term that is not found, or does not accept its options. Needed before `build`, if a record has terms.
RHEC_EXPORT void make_terms(std::span<ProblemRecord> records, const Host& host);

/// Builds the problem of a record, ready for a solver, with capacity for `max_intervals` (at least the record's own,
/// and 1). For estimation, `one_block` lists parameters that always remain a single block. Variables without an entry
/// under `bounds` are unbounded. The model gets the integrator of the record (`as_integrated`). Throws Error if names
/// or dimensions do not fit the model.
RHEC_EXPORT std::unique_ptr<HorizonProblem> build(const ProblemRecord& record, std::shared_ptr<const Model> model,
                                                  int max_intervals = 0, std::vector<int> one_block = {});

/// The parameters that have a single value over the horizon in all of these estimation problems, for `build`.
RHEC_EXPORT std::vector<int> one_block_parameters(std::span<const ProblemRecord> records, const Model& model);

/// Refills a problem that `build` made for an earlier record. Returns false and leaves the problem unchanged if its
/// capacity is too small or fixed properties differ: kind, weights, robust losses, bounds (except RHC input bounds),
/// substeps, or which inputs are blocked. The model must be the same, i.e. the records' model name and options.
RHEC_EXPORT bool refill(const ProblemRecord& record, HorizonProblem& problem);

/// Initial guess without history: the prior (RHE) or initial state (RHC), rolled out with the measured or reference
/// inputs and clipped to the bounds. Unmeasured inputs are 0.
RHEC_EXPORT void cold_start(const ProblemRecord& record, const HorizonProblem& problem, Iterate& guess);

/// A solver's initial guess: the record's guess to the bit, or a cold start if it has none. The guess keeps the
/// problem's capacity.
RHEC_EXPORT void start(const ProblemRecord& record, const HorizonProblem& problem, Iterate& guess);

/// The record of a problem, of the newest version: reading its line and building it gives a problem with the same bits
/// in its objective and its linearisations. `guess` may be null. Throws Error if the format cannot represent it:
/// blocked inputs that are not in the model's order, or have no block at interval 0.
RHEC_EXPORT ProblemRecord record_of(const HorizonProblem& problem, const Iterate* guess, std::string id,
                                    std::string model, Settings model_options);

}  // namespace rhec::sim
