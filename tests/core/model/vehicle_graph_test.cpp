#include "rhec/core/model/vehicle_graph.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

#include "models/tractor_trailer/tractor_trailer.hpp"
#include "support/error_of.hpp"

namespace rhec {
namespace vehicle_graph_test {

TEST(Trace, RecordsAFormula) {
  const TractorTrailer<double> formula;
  const VehicleGraph vehicle = trace<TractorTrailer>(formula);
  ASSERT_EQ(vehicle.states.size(), static_cast<std::size_t>(TractorTrailer<double>::state_count));
  ASSERT_EQ(vehicle.inputs.size(), static_cast<std::size_t>(TractorTrailer<double>::input_count));
  ASSERT_EQ(vehicle.parameters.size(), static_cast<std::size_t>(TractorTrailer<double>::parameter_count));
  std::vector<int> arguments;
  for (const auto* list : {&vehicle.states, &vehicle.inputs, &vehicle.parameters})
    arguments.insert(arguments.end(), list->begin(), list->end());
  std::vector<double> values;
  for (std::size_t k = 0; k < arguments.size(); ++k) values.push_back(0.2 + 0.05 * static_cast<double>(k));
  for (const auto& [node, value] : vehicle.options) {
    arguments.push_back(node);
    values.push_back(value);
  }
  double rates[TractorTrailer<double>::state_count], outputs[TractorTrailer<double>::output_count];
  const double* const u = values.data() + TractorTrailer<double>::state_count;
  formula.dynamics(values.data(), u, u + TractorTrailer<double>::input_count, rates);
  formula.outputs(values.data(), u, u + TractorTrailer<double>::input_count, outputs);
  const auto traced_rates = vehicle.graph->evaluate(vehicle.rates, arguments, values),
             traced_outputs = vehicle.graph->evaluate(vehicle.outputs, arguments, values);
  for (std::size_t j = 0; j < traced_rates.size(); ++j) EXPECT_NEAR(traced_rates[j], rates[j], 1e-14) << j;
  for (std::size_t j = 0; j < traced_outputs.size(); ++j) EXPECT_NEAR(traced_outputs[j], outputs[j], 1e-14) << j;
}

template <class Scalar>
struct Forgetful {
  static constexpr int state_count = 2, input_count = 0, parameter_count = 0, output_count = 1;
  void dynamics(const Scalar* x, const Scalar*, const Scalar*, Scalar* dxdt) const { dxdt[0] = x[1]; }
  void outputs(const Scalar* x, Scalar* y) const { y[0] = x[0]; }
};

TEST(Trace, SaysWhichResultIsLeftOut) {
  EXPECT_EQ(error_of([] { trace<Forgetful>(); }),
            "the formula's dynamics leaves out number 1; let it write all 2, from 0 on");
}

/// With a speed that two wheels share; the inputs from `first` on are written.
template <class Scalar, int first>
struct Axle {
  static constexpr int state_count = 2, input_count = 2, parameter_count = 1, output_count = 1;
  void dynamics(const Scalar*, const Scalar* u, const Scalar* p, Scalar* dxdt) const {
    dxdt[0] = p[0] * (u[0] + u[1]);
    dxdt[1] = 0.0;
  }
  void outputs(const Scalar* x, Scalar* y) const { y[0] = x[0]; }
  void straight_motion(const Scalar& ground_speed, const Scalar* p, Scalar* x, Scalar* u) const {
    x[1] = ground_speed;
    for (int j = first; j < first + 2; ++j) u[j] = 0.5 * ground_speed / p[0];
  }
};
template <class Scalar>
struct Whole : Axle<Scalar, 0> {};
template <class Scalar>
struct Late : Axle<Scalar, 1> {};

TEST(Trace, StraightMotionIsPartOfTheFormula) {
  EXPECT_FALSE(trace<TractorTrailer>().straight.has_value());
  const VehicleGraph vehicle = trace<Whole>();
  ASSERT_TRUE(vehicle.straight.has_value());
  ASSERT_EQ(vehicle.straight->states.size(), 2u);
  EXPECT_EQ(vehicle.straight->states[0], -1);
  const std::vector<int> given{vehicle.straight->ground_speed, vehicle.parameters[0]};
  const std::vector<int> wanted{vehicle.straight->states[1], vehicle.straight->inputs[0], vehicle.straight->inputs[1]};
  EXPECT_THAT(vehicle.graph->evaluate(wanted, given, std::vector<double>{3.0, 0.5}),
              ::testing::ElementsAre(3.0, 3.0, 3.0));
  EXPECT_EQ(error_of([] { trace<Late>(); }),
            "the formula's straight_motion leaves out number 0; let it write all 2, from 0 on");
}

}  // namespace vehicle_graph_test
}  // namespace rhec
