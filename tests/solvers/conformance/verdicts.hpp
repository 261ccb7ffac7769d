#pragma once

// solver x problem x verdict: kept in a folder, a file for each solver and family, so that tests which run in processes
// of their own fill one table; compared with each other, printed, and written as text and JSON.

#include <filesystem>
#include <limits>
#include <string>
#include <vector>

namespace rhec::conformance {

struct Verdict {
  std::string solver, model, family;
  bool several_optima = false;
  unsigned seed = 0;
  std::string outcome;  ///< "solved", "infeasible" (and it is), "refused" or "failed"
  std::string reason;   ///< of a refusal or a failure
  std::string status;
  int iterations = 0;
  double residual = std::numeric_limits<double>::quiet_NaN();  ///< KKT, by the core
  double objective = std::numeric_limits<double>::quiet_NaN();
  double corrected = std::numeric_limits<double>::quiet_NaN();  ///< Assessment::corrected_objective
  double milliseconds = 0.0;
  double reference = std::numeric_limits<double>::quiet_NaN();  ///< objective that another program found
  std::vector<double> solution;                                 ///< scaled_primal
};

/// The folder of this run's verdicts: what RHEC_CONFORMANCE_FOLDER of the environment says, else beside the test's
/// executable.
std::filesystem::path verdict_folder();

void forget_verdicts();
/// Replaces what was kept of the solver, model and family of these verdicts, which is one and the same.
void keep_verdicts(const std::vector<Verdict>& verdicts);

/// Compares all that is kept, prints the table, and writes it to `verdicts.txt` and `verdicts.json` in the folder.
/// Returns how many failures it shows, ends in another optimum where there is but one included.
int report_verdicts();

}  // namespace rhec::conformance
