#include "rhec/core/ocp/sparse_nlp.hpp"

#include <algorithm>
#include <cstring>

#include "rhec/core/base/infinity.hpp"

namespace rhec {
namespace {

/// Copies a row, which is short.
void copy(const double* from, int count, double* to) noexcept { std::memcpy(to, from, count * sizeof(double)); }

/// Repeats the columns of the last stage for the next one, with their rows further down.
void repeat_columns(SparseNlp::Pattern& pattern, int columns, int rows) {
  const auto first = static_cast<std::ptrdiff_t>(pattern.starts.size()) - 1 - columns;
  const int begin = pattern.starts[first], end = pattern.starts.back();
  for (int entry = begin; entry < end; ++entry) pattern.row_indices.push_back(pattern.row_indices[entry] + rows);
  for (int c = 1; c <= columns; ++c) pattern.starts.push_back(pattern.starts[first + c] + end - begin);
}

}  // namespace

bool SparseNlp::take_structure(const Ocp& ocp) {
  const int N = ocp.intervals();
  const bool given = ocp.initial_state() != nullptr;
  const Capacity capacity = ocp.capacity();
  const int most_rows = std::max(capacity.states, capacity.limits);
  state_flags_.resize(static_cast<std::size_t>(most_rows) * capacity.states);
  control_flags_.resize(static_cast<std::size_t>(most_rows) * capacity.controls);
  // A signature identifies a structure: sizes, and the flags of each interval packed into words.
  next_signature_.assign({N, given ? 1 : 0, capacity.states, capacity.controls, ocp.state_count(0)});
  next_signature_.reserve(signature_.size());
  const auto pack = [&](const std::uint8_t* flags, int count) {
    for (int first = 0; first < count; first += 8) {
      // Eight bytes with any bits set, to eight bits.
      std::uint64_t eight = 0;
      std::memcpy(&eight, flags + first, std::min(count - first, 8));
      for (const int half : {4, 2, 1}) eight |= eight >> half;  // lowest bits get only those of their byte
      eight &= 0x0101'0101'0101'0101U;
      next_signature_.push_back(static_cast<std::int32_t>((eight * 0x0102'0408'1020'4080U) >> 56));
    }
  };
  const bool is_limited = capacity.limits > 0;
  if (is_limited) next_signature_.push_back(capacity.limits);
  const auto pack_limits = [&](int i) {
    const int limits = ocp.limit_count(i);
    next_signature_.push_back(limits);
    if (limits == 0) return;
    ocp.mark_limits(i, state_flags_.data(), control_flags_.data());
    pack(state_flags_.data(), limits * ocp.state_count(i));
    if (i < N) pack(control_flags_.data(), limits * ocp.control_count(i));
  };
  words_.clear();
  for (int i = 0; i < N; ++i) {
    const int n = ocp.state_count(i), m = ocp.control_count(i), next = ocp.state_count(i + 1);
    words_.push_back(static_cast<int>(next_signature_.size()));
    next_signature_.insert(next_signature_.end(), {m, next});
    ocp.mark_dynamics(i, state_flags_.data(), control_flags_.data());
    pack(state_flags_.data(), next * n);
    pack(control_flags_.data(), next * m);
    if (is_limited) pack_limits(i);
  }
  words_.push_back(static_cast<int>(next_signature_.size()));
  if (is_limited) pack_limits(N);
  if (next_signature_ == signature_) return false;
  std::swap(signature_, next_signature_);

  state_starts_.resize(N + 1);
  state_counts_.resize(N + 1);
  control_starts_.resize(N);
  control_counts_.resize(N);
  constraint_starts_.resize(N);
  limit_starts_.resize(N + 1);
  limit_counts_.assign(N + 1, 0);
  int variable = 0, row = 0;
  for (int i = 0; i <= N; ++i) {
    state_counts_[i] = ocp.state_count(i);
    const bool is_variable = i > 0 || !given;
    state_starts_[i] = is_variable ? variable : -1;
    if (is_variable) variable += state_counts_[i];
    if (i < N) {
      control_counts_[i] = ocp.control_count(i);
      control_starts_[i] = variable;
      variable += control_counts_[i];
      constraint_starts_[i] = row;
      row += ocp.state_count(i + 1);
    }
    limit_starts_[i] = row;
    if (is_limited) limit_counts_[i] = ocp.limit_count(i);
    row += limit_counts_[i];
  }
  jacobian_.rows = row;
  jacobian_.columns = variable;
  hessian_.rows = hessian_.columns = variable;
  for (Pattern* pattern : {&jacobian_, &hessian_}) {
    pattern->starts.assign(1, 0);
    pattern->row_indices.clear();
  }
  jacobian_sources_.clear();
  hessian_sources_.clear();
  const auto end_column = [](Pattern& pattern) {
    pattern.starts.push_back(static_cast<int>(pattern.row_indices.size()));
  };
  const auto add = [&](int to_row, int source) {
    jacobian_.row_indices.push_back(to_row);
    jacobian_sources_.offsets.push_back(source);
  };
  const int ns = capacity.states, stride = capacity.row();
  for (int i = 0; i <= N; ++i) {
    const int n = state_starts_[i] >= 0 ? state_counts_[i] : 0, m = i < N ? control_counts_[i] : 0;
    const int next = i < N ? state_counts_[i + 1] : 0, limits = limit_counts_[i];
    if (is_like_before(i)) {
      repeat_columns(jacobian_, n + m, n + limits);
      repeat_columns(hessian_, n + m, n + m);
      jacobian_sources_.repeat_stage();
      hessian_sources_.repeat_stage();
      continue;
    }
    const int stage = n > 0 ? state_starts_[i] : (i < N ? control_starts_[i] : variable);
    if (i < N) ocp.mark_dynamics(i, state_flags_.data(), control_flags_.data());
    if (limits > 0) {
      limit_state_flags_.resize(static_cast<std::size_t>(limits) * state_counts_[i]);
      limit_control_flags_.resize(static_cast<std::size_t>(limits) * m);
      ocp.mark_limits(i, limit_state_flags_.data(), limit_control_flags_.data());
    }
    const auto add_limits = [&](const std::vector<std::uint8_t>& flags, int column, int first) {
      for (int r = 0; r < limits; ++r)
        if (flags[column * limits + r]) add(limit_starts_[i] + r, ~(r * stride + first + column));
    };
    const auto add_dynamics = [&](const std::uint8_t* flags, int column, int first) {
      for (int r = 0; r < next; ++r)
        if (flags[column * next + r]) add(constraint_starts_[i] + r, r * stride + first + column);
    };
    for (int c = 0; c < n; ++c) {
      if (i > 0) add(constraint_starts_[i - 1] + c, 0);  // entry of s_i itself, known to `jacobian`
      add_dynamics(state_flags_.data(), c, 0);
      add_limits(limit_state_flags_, c, 0);
      end_column(jacobian_);
    }
    for (int c = 0; c < m; ++c) {
      add_dynamics(control_flags_.data(), c, ns);
      add_limits(limit_control_flags_, c, ns);
      end_column(jacobian_);
    }
    const auto place = [&](int k) { return k < n ? k : ns + k - n; };  // column in the stage's rows
    for (int c = 0; c < n + m; ++c) {
      for (int r = c; r < n + m; ++r) {
        hessian_.row_indices.push_back(stage + r);
        hessian_sources_.offsets.push_back(place(c) * stride + place(r));
      }
      end_column(hessian_);
    }
    jacobian_sources_.end_stage();
    hessian_sources_.end_stage();
  }
  return true;
}

/// Whether a stage's columns repeat those of the stage before: equal stages between equal neighbours.
bool SparseNlp::is_like_before(int i) const noexcept {
  const int N = static_cast<int>(control_counts_.size());
  if (i < 2 || i == N) return false;
  const int n = state_counts_[i];
  if (state_counts_[i - 2] != n || state_counts_[i - 1] != n || state_counts_[i + 1] != n) return false;
  if (limit_counts_[i - 2] != limit_counts_[i - 1]) return false;
  const auto words = signature_.begin();
  return std::equal(words + words_[i - 1], words + words_[i], words + words_[i], words + words_[i + 1]);
}

void SparseNlp::Sources::clear() noexcept {
  offsets.clear();
  firsts.clear();
  starts.assign(1, 0);
}

/// Closes a stage whose entries were appended to the list.
void SparseNlp::Sources::end_stage() {
  const int shared = firsts.empty() ? 0 : firsts.back() + starts.back() - starts[starts.size() - 2];
  firsts.push_back(shared);
  starts.push_back(starts.back() + static_cast<int>(offsets.size()) - shared);
}

/// Adds a stage with the same entries as the last one.
void SparseNlp::Sources::repeat_stage() {
  firsts.push_back(firsts.back());
  starts.push_back(2 * starts.back() - starts[starts.size() - 2]);
}

void SparseNlp::Sources::gather(const double* rows, int stage, double* __restrict values) const noexcept {
  const int* const from = offsets.data() + firsts[stage];
  const int count = starts[stage + 1] - starts[stage];
  values += starts[stage];
  for (int k = 0; k < count; ++k) values[k] = rows[from[k]];
}

void SparseNlp::Sources::gather(const double* rows, const double* limits, int stage,
                                double* __restrict values) const noexcept {
  const int* const from = offsets.data() + firsts[stage];
  const int count = starts[stage + 1] - starts[stage];
  values += starts[stage];
  for (int k = 0; k < count; ++k) values[k] = from[k] >= 0 ? rows[from[k]] : limits[~from[k]];
}

// State and control of a stage are contiguous in z, and in a row if the state has the capacity's size.

void SparseNlp::read(const Ocp& ocp, const Iterate& iterate, double* z, double* multipliers,
                     double* bound_multipliers) const noexcept {
  const int ns = ocp.capacity().states;
  for (int i = 0; i <= ocp.intervals(); ++i) {
    const int n = state_starts_[i] >= 0 ? state_counts_[i] : 0, m = i < ocp.intervals() ? control_counts_[i] : 0;
    const int start = n > 0 ? state_starts_[i] : m > 0 ? control_starts_[i] : 0;
    const auto take = [&](const double* row, double* to) {
      if (!to) return;
      copy(row, n == ns ? n + m : n, to + start);
      if (n != ns) copy(row + ns, m, to + start + n);
    };
    take(iterate.row(i), z);
    take(iterate.bound_row(i), bound_multipliers);
    if (multipliers && i > 0) copy(iterate.costate(i), state_counts_[i], multipliers + constraint_starts_[i - 1]);
    if (multipliers && limit_counts_[i] > 0)
      copy(iterate.limit_bound(i), limit_counts_[i], multipliers + limit_starts_[i]);
  }
}

void SparseNlp::write(const Ocp& ocp, StageRange range, const double* z, const double* multipliers,
                      const double* bound_multipliers, Iterate& iterate) const noexcept {
  const int ns = ocp.capacity().states;
  if (range.first == 0 && ocp.initial_state()) {
    copy(ocp.initial_state(), state_counts_[0], iterate.state(0));
    if (bound_multipliers) std::fill_n(iterate.state_bound(0), state_counts_[0], 0.0);
  }
  for (int i = range.first; i <= range.last; ++i) {
    const int n = state_starts_[i] >= 0 ? state_counts_[i] : 0, m = i < ocp.intervals() ? control_counts_[i] : 0;
    const int start = n > 0 ? state_starts_[i] : m > 0 ? control_starts_[i] : 0;
    const auto put = [&](const double* from, double* row) {
      if (!from) return;
      copy(from + start, n == ns ? n + m : n, row);
      if (n != ns) copy(from + start + n, m, row + ns);
    };
    put(z, iterate.row(i));
    put(bound_multipliers, iterate.bound_row(i));
    if (multipliers && i > 0) copy(multipliers + constraint_starts_[i - 1], state_counts_[i], iterate.costate(i));
    if (multipliers && limit_counts_[i] > 0)
      copy(multipliers + limit_starts_[i], limit_counts_[i], iterate.limit_bound(i));
  }
}

void SparseNlp::set_costate_0(const StageQp& qp, Iterate& iterate) noexcept {
  for (int j = 0; j < qp.states(0); ++j) {
    double costate = 0.0;
    if (qp.initial_state_is_given) {
      costate = qp.q(0)[j] + iterate.state_bound(0)[j];
      if (qp.intervals() > 0)
        for (int r = 0; r < qp.states(1); ++r) costate += qp.AB(0)[r * qp.stride() + j] * iterate.costate(1)[r];
      for (int r = 0; r < qp.limits(0); ++r) costate += qp.G(0)[r * qp.stride() + j] * iterate.limit_bound(0)[r];
    }
    iterate.costate(0)[j] = costate;
  }
}

void SparseNlp::bounds(const Ocp& ocp, double* lower, double* upper) const noexcept {
  for (int i = 0; i <= ocp.intervals(); ++i) {
    if (state_starts_[i] >= 0) {
      copy(ocp.state_lower(i), state_counts_[i], lower + state_starts_[i]);
      copy(ocp.state_upper(i), state_counts_[i], upper + state_starts_[i]);
    }
    if (i == ocp.intervals()) break;
    copy(ocp.control_lower(i), control_counts_[i], lower + control_starts_[i]);
    copy(ocp.control_upper(i), control_counts_[i], upper + control_starts_[i]);
  }
}

void SparseNlp::row_bounds(const Ocp& ocp, double* lower, double* upper, double* linear,
                           double* quadratic) const noexcept {
  for (double* row : {lower, upper, quadratic}) std::fill_n(row, jacobian_.rows, 0.0);
  std::fill_n(linear, jacobian_.rows, infinity);
  for (int i = 0; i <= ocp.intervals(); ++i) {
    const int count = limit_counts_[i], start = limit_starts_[i];
    if (count == 0) continue;
    copy(ocp.limit_lower(i), count, lower + start);
    copy(ocp.limit_upper(i), count, upper + start);
    copy(ocp.limit_linear(i), count, linear + start);
    copy(ocp.limit_quadratic(i), count, quadratic + start);
  }
}

void SparseNlp::constraints(const Ocp& ocp, const double* defects, const double* values, double* c) const noexcept {
  for (int i = 0; i < ocp.intervals(); ++i, defects += ocp.capacity().states)
    copy(defects, state_counts_[i + 1], c + constraint_starts_[i]);
  if (values) limits(ocp, values, c);
}

void SparseNlp::limits(const Ocp& ocp, const double* values, double* c) const noexcept {
  for (int i = 0; i <= ocp.intervals(); ++i, values += ocp.capacity().limit_row())
    if (limit_counts_[i] > 0) copy(values, limit_counts_[i], c + limit_starts_[i]);
}

void SparseNlp::constraints(const StageQp& qp, StageRange range, double* c) const noexcept {
  for (int i = range.first; i < std::min(range.last + 1, qp.intervals()); ++i)
    copy(qp.b(i), state_counts_[i + 1], c + constraint_starts_[i]);
}

void SparseNlp::gradient(const StageQp& qp, StageRange range, double* g) const noexcept {
  for (int i = range.first; i <= range.last; ++i) {
    if (state_starts_[i] >= 0) copy(qp.q(i), state_counts_[i], g + state_starts_[i]);
    if (i < qp.intervals()) copy(qp.r(i), control_counts_[i], g + control_starts_[i]);
  }
}

void SparseNlp::jacobian(const StageQp& qp, StageRange range, double* values) const noexcept {
  for (int i = range.first; i <= range.last; ++i) {
    if (qp.has_limits())
      jacobian_sources_.gather(qp.AB(i), qp.G(i), i, values);
    else
      jacobian_sources_.gather(qp.AB(i), i, values);
    // Columns of states begin with the entry of s_i itself, in the equation that leads to it.
    const int* const starts = jacobian_.starts.data() + state_starts_[i];
    for (int c = 0; i > 0 && c < state_counts_[i]; ++c) values[starts[c]] = -1.0;
  }
}

void SparseNlp::hessian(const StageQp& qp, StageRange range, double* values) const noexcept {
  for (int i = range.first; i <= range.last; ++i) hessian_sources_.gather(qp.H(i), i, values);
}

}  // namespace rhec
