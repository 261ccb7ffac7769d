#pragma once

#include <vector>

#include "bench.hpp"

namespace rhec::sim {

/// Tightens a backend's option `tolerance` until the 99th percentile of the KKT residual is small enough; returns the
/// options to use and stores the outcome in `result`.
Settings tighten(const Host& host, const Backend& backend, double accuracy, const std::vector<Recorded>& records,
                 BackendAnswers& result);

}  // namespace rhec::sim
