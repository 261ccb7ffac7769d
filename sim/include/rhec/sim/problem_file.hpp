#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "rhec/core/horizon_problem.hpp"
#include "rhec/core/settings.hpp"
#include "rhec/core/solver.hpp"

namespace rhec::sim {

/// One line of a problem file: an RHE or RHC problem with every number that a solver needs, as JSON. What is written
/// there by name is kept by name; the model says later what the names mean.
struct ProblemRecord {
  using Rows = std::vector<std::vector<double>>;

  std::string where;       ///< "gentle-rhe.jsonl:3", for errors
  std::string id;          ///< "gentle/rhe/fhb/19"
  std::string prefix;      ///< "gentle/rhe/fhb": of the sequence over time that it belongs to
  std::int64_t step = -1;  ///< 19: the place in that sequence; -1 where the id does not end in a number
  OcpKind kind = OcpKind::rhe;
  std::string model;       ///< name of the plugin
  Settings model_options;  ///< a map
  int intervals = 0;       ///< N
  double dt = 0.0;         ///< [s]
  int substeps = 1;
  std::map<std::string, std::array<double, 2>> bounds;   ///< [lower, upper], infinite where there is none
  std::map<std::string, std::vector<int>> block_starts;  ///< RHE: by parameter. RHC: by input that is blocked

  // RHE
  std::vector<double> arrival_state, arrival_parameters;
  Rows arrival_information;
  Rows outputs;  ///< N+1 rows, NaN where missing
  Rows inputs;   ///< N rows, as measured, NaN where missing
  std::vector<double> output_weights, input_weights;

  // RHC
  std::vector<double> initial_state, parameters;
  std::map<std::string, std::vector<double>> reference;  ///< N+1 values of a state, N of an input
  std::map<std::string, double> stage_weights, terminal_weights;

  /// Absolute index of the window's first interval, for a sequence: RHE looks back from `step`, RHC ahead.
  std::int64_t first_interval() const noexcept { return kind == OcpKind::rhe ? step - intervals : step; }
};

/// Reads a line. Throws Error naming file, line and key: no JSON, a key that is unknown (with the nearest one that is
/// known), missing or written twice, a value of the wrong type, a list of the wrong length.
RHEC_EXPORT ProblemRecord read_problem(std::string_view text, const std::string& file, int line);

/// Reads the lines of a file; blank lines are passed over.
RHEC_EXPORT std::vector<ProblemRecord> read_problems(std::string_view text, const std::string& file);

/// The problem of a record, ready for a solver: an RheProblem or an RhcProblem with room for `max_intervals` (at least
/// the record's own). What has no entry under `bounds` has no bound. Throws Error as above, where names or shapes do
/// not fit the model.
RHEC_EXPORT std::unique_ptr<HorizonProblem> build(const ProblemRecord& record, std::shared_ptr<const Model> model,
                                                  int max_intervals = 0);

/// Fills a problem that `build` made for an earlier record anew. False, with the problem left as it was, where it has
/// no room or differs in what cannot be changed: kind, weights, bounds (but for RHC's of inputs), substeps, which
/// inputs are blocked. The model must be the same; records tell by name and options.
RHEC_EXPORT bool refill(const ProblemRecord& record, HorizonProblem& problem);

/// The guess without a history: the prior (RHE) or the initial state (RHC), rolled out with the measured or reference
/// inputs, clipped to bounds. An input that was not measured is 0.
RHEC_EXPORT void cold_start(const ProblemRecord& record, const HorizonProblem& problem, Iterate& guess);

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
