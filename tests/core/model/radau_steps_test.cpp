#include "core/model/radau_steps.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <vector>

#include "rhec/core/base/aligned.hpp"
#include "rhec/core/formula/expression.hpp"
#include "rhec/core/model/model_functions.hpp"

namespace rhec {
namespace radau_steps_test {

/// x' = p x + u.
template <class Scalar>
struct Linear {
  static constexpr int state_count = 1, input_count = 1, parameter_count = 1, output_count = 1;
  void dynamics(const Scalar* x, const Scalar* u, const Scalar* p, Scalar* dxdt) const { dxdt[0] = p[0] * x[0] + u[0]; }
  void outputs(const Scalar* x, Scalar* y) const { y[0] = x[0]; }
};

struct Made {
  VehicleGraph vehicle = trace<Linear>();
  std::shared_ptr<const RatesTapes> tapes;

  Made() {
    ModelFunctions functions(vehicle);
    const auto tape = [&](ModelFunction function) {
      return Tape(*vehicle.graph, functions.inputs(function), functions.results(function), vehicle.options);
    };
    tapes = std::make_shared<const RatesTapes>(RatesTapes{.rates = tape(ModelFunction::rates),
                                                          .slopes = tape(ModelFunction::rates_jacobian),
                                                          .bends = tape(ModelFunction::rates_hessian)});
  }
};

/// The stability function: the subdiagonal Pade approximation of exp(z).
double growth(double z) { return (1 + 2 * z / 5 + z * z / 20) / (1 - 3 * z / 5 + 3 * z * z / 20 - z * z * z / 60); }

TEST(RadauSteps, MultiplyALinearModeByTheirStabilityFunction) {
  const Made made;
  const RadauSteps steps(made.tapes, 1, 1, 1, false, {1.0});
  const double x = 1.3, u = 0.0, weight = 1.0;
  for (const double p : {-1e6, -200.0, -20.0, -1.0, 0.0, 0.5}) {
    for (const int substeps : {1, 3}) {
      AlignedDoubles memory(steps.memory(), NAN);
      const double duration = 0.2, d = 1e-3;
      double next = NAN;
      std::vector<double> jacobian(3, NAN), hessian(9, NAN);
      steps.integrate({.count = 1,
                       .states = &x,
                       .inputs = &u,
                       .parameters = &p,
                       .durations = &duration,
                       .substeps = substeps,
                       .next_states = &next,
                       .jacobians = jacobian.data(),
                       .multipliers = &weight,
                       .hessians = hessian.data()},
                      *runnable_tape_kernels().back(), memory.data());
      const auto factor = [&](double at) { return std::pow(growth(at * duration / substeps), substeps); };
      EXPECT_NEAR(next, x * factor(p), 1e-12) << p;
      EXPECT_NEAR(jacobian[0], factor(p), 1e-12) << p;
      EXPECT_NEAR(jacobian[2], x * (factor(p + d) - factor(p - d)) / (2 * d), 1e-6) << p;
      EXPECT_NEAR(hessian[6], (factor(p + d) - factor(p - d)) / (2 * d), 1e-6) << p;
      EXPECT_EQ(hessian[6], hessian[2]);
      EXPECT_EQ(hessian[0], 0.0);
    }
  }
}

TEST(RadauSteps, APivotThatIsLostIsNoStep) {
  const Made made;
  const RadauSteps steps(made.tapes, 1, 1, 1, false, {1.0});
  const double x = 1.3, u = 0.0, duration = 0.2, lost = RadauMethod().inverse[0][0] / duration;
  for (const double p : {lost, lost * (1.0 + 1e-3)}) {
    AlignedDoubles memory(steps.memory(), NAN);
    double next = 0.0;
    steps.integrate(
        {.count = 1, .states = &x, .inputs = &u, .parameters = &p, .durations = &duration, .next_states = &next},
        *runnable_tape_kernels().back(), memory.data());
    if (p == lost)
      EXPECT_TRUE(std::isnan(next));
    else
      EXPECT_NEAR(next, x * growth(p * duration), 1e-9);
  }
}

TEST(RadauSteps, CountWhatTheyTake) {
  const Made made;
  const RadauSteps steps(made.tapes, 1, 1, 1, true, {1.0});
  EXPECT_GT(steps.operations(false, false), 0);
  EXPECT_GT(steps.operations(true, false), steps.operations(false, false));
  EXPECT_GT(steps.operations(true, true), steps.operations(true, false));
}

}  // namespace radau_steps_test
}  // namespace rhec
