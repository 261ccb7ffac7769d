#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "rhec/core/ocp/solver.hpp"
#include "rhec/sim/problems/problem_record.hpp"

namespace rhec::sim {

/// Reads a line. Throws Error naming file, line and key: no JSON, a key that is unknown (with the nearest one that is
/// known), missing or written twice, a value of the wrong type, a list of the wrong length, an arrival information that
/// is not symmetric positive semidefinite, a version that is not known.
RHEC_EXPORT ProblemRecord read_problem(std::string_view text, const std::string& file, int line);

/// Reads the lines of a file; blank lines are passed over.
RHEC_EXPORT std::vector<ProblemRecord> read_problems(std::string_view text, const std::string& file);

/// A record as a line of a problem file of the newest version (without the line end). Numbers are written so that
/// reading them gives the same bits; one that is not finite where the format demands it is written as null, which
/// reading then refuses.
RHEC_EXPORT std::string problem_line(const ProblemRecord& record);

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
