#pragma once

#include <vector>

#include "bench.hpp"

namespace rhec::sim {

/// Tightens a backend's option `tolerance` until the residual is small enough at the 99th percentile of the problems;
/// returns the options to go on with, and puts into `result` what came of it.
Settings tighten(const Host& host, const Backend& backend, double accuracy, const std::vector<Recorded>& records,
                 BackendAnswers& result);

}  // namespace rhec::sim
