#include "rhec/core/stage_qp.hpp"

#include <algorithm>
#include <limits>

namespace rhec {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

}  // namespace

StageQp::StageQp(const Capacity& capacity)
    : capacity_(capacity), stride_(capacity.row()), wide_(capacity.states + capacity.controls) {
  const auto nodes = static_cast<std::size_t>(capacity.intervals) + 1;
  state_counts_.assign(nodes, 0);
  control_counts_.assign(nodes, 0);
  // Room for twice the stages, so that they move back to the front once in so many drops only.
  F_.assign(2 * nodes * capacity.states * stride_, 0.0);
  H_.assign(2 * nodes * wide_ * stride_, 0.0);
  h_.assign(nodes * stride_, 0.0);
  b_.assign(2 * nodes * stride_, 0.0);
  lower_.assign(nodes * stride_, -infinity);
  upper_.assign(nodes * stride_, infinity);
  initial_step_.assign(stride_, 0.0);
}

void StageQp::clear(int i) noexcept {
  std::fill_n(F(i), capacity_.states * stride_, 0.0);
  std::fill_n(H(i), wide_ * stride_, 0.0);
  for (double* row : {h(i), b(i)}) std::fill_n(row, stride_, 0.0);
  std::fill_n(lower(i), stride_, -infinity);
  std::fill_n(upper(i), stride_, infinity);
}

/// Of `rows` rows a stage: as far as there is room, stage 0 becomes another slot.
void StageQp::advance(AlignedDoubles& v, int& first, int rows, int stages) const noexcept {
  const std::ptrdiff_t slot = static_cast<std::ptrdiff_t>(rows) * stride_;
  if (first + stages + capacity_.intervals < 2 * (capacity_.intervals + 1)) {
    first += stages;
  } else {
    std::copy(v.data() + (first + stages) * slot, v.data() + (first + intervals_ + 1) * slot, v.data());
    first = 0;
  }
  std::fill_n(v.data() + (first + intervals_ + 1 - stages) * slot, stages * slot, 0.0);
}

void StageQp::drop_first(int stages, bool with_curvature) noexcept {
  const int kept = intervals_ + 1 - stages;
  advance(F_, first_F_, capacity_.states, stages);
  advance(b_, first_b_, 1, stages);
  if (with_curvature) {
    advance(H_, first_H_, wide_, stages);
    std::copy_n(H(kept - 1), wide_ * stride_, H(intervals_));  // of the last node, which stays the last one
  }
  std::copy_n(state_counts_.data() + stages, kept, state_counts_.data());
  std::copy_n(control_counts_.data() + stages, kept, control_counts_.data());
}

}  // namespace rhec
