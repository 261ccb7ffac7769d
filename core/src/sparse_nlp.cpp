#include "rhec/core/sparse_nlp.hpp"

#include <algorithm>

namespace rhec {

bool SparseNlp::take_structure(const Ocp& ocp) {
  const int N = ocp.intervals();
  const bool given = ocp.initial_state() != nullptr;
  const Capacity capacity = ocp.capacity();
  state_flags_.resize(static_cast<std::size_t>(capacity.states) * capacity.states);
  control_flags_.resize(static_cast<std::size_t>(capacity.states) * capacity.controls);
  // What tells structures apart: sizes, and the flags of each interval packed into words.
  next_signature_.assign({N, given ? 1 : 0, capacity.states, capacity.controls, ocp.state_count(0)});
  const auto pack = [&](const std::uint8_t* flags, int count) {
    for (int first = 0; first < count; first += 31) {
      std::int32_t word = 0;
      for (int k = first; k < std::min(count, first + 31); ++k) word |= (flags[k] ? 1 : 0) << (k - first);
      next_signature_.push_back(word);
    }
  };
  for (int i = 0; i < N; ++i) {
    const int n = ocp.state_count(i), m = ocp.control_count(i), next = ocp.state_count(i + 1);
    next_signature_.insert(next_signature_.end(), {m, next});
    ocp.mark_dynamics(i, state_flags_.data(), control_flags_.data());
    pack(state_flags_.data(), next * n);
    pack(control_flags_.data(), next * m);
  }
  if (next_signature_ == signature_) return false;
  std::swap(signature_, next_signature_);

  state_starts_.resize(N + 1);
  state_counts_.resize(N + 1);
  control_starts_.resize(N);
  control_counts_.resize(N);
  constraint_starts_.resize(N);
  int variable = 0, row = 0;
  for (int i = 0; i <= N; ++i) {
    state_counts_[i] = ocp.state_count(i);
    const bool is_variable = i > 0 || !given;
    state_starts_[i] = is_variable ? variable : -1;
    if (is_variable) variable += state_counts_[i];
    if (i == N) break;
    control_counts_[i] = ocp.control_count(i);
    control_starts_[i] = variable;
    variable += control_counts_[i];
    constraint_starts_[i] = row;
    row += ocp.state_count(i + 1);
  }
  jacobian_.rows = row;
  jacobian_.columns = variable;
  hessian_.rows = hessian_.columns = variable;
  for (Pattern* pattern : {&jacobian_, &hessian_}) {
    pattern->starts.assign(1, 0);
    pattern->row_indices.clear();
  }
  jacobian_sources_.clear();
  const auto end_column = [](Pattern& pattern) {
    pattern.starts.push_back(static_cast<int>(pattern.row_indices.size()));
  };
  const auto add = [&](int to_row, int source) {
    jacobian_.row_indices.push_back(to_row);
    jacobian_sources_.push_back(source);
  };
  const int ns = capacity.states, stride = capacity.row();
  for (int i = 0; i <= N; ++i) {
    const int n = state_starts_[i] >= 0 ? state_counts_[i] : 0, m = i < N ? control_counts_[i] : 0;
    const int next = i < N ? state_counts_[i + 1] : 0;
    const int stage = n > 0 ? state_starts_[i] : (i < N ? control_starts_[i] : variable);
    if (i < N) ocp.mark_dynamics(i, state_flags_.data(), control_flags_.data());
    const auto add_dynamics = [&](const std::uint8_t* flags, int column, int first) {
      for (int r = 0; r < next; ++r)
        if (flags[column * next + r]) add(constraint_starts_[i] + r, r * stride + first + column);
    };
    for (int c = 0; c < n; ++c) {
      if (i > 0) add(constraint_starts_[i - 1] + c, -1);
      add_dynamics(state_flags_.data(), c, 0);
      end_column(jacobian_);
    }
    for (int c = 0; c < m; ++c) {
      add_dynamics(control_flags_.data(), c, ns);
      end_column(jacobian_);
    }
    for (int c = 0; c < n + m; ++c) {
      for (int r = c; r < n + m; ++r) hessian_.row_indices.push_back(stage + r);
      end_column(hessian_);
    }
  }
  return true;
}

void SparseNlp::read(const Ocp& ocp, const Iterate& point, double* z, double* multipliers,
                     double* bound_multipliers) const noexcept {
  const auto copy = [](const double* from, int count, double* to, int start) {
    if (to && start >= 0) std::copy_n(from, count, to + start);
  };
  for (int i = 0; i <= ocp.intervals(); ++i) {
    copy(point.state(i), state_counts_[i], z, state_starts_[i]);
    copy(point.state_bound(i), state_counts_[i], bound_multipliers, state_starts_[i]);
    if (i == ocp.intervals()) break;
    copy(point.control(i), control_counts_[i], z, control_starts_[i]);
    copy(point.control_bound(i), control_counts_[i], bound_multipliers, control_starts_[i]);
    copy(point.costate(i + 1), state_counts_[i + 1], multipliers, constraint_starts_[i]);
  }
}

void SparseNlp::write(const Ocp& ocp, const double* z, const double* multipliers, const double* bound_multipliers,
                      Iterate& point) const noexcept {
  const auto copy = [](const double* from, int start, int count, double* to) {
    if (from && start >= 0) std::copy_n(from + start, count, to);
  };
  if (ocp.initial_state()) {
    std::copy_n(ocp.initial_state(), state_counts_[0], point.state(0));
    if (bound_multipliers) std::fill_n(point.state_bound(0), state_counts_[0], 0.0);
  }
  for (int i = 0; i <= ocp.intervals(); ++i) {
    copy(z, state_starts_[i], state_counts_[i], point.state(i));
    copy(bound_multipliers, state_starts_[i], state_counts_[i], point.state_bound(i));
    if (i == ocp.intervals()) break;
    copy(z, control_starts_[i], control_counts_[i], point.control(i));
    copy(bound_multipliers, control_starts_[i], control_counts_[i], point.control_bound(i));
    copy(multipliers, constraint_starts_[i], state_counts_[i + 1], point.costate(i + 1));
  }
}

void SparseNlp::set_costate_0(const StageQp& qp, Iterate& point) noexcept {
  for (int j = 0; j < qp.states(0); ++j) {
    double costate = 0.0;
    if (qp.initial_state_is_given) {
      costate = qp.q(0)[j] + point.state_bound(0)[j];
      if (qp.intervals() > 0)
        for (int r = 0; r < qp.states(1); ++r) costate += qp.F(0)[r * qp.stride() + j] * point.costate(1)[r];
    }
    point.costate(0)[j] = costate;
  }
}

void SparseNlp::bounds(const Ocp& ocp, double* lower, double* upper) const noexcept {
  for (int i = 0; i <= ocp.intervals(); ++i) {
    if (state_starts_[i] >= 0) {
      std::copy_n(ocp.state_lower(i), state_counts_[i], lower + state_starts_[i]);
      std::copy_n(ocp.state_upper(i), state_counts_[i], upper + state_starts_[i]);
    }
    if (i == ocp.intervals()) break;
    std::copy_n(ocp.control_lower(i), control_counts_[i], lower + control_starts_[i]);
    std::copy_n(ocp.control_upper(i), control_counts_[i], upper + control_starts_[i]);
  }
}

void SparseNlp::constraints(const Ocp& ocp, const double* defects, double* c) const noexcept {
  for (int i = 0; i < ocp.intervals(); ++i)
    std::copy_n(defects + static_cast<std::ptrdiff_t>(i) * ocp.capacity().states, state_counts_[i + 1],
                c + constraint_starts_[i]);
}

void SparseNlp::constraints(const StageQp& qp, double* c) const noexcept {
  for (int i = 0; i < qp.intervals(); ++i) std::copy_n(qp.b(i), state_counts_[i + 1], c + constraint_starts_[i]);
}

void SparseNlp::gradient(const StageQp& qp, double* g) const noexcept {
  for (int i = 0; i <= qp.intervals(); ++i) {
    if (state_starts_[i] >= 0) std::copy_n(qp.q(i), state_counts_[i], g + state_starts_[i]);
    if (i < qp.intervals()) std::copy_n(qp.r(i), control_counts_[i], g + control_starts_[i]);
  }
}

void SparseNlp::jacobian(const StageQp& qp, double* values) const noexcept {
  int entry = 0;
  const auto scatter = [&](const double* matrix, int column_start, int columns) {
    for (const int end = jacobian_.starts[column_start + columns]; entry < end; ++entry)
      values[entry] = jacobian_sources_[entry] >= 0 && matrix ? matrix[jacobian_sources_[entry]] : -1.0;
  };
  for (int i = 0; i <= qp.intervals(); ++i) {
    if (state_starts_[i] >= 0) scatter(i < qp.intervals() ? qp.F(i) : nullptr, state_starts_[i], state_counts_[i]);
    if (i < qp.intervals()) scatter(qp.F(i), control_starts_[i], control_counts_[i]);
  }
}

void SparseNlp::hessian(const StageQp& qp, double* values) const noexcept {
  const int ns = qp.capacity().states;
  for (int i = 0; i <= qp.intervals(); ++i) {
    const int n = state_starts_[i] >= 0 ? state_counts_[i] : 0, m = i < qp.intervals() ? control_counts_[i] : 0;
    const double* H = qp.H(i);
    for (int c = 0; c < n; ++c) {
      values = std::copy_n(H + c * qp.stride() + c, n - c, values);
      values = std::copy_n(H + c * qp.stride() + ns, m, values);
    }
    for (int c = 0; c < m; ++c) values = std::copy_n(H + (ns + c) * qp.stride() + ns + c, m - c, values);
  }
}

}  // namespace rhec
