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
  F_.assign(nodes * capacity.states * stride_, 0.0);
  H_.assign(nodes * wide_ * stride_, 0.0);
  for (auto* v : {&h_, &b_}) v->assign(nodes * stride_, 0.0);
  lower_.assign(nodes * stride_, -infinity);
  upper_.assign(nodes * stride_, infinity);
  initial_step_.assign(stride_, 0.0);
}

void StageQp::clear(int i) noexcept {
  std::fill_n(F(i), capacity_.states * stride_, 0.0);
  std::fill_n(b(i), stride_, 0.0);
  clear_costs(i);
}

void StageQp::clear_costs(int i) noexcept {
  std::fill_n(H(i), wide_ * stride_, 0.0);
  std::fill_n(h(i), stride_, 0.0);
  std::fill_n(lower(i), stride_, -infinity);
  std::fill_n(upper(i), stride_, infinity);
}

void StageQp::drop_first(int stages, bool with_curvature) noexcept {
  const int kept = intervals_ + 1 - stages;
  std::copy(F(stages), F(intervals_ + 1), F(0));
  std::copy(b(stages), b(intervals_ + 1), b(0));
  // The terminal cost stays where it is.
  if (with_curvature) std::copy(H(stages), H(intervals_), H(0));
  for (int i = 0; i < kept; ++i) {
    const int states = state_counts_[i + stages], controls = control_counts_[i + stages];
    if (!with_curvature && (states < state_counts_[i] || controls < control_counts_[i])) clear_costs(i);
    state_counts_[i] = states;
    control_counts_[i] = controls;
  }
}

}  // namespace rhec
