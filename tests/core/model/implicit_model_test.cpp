#include "rhec/core/model/implicit_model.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

#include "models/bicycle_slip/bicycle_slip.hpp"
#include "models/model_checks.hpp"
#include "models/tractor_trailer/tractor_trailer.hpp"
#include "rhec/core/model/formula_model.hpp"
#include "support/allocations.hpp"
#include "support/error_of.hpp"
#include "support/other_model.hpp"
#include "support/wide_vehicle.hpp"

namespace rhec {
namespace implicit_model_test {

template <class Scalar>
struct Three : testing::WideVehicle<3, Scalar> {};
template <class Scalar>
struct Six : testing::WideVehicle<6, Scalar> {};
template <class Scalar>
struct Twenty : testing::WideVehicle<20, Scalar> {};

/// One state, which grows or decays as the others push it.
template <class Scalar>
struct Alone {
  static constexpr int state_count = 1, input_count = 1, parameter_count = 1, output_count = 1;
  void dynamics(const Scalar* x, const Scalar* u, const Scalar* p, Scalar* dxdt) const {
    dxdt[0] = p[0] * u[0] - x[0] * x[0] * x[0];
  }
  void outputs(const Scalar* x, Scalar* y) const { y[0] = x[0]; }
};

/// A state that reaches infinity in finite time.
template <class Scalar>
struct Explosion {
  static constexpr int state_count = 2, input_count = 1, parameter_count = 0, output_count = 1;
  void dynamics(const Scalar* x, const Scalar* u, const Scalar*, Scalar* dxdt) const {
    dxdt[0] = x[0] * x[0] + 1.0;
    dxdt[1] = u[0];
  }
  void outputs(const Scalar* x, Scalar* y) const { y[0] = x[0]; }
};

/// A bicycle whose steering angle follows the wanted one with a lag, and whose wheels creep over a relaxation length.
template <class Scalar>
struct Stiff {
  static constexpr int state_count = 5, input_count = 2, parameter_count = 2, output_count = 2;
  Scalar lag{1e-3};
  template <class Visitor>
  void options(Visitor&& option) {
    option("lag", lag, "of the steering motor [s]", greater_than(0.0));
  }
  void dynamics(const Scalar* x, const Scalar* u, const Scalar* p, Scalar* dxdt) const {
    using std::cos, std::sin, std::tan, std::tanh;
    const Scalar v = p[0] * u[0];
    dxdt[0] = v * cos(x[2]) - x[4] * sin(x[2]);
    dxdt[1] = v * sin(x[2]) + x[4] * cos(x[2]);
    dxdt[2] = v * tan(x[3]) / 2.0;
    dxdt[3] = (u[1] - x[3] + 0.1 * tanh(x[4])) / lag;
    dxdt[4] = v / 0.05 * (0.2 * p[1] * sin(x[3]) - x[4]);
  }
  void outputs(const Scalar* x, Scalar* y) const {
    y[0] = x[0];
    y[1] = x[1];
  }
};

template <template <class> class Formula>
ModelDescription describe() {
  using F = Formula<double>;
  ModelDescription about = testing::about_wide_vehicle(F::state_count);
  about.inputs.resize(F::input_count, about.inputs.front());
  about.parameters.resize(F::parameter_count, about.parameters.front());
  about.outputs.resize(F::output_count, about.outputs.front());
  return about;
}

template <template <class> class Formula>
std::shared_ptr<const Model> vehicle() {
  return std::make_shared<const FormulaModel<Formula>>(Formula<double>(), describe<Formula>());
}

/// The next states of both at random points.
double largest_difference(const Model& one, int substeps_of_one, const Model& other, int substeps_of_other, bool ramp) {
  checks::Stages found = checks::random_stages(one, 13, ramp, 7), expected = found;
  found.substeps = substeps_of_one;
  expected.substeps = substeps_of_other;
  one.integrate(found.intervals(true, false, false));
  other.integrate(expected.intervals(true, false, false));
  double largest = 0.0;
  for (int k = 0; k < found.count * found.nx; ++k) {
    const double difference = std::abs(found.next[k] - expected.next[k]);
    largest = std::isfinite(difference) ? std::max(largest, difference) : HUGE_VAL;
  }
  return largest;
}

template <template <class> class Formula>
void expect_a_model() {
  const auto explicit_one = vehicle<Formula>();
  ImplicitModel implicit_one(explicit_one);
  EXPECT_LT(largest_difference(implicit_one, 10, *explicit_one, 1000, false), 1e-8);
  EXPECT_LT(largest_difference(implicit_one, 10, *explicit_one, 1000, true), 1e-8);
  for (const std::string& set : implicit_one.instruction_sets()) {
    SCOPED_TRACE(set);
    ASSERT_TRUE(implicit_one.use_instruction_set(set));
    for (const bool ramp : {false, true}) {
      for (const int substeps : {1, 3}) {
        SCOPED_TRACE(substeps);
        checks::expect_derivatives(implicit_one, ramp, substeps, 3);
        for (const int count : {1, 8, 11}) {
          checks::same_steps_by_rows(implicit_one, count, ramp, substeps,
                                     [&](const IntervalRows& request) { implicit_one.integrate_rows(request); });
          checks::Stages all = checks::random_stages(implicit_one, count, ramp, 9), alone = all;
          all.substeps = alone.substeps = substeps;
          implicit_one.integrate(all.intervals(true, true, true));
          implicit_one.integrate(alone.intervals(true, false, false));
          checks::expect_same(alone.next, all.next, count, "F");
          implicit_one.integrate(alone.intervals(false, true, false));
          checks::expect_same(alone.jacobians, all.jacobians, count, "dF");
          implicit_one.integrate(alone.intervals(false, false, true));
          checks::expect_same(alone.hessians, all.hessians, count, "d2F");
        }
      }
    }
  }
}

TEST(ImplicitModel, IsTheSameMotionWithItsDerivatives) {
  expect_a_model<BicycleSlip>();
  expect_a_model<TractorTrailer>();
  expect_a_model<Alone>();
  expect_a_model<Three>();
  expect_a_model<Six>();
  expect_a_model<Twenty>();
}

/// The largest error of the next states of Stiff against short Runge-Kutta steps, from where the fast states have
/// settled. It drives forward.
double error_of_stiff(const Model& model, int substeps, bool ramp) {
  static const auto reference = vehicle<Stiff>();
  checks::Stages found = checks::random_stages(model, 13, ramp, 7), expected = found;
  for (int i = 0; i < found.count; ++i) {
    double* const x = found.x.data() + i * found.nx;
    const double* const u = found.u.data() + i * found.nu;
    found.u[i * found.nu] = std::abs(u[0]) + 2.0;
    for (std::vector<double>* p : {&found.p, &found.p_end}) (*p)[i * found.np] = std::abs((*p)[i * found.np]) + 0.5;
    for (int pass = 0; pass < 20; ++pass) {
      x[4] = 0.2 * found.p[i * found.np + 1] * std::sin(x[3]);
      x[3] = u[1] + 0.1 * std::tanh(x[4]);
    }
  }
  expected.x = found.x;
  expected.u = found.u;
  expected.p = found.p;
  expected.p_end = found.p_end;
  found.substeps = substeps;
  expected.substeps = 4000;
  model.integrate(found.intervals(true, false, false));
  reference->integrate(expected.intervals(true, false, false));
  double largest = 0.0;
  for (int k = 0; k < found.count * found.nx; ++k) {
    const double difference = std::abs(found.next[k] - expected.next[k]);
    largest = std::isfinite(difference) ? std::max(largest, difference) : HUGE_VAL;
  }
  return largest;
}

TEST(ImplicitModel, FollowsAStiffVehicleWithOneStep) {
  const auto explicit_one = vehicle<Stiff>();
  const ImplicitModel implicit_one(explicit_one);
  // 200 time constants in an interval: 10 Runge-Kutta steps are far from stable.
  EXPECT_GT(error_of_stiff(*explicit_one, 10, false), 1e3);
  for (const bool ramp : {false, true}) {
    EXPECT_LT(error_of_stiff(implicit_one, 1, ramp), 2e-3);
    EXPECT_LT(error_of_stiff(implicit_one, 4, ramp), 1e-4);
    for (const int substeps : {1, 4}) checks::expect_derivatives(implicit_one, ramp, substeps, 3);
  }
}

TEST(ImplicitModel, HasOrderFive) {
  const auto explicit_one = vehicle<Six>();
  const ImplicitModel implicit_one(explicit_one);
  for (const bool ramp : {false, true}) {
    double last = 0.0;
    for (const int substeps : {1, 2, 4, 8}) {
      const double error = largest_difference(implicit_one, substeps, *explicit_one, 2000, ramp);
      if (last > 0.0) {
        EXPECT_GT(last / error, 24.0) << substeps;
        EXPECT_LT(last / error, 44.0) << substeps;
      }
      last = error;
    }
  }
}

TEST(ImplicitModel, IsNotANumberWhereNoStepIsFound) {
  const ImplicitModel model(vehicle<Explosion>());
  checks::Stages stages = checks::random_stages(model, 3, false, 1);
  stages.x[0] = stages.x[2] = stages.x[4] = 0.0;
  stages.durations = {0.2, 40.0, 0.2};  // x = tan(t) has its pole at pi/2
  model.integrate(stages.intervals(true, true, true));
  for (const int i : {0, 2}) EXPECT_NEAR(stages.next[i * 2], std::tan(0.2), 1e-7);
  EXPECT_TRUE(std::isnan(stages.next[2]));
  EXPECT_TRUE(std::isnan(stages.next[3]));
  EXPECT_TRUE(std::isnan(stages.jacobians[stages.nx * stages.nz]));
}

TEST(ImplicitModel, AnIntervalHasTheSameBitsWhateverStandsBesideIt) {
  const ImplicitModel model(vehicle<Stiff>());
  checks::Stages all = checks::random_stages(model, 13, true, 2);
  model.integrate(all.intervals(true, true, true));
  for (int i = 0; i < all.count; ++i) {
    checks::Stages one(model, 1, true);
    const auto pick = [i](const std::vector<double>& from, int size) {
      return std::vector<double>(from.begin() + i * size, from.begin() + (i + 1) * size);
    };
    one.x = pick(all.x, all.nx);
    one.u = pick(all.u, all.nu);
    one.p = pick(all.p, all.np);
    one.p_end = pick(all.p_end, all.np);
    one.durations = pick(all.durations, 1);
    one.weights = pick(all.weights, all.nx);
    model.integrate(one.intervals(true, true, true));
    const auto compare = [i](const std::vector<double>& found, const std::vector<double>& expected, int size) {
      for (int k = 0; k < size; ++k)
        ASSERT_EQ(std::bit_cast<std::uint64_t>(found[k]), std::bit_cast<std::uint64_t>(expected[i * size + k])) << k;
    };
    compare(one.next, all.next, all.nx);
    compare(one.jacobians, all.jacobians, all.nx * all.nz);
    compare(one.hessians, all.hessians, all.nz * all.nz);
  }
}

TEST(ImplicitModel, EvaluatesWithoutAllocation) {
  const ImplicitModel small(vehicle<Stiff>()), large(vehicle<Twenty>());
  for (const Model* model : {static_cast<const Model*>(&small), static_cast<const Model*>(&large)}) {
    checks::Stages stages = checks::random_stages(*model, 15, true, 5);
    const auto intervals = stages.intervals(true, true, true);
    const auto nodes = stages.nodes(true, true, true);
    const long before = allocation_count();
    model->integrate(intervals);
    model->observe(nodes);
    EXPECT_EQ(allocation_count(), before);
  }
}

TEST(ImplicitModel, IsWhatTheVehicleIsOtherwise) {
  const auto explicit_one = vehicle<BicycleSlip>();
  ImplicitModel model(explicit_one);
  EXPECT_TRUE(is_implicit(model));
  EXPECT_FALSE(is_implicit(*explicit_one));
  EXPECT_EQ(model.vehicle(), explicit_one);
  EXPECT_EQ(model.graph(), explicit_one->graph());
  EXPECT_TRUE(model.has_second_derivatives());
  EXPECT_FALSE(model.use_instruction_set("mmx"));
  const Model::Operations of_step = model.operations();
  EXPECT_GT(of_step.values, explicit_one->operations().values);
  EXPECT_GT(of_step.jacobians, of_step.values);
  EXPECT_GT(of_step.hessians, of_step.jacobians);
}

TEST(ImplicitModel, RefusesAModelWithoutAFormula) {
  const auto opaque = std::make_shared<const OtherModel>(vehicle<BicycleSlip>());
  const std::string message = error_of([&] { ImplicitModel{opaque}; });
  EXPECT_NE(message.find("has no formula"), std::string::npos) << message;
}

}  // namespace implicit_model_test
}  // namespace rhec
