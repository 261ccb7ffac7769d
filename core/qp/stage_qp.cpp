#include "rhec/core/qp/stage_qp.hpp"

#include <algorithm>

#include "rhec/core/base/infinity.hpp"

namespace rhec {
StageQp::StageQp(const Capacity& capacity) : StageQp(capacity, capacity.intervals + 1) {
  window_ = 0;
  // Space for twice the stages, so that they are copied back to the front only once in many drops.
  for (auto* v : {&AB_, &H_, &h_, &b_, &G_, &limits_}) v->resize(2 * v->size(), 0.0);
}

StageQp::StageQp(const Capacity& capacity, int stages)
    : capacity_(capacity),
      stride_(capacity.row()),
      wide_(capacity.states + capacity.controls),
      window_(std::min(stages, capacity.intervals + 1)) {
  const auto nodes = static_cast<std::size_t>(capacity.intervals) + 1, held = static_cast<std::size_t>(window_);
  // Includes places behind the last stage, for a window that ends there.
  for (auto* counts : {&state_counts_, &control_counts_, &identity_counts_, &limit_counts_})
    counts->assign(nodes + held, 0);
  AB_.assign(held * capacity.states * stride_, 0.0);
  H_.assign(held * wide_ * stride_, 0.0);
  for (auto* v : {&h_, &b_}) v->assign(held * stride_, 0.0);
  lower_.assign(held * stride_, -infinity);
  upper_.assign(held * stride_, infinity);
  initial_step_.assign(stride_, 0.0);
  G_.assign(held * capacity.limits * stride_, 0.0);
  limits_.assign(held * rows_of_limits * capacity.limit_row(), 0.0);
}

void StageQp::look_at(int first) noexcept {
  // Each place keeps its content and the sizes of its former stage: `set_sizes` clears what is no longer used.
  for (auto* counts : {&state_counts_, &control_counts_, &limit_counts_}) {
    const auto held = counts->begin() - first_, end = held + window_;
    if (first > -first_)
      std::copy_backward(held, end, counts->begin() + first + window_);
    else
      std::copy(held, end, counts->begin() + first);
  }
  first_ = first_bounds_ = -first;
}

void StageQp::take_stages(const StageQp& from) noexcept {
  RHEC_ASSERT(capacity_ == from.capacity_ && window_ == 0 && from.window_ == 0, "whole QPs of one capacity");
  set_intervals(from.intervals_);
  initial_state_is_given = from.initial_state_is_given;
  first_ = first_bounds_ = 0;
  const int stages = intervals_ + 1;
  // Stage by stage: that is as much as fits into registers at a time, and the next one is fetched meanwhile.
  const auto take = [&](AlignedDoubles& to, const AlignedDoubles& of, int first, std::ptrdiff_t slot) {
    for (int i = 0; i < stages; ++i) std::copy_n(of.data() + (first + i) * slot, slot, to.data() + i * slot);
  };
  const std::ptrdiff_t row = stride_;
  take(AB_, from.AB_, from.first_, capacity_.states * row);
  take(H_, from.H_, from.first_, wide_ * row);
  take(h_, from.h_, from.first_, row);
  take(b_, from.b_, from.first_, row);
  take(lower_, from.lower_, from.first_bounds_, row);
  take(upper_, from.upper_, from.first_bounds_, row);
  std::copy(from.initial_step_.begin(), from.initial_step_.end(), initial_step_.begin());
  if (has_limits()) {
    take(G_, from.G_, from.first_, capacity_.limits * row);
    take(limits_, from.limits_, from.first_, static_cast<std::ptrdiff_t>(rows_of_limits) * capacity_.limit_row());
  }
  state_counts_ = from.state_counts_;
  control_counts_ = from.control_counts_;
  identity_counts_ = from.identity_counts_;
  limit_counts_ = from.limit_counts_;
}

void StageQp::drop_identity_rows() noexcept {
  if (window_ > 0)
    std::fill_n(identity_counts_.begin() - first_, window_, 0);
  else
    std::fill(identity_counts_.begin(), identity_counts_.end(), 0);
}

void StageQp::clear(int i) noexcept {
  std::fill_n(AB(i), capacity_.states * stride_, 0.0);
  std::fill_n(H(i), wide_ * stride_, 0.0);
  for (double* row : {h(i), b(i)}) std::fill_n(row, stride_, 0.0);
  std::fill_n(lower(i), stride_, -infinity);
  std::fill_n(upper(i), stride_, infinity);
}

void StageQp::clear_limits(int i) noexcept {
  std::fill_n(G(i), capacity_.limits * stride_, 0.0);
  std::fill_n(of_limits(i, 0), rows_of_limits * capacity_.limit_row(), 0.0);
}

void StageQp::drop_first(int stages) noexcept {
  const int kept = intervals_ + 1 - stages;
  const bool has_room = first_ + stages + capacity_.intervals < 2 * (capacity_.intervals + 1);
  const int first = has_room ? first_ + stages : 0;
  const auto move = [&](AlignedDoubles& v, std::ptrdiff_t slot) {
    // In pieces of some cache lines: processors start slowly on long copies.
    constexpr std::ptrdiff_t piece = 512;
    for (std::ptrdiff_t k = 0; !has_room && k < kept * slot; k += piece)
      std::copy_n(v.data() + (first_ + stages) * slot + k, std::min(piece, kept * slot - k), v.data() + k);
    // Includes what a longer horizon has left there.
    std::fill_n(v.data() + (first + kept) * slot, (capacity_.intervals + 1 - kept) * slot, 0.0);
  };
  const std::ptrdiff_t row = stride_;
  move(AB_, capacity_.states * row);
  move(H_, wide_ * row);
  for (auto* v : {&h_, &b_}) move(*v, row);
  if (has_limits()) {
    move(G_, capacity_.limits * row);
    move(limits_, static_cast<std::ptrdiff_t>(rows_of_limits) * capacity_.limit_row());
  }
  first_ = first;
  for (auto* counts : {&state_counts_, &control_counts_, &identity_counts_, &limit_counts_})
    std::copy_n(counts->data() + stages, kept, counts->data());
}

}  // namespace rhec
