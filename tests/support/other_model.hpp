#pragma once

#include <memory>
#include <utility>

#include "rhec/core/model/model.hpp"

namespace rhec {

/// Forwards everything to another model: a base for models that change part of one.
class OtherModel : public Model {
 public:
  explicit OtherModel(std::shared_ptr<const Model> model) : model_(std::move(model)) {}
  const ModelDescription& description() const noexcept override { return model_->description(); }
  int data_count() const noexcept override { return model_->data_count(); }
  void integrate(const Intervals& request) const noexcept override { model_->integrate(request); }
  void observe(const Nodes& request) const noexcept override { model_->observe(request); }
  void integrate_rows(const IntervalRows& request) const noexcept override { model_->integrate_rows(request); }
  void observe_rows(const NodeRows& request) const noexcept override { model_->observe_rows(request); }
  std::size_t rows_scratch(int count) const noexcept override { return model_->rows_scratch(count); }
  void rates(const double* x, const double* u, const double* p, double* dxdt) const noexcept override {
    model_->rates(x, u, p, dxdt);
  }
  bool has_second_derivatives() const noexcept override { return model_->has_second_derivatives(); }

 private:
  std::shared_ptr<const Model> model_;
};

}  // namespace rhec
