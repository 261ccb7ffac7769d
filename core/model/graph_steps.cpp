#include "graph_steps.hpp"

#include <utility>

namespace rhec {

void load_columns(const double* rows, int columns, int count, double* registers) noexcept {
  for (int c = 0; c < columns; ++c)
    for (int i = 0; i < GraphSteps::lanes; ++i)
      registers[c * GraphSteps::lanes + i] = rows[static_cast<std::ptrdiff_t>(std::min(i, count - 1)) * columns + c];
}

GraphSteps::GraphSteps(const Parts& parts, const Model::Intervals& request, double* memory) noexcept
    : p_(parts),
      q_(request),
      ramp_(is_ramp(request, parts.np)),
      nz_(parts.nx + parts.nu + parts.np + (ramp_ ? parts.np : 0)) {
  const auto take = [&](int size) { return std::exchange(memory, memory + static_cast<std::ptrdiff_t>(size) * lanes); };
  const int nx = p_.nx;
  z_ = take(nz_);
  h_ = take(1);
  x_ = take(nx);
  lambda_ = take(nx);
  next_ = take(nx);
  M_ = take(nx * nz_);
  M_next_ = take(nx * nz_);
  H_ = take(nz_ * nz_);
  product_ = take(nz_);
  registers_ = memory;
}

void GraphSteps::load(int first, int count) noexcept {
  count_ = count;
  const auto rows = [&](const double* array, int columns) {
    return array + static_cast<std::ptrdiff_t>(first) * columns;
  };
  load_columns(rows(q_.states, p_.nx), p_.nx, count, z_);
  if (p_.np) load_columns(rows(q_.parameters, p_.np), p_.np, count, z_ + p_.nx * lanes);
  if (p_.nu) load_columns(rows(q_.inputs, p_.nu), p_.nu, count, z_ + (p_.nx + p_.np) * lanes);
  if (ramp_ && p_.np) load_columns(rows(q_.parameters_end, p_.np), p_.np, count, z_ + (p_.nx + p_.np + p_.nu) * lanes);
  load_columns(rows(q_.durations, 1), 1, count, h_);
  for (int i = 0; i < lanes; ++i) h_[i] *= 1.0 / q_.substeps;
}

void GraphSteps::start() noexcept {
  std::copy_n(z_, p_.nx * lanes, x_);
  std::fill_n(M_, p_.nx * nz_ * lanes, 0.0);
  for (int r = 0; r < p_.nx; ++r) std::fill_n(entry(M_, r, r), lanes, 1.0);
  at_start_ = true;
}

/// Evaluates a tape at x_k; its weights are the multipliers as they are.
void GraphSteps::run(const Tape& tape, int step) noexcept {
  double* at = std::copy_n(x_, p_.nx * lanes, registers_);
  at = std::copy_n(z_ + p_.nx * lanes, (nz_ - p_.nx) * lanes, at);
  at = std::copy_n(h_, lanes, at);
  if (ramp_) {
    at = std::fill_n(at, lanes, static_cast<double>(step) / q_.substeps);
    at = std::fill_n(at, lanes, 1.0 / q_.substeps);
  }
  if (&tape == p_.hessians) std::copy_n(lambda_, p_.nx * lanes, at);
  tape.run(*p_.kernels, registers_, lanes, count_);
}

void GraphSteps::add_product(const Tape& tape, int which, const double* values, double* out) const noexcept {
  const int source = tape.results()[static_cast<std::size_t>(which)];
  if (source == Tape::zero) return;
  if (source >= 0) {
    const double* factors = registers_ + static_cast<std::ptrdiff_t>(source) * lanes;
    for (int i = 0; i < lanes; ++i) out[i] += factors[i] * values[i];
  } else {
    const double factor = tape.uniforms()[static_cast<std::size_t>(~std::ptrdiff_t{source})];
    for (int i = 0; i < lanes; ++i) out[i] += factor * values[i];
  }
}

/// x_{k+1} and M_{k+1} from the results of a tape.
void GraphSteps::advance(const Tape& tape, bool with_jacobian) noexcept {
  static constexpr double ones[lanes] = {1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0};
  std::fill_n(next_, p_.nx * lanes, 0.0);
  for (int r = 0; r < p_.nx; ++r) add_product(tape, r, ones, next_ + r * lanes);
  std::swap(x_, next_);
  if (!with_jacobian) return;
  std::fill_n(M_next_, p_.nx * nz_ * lanes, 0.0);
  for (int r = 0; r < p_.nx; ++r) {
    for (int a = 0; a < p_.nx && !at_start_; ++a)
      for (int j = 0; j < nz_; ++j) add_product(tape, jacobian_result(r, a), entry(M_, a, j), entry(M_next_, r, j));
    for (int j = at_start_ ? 0 : p_.nx; j < nz_; ++j)
      add_product(tape, jacobian_result(r, j), ones, entry(M_next_, r, j));
  }
  std::swap(M_, M_next_);
  at_start_ = false;
}

void GraphSteps::take(int steps, bool with_jacobian) noexcept {
  start();
  const Tape& tape = with_jacobian ? *p_.jacobians : *p_.values;
  for (int k = 0; k < steps; ++k) {
    run(tape, k);
    advance(tape, with_jacobian);
  }
}

/// H += Z' H_k Z, with M_k in M.
void GraphSteps::add_curvature(const Tape& tape) noexcept {
  static constexpr double ones[lanes] = {1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0};
  for (int b = 0; b < nz_; ++b) {
    std::fill_n(product_, nz_ * lanes, 0.0);  // row b of H_k Z
    for (int a = 0; a < nz_; ++a) {
      if (tape.results()[static_cast<std::size_t>(hessian_result(b, a))] == Tape::zero) continue;
      if (a >= p_.nx || at_start_)
        add_product(tape, hessian_result(b, a), ones, product_ + a * lanes);
      else
        for (int j = 0; j < nz_; ++j) add_product(tape, hessian_result(b, a), entry(M_, a, j), product_ + j * lanes);
    }
    const auto add = [&](int i, const double* factors) {
      for (int j = 0; j < nz_; ++j)
        for (int lane = 0; lane < lanes; ++lane) entry(H_, i, j)[lane] += factors[lane] * product_[j * lanes + lane];
    };
    if (b >= p_.nx || at_start_)
      add(b, ones);
    else
      for (int i = 0; i < nz_; ++i) add(i, entry(M_, b, i));
  }
}

void GraphSteps::pull_multipliers(const Tape& tape) noexcept {
  std::fill_n(next_, p_.nx * lanes, 0.0);
  for (int r = 0; r < p_.nx; ++r)
    for (int c = 0; c < p_.nx; ++c) add_product(tape, jacobian_result(r, c), lambda_ + r * lanes, next_ + c * lanes);
  std::swap(lambda_, next_);
}

void GraphSteps::store_values(int first, int count) const noexcept {
  for (int i = 0; i < count; ++i) {
    const std::ptrdiff_t row = first + i;
    for (int r = 0; q_.next_states && r < p_.nx; ++r) q_.next_states[row * p_.nx + r] = x_[r * lanes + i];
    for (int r = 0; q_.jacobians && r < p_.nx; ++r)
      for (int j = 0; j < nz_; ++j) q_.jacobians[(row * nz_ + column(j)) * p_.nx + r] = entry(M_, r, j)[i];
  }
}

void GraphSteps::store_hessians(int first, int count) const noexcept {
  for (int i = 0; i < count; ++i)
    for (int r = 0; r < nz_; ++r)
      for (int c = 0; c < nz_; ++c)
        q_.hessians[(static_cast<std::ptrdiff_t>(first + i) * nz_ + column(r)) * nz_ + column(c)] = entry(H_, r, c)[i];
}

void GraphSteps::integrate(int first, int count) noexcept {
  load(first, count);
  if (!q_.hessians) {
    take(q_.substeps, q_.jacobians != nullptr);
    return store_values(first, count);
  }
  load_columns(q_.multipliers + static_cast<std::ptrdiff_t>(first) * p_.nx, p_.nx, count, lambda_);
  std::fill_n(H_, nz_ * nz_ * lanes, 0.0);
  for (int k = q_.substeps - 1; k >= 0; --k) {
    take(k, true);
    run(*p_.hessians, k);
    add_curvature(*p_.hessians);
    pull_multipliers(*p_.hessians);
    if (k != q_.substeps - 1) continue;
    advance(*p_.hessians, true);
    store_values(first, count);
  }
  store_hessians(first, count);
}

}  // namespace rhec
