#include "rhec/core/model/graph_model.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "models/bicycle_sideslip/bicycle_sideslip.hpp"
#include "models/bicycle_slip/bicycle_slip.hpp"
#include "models/model_checks.hpp"
#include "models/skid_steer/skid_steer.hpp"
#include "models/tractor_trailer/tractor_trailer.hpp"
#include "models/unicycle_traction/unicycle_traction.hpp"
#include "plugins/template/articulated.hpp"
#include "rhec/core/model/formula_model.hpp"
#include "support/allocations.hpp"
#include "support/error_of.hpp"
#include "support/every_function.hpp"
#include "support/test_models.hpp"

namespace rhec {
namespace graph_model_test {

std::vector<Variable> variables(const char* letter, int count) {
  std::vector<Variable> all;
  for (int k = 0; k < count; ++k)
    all.push_back(
        {.name = letter + std::to_string(k), .unit = "1", .meaning = "any", .lower = -0.8, .upper = 0.8, .scale = 0.5});
  return all;
}

template <template <class> class Formula>
ModelDescription describe() {
  ModelDescription about;
  about.name = "traced";
  about.states = variables("x", Formula<double>::state_count);
  about.inputs = variables("u", Formula<double>::input_count);
  about.parameters = variables("p", Formula<double>::parameter_count);
  about.outputs = variables("y", Formula<double>::output_count);
  return about;
}

/// A class template as a type.
template <template <class> class Template>
struct Of {
  template <class Scalar>
  using Formula = Template<Scalar>;
  static GraphModel make() { return {trace<Template>(), describe<Template>()}; }
};
template <class Each>
class Traced : public ::testing::Test {
 protected:
  GraphModel interpreted_ = Each::make();
};
using Formulas = ::testing::Types<Of<BicycleSlip>, Of<UnicycleTraction>, Of<TractorTrailer>, Of<BicycleSideslip>,
                                  Of<SkidSteer>, Of<Articulated>, Of<EveryFunction>, Of<testing::Integrator>>;
TYPED_TEST_SUITE(Traced, Formulas);

TYPED_TEST(Traced, HasTheDerivativesOfItsValues) {
  for (const std::string& set : this->interpreted_.instruction_sets()) {
    SCOPED_TRACE(set);
    ASSERT_TRUE(this->interpreted_.use_instruction_set(set));
    for (const bool ramp : {false, true})
      for (const int substeps : {1, 3}) checks::expect_derivatives(this->interpreted_, ramp, substeps, 23);
  }
}

TYPED_TEST(Traced, PassesTheSuiteOfModels) {
  GraphModel generic = TypeParam::make();
  ASSERT_TRUE(generic.use_instruction_set("generic"));
  GraphModel& model = this->interpreted_;
  for (const std::string& set : model.instruction_sets()) {
    SCOPED_TRACE(set);
    ASSERT_TRUE(model.use_instruction_set(set));
    checks::same_as_generic(model, generic);
    for (const int count : {0, 1, 7, 8, 9, 16, 17, 24, 25, 33, 41})
      checks::same_by_rows(model, count, [&](const NodeRows& request) { model.observe_rows(request); });
    for (const bool ramp : {false, true}) {
      for (const int substeps : {1, 2}) checks::expect_runge_kutta(model, ramp, substeps);
      for (const int count : {0, 1, 8, 17, 41})
        for (const int substeps : {1, 2})
          checks::same_steps_by_rows(model, count, ramp, substeps,
                                     [&](const IntervalRows& request) { model.integrate_rows(request); });
    }
  }
}

TYPED_TEST(Traced, EvaluatesWithoutAllocation) {
  GraphModel& model = this->interpreted_;
  checks::Stages s = checks::random_stages(model, 15, true, 5);
  s.substeps = 2;
  const auto intervals = s.intervals(true, true, true);
  const auto nodes = s.nodes(true, true, true);
  std::vector<double> rates(TypeParam::template Formula<double>::state_count);
  const long before = allocation_count();
  model.integrate(intervals);
  model.observe(nodes);
  model.rates(s.x.data(), s.u.data(), s.p.data(), rates.data());
  EXPECT_EQ(allocation_count(), before);
}

TEST(GraphModel, RefusesADescriptionOfAnotherVehicle) {
  EXPECT_CONTAINS(error_of([] { GraphModel(trace<BicycleSlip>(), describe<TractorTrailer>()); }),
                  "its formula has 4 states and its description 5");
}

/// Masses on springs in a row, whose last one is driven (Wirsching, Bock and Diehl 2006): 39 states with six masses.
template <class Scalar>
struct MassesOnSprings {
  static constexpr int masses = 6, state_count = 6 * masses + 3, input_count = 3, parameter_count = 0, output_count = 3;
  void dynamics(const Scalar* x, const Scalar* u, const Scalar*, Scalar* dxdt) const {
    using std::sqrt;
    constexpr int ends = 3 * (masses + 1);  // positions; velocities stand behind them
    Scalar force[ends];
    for (int i = 0; i <= masses; ++i) {
      Scalar stretch[3];
      for (int k = 0; k < 3; ++k) stretch[k] = i == 0 ? x[k] + 0.3 : x[3 * i + k] - x[3 * i - 3 + k] + 0.3;
      const Scalar length = sqrt(stretch[0] * stretch[0] + stretch[1] * stretch[1] + stretch[2] * stretch[2] + 0.01);
      for (int k = 0; k < 3; ++k) force[3 * i + k] = 30.0 * (1.0 - 0.03 / length) * stretch[k];
    }
    for (int j = 0; j < 3 * masses; ++j) {
      dxdt[j] = x[ends + j];
      dxdt[ends + j] = force[j + 3] - force[j] - (j % 3 == 2 ? 9.81 : 0.0);
    }
    for (int k = 0; k < 3; ++k) dxdt[3 * masses + k] = u[k];
  }
  void outputs(const Scalar* x, Scalar* y) const {
    for (int k = 0; k < 3; ++k) y[k] = x[3 * masses + k];
  }
};

TEST(GraphModel, TakesManyStates) {
  const GraphModel model(trace<MassesOnSprings>(), describe<MassesOnSprings>());
  const checks::Stages at = checks::random_stages(model, 8, false, 3);
  checks::Stages here = at;
  here.substeps = 2;
  here.durations.assign(8, 0.05);
  model.integrate(here.intervals(true, true, true));
  // Along a random direction: values by first derivatives, and these by second ones.
  constexpr int nx = MassesOnSprings<double>::state_count, nz = nx + 3;
  std::vector<double> direction(nz);
  for (int c = 0; c < nz; ++c) direction[c] = std::sin(1.7 * c + 0.4);
  const double h = 1e-5;
  std::vector<checks::Stages> moved(2, here);
  for (int side = 0; side < 2; ++side) {
    for (int i = 0; i < 8; ++i) {
      for (int c = 0; c < nx; ++c) moved[side].x[i * nx + c] += (side ? -h : h) * direction[c];
      for (int c = 0; c < 3; ++c) moved[side].u[i * 3 + c] += (side ? -h : h) * direction[nx + c];
    }
    model.integrate(moved[side].intervals(true, true, true));
  }
  for (int i = 0; i < 8; ++i) {
    for (int r = 0; r < nx; ++r) {
      double slope = 0.0;
      for (int c = 0; c < nz; ++c) slope += here.jacobians[(i * nz + c) * nx + r] * direction[c];
      EXPECT_NEAR(slope, (moved[0].next[i * nx + r] - moved[1].next[i * nx + r]) / (2 * h), 1e-7);
    }
    for (int d = 0; d < nz; ++d) {
      double bend = 0.0, expected = 0.0;
      for (int c = 0; c < nz; ++c) bend += here.hessians[(i * nz + d) * nz + c] * direction[c];
      for (int r = 0; r < nx; ++r)
        expected += here.weights[i * nx + r] *
                    (moved[0].jacobians[(i * nz + d) * nx + r] - moved[1].jacobians[(i * nz + d) * nx + r]) / (2 * h);
      EXPECT_NEAR(bend, expected, 1e-6);
    }
  }
}

TEST(GraphModel, StraightMotionIsAGraphToo) {
  VehicleGraph vehicle = trace<SkidSteer>();
  Graph& graph = *vehicle.graph;
  const Expression speed = Expression::input(graph, "ground_speed"), slip(graph, vehicle.parameters[0]);
  vehicle.straight = StraightMotion{speed.node_in(graph),
                                    {-1, (0.5 * speed).node_in(graph), -1},
                                    {(speed / (1 - slip)).node_in(graph), (2 * speed).node_in(graph)}};
  const GraphModel model(vehicle, describe<SkidSteer>());
  double state[3] = {7, 7, 7}, inputs[2] = {};
  const double slips[3] = {0.5, 0.0, 0.0};
  model.straight_motion(3.0, slips, state, inputs);
  EXPECT_THAT(inputs, ::testing::ElementsAre(6.0, 6.0));
  EXPECT_THAT(state, ::testing::ElementsAre(7.0, 1.5, 7.0));
}

TEST(GraphModel, SaysWhatItCosts) {
  const GraphModel model(trace<BicycleSlip>(), describe<BicycleSlip>());
  EXPECT_GT(model.cost_of_values().instructions, 20);
  EXPECT_GT(model.cost_of_jacobians().instructions, model.cost_of_values().instructions);
  EXPECT_GT(model.cost_of_hessians().instructions, model.cost_of_jacobians().instructions);
  EXPECT_LT(model.cost_of_hessians().runs, model.cost_of_hessians().instructions);
}

}  // namespace graph_model_test
}  // namespace rhec
