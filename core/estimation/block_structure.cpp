#include "block_structure.hpp"

#include <algorithm>

namespace rhec {
namespace {

/// Process noise: each interval costs the square of its block's value; the horizon's first interval does so in the
/// arrival cost.
void weigh_blocks(int intervals, int parameter, double sigma, const std::vector<std::uint8_t>& begins,
                  RheProblem& problem) noexcept {
  for (int first = 0, end = 1; first < intervals; first = end++) {
    while (end < intervals && !begins[end]) ++end;
    const int counted = first == 0 ? end - 1 : end - first;
    problem.set_block_weight(first, parameter, counted / (sigma * sigma));
  }
}

}  // namespace

void set_block_structure(const Window& window, const std::vector<std::shared_ptr<const Blocking>>& blockings,
                         const std::vector<ParameterWalk>& walks, std::vector<std::int64_t>& first_starts,
                         std::vector<std::uint8_t>& begins, RheProblem& problem) noexcept {
  problem.set_intervals(window.intervals);
  for (std::size_t k = 0; k < blockings.size(); ++k) {
    const int j = static_cast<int>(k);
    const Blocking& blocking = *blockings[k];
    const bool ramp = blocking.transition() == Transition::ramp;
    const std::int64_t first_start = blocking.starts(window, begins.data());
    // A ramp can start at the start of the horizon, but not before the run itself.
    begins[0] = ramp && first_start == window.first && window.first > 0;
    problem.set_blocks(j, begins.data(), blocking.transition());
    if (const double sigma = walks[k].noise_sigma; sigma > 0.0) {
      weigh_blocks(window.intervals, j, sigma, begins, problem);
      first_starts[k] = first_start;
      continue;
    }
    std::int64_t block = begins[0] ? first_starts[k] : first_start;
    const double alone = walks[k].block_sigma;
    const auto sigma = blocking.neighbour_sigma();
    for (int i = 0; i < window.intervals; ++i) {
      if (!begins[i]) continue;
      const std::int64_t start = window.first + i;
      const double steps = std::max(1.0, static_cast<double>(start - block));
      problem.link(i, j, sigma ? *sigma * *sigma * steps : alone * alone);
      block = start;
    }
    first_starts[k] = first_start;
  }
  problem.finish();
}

std::vector<int> one_block_parameters(const std::vector<std::shared_ptr<const Blocking>>& blockings) {
  std::vector<int> found;
  for (std::size_t j = 0; j < blockings.size(); ++j)
    if (blockings[j]->is_one_block()) found.push_back(static_cast<int>(j));
  return found;
}

}  // namespace rhec
