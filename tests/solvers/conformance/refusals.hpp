#pragma once

// The refusals that docs/solvers.md allows.

#include <string>
#include <vector>

#include "rhec/core/config/settings.hpp"

namespace rhec::conformance {

/// A row of the table under the heading "Refusals".
struct AllowedRefusal {
  int line = 0;
  std::string solver;
  Settings options;     ///< with which it refuses; an empty map: with its default ones
  std::string problem;  ///< pattern (* and ?) of "<family> on <model>"
  std::string words;    ///< part of what `why_not` says
};

struct Documentation {
  std::vector<std::string> solvers;  ///< that have a section of their own
  std::vector<AllowedRefusal> refusals;

  bool knows(const std::string& solver) const;
};

/// Read from docs/solvers.md. Throws Error naming the line that cannot be read.
const Documentation& documentation();

std::string problem_name(const std::string& family, const std::string& model);
bool covers(const AllowedRefusal& refusal, const std::string& solver, const std::string& problem);

}  // namespace rhec::conformance
