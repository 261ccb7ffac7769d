#include "rhec/core/qp/riccati.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#include <fmt/format.h>

#include "rhec/core/base/assertion.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/core/base/with_size.hpp"
#include "rhec/core/kernels/kernel_sets.hpp"
#include "rhec/core/kernels/riccati_kernels.hpp"
#include "rhec/core/qp/small_matrix.hpp"

namespace rhec {

ActiveSet::ActiveSet(const Capacity& capacity)
    : capacity_(capacity),
      row_(capacity.row()),
      limit_row_(capacity.limit_row()),
      sides_(static_cast<std::size_t>(capacity.intervals + 1) * capacity.row(), 0),
      limits_(static_cast<std::size_t>(capacity.intervals + 1) * capacity.limit_row(), 0) {}

bool ActiveSet::is_empty() const noexcept {
  // Rows are padded to multiples of eight.
  std::uint64_t any = 0;
  for (std::size_t k = 0; k < sides_.size(); k += sizeof any) {
    std::uint64_t eight = 0;
    std::memcpy(&eight, sides_.data() + k, sizeof eight);
    any |= eight;
  }
  return any == 0;
}

void ActiveSet::clear() noexcept {
  for (auto* sides : {&sides_, &limits_}) std::fill(sides->begin(), sides->end(), std::int8_t{0});
}

Riccati::Riccati(const Capacity& capacity)
    : capacity_(capacity),
      ns_(capacity.states),
      nw_(capacity.controls),
      stride_(capacity.row()),
      width_(std::max(capacity.states, capacity.controls)),
      max_rows_(3 * capacity.states),
      kernels_(&riccati_kernels()) {
  if (width_ > max_width)
    throw Error(fmt::format("a stage has {} states and {} controls; the Riccati recursion takes at most {} of each",
                            ns_, nw_, max_width));
  // Node 0 is stored as one more special stage whose 'controls' are the initial state, so matrices have the larger of
  // the two widths.
  const auto stages = static_cast<std::size_t>(capacity.intervals) + 1;
  const std::size_t wide = width_, rows = max_rows_, row = stride_;
  P_.assign(stages * ns_ * row, 0.0);
  initial_inverse_.assign(ns_ * row, 0.0);
  for (auto* v : {&U_, &V_}) v->assign(stages * nw_ * row, 0.0);
  for (auto* v : {&closed_, &columns_}) v->assign(stages * 64, 0.0);
  inverse_.assign(stages * nw_, 0.0);
  for (auto* v : {&drift_, &g_, &p_}) v->assign(stages * row, 0.0);
  state_counts_.assign(stages, 0);
  control_counts_.assign(stages, 0);
  for (auto* v : {&is_special_, &fixes_control_, &has_gradient_}) v->assign(stages, 0);
  reductions_.resize(stages);
  for (auto* v : {&G_, &factor_, &T_}) v->assign(stages * wide * wide, 0.0);
  for (auto* v : {&L_, &K_, &Y_}) v->assign(stages * wide * ns_, 0.0);
  C_.assign(stages * rows * ns_, 0.0);
  eliminator_.assign(stages * rows * rows, 0.0);
  for (auto* v : {&pivot_row_, &pivot_column_, &left_row_}) v->assign(stages * rows, 0);
  for (auto* v : {&d_, &row_multipliers_}) v->assign(stages * rows, 0.0);
  for (auto* v : {&special_g_, &y0_, &k_}) v->assign(stages * wide, 0.0);
  work_.assign(2 * (ns_ + nw_) * row + 2 * rows * (wide + ns_) + 7 * wide * wide + 8 * wide + 4 * rows, 0.0);
}

namespace {

bool holds_any(const std::int8_t* sides, int count) noexcept {
  return std::any_of(sides, sides + count, [](std::int8_t side) { return side != 0; });
}

/// Whether all stages carry the same states.
bool carries_alike(const StageQp& qp) noexcept {
  const int N = qp.intervals(), states = qp.states(0);
  int differences = 0;
  for (int i = 0; i < N; ++i)
    differences |= (qp.states(i + 1) ^ states) | (qp.identity_counts()[i] ^ qp.identity_counts()[0]);
  return differences == 0 && states == qp.capacity().states;
}

static_assert(small::longest >= Riccati::max_width);

}  // namespace

RiccatiView Riccati::view_of(const StageQp& qp, const std::int8_t* sides) noexcept {
  return {.intervals = qp.intervals(),
          .states = ns_,
          .controls = nw_,
          .stride = stride_,
          .state_counts = state_counts_.data(),
          .control_counts = control_counts_.data(),
          .identity_counts = qp.identity_counts(),
          .AB = qp.AB(0),
          .H = qp.H(0),
          .h = qp.h(0),
          .b = qp.b(0),
          .lower = qp.lower(0),
          .upper = qp.upper(0),
          .sides = sides,
          .special = is_special_.data(),
          .for_steps = for_steps_,
          .P = P_.data(),
          .U = U_.data(),
          .V = V_.data(),
          .closed = closed_.data(),
          .T = columns_.data(),
          .inverse = inverse_.data(),
          .fixes = fixes_control_.data(),
          .drift = drift_.data(),
          .g = g_.data(),
          .p = p_.data()};
}

void Riccati::factor(const StageQp& qp, const ActiveSet& active, const double* diagonal) noexcept {
  for_steps_ = true;
  factor_stages(qp, active, diagonal);
}

void Riccati::factor_for_covariances(const StageQp& qp, const ActiveSet& active) noexcept {
  for_steps_ = false;
  factor_stages(qp, active, nullptr);
}

/// Sizes, and the value function of the last node.
RiccatiView Riccati::begin_factor(const StageQp& qp, const ActiveSet& active, const double* diagonal) noexcept {
  RHEC_ASSERT(qp.capacity() == capacity_ && qp.window() == 0, "a whole QP of the capacity");
  const int N = qp.intervals(), n = qp.states(N);
  convexified_ = false;
  std::copy_n(qp.state_counts(), N + 1, state_counts_.data());
  std::copy_n(qp.control_counts(), N, control_counts_.data());
  control_counts_[N] = 0;
  std::fill_n(is_special_.data(), N + 1, std::uint8_t{0});
  RiccatiView view = view_of(qp, active.row(0));
  view.diagonal = diagonal;
  std::copy_n(qp.H(N), n * stride_, P(N));
  for (int c = 0; diagonal && c < n; ++c)
    P(N)[c * stride_ + c] += diagonal[static_cast<std::ptrdiff_t>(N) * stride_ + c];
  return view;
}

void Riccati::factor_stages(const StageQp& qp, const ActiveSet& active, const double* diagonal) noexcept {
  const RiccatiView view = begin_factor(qp, active, diagonal);
  const int N = qp.intervals();
  // A stage is special if bounds of the next state are active, which its controls must satisfy.
  if (!active.is_empty())
    for (int i = 0; i < N; ++i) is_special_[i] = holds_any(active.state(i + 1), ns_);
  int left = 0;
  for (int i = kernels_->factor(view, N - 1, definite_tolerance); i >= 0;
       i = kernels_->factor(view, i - 1, definite_tolerance)) {
    Reduction& reduction = reductions_[i];
    const bool follows_special = i + 1 < N && is_special_[i + 1] != 0;
    left = follows_special ? reductions_[i + 1].left : 0;
    reduction = {};
    reduction.rows = count_active(qp, active, i + 1) + left;
    write_active_rows(qp, active, i + 1);
    is_special_[i] = 1;
    factor_special(qp, active, view, i);
    if (i > 0 && reduction.left > 0) is_special_[i - 1] = 1;
  }
  factor_node_0(qp, active);
}

void Riccati::factor_node_0(const StageQp& qp, const ActiveSet& active) noexcept {
  const int N = qp.intervals();
  Reduction& initial = reductions_[N];
  initial = {};
  initial.rows = count_active(qp, active, 0) + (N > 0 && is_special_[0] != 0 ? reductions_[0].left : 0);
  write_active_rows(qp, active, 0);
  if (!qp.initial_state_is_given) factor_initial(qp, active);
}

bool Riccati::factor_if_convex(const StageQp& qp, const ActiveSet& active) noexcept {
  for_steps_ = true;
  const RiccatiView view = begin_factor(qp, active, nullptr);
  if (kernels_->factor(view, qp.intervals() - 1, definite_tolerance) >= 0) return false;
  factor_node_0(qp, active);
  return !convexified_;
}

bool Riccati::convexify(StageQp& qp, const ActiveSet& no_bounds) noexcept {
  for_steps_ = true;
  RiccatiView view = begin_factor(qp, no_bounds, nullptr);
  view.own_H = qp.H(0);
  view.is_reflected = &convexified_;
  double* const formed = work_.data();
  double* const reduced = formed + static_cast<std::ptrdiff_t>(ns_ + nw_) * stride_;
  double* const factor = reduced + static_cast<std::ptrdiff_t>(width_) * width_;
  for (int i = qp.intervals() - 1, last = -1; i >= 0; last = i) {
    i = kernels_->factor(view, i, definite_tolerance);
    if (i < 0) break;
    if (i == last) return false;
    const int m = qp.controls(i);
    kernels_->form(view, i, formed);
    for (int c = 0; c < m; ++c) std::copy_n(formed + (ns_ + c) * stride_ + ns_, m, reduced + c * width_);
    factor_reduced(reduced, m, definite_tolerance, factor);
    write_change(reduced, factor, i, qp);
  }
  factor_node_0(qp, no_bounds);
  return true;
}

Riccati::Outcome Riccati::solve(const StageQp& qp, const ActiveSet& active, Iterate& step, const double* h) noexcept {
  const int N = qp.intervals();
  if (!h) h = qp.h(0);
  if (!for_steps_) factor(qp, active);
  RiccatiView view = view_of(qp, active.row(0));
  view.h = h;
  view.values = step.row(0);
  view.costates = step.costate(0);
  view.bounds = step.bound_row(0);
  const double* last = h + static_cast<std::ptrdiff_t>(N) * stride_;
  std::copy_n(last, stride_, p(N));
  for (int i = kernels_->solve_backward(view, N - 1); i >= 0; i = kernels_->solve_backward(view, i - 1)) {
    write_active_bounds(qp, active, i + 1);
    if (!solve_special_backward(qp, active, h, i)) return Outcome::inconsistent;
  }
  write_active_bounds(qp, active, 0);
  const std::ptrdiff_t entries = static_cast<std::ptrdiff_t>(N + 1) * stride_;
  std::fill_n(step.row(0), entries, 0.0);
  std::fill_n(step.bound_row(0), entries, 0.0);
  if (!solve_initial(qp, active, step)) return Outcome::inconsistent;
  for (int i = kernels_->solve_forward(view, 0); i < N; i = kernels_->solve_forward(view, i + 1))
    solve_special_forward(qp, active, step, i);
  return Outcome::done;
}

Riccati::Sensitivities::Sensitivities(const Capacity& capacity) {
  const std::size_t stages = static_cast<std::size_t>(capacity.intervals) + 1;
  values.assign(stages * (capacity.row() + capacity.limit_row()) * size, 0.0);
  if (capacity.limits == 0) costates.assign(stages * capacity.row() * size, 0.0);
  control_counts.assign(capacity.intervals, 0);
}

bool Riccati::find_sensitivities(const StageQp& qp, const ActiveSet& active, const Entry* gradients, int count,
                                 Sensitivities& sensitivities) noexcept {
  constexpr int size = Sensitivities::size;
  static_assert(size == response_batch);
  const int N = qp.intervals(), n = qp.states(0);
  const auto is_set = [](std::uint8_t flag) { return flag != 0; };
  if (std::any_of(is_special_.data(), is_special_.data() + N, is_set) || reductions_[N].rows > 0) return false;
  double* const values = sensitivities.values.data();
  double* const costates = sensitivities.costates.empty() ? nullptr : sensitivities.costates.data();
  // Entries that stages do not use stay zero.
  if (!std::equal(qp.control_counts(), qp.control_counts() + N, sensitivities.control_counts.begin()) ||
      (qp.has_limits() && sensitivities.intervals != N)) {
    sensitivities.intervals = N;
    for (auto* v : {&sensitivities.values, &sensitivities.costates}) std::fill(v->begin(), v->end(), 0.0);
    std::copy_n(qp.control_counts(), N, sensitivities.control_counts.begin());
  }
  int last = 0;
  for (int c = 0; c < count; ++c) last = std::max(last, gradients[c].stage);
  std::fill_n(has_gradient_.data(), N + 1, std::uint8_t{0});
  const auto clear = [&](int stage) {
    const std::size_t entries = static_cast<std::size_t>(ns_ + qp.controls(stage)) * size;
    std::memset(values + static_cast<std::ptrdiff_t>(stage) * stride_ * size, 0, entries * sizeof(double));
  };
  for (int c = 0; c < count; ++c) {
    const auto [stage, place, row] = gradients[c];
    if (has_gradient_[stage] == 0) clear(stage);
    has_gradient_[stage] = 1;
    double* entries = values + static_cast<std::ptrdiff_t>(stage) * stride_ * size + c;
    if (!row) {
      entries[place * size] = 1.0;
      continue;
    }
    for (int j = 0; j < ns_ + qp.controls(stage); ++j) entries[j * size] = row[j];
  }
  RiccatiView view = view_of(qp, active.row(0));
  view.keeps_carried = qp.initial_state_is_given && !costates && carries_alike(qp);
  kernels_->sensitivities_backward(view, last, has_gradient_.data(), values);
  if (qp.initial_state_is_given) {
    if (costates) std::copy_n(values, n * size, costates);
    std::fill_n(values, n * size, 0.0);
  } else if (std::fill_n(costates, costates ? n * size : 0, 0.0); has_initial_inverse_) {
    kernels_->answer(initial_inverse_.data(), n, stride_, values);
  } else {
    // Multiplies the gradients by -(G G')^-1, with the factor's lower triangle.
    const double* G = special(N).factor;
    const auto row = [values](int j) { return values + static_cast<std::ptrdiff_t>(j) * size; };
    const auto subtract = [&row](int from, int other, double factor) {
      for (int c = 0; c < size; ++c) row(from)[c] -= row(other)[c] * factor;
    };
    const auto scale = [&row](int j, double factor) {
      for (int c = 0; c < size; ++c) row(j)[c] *= factor;
    };
    for (int j = 0; j < n; ++j) {
      for (int k = 0; k < j; ++k) subtract(j, k, G[k * width_ + j]);
      scale(j, 1.0 / G[j * width_ + j]);
    }
    for (int j = n - 1; j >= 0; --j) {
      for (int k = j + 1; k < n; ++k) subtract(j, k, -G[j * width_ + k]);
      scale(j, -1.0 / G[j * width_ + j]);
    }
  }
  kernels_->sensitivities_forward(view, last, values, costates);
  return true;
}

void Riccati::combine(const StageQp& qp, const ActiveSet& active, const Sensitivities& sensitivities,
                      const double* weights, Iterate& step) noexcept {
  RHEC_ASSERT(!sensitivities.costates.empty(), "sensitivities of costates");
  const long entries = static_cast<long>(qp.intervals() + 1) * stride_;
  const auto each_fixed = [&](const auto& function) {
    for (int i = 0; i < qp.intervals(); ++i) {
      if (fixes_control_[i] == 0) continue;
      for (int j = 0; j < qp.controls(i); ++j)
        if (const std::int8_t side = active.control(i)[j]; side != 0) function(i, j, side);
    }
  };
  // For fixed controls, the sensitivities are those of the multipliers.
  each_fixed([&](int i, int j, std::int8_t /*side*/) { step.control(i)[j] = step.control_bound(i)[j]; });
  kernels_->combine(sensitivities.values.data(), weights, step.row(0), entries);
  kernels_->combine(sensitivities.costates.data(), weights, step.costate(0), entries);
  each_fixed([&](int i, int j, std::int8_t side) {
    step.control_bound(i)[j] = step.control(i)[j];
    step.control(i)[j] = (side < 0 ? qp.control_lower(i) : qp.control_upper(i))[j];
  });
}

void Riccati::add_values(const Sensitivities& sensitivities, const double* weights, int places,
                         double* sums) const noexcept {
  kernels_->combine(sensitivities.values.data(), weights, sums, places);
}

void Riccati::feedback(const StageQp& qp, int i, const double* s, double* w) noexcept {
  const int n = qp.states(i), m = qp.controls(i);
  if (is_special_[i] == 0) {
    for (int k = 0; k < m; ++k) {
      const double* policy = V_.data() + (static_cast<std::ptrdiff_t>(i) * nw_ + k) * stride_;
      w[k] = p(i)[ns_ + k];
      for (int j = 0; j < n; ++j) w[k] -= policy[j] * s[j];
    }
    return;
  }
  const Special v = special(i);
  const Reduction& reduction = reductions_[i];
  const int f = reduction.free;
  double free_step[max_width];
  const double* k = k_.data() + i * width_;
  for (int j = 0; j < f; ++j) free_step[j] = -k[j];
  for (int c = 0; c < n; ++c)
    for (int j = 0; j < f; ++j) free_step[j] -= v.K[c * width_ + j] * s[c];
  if (reduction.plain) {
    std::copy_n(free_step, m, w);
    return;
  }
  std::copy_n(y0_.data() + i * width_, m, w);
  small::add_product(v.T, width_, free_step, w, m, f);
  small::add_product(v.Y, width_, s, w, m, n);
}

bool Riccati::filter_covariance(const StageQp& qp, double* last) noexcept {
  const int N = qp.intervals(), n0 = qp.states(0), n = qp.states(N);
  std::copy_n(qp.state_counts(), N + 1, state_counts_.data());
  std::copy_n(qp.control_counts(), N, control_counts_.data());
  control_counts_[N] = 0;
  double* const now = work_.data();
  if (!kernels_->invert(qp.H(0), n0, stride_, definite_tolerance, now)) return false;
  for (int k = 0; k < n0 * stride_; ++k) now[k] *= 2.0;
  if (!kernels_->filter_covariance(view_of(qp, nullptr), now)) return false;
  for (int c = 0; c < n; ++c)
    for (int r = 0; r < n; ++r) last[c * ns_ + r] = 0.5 * (now[c * stride_ + r] + now[r * stride_ + c]);
  return true;
}

void Riccati::covariances(const StageQp& qp, double* covariance, double* last) noexcept {
  const int N = qp.intervals(), n0 = qp.states(0), width = ns_ + nw_;
  // Covariance of z = [s; w] at a stage, and of the next state.
  double* now = work_.data();
  double* half = now + static_cast<std::ptrdiff_t>(width) * stride_;
  const Special initial = special(N);
  if (has_initial_inverse_) {
    // Whole rows: beyond the states they are zero.
    for (int k = 0; k < n0 * stride_; ++k) now[k] = 2.0 * initial_inverse_[k];
  } else {
    std::fill_n(now, n0 * stride_, 0.0);
    for (int c = 0; c < n0; ++c) {
      now[c * stride_ + c] = 2.0;
      small::solve(initial.factor, width_, n0, now + c * stride_);
    }
  }
  const auto store = [&](int node, double* target) {
    if (!target) return;
    with_size(qp.states(node), [&](auto n) {
      for (int c = 0; c < n; ++c)
        for (int r = 0; r < n; ++r) target[c * ns_ + r] = 0.5 * (now[c * stride_ + r] + now[r * stride_ + c]);
    });
  };
  store(0, covariance);
  const RiccatiView view = view_of(qp, nullptr);  // bounds are ignored
  for (int i = kernels_->carry_covariance(view, 0, now, covariance); i < N;
       i = kernels_->carry_covariance(view, i + 1, now, covariance)) {
    const int n = qp.states(i), n_next = qp.states(i + 1), m = qp.controls(i);
    add_special_controls(i, n, m, now);
    // [A B] Sigma [A B]'
    for (int l = 0; l < n_next; ++l) {
      const double* AB = qp.AB(i) + l * stride_;
      double* of_row = half + l * stride_;
      std::fill_n(of_row, width, 0.0);
      const auto add = [&](int j) {
        for (int c = 0; c < width; ++c) of_row[c] += AB[j] * now[j * stride_ + c];
      };
      for (int j = 0; j < n; ++j) add(j);
      for (int j = ns_; j < ns_ + m; ++j) add(j);
    }
    for (int c = 0; c < n_next; ++c) {
      const double* AB = qp.AB(i) + c * stride_;
      std::fill_n(now + c * stride_, stride_, 0.0);
      for (int r = 0; r < n_next; ++r) {
        double sum = 0.0;
        for (int j = 0; j < n; ++j) sum += half[r * stride_ + j] * AB[j];
        for (int j = ns_; j < ns_ + m; ++j) sum += half[r * stride_ + j] * AB[j];
        now[c * stride_ + r] = sum;
      }
    }
    if (covariance) store(i + 1, covariance + static_cast<std::ptrdiff_t>(i + 1) * ns_ * ns_);
  }
  store(N, last);
}

}  // namespace rhec
