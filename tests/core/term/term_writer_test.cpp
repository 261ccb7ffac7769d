#include "rhec/core/term/term_writer.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "rhec/core/base/error.hpp"
#include "rhec/core/model/vehicle_graph.hpp"
#include "support/cart.hpp"
#include "support/error_of.hpp"
#include "support/unicycle.hpp"

namespace rhec {
namespace term_writer_test {

using ::testing::AllOf;
using testing::cart;
using ::testing::HasSubstr;
using testing::unicycle;

/// A writer with the variables of a vehicle, whose values can be set.
struct Desk {
  explicit Desk(std::shared_ptr<const Model> of) : vehicle(std::move(of)) {
    const ModelDescription& about = vehicle->description();
    variables.states = new_variables(graph, "x", vehicle->state_count(), names_of(about.states));
    variables.inputs = new_variables(graph, "u", vehicle->input_count(), names_of(about.inputs));
    variables.parameters = new_variables(graph, "p", vehicle->parameter_count(), names_of(about.parameters));
  }
  double value(const Expression& of, const std::vector<double>& x, const std::vector<double>& u,
               const std::vector<double>& p) {
    std::vector<int> inputs;
    std::vector<double> values = x;
    for (const auto* all : {&variables.states, &variables.inputs, &variables.parameters})
      for (const Expression& each : *all) inputs.push_back(each.node_in(graph));
    values.insert(values.end(), u.begin(), u.end());
    values.insert(values.end(), p.begin(), p.end());
    return graph.evaluate(std::vector{of.node_in(graph)}, inputs, values)[0];
  }
  std::shared_ptr<const Model> vehicle;
  Graph graph;
  StageVariables variables;
  TermWriter writer() { return {"mine", *vehicle, graph, variables}; }
};

TEST(TermWriter, FindsTheVehiclesVariablesAndRates) {
  Desk desk(unicycle());
  TermWriter writer = desk.writer();
  const std::vector<double> x{1.0, 2.0, 0.3}, u{1.5, 0.4}, p{0.8};
  EXPECT_EQ(desk.value(writer.position_x(), x, u, p), 1.0);
  EXPECT_EQ(desk.value(writer.position_y(), x, u, p), 2.0);
  EXPECT_EQ(desk.value(writer.heading(), x, u, p), 0.3);
  EXPECT_EQ(desk.value(writer.wheel_speed(), x, u, p), 1.5);
  EXPECT_EQ(desk.value(writer.input("curvature"), x, u, p), 0.4);
  EXPECT_EQ(desk.value(writer.state("y"), x, u, p), 2.0);
  EXPECT_NEAR(desk.value(writer.ground_speed(), x, u, p), 0.8 * 1.5, 1e-15);
  EXPECT_NEAR(desk.value(writer.heading_rate(), x, u, p), 0.8 * 1.5 * 0.4, 1e-15);
  std::vector<double> rates(3);
  desk.vehicle->rates(x.data(), u.data(), p.data(), rates.data());
  for (int j = 0; j < 3; ++j) EXPECT_NEAR(desk.value(writer.rate(j), x, u, p), rates[j], 1e-15) << j;
}

TEST(TermWriter, KeepsWhatIsWrittenInItsOrder) {
  Desk desk(unicycle());
  TermWriter writer = desk.writer();
  const Expression first = writer.data("first"), second = writer.data("second");
  writer.limit(writer.position_x() - second, {.linear = 2.0, .quadratic = 3.0}, "a");
  writer.limit(writer.position_y() - first, {}, "b");
  writer.residual(writer.heading(), {.weight = 4.0, .delta = 0.5}, "c");
  EXPECT_EQ(writer.data_nodes(), (std::vector{first.node_in(desk.graph), second.node_in(desk.graph)}));
  ASSERT_EQ(writer.limits().size(), 2u);
  EXPECT_EQ(writer.limits()[0].name, "a");
  EXPECT_EQ(writer.limits()[0].softness.quadratic, 3.0);
  EXPECT_FALSE(writer.limits()[0].softness.is_hard());
  EXPECT_TRUE(writer.limits()[1].softness.is_hard());
  ASSERT_EQ(writer.residuals().size(), 1u);
  EXPECT_EQ(writer.residuals()[0].loss.delta, 0.5);
}

TEST(TermWriter, RefusesInWordsWhatIsNotThere) {
  Desk unicycle_desk(unicycle()), cart_desk(cart());
  TermWriter of_unicycle = unicycle_desk.writer(), of_cart = cart_desk.writer();
  EXPECT_THAT(error_of([&] { of_cart.heading(); }),
              AllOf(HasSubstr("term 'mine': the model 'cart'"), HasSubstr("heading")));
  EXPECT_THAT(error_of([&] { of_cart.position_y(); }), HasSubstr("position"));
  EXPECT_THAT(error_of([&] { of_cart.wheel_speed(); }), HasSubstr("speed"));
  EXPECT_THAT(error_of([&] { of_cart.heading_rate(); }), HasSubstr("heading"));
  EXPECT_THAT(error_of([&] { of_unicycle.input("curvatur"); }), HasSubstr("did you mean 'curvature'?"));
  EXPECT_THAT(error_of([&] { of_unicycle.state("speed"); }), HasSubstr("has no state 'speed'"));
  const Expression x = of_unicycle.position_x();
  EXPECT_THAT(error_of([&] { of_unicycle.limit(x, {.linear = 0.0}, "free"); }), HasSubstr("'free' costs 0 per unit"));
  EXPECT_THAT(error_of([&] { of_unicycle.limit(x, {.linear = -1.0, .quadratic = 1.0}, "free"); }), HasSubstr("'free'"));
  EXPECT_THAT(error_of([&] { of_unicycle.residual(x, {.weight = -1.0}, "r"); }), HasSubstr("weight -1"));
  EXPECT_THAT(error_of([&] { of_unicycle.residual(x, {.delta = 0.0}, "r"); }), HasSubstr("delta 0"));
}

}  // namespace term_writer_test
}  // namespace rhec
