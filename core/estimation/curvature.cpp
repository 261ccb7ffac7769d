#include "rhec/core/estimation/curvature.hpp"

#include <algorithm>

namespace rhec {
namespace {

/// Different fractions of what is typical: no product is 0 by chance.
std::vector<double> any_values(const std::vector<Variable>& variables, int& number) {
  std::vector<double> z;
  z.reserve(variables.size());
  for (const Variable& variable : variables) z.push_back(variable.scale * (0.31 + 0.017 * number++));
  return z;
}

bool has_any(const std::vector<double>& hessian) {
  return std::ranges::any_of(hessian, [](double value) { return value != 0.0; });
}

}  // namespace

Curvature::Curvature(int rows, int size, int outputs) : size_(size), multipliers_(outputs, 0.0) {
  const auto n = static_cast<std::size_t>(size), count = static_cast<std::size_t>(rows);
  hessians_.assign(count * n * n, 0.0);
  products_ = hessians_;
  active_.reserve(n);
  means_.assign(count, 0.0);
  variances_ = means_;
  covariances_.assign(count * count, 0.0);
  factor_.assign(count * factors, 0.0);
}

void Curvature::look() noexcept {
  active_.clear();
  for (std::ptrdiff_t c = 0; c < size_; ++c) {
    bool is_active = false;
    for (std::ptrdiff_t k = 0; k < std::ssize(means_) && !is_active; ++k) {
      const double* const column = hessians_.data() + (k * size_ + c) * size_;
      is_active = std::any_of(column, column + size_, [](double value) { return value != 0.0; });
    }
    if (is_active) active_.push_back(c);
  }
}

void Curvature::observe(const Model& model, const std::vector<int>& outputs, const double* x) noexcept {
  for (std::size_t k = 0; k < outputs.size(); ++k) {
    std::ranges::fill(multipliers_, 0.0);
    multipliers_[outputs[k]] = 1.0;
    model.observe(
        {.count = 1, .states = x, .multipliers = multipliers_.data(), .hessians = hessian(static_cast<int>(k))});
  }
  look();
}

/// The columns of a Cholesky factorisation with the largest pivots. Rows have different units: what is left of a
/// variance counts relative to all of it.
void Curvature::factorise() noexcept {
  const std::ptrdiff_t rows = std::ssize(means_);
  const auto V = [&](std::ptrdiff_t k, std::ptrdiff_t l) -> double& { return covariances_[l * rows + k]; };
  for (std::ptrdiff_t k = 0; k < rows; ++k) {
    for (std::ptrdiff_t l = 0; l <= k; ++l) {
      double sum = 0.0;
      for (const std::ptrdiff_t c : active_)
        for (const std::ptrdiff_t r : active_) sum += product(k, r, c) * product(l, c, r);
      V(k, l) = V(l, k) = 0.5 * sum;
    }
  }
  for (std::ptrdiff_t k = 0; k < rows; ++k) {
    if (!std::isfinite(V(k, k)))
      for (std::ptrdiff_t l = 0; l < rows; ++l) V(k, l) = V(l, k) = 0.0;
    variances_[k] = V(k, k);
  }
  for (int column = 0; column < factors; ++column) {
    double* const L = factor_.data() + column * rows;
    std::ptrdiff_t pivot = -1;
    double largest = 1e-12;
    for (std::ptrdiff_t k = 0; k < rows; ++k) {
      if (!(variances_[k] > 0.0) || !(V(k, k) > largest * variances_[k])) continue;
      largest = V(k, k) / variances_[k];
      pivot = k;
    }
    if (pivot < 0) {
      std::fill_n(L, rows, 0.0);
      continue;
    }
    const double root = std::sqrt(V(pivot, pivot));
    for (std::ptrdiff_t k = 0; k < rows; ++k) L[k] = V(k, pivot) / root;
    for (std::ptrdiff_t k = 0; k < rows; ++k)
      for (std::ptrdiff_t l = 0; l < rows; ++l) V(k, l) -= L[k] * L[l];
  }
}

std::vector<int> curved_states(const Model& model) {
  std::vector<int> curved;
  if (!model.has_second_derivatives()) return curved;
  const ModelDescription& about = model.description();
  int number = 0;
  const std::vector<double> x = any_values(about.states, number), u = any_values(about.inputs, number),
                            p = any_values(about.parameters, number), p_end = any_values(about.parameters, number),
                            data(model.data_count(), 0.0);
  const std::size_t z = x.size() + u.size() + 2 * p.size();
  std::vector<double> multipliers(x.size(), 0.0), hessian(z * z, 0.0);
  const double duration = 0.1;
  for (std::size_t r = 0; r < x.size(); ++r) {
    std::ranges::fill(multipliers, 0.0);
    multipliers[r] = 1.0;
    model.integrate({.count = 1,
                     .states = x.data(),
                     .inputs = u.data(),
                     .parameters = p.data(),
                     .parameters_end = p_end.data(),
                     .durations = &duration,
                     .data = data.empty() ? nullptr : data.data(),
                     .multipliers = multipliers.data(),
                     .hessians = hessian.data()});
    if (has_any(hessian)) curved.push_back(static_cast<int>(r));
  }
  return curved;
}

std::vector<int> curved_outputs(const Model& model, const std::vector<int>& outputs) {
  std::vector<int> curved;
  if (!model.has_second_derivatives()) return curved;
  int number = 0;
  const std::vector<double> x = any_values(model.description().states, number);
  std::vector<double> multipliers(model.output_count(), 0.0), hessian(x.size() * x.size(), 0.0);
  for (const int j : outputs) {
    std::ranges::fill(multipliers, 0.0);
    multipliers[j] = 1.0;
    model.observe({.count = 1, .states = x.data(), .multipliers = multipliers.data(), .hessians = hessian.data()});
    if (has_any(hessian)) curved.push_back(j);
  }
  return curved;
}

}  // namespace rhec
