#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "rhec/core/horizon/horizon_problem.hpp"
#include "rhec/plugins/host.hpp"
#include "rhec/sim/problem_file.hpp"

namespace rhec::bench {

/// ... and what does.
void set_newest(const HorizonProblem& from, HorizonProblem& to, std::span<double> scratch) noexcept;

}  // namespace rhec::bench
