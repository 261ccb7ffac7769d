#pragma once

#include <cmath>

#include "rhec/core/horizon/rhe_problem.hpp"

namespace rhec {

/// Whether an input of an interval was not measured.
inline bool lacks_inputs(const RheProblem& problem, int interval) noexcept {
  const double* const measured = problem.measured_input(interval);
  for (int j = 0; j < problem.model().input_count(); ++j)
    if (std::isnan(measured[j])) return true;
  return false;
}

/// Whether one of the window was not.
inline bool lacks_inputs(const RheProblem& problem) noexcept {
  for (int i = 0; i < problem.intervals(); ++i)
    if (lacks_inputs(problem, i)) return true;
  return false;
}

}  // namespace rhec
