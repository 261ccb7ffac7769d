#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "rhec/core/estimation/arrival_cost.hpp"
#include "rhec/core/horizon/blocking.hpp"
#include "rhec/core/horizon/rhe_problem.hpp"

namespace rhec {

/// Marks and links the blocks of every parameter for a window, and finishes the problem. `first_starts` are the
/// absolute indices at which the window's first blocks really started (n_p): read for the ramps that start at its edge,
/// then written anew. `begins` is workspace with an entry an interval.
void set_block_structure(const Window& window, const std::vector<std::shared_ptr<const Blocking>>& blockings,
                         const std::vector<ParameterWalk>& walks, std::vector<std::int64_t>& first_starts,
                         std::vector<std::uint8_t>& begins, RheProblem& problem) noexcept;

/// The parameters whose blocking makes one block of every window.
std::vector<int> one_block_parameters(const std::vector<std::shared_ptr<const Blocking>>& blockings);

}  // namespace rhec
