#pragma once

#include <string>
#include <utility>
#include <vector>

#include "rhec/core/base/assertion.hpp"
#include "rhec/core/model/kernel_tables.hpp"

namespace rhec {

/// The kernels of a formula by instruction set. `rhec_add_model(<name> ...)` in CMake compiles them, in units of their
/// own, and defines `rhec::ModelKernelSets <name>_kernels()`.
struct ModelKernelSets {
  const ModelKernels* generic = nullptr;
  const ModelKernels* avx2 = nullptr;    ///< null if it was not built
  const ModelKernels* avx512 = nullptr;  ///< likewise
};

/// Numbers of variables of a formula.
struct FormulaCounts {
  int states, inputs, parameters, outputs;
};
/// Throws Error if a description has other numbers of variables, or gives a role to a variable that does not exist.
RHEC_EXPORT void check_description(const ModelDescription& description, const FormulaCounts& counts);

/// Throws Error if the generic kernels are missing.
RHEC_EXPORT void check_kernels(const ModelDescription& description, const ModelKernelSets& kernels);

/// A value that no formula computes. It marks results that have not been written.
RHEC_EXPORT double unwritten_result() noexcept;
/// Throws Error if a function of a formula ("dynamics" or "outputs") left a result unwritten or wrote beyond the last
/// one. `results` was filled with unwritten values, plus `result_guard` more behind the last result.
inline constexpr int result_guard = 8;
RHEC_EXPORT void check_results(const ModelDescription& description, const char* function,
                               const std::vector<Variable>& variables, const std::vector<double>& results);

/// Makes a Model from one formula. Everything else (integration, first and second derivatives, evaluation of several
/// stages at once) is derived. `Formula` is
///
///     struct Formula {
///       static constexpr int state_count, input_count, parameter_count, output_count;
///       template <class Scalar> void dynamics(const Scalar* x, const Scalar* u, const Scalar* p, Scalar* dxdt) const;
///       template <class Scalar> void outputs(const Scalar* x, Scalar* y) const;
///     };
///
/// where Scalar behaves like a double: + - * /, sqrt exp log sin cos tan tanh asin acos atan atan2, the latter called
/// without `std::` after a `using std::sin;`. It is not a double: a formula must not compare values or branch on them.
/// If both functions are `constexpr`, the compiler finds the derivatives that are always zero and omits them, which
/// makes a step faster.
template <class Formula>
class FormulaModel : public Model {
 public:
  /// With kernels that are compiled here, for the program's own instruction set. Throws Error if the numbers of
  /// variables in the description differ from those of the formula.
  FormulaModel(Formula formula, ModelDescription description)
      : FormulaModel(std::move(formula), std::move(description), {.generic = own_kernels()}) {}
  /// With kernels that were compiled elsewhere, the generic ones among them. Throws as above.
  FormulaModel(Formula formula, ModelDescription description, const ModelKernelSets& kernels)
      : formula_(std::move(formula)), description_(std::move(description)) {
    check_description(description_, {.states = Formula::state_count,
                                     .inputs = Formula::input_count,
                                     .parameters = Formula::parameter_count,
                                     .outputs = Formula::output_count});
    check_written();
    check_kernels(description_, kernels);
    add("generic", kernels.generic);
#if defined(__x86_64__)
    // All instruction sets that the kernels use (cmake/RhecModel.cmake), not only the one in their name.
    const bool has_avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
    const bool has_avx512 = __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512cd") &&
                            __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512bw") &&
                            __builtin_cpu_supports("avx512vl");
    if (kernels.avx2 && has_avx2) add("avx2", kernels.avx2);
    if (kernels.avx512 && has_avx2 && has_avx512) add("avx512", kernels.avx512);
#endif
  }

  const ModelDescription& description() const noexcept override { return description_; }
  void integrate(const Intervals& request) const noexcept override {
    RHEC_ASSERT(request.count >= 0 && request.substeps >= 1, "whole intervals and Runge-Kutta steps");
    RHEC_ASSERT(request.count == 0 || (request.states && request.durations), "where to integrate");
    RHEC_ASSERT(request.count == 0 || Formula::input_count == 0 || request.inputs, "the inputs");
    RHEC_ASSERT(request.count == 0 || Formula::parameter_count == 0 || request.parameters, "the parameters");
    RHEC_ASSERT(request.count == 0 || !request.hessians || request.multipliers,
                "second derivatives are weighted by multipliers");
    kernels_->integrate(&formula_, request);
  }
  void observe(const Nodes& request) const noexcept override {
    RHEC_ASSERT(request.count == 0 || (request.count > 0 && request.states), "where to observe");
    RHEC_ASSERT(request.count == 0 || !request.hessians || request.multipliers,
                "second derivatives are weighted by multipliers");
    kernels_->observe(&formula_, request);
  }
  void integrate_rows(const IntervalRows& request) const noexcept override {
    if (!kernels_->integrate_rows || request.substeps != 1 || request.ramp || !request.jacobians)
      return Model::integrate_rows(request);
    (request.hessians ? kernels_->integrate_rows_with_hessians : kernels_->integrate_rows)(&formula_, request);
  }
  void observe_rows(const NodeRows& request) const noexcept override {
    if (!kernels_->observe_rows) return Model::observe_rows(request);
    kernels_->observe_rows(&formula_, request);
  }
  void rates(const double* x, const double* u, const double* p, double* dxdt) const noexcept override {
    formula_.dynamics(x, u, p, dxdt);
  }
  bool has_second_derivatives() const noexcept override { return true; }

  std::vector<std::string> instruction_sets() const override {
    std::vector<std::string> names;
    for (const auto& [name, kernels] : available_) names.push_back(name);
    return names;
  }
  bool use_instruction_set(const std::string& wanted) override {
    for (const auto& [name, kernels] : available_) {
      if (name != wanted) continue;
      kernels_ = kernels;
      return true;
    }
    return false;
  }

 private:
  /// Calls the formula once to check that it writes every result.
  void check_written() const {
    const auto room = [](int count) { return std::vector<double>(count + result_guard, unwritten_result()); };
    const std::vector<double> x(Formula::state_count, 0.1), u(Formula::input_count, 0.1);
    std::vector<double> p = nominal_values(description_.parameters), rates = room(Formula::state_count),
                        outputs = room(Formula::output_count);
    formula_.dynamics(x.data(), u.data(), p.data(), rates.data());
    check_results(description_, "dynamics", description_.states, rates);
    formula_.outputs(x.data(), outputs.data());
    check_results(description_, "outputs", description_.outputs, outputs);
  }
  static const ModelKernels* own_kernels() {
    static constexpr ModelKernels own = make_model_kernels<Formula, double>();
    return &own;
  }
  void add(std::string name, const ModelKernels* kernels) {
    available_.emplace_back(std::move(name), kernels);
    kernels_ = kernels;
  }

  Formula formula_;
  ModelDescription description_;
  std::vector<std::pair<std::string, const ModelKernels*>> available_;
  const ModelKernels* kernels_ = nullptr;
};

}  // namespace rhec
