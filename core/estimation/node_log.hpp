#pragma once

#include <vector>

#include "rhec/core/estimation/smoother.hpp"
#include "rhec/core/horizon/rhe_problem.hpp"

namespace rhec {

/// Makes rows complete: those with a value that is not finite copy the row before them (at the start: the row after
/// them).
void fill_gaps(std::vector<double>& rows, int width);
/// The same column by column; one that is never known becomes 0.
void fill_columns(std::vector<double>& rows, int width);

/// What cannot be a measurement becomes missing.
void clean(NodeLog& log);

/// Copies outputs, those between nodes, durations and measured inputs of a log to a problem with as many intervals. The
/// problem's model may have further inputs behind the log's `inputs`: these are measured as 0.
void fill_data(const NodeLog& log, int inputs, RheProblem& problem);

}  // namespace rhec
