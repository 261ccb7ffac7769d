#include "rhec/core/model/implicit_model.hpp"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include "radau_steps.hpp"
#include "rhec/core/base/assertion.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/core/base/reserve.hpp"
#include "rhec/core/base/scratch.hpp"
#include "rhec/core/model/formula_copy.hpp"
#include "rhec/core/model/graph_model.hpp"
#include "rhec/core/model/model_functions.hpp"
#include "rhec/core/model/sensor_model.hpp"
#include "rhec/core/model/state_noise_model.hpp"

namespace rhec {

ImplicitModel::ImplicitModel(std::shared_ptr<const Model> vehicle)
    : vehicle_(std::move(vehicle)), kernels_(runnable_tape_kernels().back()) {
  const std::string& name = vehicle_->description().name;
  if (!vehicle_->graph())
    throw Error(
        fmt::format("model '{}' has no formula that derivatives could be made of, which implicit steps need; "
                    "expected a model that is written as a formula or as equations, or explicit steps",
                    name));
  if (vehicle_->data_count() != 0)
    throw Error(fmt::format("model '{}' depends on data of the interval, which implicit steps do not know", name));
  // Derivatives are made in a copy, which goes with them.
  const VehicleGraph copy = formula_copy(*vehicle_->graph());
  ModelFunctions functions(copy);
  const auto tape = [&](ModelFunction function) {
    return Tape(*copy.graph, functions.inputs(function), functions.results(function), copy.options);
  };
  auto tapes = std::make_shared<const RatesTapes>(RatesTapes{.rates = tape(ModelFunction::rates),
                                                             .slopes = tape(ModelFunction::rates_jacobian),
                                                             .bends = tape(ModelFunction::rates_hessian)});
  std::vector<double> scales;
  for (const Variable& state : vehicle_->description().states) scales.push_back(state.scale);
  const auto make = [&](bool ramp) {
    return std::make_shared<const RadauSteps>(tapes, state_count(), parameter_count(), input_count(), ramp, scales);
  };
  steady_ = make(false);
  memory_ = steady_->memory();
  if (parameter_count() > 0) {
    ramped_ = make(true);
    memory_ = std::max(memory_, ramped_->memory());
  }
  if (memory_ > GraphModel::most_stack) reserve_ = std::make_shared<Reserve>(memory_);
}

void ImplicitModel::integrate(const Intervals& q) const noexcept {
  RHEC_ASSERT(q.count >= 0 && q.substeps >= 1, "whole intervals and steps");
  RHEC_ASSERT(q.count == 0 || (q.states && q.durations), "where to integrate");
  RHEC_ASSERT(q.count == 0 || !q.hessians || q.multipliers, "second derivatives are weighted by multipliers");
  const RadauSteps& of = steps(q.parameters_end && parameter_count() > 0);
  if (reserve_) return reserve_->lend([&](double* memory) { of.integrate(q, *kernels_, memory); });
  // Memory of a size that is known at run time only, without an allocation.
  of.integrate(q, *kernels_, static_cast<double*>(__builtin_alloca_with_align(memory_ * sizeof(double), 512)));
}

void ImplicitModel::integrate_rows(const IntervalRows& q) const noexcept {
  steps(q.ramp && parameter_count() > 0).integrate_rows(q, *kernels_, Scratch(q.scratch).take(0));
}

std::size_t ImplicitModel::rows_scratch(int count) const noexcept {
  return std::max(vehicle_->rows_scratch(count), memory_ + 7);
}

Model::Operations ImplicitModel::operations() const noexcept {
  const auto of_one = [&](bool with_jacobian, bool with_hessian) {
    return static_cast<double>(steady_->operations(with_jacobian, with_hessian)) / RadauSteps::lanes;
  };
  return {of_one(false, false), of_one(true, false), of_one(true, true)};
}

std::vector<std::string> ImplicitModel::instruction_sets() const {
  std::vector<std::string> names;
  for (const TapeKernels* kernels : runnable_tape_kernels()) names.emplace_back(kernels->name);
  return names;
}

bool ImplicitModel::use_instruction_set(const std::string& name) {
  for (const TapeKernels* kernels : runnable_tape_kernels()) {
    if (kernels->name != name) continue;
    kernels_ = kernels;
    return true;
  }
  return false;
}

bool is_implicit(const Model& model) noexcept {
  if (const auto* noisy = dynamic_cast<const StateNoiseModel*>(&model)) return is_implicit(noisy->vehicle());
  if (const auto* sensors = dynamic_cast<const SensorModel*>(&model)) return is_implicit(sensors->vehicle());
  return dynamic_cast<const ImplicitModel*>(&model) != nullptr;
}

}  // namespace rhec
