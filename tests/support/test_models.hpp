#pragma once

#include "support/other_model.hpp"

namespace rhec::testing {

/// x' = u: a linear model whose optima are known.
template <class Scalar>
struct Integrator {
  static constexpr int state_count = 1, input_count = 1, parameter_count = 0, output_count = 1;
  void dynamics(const Scalar*, const Scalar* u, const Scalar*, Scalar* dxdt) const { dxdt[0] = u[0]; }
  void outputs(const Scalar* x, Scalar* y) const { y[0] = x[0]; }
};

/// Wraps another model, without its second derivatives.
class WithoutSecondDerivatives final : public OtherModel {
 public:
  using OtherModel::OtherModel;
  bool has_second_derivatives() const noexcept override { return false; }
};

}  // namespace rhec::testing
