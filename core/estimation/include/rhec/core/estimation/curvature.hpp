#pragma once

#include <cmath>
#include <cstddef>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/core/model/model.hpp"

namespace rhec {

/// Second-order terms e_k = (w - w0)' H_k (w - w0) / 2 of several functions of w, whose mean is w0 and covariance W:
/// they have the means tr(H_k W) / 2 and, if w is normally distributed, the covariances tr(H_k W H_l W) / 2
/// (Bar-Shalom, Li & Kirubarajan 2001, section 10.3.2). A few products of variables make up nearly all of them: of the
/// covariances a factor L of few columns is found, e = mean + L f, with f independent and of variance 1. Allocates in
/// its constructor only.
class RHEC_EXPORT Curvature {
 public:
  Curvature() = default;
  /// Of `rows` functions of `size` variables; of a model with `outputs` outputs, if `observe` is to be used.
  Curvature(int rows, int size, int outputs = 0);

  /// Columns of L.
  static constexpr int factors = 4;

  /// H_k, symmetric (size x size), to be filled; then `look` finds the variables that take part.
  double* hessian(int row) noexcept { return hessians_.data() + static_cast<std::ptrdiff_t>(row) * size_ * size_; }
  void look() noexcept;
  /// The same of outputs at a state x, by x.
  void observe(const Model& model, const std::vector<int>& outputs, const double* x) noexcept;
  /// Means and L of the terms with a W(r, c) by a function of two variables' numbers. A function whose second
  /// derivatives are not finite has none.
  template <class Covariance>
  void find_means(const Covariance& W) noexcept {
    for (std::ptrdiff_t k = 0; k < std::ssize(means_); ++k) {
      double trace = 0.0;
      for (const std::ptrdiff_t c : active_)
        for (const std::ptrdiff_t r : active_) trace += hessian(k, r, c) * W(r, c);
      means_[k] = std::isfinite(trace) ? 0.5 * trace : 0.0;
    }
  }
  template <class Covariance>
  void find_factor(const Covariance& W) noexcept {
    for (std::ptrdiff_t k = 0; k < std::ssize(means_); ++k) {
      for (const std::ptrdiff_t c : active_) {
        for (const std::ptrdiff_t r : active_) product(k, r, c) = 0.0;
        for (const std::ptrdiff_t a : active_) {
          const double w = W(a, c);
          for (const std::ptrdiff_t r : active_) product(k, r, c) += hessian(k, r, a) * w;
        }
      }
    }
    factorise();
  }
  double mean(int row) const noexcept { return means_[row]; }
  double variance(int row) const noexcept { return variances_[row]; }
  double factor(int row, int column) const noexcept { return factor_[column * std::ssize(means_) + row]; }

 private:
  double hessian(std::ptrdiff_t k, std::ptrdiff_t r, std::ptrdiff_t c) const noexcept {
    return hessians_[(k * size_ + c) * size_ + r];
  }
  double& product(std::ptrdiff_t k, std::ptrdiff_t r, std::ptrdiff_t c) noexcept {
    return products_[(k * size_ + c) * size_ + r];
  }
  void factorise() noexcept;

  std::ptrdiff_t size_ = 0;
  std::vector<double> hessians_, products_, means_, covariances_, variances_, factor_;
  std::vector<std::ptrdiff_t> active_;
  std::vector<double> multipliers_;
};

/// The states whose next value has second derivatives that are not all 0 at a point like any other, ascending; none of
/// a model without second derivatives.
RHEC_EXPORT std::vector<int> curved_states(const Model& model);
/// Those of some outputs that have second derivatives by the state.
RHEC_EXPORT std::vector<int> curved_outputs(const Model& model, const std::vector<int>& outputs);

}  // namespace rhec
