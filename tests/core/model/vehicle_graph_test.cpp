#include "rhec/core/model/vehicle_graph.hpp"

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

}  // namespace vehicle_graph_test
}  // namespace rhec
