#include "rhec/core/stage_qp.hpp"

namespace rhec {

StageQp::StageQp(const Capacity& capacity) : capacity_(capacity), ns_(capacity.states), nw_(capacity.controls) {
  const auto nodes = static_cast<std::size_t>(capacity.intervals) + 1;
  state_counts_.assign(nodes, 0);
  control_counts_.assign(nodes, 0);
  for (auto* v : {&A_, &Q_}) v->assign(nodes * ns_ * ns_, 0.0);
  for (auto* v : {&B_, &S_}) v->assign(nodes * ns_ * nw_, 0.0);
  R_.assign(nodes * nw_ * nw_, 0.0);
  for (auto* v : {&b_, &q_, &state_lower_, &state_upper_}) v->assign(nodes * ns_, 0.0);
  for (auto* v : {&r_, &control_lower_, &control_upper_}) v->assign(nodes * nw_, 0.0);
  initial_step_.assign(ns_, 0.0);
}

}  // namespace rhec
