#include <algorithm>
#include <utility>

#include "graph_steps.hpp"
#include "rhec/core/base/reserve.hpp"
#include "rhec/core/model/formula_copy.hpp"
#include "rhec/core/model/graph_model.hpp"
#include "rhec/core/model/model_functions.hpp"
#include "staged_steps.hpp"

namespace rhec {

/// Makes tapes: of compiled functions, as far as there are some, else for the interpreter.
class GraphModel::TapeMaker {
 public:
  TapeMaker(const VehicleGraph& vehicle, const StraightCode* code, const StraightSet* set)
      : vehicle_(formula_copy(vehicle)), functions_(vehicle_), code_(set ? code : nullptr), set_(set) {
    if (!code_) return;
    std::vector<double> values;
    for (const auto& [node, value] : vehicle.options) values.push_back(value);
    uniforms_ = code_->uniforms(values);
  }
  Tape make(ModelFunction function) {
    const auto which = static_cast<std::size_t>(function);
    if (code_ && which < code_->functions.size() && set_->runs[which])
      return {code_->functions[which], set_->runs[which], uniforms_};
    return {*vehicle_.graph, functions_.inputs(function), functions_.results(function), vehicle_.options};
  }
  /// Whether a step is one function; what was compiled has decided that.
  bool is_whole(ModelFunction step) {
    if (code_ && set_->runs[static_cast<std::size_t>(step)]) return true;
    const bool has_rates = code_ && code_->functions.size() > static_cast<std::size_t>(ModelFunction::rates);
    return !has_rates && functions_.is_whole(step);
  }
  /// The formula and its derivatives, made once.
  std::shared_ptr<const RatesTapes> rates() {
    if (!rates_)
      rates_ = std::make_shared<const RatesTapes>(RatesTapes{.rates = make(ModelFunction::rates),
                                                             .slopes = make(ModelFunction::rates_jacobian),
                                                             .bends = make(ModelFunction::rates_hessian)});
    return rates_;
  }

 private:
  VehicleGraph vehicle_;  ///< derivatives are made in a copy, which goes with them
  ModelFunctions functions_;
  const StraightCode* code_;
  const StraightSet* set_;
  std::vector<double> uniforms_;
  std::shared_ptr<const RatesTapes> rates_;
};

GraphModel::StepTapes::StepTapes(TapeMaker& maker, const Counts& n, bool ramp) {
  const int nx = n.x, nz = n.z(ramp);
  const auto whole = [&](ModelFunction steady, ModelFunction ramped) { return maker.is_whole(ramp ? ramped : steady); };
  if (whole(ModelFunction::step, ModelFunction::ramp)) {
    values = maker.make(ramp ? ModelFunction::ramp : ModelFunction::step);
    next_of_values = values.rows(0, 1, nx);
  }
  if (whole(ModelFunction::step_jacobian, ModelFunction::ramp_jacobian)) {
    jacobians = maker.make(ramp ? ModelFunction::ramp_jacobian : ModelFunction::step_jacobian);
    next_of_jacobians = jacobians.rows(0, 1, nx);
    rows_of_jacobians = jacobians.rows(nx, nx, nz);
  }
  if (whole(ModelFunction::step_hessian, ModelFunction::ramp_hessian)) {
    hessians = maker.make(ramp ? ModelFunction::ramp_hessian : ModelFunction::step_hessian);
    next_of_hessians = hessians.rows(0, 1, nx);
    jacobian_of_hessians = hessians.rows(nx, nx, nz);
    hessian_of_hessians = hessians.rows(nx + nx * nz, nz, nz);
  } else {
    staged = std::make_shared<const StagedSteps>(maker.rates(), n.x, n.p, n.u, ramp);
  }
}

GraphModel::Tapes::Tapes(TapeMaker& maker, const Counts& n)
    : steady(maker, n, false),
      outputs(maker.make(ModelFunction::outputs)),
      output_jacobians(maker.make(ModelFunction::output_jacobian)),
      output_hessians(maker.make(ModelFunction::output_hessian)),
      output_values(outputs.rows(0, 1, n.y)),
      values_of_output_jacobians(output_jacobians.rows(0, 1, n.y)),
      output_slopes(output_jacobians.rows(n.y, n.y, n.x)) {
  if (n.p > 0) ramped = StepTapes(maker, n, true);
  for (int entry = 0; entry < n.x * n.x; ++entry)
    if (output_hessians.results()[static_cast<std::size_t>(entry)] != Tape::zero) curved.push_back(entry);
  for (const Tape* each : {&steady.values, &steady.jacobians, &steady.hessians, &ramped.values, &ramped.jacobians,
                           &ramped.hessians, &outputs, &output_jacobians, &output_hessians})
    most_registers = std::max(most_registers, each->register_count());
}

/// Makes the tapes of an instruction set, and the memory for calls that bring none.
void GraphModel::use(const TapeKernels& kernels, const StraightSet* set) {
  TapeMaker maker(vehicle_, code_, set);
  Tapes made(maker, n_);
  const std::size_t registers =
      static_cast<std::size_t>(std::max({made.most_registers, rates_.register_count(), straight_.register_count()}));
  // Several steps by the chain rule of whole ones.
  const std::size_t steps = registers * GraphSteps::lanes + GraphSteps::memory(n_.x, n_.z(n_.p > 0));
  std::size_t most = steps;
  for (const StepTapes* each : {&made.steady, &made.ramped})
    if (each->staged) most = std::max(most, each->staged->memory());
  reserve_ = most > most_stack ? std::make_shared<Reserve>(most) : nullptr;
  tapes_ = std::move(made);
  memory_of_steps_ = steps;
  kernels_ = &kernels;
}

GraphModel::Cost GraphModel::cost_of(const Tape& tape, bool with_jacobian, bool with_hessian) const noexcept {
  if (!tape.results().empty()) return {tape.instruction_count(), tape.run_count(), tape.register_count()};
  const StagedSteps& staged = *tapes_.steady.staged;
  return {static_cast<int>(staged.operations(with_jacobian, with_hessian)), 0,
          static_cast<int>(staged.memory() / StagedSteps::lanes)};
}

Model::Operations GraphModel::operations() const noexcept {
  const auto of_one = [](const Cost& of_eight) {
    return static_cast<double>(of_eight.instructions) / GraphSteps::lanes;
  };
  return {of_one(cost_of_values()), of_one(cost_of_jacobians()), of_one(cost_of_hessians())};
}

bool GraphModel::is_compiled() const noexcept {
  const Tape& values = tapes_.steady.values;
  return values.results().empty() ? tapes_.steady.staged->is_compiled() : values.is_compiled();
}

}  // namespace rhec
