#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "rhec/core/ocp/solver.hpp"
#include "rhec/sim/problems/problem_record.hpp"

namespace rhec::sim {

/// Reads a line. Throws Error, naming file, line and key, for invalid JSON, a key that is unknown (suggesting the
/// closest known one), missing or repeated, a value of the wrong type, a list of the wrong length, an arrival
/// information matrix that is not symmetric positive semidefinite, or an unknown version.
RHEC_EXPORT ProblemRecord read_problem(std::string_view text, const std::string& file, int line);

/// Reads the lines of a file; skips blank lines.
RHEC_EXPORT std::vector<ProblemRecord> read_problems(std::string_view text, const std::string& file);

/// A record as a line of a problem file of the newest version (without the line end). Numbers round-trip to the same
/// bits. A non-finite number where the format requires a finite one is written as null, which the reader refuses.
RHEC_EXPORT std::string problem_line(const ProblemRecord& record);

/// A solver's outcome for a problem, apart from the point.
struct Outcome {
  std::string solver;
  Status status = Status::bad_input;
  int iterations = 0;
  double objective = 0.0;
  double kkt_residual = 0.0;  ///< its largest component
  double solve_time_us = 0.0;
};

/// A line of a solution file (without the line end): the problem's id, the point as states, inputs and parameters, the
/// outcome. Numbers round-trip to the same bits.
RHEC_EXPORT std::string solution_line(const ProblemRecord& record, const HorizonProblem& problem, const Iterate& point,
                                      const Outcome& outcome);

}  // namespace rhec::sim
