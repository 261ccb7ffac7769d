#include "rhec/core/sparse_nlp.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace rhec {

bool SparseNlp::take_structure(const Ocp& ocp) {
  const int N = ocp.intervals();
  const bool given = ocp.initial_state() != nullptr;
  const Capacity capacity = ocp.capacity();
  state_flags_.resize(static_cast<std::size_t>(capacity.states) * capacity.states);
  control_flags_.resize(static_cast<std::size_t>(capacity.states) * capacity.controls);
  // What tells structures apart: sizes, and the flags of each interval packed into words.
  next_signature_.assign({N, given ? 1 : 0, capacity.states, capacity.controls, ocp.state_count(0)});
  next_signature_.reserve(signature_.size());
  const auto pack = [&](const std::uint8_t* flags, int count) {
    for (int first = 0; first < count; first += 8) {
      // Eight bytes, of which any bit may be set, to eight bits.
      std::uint64_t eight = 0;
      std::memcpy(&eight, flags + first, std::min(count - first, 8));
      for (const int half : {4, 2, 1}) eight |= eight >> half;  // bits of the byte above stay above the lowest one
      eight &= 0x0101'0101'0101'0101U;
      next_signature_.push_back(static_cast<std::int32_t>((eight * 0x0102'0408'1020'4080U) >> 56));
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
    if (!to || start < 0) return;
    for (int j = 0; j < count; ++j) to[start + j] = from[j];
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
    if (!from || start < 0) return;
    for (int j = 0; j < count; ++j) to[j] = from[start + j];
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

void SparseNlp::constraints(const StageQp& qp, StageRange range, double* c) const noexcept {
  for (int i = range.first; i < std::min(range.last + 1, qp.intervals()); ++i)
    std::copy_n(qp.b(i), state_counts_[i + 1], c + constraint_starts_[i]);
}

void SparseNlp::gradient(const StageQp& qp, StageRange range, double* g) const noexcept {
  for (int i = range.first; i <= range.last; ++i) {
    if (state_starts_[i] >= 0) std::copy_n(qp.q(i), state_counts_[i], g + state_starts_[i]);
    if (i < qp.intervals()) std::copy_n(qp.r(i), control_counts_[i], g + control_starts_[i]);
  }
}

void SparseNlp::jacobian(const StageQp& qp, StageRange range, double* values) const noexcept {
  const auto gather = [&](const double* F, int column, int columns, bool begin_with_themselves) {
    const int* const sources = jacobian_sources_.data();
    for (const int end = column + columns; column < end; ++column) {
      int entry = jacobian_.starts[column];
      if (begin_with_themselves) values[entry++] = -1.0;
      for (const int last = jacobian_.starts[column + 1]; entry < last; ++entry) values[entry] = F[sources[entry]];
    }
  };
  for (int i = range.first; i <= range.last; ++i) {
    if (state_starts_[i] >= 0) gather(qp.F(i), state_starts_[i], state_counts_[i], i > 0);
    if (i < qp.intervals()) gather(qp.F(i), control_starts_[i], control_counts_[i], false);
  }
}

void SparseNlp::hessian(const StageQp& qp, StageRange range, double* values) const noexcept {
  const int ns = qp.capacity().states;
  const auto copy = [](const double* from, int count, double* to) {
    for (int j = 0; j < count; ++j) to[j] = from[j];
    return to + count;
  };
  for (int i = range.first; i <= range.last; ++i) {
    const int n = state_starts_[i] >= 0 ? state_counts_[i] : 0, m = i < qp.intervals() ? control_counts_[i] : 0;
    if (n + m == 0) continue;
    const double* H = qp.H(i);
    double* to = values + hessian_.starts[n > 0 ? state_starts_[i] : control_starts_[i]];
    for (int c = 0; c < n; ++c) {
      to = copy(H + c * qp.stride() + c, n - c, to);
      to = copy(H + c * qp.stride() + ns, m, to);
    }
    for (int c = 0; c < m; ++c) to = copy(H + (ns + c) * qp.stride() + ns + c, m - c, to);
  }
}

void SparseNlp::lagrangian_gradient(const double* gradient, const double* jacobian, const double* multipliers,
                                    double* sum) const noexcept {
  const int* const rows = jacobian_.row_indices.data();
  for (int column = 0, entry = 0; column < jacobian_.columns; ++column) {
    double pull = gradient[column];
    for (const int end = jacobian_.starts[column + 1]; entry < end; ++entry)
      pull += jacobian[entry] * multipliers[rows[entry]];
    sum[column] = pull;
  }
}

void SparseNlp::add_kkt(const Judged& point, KktTerms& terms) const noexcept {
  // Each largest value and each sum in parts, of which none waits for the others.
  constexpr int parts = 4;
  struct Part {
    double stationarity = 0.0, gradient = 0.0, bound_violation = 0.0, complementarity = 0.0;
    double rest = 0.0;  // stays 0 as long as all is finite
  };
  Part found[parts];
  const auto take = [](double& largest, double value) { largest = value > largest ? value : largest; };
  const auto look_at = [&](Part& part, int j) {
    const double bound = point.bound_multipliers[j], sum = point.lagrangian_gradient[j] + bound;
    part.rest += 0.0 * sum;
    take(part.stationarity, std::abs(sum));
    take(part.gradient, std::abs(point.gradient[j]));
    take(part.gradient, std::abs(bound));
    const double below = point.lower[j] - point.z[j], above = point.upper[j] - point.z[j];
    take(part.bound_violation, below);
    take(part.bound_violation, -above);
    // A multiplier at a bound that does not exist is as wrong as it is large.
    const double gap = std::abs(bound > 0.0 ? above : below);
    take(part.complementarity, std::abs(bound) * (gap < 1.0 ? gap : 1.0));
  };
  int j = 0;
  for (; j + parts <= variables(); j += parts)
    for (int k = 0; k < parts; ++k) look_at(found[k], j + k);
  for (; j < variables(); ++j) look_at(found[0], j);
  double defect = 0.0, costate = 0.0, rest = 0.0;
  for (int row = 0; row < constraints(); ++row) {
    rest += 0.0 * point.constraints[row];
    take(defect, std::abs(point.constraints[row]));
    take(costate, std::abs(point.multipliers[row]));
  }
  terms.add({rest, defect, 0.0, 0.0, costate});
  for (const Part& part : found)
    terms.add({part.stationarity + part.rest, 0.0, part.bound_violation, part.complementarity, part.gradient});
}

}  // namespace rhec
