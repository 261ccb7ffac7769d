#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "rhec/core/estimation/arrival_cost.hpp"
#include "rhec/core/horizon/blocking.hpp"
#include "rhec/core/horizon/rhe_problem.hpp"

namespace rhec {

/// Marks, links and weighs the blocks of every parameter for a horizon, and finishes the problem. `first_starts` are
/// the absolute indices at which the horizon's first blocks really started (n_p): read for ramps that start at interval
/// 0, then overwritten. `begins` is workspace with one entry per interval.
void set_block_structure(const Window& window, const std::vector<std::shared_ptr<const Blocking>>& blockings,
                         const std::vector<ParameterWalk>& walks, std::vector<std::int64_t>& first_starts,
                         std::vector<std::uint8_t>& begins, RheProblem& problem) noexcept;

/// The parameters whose blocking gives one block for every horizon.
std::vector<int> one_block_parameters(const std::vector<std::shared_ptr<const Blocking>>& blockings);

}  // namespace rhec
