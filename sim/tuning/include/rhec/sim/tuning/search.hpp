#pragma once

#include <atomic>
#include <functional>
#include <vector>

#include <Eigen/Core>

#include "rhec/core/base/export.hpp"

namespace rhec::sim {

/// Calls `work` for 0 to count - 1, on so many threads. What it throws is rethrown, once all threads are done.
RHEC_EXPORT void in_parallel(int count, int threads, const std::function<void(int)>& work);

/// A function to be maximised; several threads call it at once. What it throws ends the search.
using Objective = std::function<double(const Eigen::VectorXd& at)>;

struct SearchOptions {
  Eigen::VectorXd lower, upper, step;  ///< bounds, and the first step, of each coordinate
  int most_evaluations = 1000;         ///< for each start
  double tolerance = 0.01;             ///< of the objective: differences below it end the search
  int threads = 1;                     ///< the starts are shared among these
  /// Called after each evaluation, by any thread but by one at a time, with the best point so far.
  std::function<void(const Eigen::VectorXd& best, double value)> progress = {};
  std::function<bool()> stop = {};  ///< polled at each evaluation: true ends the search with the best point so far
};
struct Maximum {
  Eigen::VectorXd at;
  double value = 0.0;
  int evaluations = 0;
  bool stopped = false;  ///< by request
};

/// The largest of the maxima that are found from these starts, without derivatives: by quadratic models (BOBYQA; M. J.
/// D. Powell, The BOBYQA algorithm for bound constrained optimization without derivatives, Cambridge 2009), of a single
/// coordinate by simplices (Sbplx).
RHEC_EXPORT Maximum maximise(const Objective& objective, const std::vector<Eigen::VectorXd>& starts,
                             const SearchOptions& options);

}  // namespace rhec::sim
