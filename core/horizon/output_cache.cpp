#include "output_cache.hpp"

#include <algorithm>

namespace rhec {

OutputCache::OutputCache(int nodes, std::ptrdiff_t outputs, std::ptrdiff_t jacobians)
    : output_size_(outputs), jacobian_size_(jacobians) {
  // Space for twice the nodes, so that rows are copied back to the front only once in many steps.
  outputs_.assign(2 * nodes * output_size_, 0.0);
  jacobians_.assign(2 * nodes * jacobian_size_, 0.0);
  for (auto* marks : {&is_known_, &is_clean_}) marks->assign(nodes, 0);
}

int OutputCache::mark_unknown(int node, int last, int& end) noexcept {
  const auto marks = is_known_.begin(), stop = marks + last + 1;
  auto mark = std::find(marks + node, stop, 0);
  const int first = static_cast<int>(mark - marks);
  while (mark != stop && *mark == 0) *mark++ = 1;
  end = static_cast<int>(mark - marks);
  return first;
}

void OutputCache::forget() noexcept { std::fill(is_known_.begin(), is_known_.end(), std::uint8_t{0}); }

int OutputCache::move_marks(int steps, int nodes) noexcept {
  const int kept = nodes - steps;
  for (auto* marks : {&is_known_, &is_clean_}) {
    std::copy_n(marks->begin() + steps, kept, marks->begin());
    std::fill(marks->begin() + kept, marks->end(), std::uint8_t{0});
  }
  return kept;
}

void OutputCache::move_rows(int steps, int kept) noexcept {
  const int nodes = static_cast<int>(is_known_.size());
  if (first_ + steps + nodes <= 2 * nodes) {
    first_ += steps;
    return;
  }
  const int from = first_ + steps;
  first_ = 0;
  std::copy_n(outputs_.data() + from * output_size_, kept * output_size_, outputs_.data());
  std::copy_n(jacobians_.data() + from * jacobian_size_, kept * jacobian_size_, jacobians_.data());
}

}  // namespace rhec
