#include "rhec/core/model/chosen_outputs.hpp"

#include <algorithm>
#include <array>
#include <memory>
#include <numeric>
#include <optional>
#include <set>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "rhec/core/base/call_memory.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/core/model/formula_copy.hpp"

namespace rhec {
namespace {

/// Evaluates all outputs of the model, some nodes at a time, and returns the chosen ones.
class ChosenOutputs final : public Model {
 public:
  ChosenOutputs(std::shared_ptr<Model> model, std::vector<int> chosen, const std::vector<std::string>& names)
      : model_(std::move(model)),
        chosen_(std::move(chosen)),
        description_(model_->description()),
        all_(model_->output_count()),
        memory_(static_cast<std::size_t>(all_) * (static_cast<std::size_t>(model_->state_count()) + 2)) {
    if (chosen_.size() > room)
      throw Error(
          fmt::format("model '{}': {} outputs chosen; expected at most {}", description_.name, chosen_.size(), room));
    description_.outputs.clear();
    for (std::size_t j = 0; j < chosen_.size(); ++j) {
      description_.outputs.push_back(model_->description().outputs[chosen_[j]]);
      Variable& output = description_.outputs.back();
      if (!names.empty() && !names[j].empty()) output.name = names[j];
      const auto here = chosen_.begin() + static_cast<std::ptrdiff_t>(j);
      output.device = static_cast<std::uint8_t>(output.device + std::count(chosen_.begin(), here, chosen_[j]));
    }
    if (const VehicleGraph* all = model_->graph()) graph_ = formula_copy(*all, chosen_);
  }

  const ModelDescription& description() const noexcept override { return description_; }
  int data_count() const noexcept override { return model_->data_count(); }
  void integrate(const Intervals& request) const noexcept override { model_->integrate(request); }
  void integrate_rows(const IntervalRows& request) const noexcept override { model_->integrate_rows(request); }
  void observe_rows(const NodeRows& request) const noexcept override {
    if (request.chosen) return observe_some(request);
    observe_of_all(request, chosen_.data(), static_cast<int>(chosen_.size()));
  }
  std::size_t rows_scratch(int count) const noexcept override { return model_->rows_scratch(count); }
  void rates(const double* x, const double* u, const double* p, double* dxdt) const noexcept override {
    model_->rates(x, u, p, dxdt);
  }
  void straight_motion(double ground_speed, const double* p, double* state, double* inputs) const noexcept override {
    model_->straight_motion(ground_speed, p, state, inputs);
  }
  Operations operations() const noexcept override { return model_->operations(); }
  bool has_second_derivatives() const noexcept override { return model_->has_second_derivatives(); }
  std::vector<std::string> instruction_sets() const override { return model_->instruction_sets(); }
  bool use_instruction_set(const std::string& name) override { return model_->use_instruction_set(name); }
  const VehicleGraph* graph() const noexcept override { return graph_ ? &*graph_ : nullptr; }

  void observe(const Nodes& request) const noexcept override {
    memory_.lend([&](double* memory) { observe_of_all(request, memory); });
  }

 private:
  static constexpr std::size_t room = 4096;  ///< indices on the stack

  /// With all outputs, their derivatives and their multipliers in memory, for some nodes at a time.
  void observe_of_all(const Nodes& request, double* memory) const noexcept {
    const std::ptrdiff_t nx = state_count(), ny = output_count();
    const int nodes_at_once = memory_.rows();
    double* const outputs = memory;
    double* const jacobians = outputs + static_cast<std::ptrdiff_t>(nodes_at_once) * all_;
    double* const multipliers = jacobians + nodes_at_once * all_ * nx;
    for (int first = 0; first < request.count; first += nodes_at_once) {
      const int count = std::min(nodes_at_once, request.count - first);
      Nodes part;
      part.count = count;
      part.states = request.states + first * nx;
      if (request.outputs) part.outputs = outputs;
      if (request.jacobians) part.jacobians = jacobians;
      if (request.hessians) {
        std::fill_n(multipliers, count * all_, 0.0);
        for (int i = 0; i < count; ++i)
          for (int j = 0; j < ny; ++j) multipliers[i * all_ + chosen_[j]] += request.multipliers[(first + i) * ny + j];
        part.multipliers = multipliers;
        part.hessians = request.hessians + first * nx * nx;
      }
      model_->observe(part);
      for (int i = 0; i < count; ++i) {
        if (request.outputs) pick(outputs + i * all_, 1, request.outputs + (first + i) * ny);
        if (request.jacobians)
          pick(jacobians + i * all_ * nx, static_cast<int>(nx), request.jacobians + (first + i) * ny * nx);
      }
    }
  }

  /// For some of the chosen outputs.
  void observe_some(const NodeRows& request) const noexcept {
    std::array<int, room> chosen;
    for (int j = 0; j < request.chosen_count; ++j) chosen[j] = chosen_[request.chosen[j]];
    observe_of_all(request, chosen.data(), request.chosen_count);
  }
  /// Sets members one by one: a copy of a freshly written struct would have to wait until it reaches the cache.
  void observe_of_all(const NodeRows& request, const int* chosen, int count) const noexcept {
    model_->observe_rows({.count = request.count,
                          .states = request.states,
                          .state_step = request.state_step,
                          .chosen = chosen,
                          .chosen_count = count,
                          .outputs = request.outputs,
                          .output_step = request.output_step,
                          .jacobians = request.jacobians,
                          .jacobian_row = request.jacobian_row,
                          .multipliers = request.multipliers,
                          .multiplier_step = request.multiplier_step,
                          .hessians = request.hessians,
                          .hessian_step = request.hessian_step,
                          .hessian_row = request.hessian_row,
                          .scratch = request.scratch});
  }
  /// From columns of all outputs to columns of the chosen ones.
  void pick(const double* all, int columns, double* chosen) const noexcept {
    for (int c = 0; c < columns; ++c, all += all_)
      for (const int output : chosen_) *chosen++ = all[output];
  }

  std::shared_ptr<Model> model_;
  std::vector<int> chosen_;
  ModelDescription description_;
  std::optional<VehicleGraph> graph_;
  int all_;
  CallMemory memory_;
};

}  // namespace

std::vector<int> usual_outputs(const ModelDescription& about) {
  std::vector<int> usual;
  for (std::size_t j = 0; j < about.outputs.size(); ++j)
    if (about.outputs[j].usual) usual.push_back(static_cast<int>(j));
  return usual;
}

OptionRow outputs_row() {
  return {"outputs", "list of texts", "the usual ones", "all, or outputs of the model",
          "what is measured; `{NAME: OUTPUT}`: by one more sensor of that name"};
}

std::shared_ptr<Model> with_outputs(std::shared_ptr<Model> model, const std::vector<int>& chosen,
                                    const std::vector<std::string>& names) {
  const ModelDescription& about = model->description();
  if (!names.empty() && names.size() != chosen.size())
    throw Error(fmt::format("model '{}': {} outputs chosen with {} names", about.name, chosen.size(), names.size()));
  std::set<std::string> called;
  bool has_own_names = true;
  for (std::size_t j = 0; j < chosen.size(); ++j) {
    if (chosen[j] < 0 || chosen[j] >= model->output_count())
      throw Error(fmt::format("model '{}': output {} chosen; it has {}, counted from 0", about.name, chosen[j],
                              model->output_count()));
    const std::string& own = about.outputs[chosen[j]].name;
    const std::string& name = names.empty() || names[j].empty() ? own : names[j];
    has_own_names = has_own_names && name == own;
    // Models in programs need no names: then the outputs themselves must differ.
    if (!called.insert(name.empty() ? fmt::format("output {}", chosen[j]) : name).second)
      throw Error(fmt::format("model '{}': output '{}' chosen twice", about.name, name));
  }
  std::vector<int> all(about.outputs.size());
  std::iota(all.begin(), all.end(), 0);
  if (chosen == all && has_own_names) return model;
  return std::make_shared<ChosenOutputs>(std::move(model), chosen, names);
}

}  // namespace rhec
