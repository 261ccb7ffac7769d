#pragma once

#include <memory>
#include <utility>

#include "rhec/core/model.hpp"

namespace rhec::testing {

/// x' = u, where nothing is curved and every optimum is known.
struct Integrator {
  static constexpr int state_count = 1, input_count = 1, parameter_count = 0, output_count = 1;
  template <class Scalar>
  void dynamics(const Scalar*, const Scalar* u, const Scalar*, Scalar* dxdt) const {
    dxdt[0] = u[0];
  }
  template <class Scalar>
  void outputs(const Scalar* x, Scalar* y) const {
    y[0] = x[0];
  }
};

/// Another model without its second derivatives.
class WithoutSecondDerivatives final : public Model {
 public:
  explicit WithoutSecondDerivatives(std::shared_ptr<const Model> model) : model_(std::move(model)) {}
  const ModelDescription& description() const noexcept override { return model_->description(); }
  void integrate(const Intervals& request) const noexcept override { model_->integrate(request); }
  void observe(const Nodes& request) const noexcept override { model_->observe(request); }
  void rates(const double* x, const double* u, const double* p, double* dxdt) const noexcept override {
    model_->rates(x, u, p, dxdt);
  }
  bool has_second_derivatives() const noexcept override { return false; }

 private:
  std::shared_ptr<const Model> model_;
};

}  // namespace rhec::testing
