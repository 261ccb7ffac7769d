#include "core/model/staged_steps.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "models/bicycle_slip/bicycle_slip.hpp"
#include "models/model_checks.hpp"
#include "models/tractor_trailer/tractor_trailer.hpp"
#include "rhec/core/base/aligned.hpp"
#include "rhec/core/base/scratch.hpp"
#include "rhec/core/model/graph_model.hpp"
#include "rhec/core/model/model_functions.hpp"
#include "support/other_model.hpp"
#include "support/wide_vehicle.hpp"

namespace rhec {
namespace staged_steps_test {

template <class Scalar>
struct Nine : testing::WideVehicle<9, Scalar> {};

template <template <class> class Formula>
ModelDescription describe() {
  using F = Formula<double>;
  ModelDescription about = testing::about_wide_vehicle(F::state_count);
  about.inputs.resize(F::input_count, about.inputs.front());
  about.parameters.resize(F::parameter_count, about.parameters.front());
  about.outputs.resize(F::output_count, about.outputs.front());
  return about;
}

/// A vehicle whose steps are staged, whatever their length.
class Staged final : public OtherModel {
 public:
  Staged(const VehicleGraph& vehicle, const std::shared_ptr<const Model>& whole, const TapeKernels& kernels)
      : OtherModel(whole), kernels_(kernels) {
    ModelFunctions functions(vehicle);
    const auto tape = [&](ModelFunction function) {
      return Tape(*vehicle.graph, functions.inputs(function), functions.results(function), vehicle.options);
    };
    tapes_ = std::make_shared<const RatesTapes>(RatesTapes{.rates = tape(ModelFunction::rates),
                                                           .slopes = tape(ModelFunction::rates_jacobian),
                                                           .bends = tape(ModelFunction::rates_hessian)});
    for (const bool ramp : {false, true})
      steps_.emplace_back(tapes_, state_count(), parameter_count(), input_count(), ramp);
  }
  void integrate(const Intervals& request) const noexcept override {
    const StagedSteps& of = steps_[request.parameters_end ? 1 : 0];
    AlignedDoubles memory(of.memory(), NAN);
    of.integrate(request, kernels_, memory.data());
  }
  void integrate_rows(const IntervalRows& request) const noexcept override {
    steps_[request.ramp ? 1 : 0].integrate_rows(request, kernels_, Scratch(request.scratch).take(0));
  }
  std::size_t rows_scratch(int count) const noexcept override {
    return std::max(OtherModel::rows_scratch(count), steps_[1].memory() + 7);
  }
  const StagedSteps& steady() const { return steps_[0]; }

 private:
  const TapeKernels& kernels_;
  std::shared_ptr<const RatesTapes> tapes_;
  std::vector<StagedSteps> steps_;
};

template <template <class> class Formula>
void expect_the_same_as_whole() {
  const VehicleGraph vehicle = trace<Formula>();
  const auto whole = std::make_shared<const GraphModel>(vehicle, describe<Formula>());
  for (const TapeKernels* kernels : runnable_tape_kernels()) {
    SCOPED_TRACE(kernels->name);
    const Staged staged(vehicle, whole, *kernels);
    for (const int count : {1, 7, 8, 9, 17}) {
      for (const bool ramp : {false, true}) {
        for (const int substeps : {1, 2, 3}) {
          checks::Stages found = checks::random_stages(staged, count, ramp, 50 + count), expected = found;
          found.substeps = expected.substeps = substeps;
          staged.integrate(found.intervals(true, true, true));
          whole->integrate(expected.intervals(true, true, true));
          checks::expect_same(found.next, expected.next, count, "F");
          checks::expect_same(found.jacobians, expected.jacobians, count, "dF");
          checks::expect_same(found.hessians, expected.hessians, count, "d2F");
          // What is asked for alone.
          found.clear();
          staged.integrate(found.intervals(true, false, false));
          checks::expect_same(found.next, expected.next, count, "F");
          staged.integrate(found.intervals(false, true, false));
          checks::expect_same(found.jacobians, expected.jacobians, count, "dF");
          staged.integrate(found.intervals(false, false, true));
          checks::expect_same(found.hessians, expected.hessians, count, "d2F");
          checks::same_steps_by_rows(staged, count, ramp, substeps,
                                     [&](const IntervalRows& request) { staged.integrate_rows(request); });
        }
      }
    }
  }
}

TEST(StagedSteps, AreTheSameAsWholeOnes) {
  expect_the_same_as_whole<BicycleSlip>();
  expect_the_same_as_whole<TractorTrailer>();
  expect_the_same_as_whole<Nine>();
}

TEST(StagedSteps, CountWhatTheyTake) {
  const VehicleGraph vehicle = trace<Nine>();
  const auto whole = std::make_shared<const GraphModel>(vehicle, describe<Nine>());
  const Staged staged(vehicle, whole, *runnable_tape_kernels().front());
  const long values = staged.steady().operations(false, false), jacobian = staged.steady().operations(true, false),
             hessian = staged.steady().operations(true, true);
  EXPECT_GT(values, 4 * 9);
  EXPECT_GT(jacobian, values);
  EXPECT_GT(hessian, jacobian);
  EXPECT_FALSE(staged.steady().is_compiled());
}

}  // namespace staged_steps_test
}  // namespace rhec
