#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "rhec/core/base/export.hpp"

/// What a check of a model or a term found; docs/check.md explains each check.
namespace rhec::sim {

/// `skip`: nothing to check, or no way to check it.
enum class Verdict { pass, skip, warn, fail };
RHEC_EXPORT std::string_view word_of(Verdict verdict);

struct Finding {
  std::string check;  ///< of a model "description", "symmetry", "straight_motion", "integration", "derivatives",
                      ///< "numbers", "scaling", "observability" or "time"; of a term "description", "vehicle", "rows",
                      ///< "derivatives", "numbers" or "time"
  Verdict verdict = Verdict::pass;
  std::string where;                                    ///< the variable, entry or vehicle; empty: the whole
  std::string found;                                    ///< a phrase with numbers
  std::string advice;                                   ///< what to do; may be empty
  std::vector<std::pair<std::string, double>> numbers;  ///< the numbers in `found`, by name
};

RHEC_EXPORT int count_of(const std::vector<Finding>& findings, Verdict verdict);
/// fail or warn if there is such a finding, else pass.
RHEC_EXPORT Verdict verdict_of(const std::vector<Finding>& findings);

}  // namespace rhec::sim
