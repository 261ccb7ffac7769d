#include "rhec/sim/check/formula_trace.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include "rhec/core/model/graph_model.hpp"
#include "rhec/sim/files/json.hpp"
#include "sim/support/tank_graph.hpp"
#include "support/error_of.hpp"

namespace rhec::sim {
namespace formula_trace_test {

using testing::Contains;
using testing::ElementsAre;
using testing::Field;
using testing::UnorderedElementsAre;

FormulaTrace traced(double level, double wheel) {
  const TankGraph tank;
  return trace_formula(tank.vehicle, tank.about, {{level, wheel}, {3.0}, {0.5}});
}
const TracedNode& named(const TracedPart& part, const std::string& name) {
  for (const TracedNode& node : part.nodes)
    if (node.name == name) return node;
  ADD_FAILURE() << "no node is called " << name;
  return part.nodes.front();
}

TEST(FormulaTrace, HasEachNodeWithItsValue) {
  const FormulaTrace trace = traced(4.0, 2.0);
  EXPECT_TRUE(trace.is_finite());
  ASSERT_EQ(trace.parts.size(), 3u);
  const TracedPart &values = trace.parts[0], &slopes = trace.parts[1];
  EXPECT_EQ(values.results, 4);
  EXPECT_EQ(named(values, "hole").value, 0.25);
  EXPECT_EQ(named(values, "hole").term, "option");
  EXPECT_EQ(named(values, "outflow").value, 2.0);
  EXPECT_EQ(named(values, "outflow").term, "sqrt(level)");
  EXPECT_EQ(named(values, "level'").value, -0.5);
  EXPECT_EQ(named(values, "wheel'").value, 2.0);
  EXPECT_EQ(named(values, "seen").value, std::log(4.0));
  EXPECT_NEAR(named(slopes, "d level' / d level").value, -0.25 / 4.0, 1e-15);
  EXPECT_NEAR(named(slopes, "d wheel' / d wheel").value, -0.75, 1e-15);
  // Each node stands in one part alone.
  for (const TracedNode& node : slopes.nodes)
    EXPECT_THAT(values.nodes, Not(Contains(Field(&TracedNode::node, node.node))));
}

// The case that values do not show: a square root at zero.
TEST(FormulaTrace, FindsASlopeThatIsInfiniteWhereTheValueIsNot) {
  TankGraph tank;
  tank.vehicle.outputs.erase(tank.vehicle.outputs.begin());  // log(level)
  tank.about.outputs.erase(tank.about.outputs.begin());
  const FormulaTrace trace = trace_formula(tank.vehicle, tank.about, {{0.0, 2.0}, {3.0}, {0.5}});
  EXPECT_FALSE(trace.is_finite());
  EXPECT_FALSE(trace.parts[0].first.has_value());
  ASSERT_TRUE(trace.parts[1].first.has_value());
  const NotFinite& first = *trace.parts[1].first;
  EXPECT_EQ(first.node.term, "1 / outflow");
  EXPECT_CONTAINS(first.why, "the slope of a square root is infinite");
  EXPECT_CONTAINS(first.advice, "sqrt(a + w^2)");
  ASSERT_EQ(first.operands.size(), 1u);
  EXPECT_EQ(first.operands[0].name, "outflow");
  EXPECT_EQ(first.operands[0].value, 0.0);
  EXPECT_THAT(first.results, ElementsAre("d level' / d level"));
}

TEST(FormulaTrace, SaysWhyAValueIsNotFinite) {
  const NotFinite of_zero = *traced(1.0, 0.0).parts[0].first;
  EXPECT_EQ(of_zero.node.term, "1 / wheel");
  EXPECT_EQ(of_zero.why, "it divides by 0");
  EXPECT_THAT(of_zero.results, UnorderedElementsAre("wheel'"));
  // The root comes before the logarithm, and spoils the other result.
  const NotFinite of_negative = *traced(-1.0, 2.0).parts[0].first;
  EXPECT_EQ(of_negative.node.name, "outflow");
  EXPECT_CONTAINS(of_negative.why, "the square root of a negative number, -1");
  EXPECT_THAT(of_negative.results, UnorderedElementsAre("level'", "seen"));
}

TEST(FormulaTrace, KnowsTheReasonOfEachOperation) {
  struct Case {
    Expression (*of)(const Expression&);
    double at;
    const char* why;
  };
  const Case cases[] = {
      {[](const Expression& x) { return log(x); }, 0.0, "the logarithm of 0"},
      {[](const Expression& x) { return log(x); }, -2.0, "the logarithm of a negative number, -2"},
      {[](const Expression& x) { return asin(x); }, 1.5, "asin of 1.5, which is not within [-1, 1]"},
      {[](const Expression& x) { return exp(x); }, 1000.0, "exp of 1000 is too large"},
      {[](const Expression& x) { return pow(x, 7); }, 1e100, "power of 1e+100 is too large"},
      {[](const Expression& x) { return x * x; }, 1e200, "1e+200 * 1e+200 is too large"},
      {[](const Expression& x) { return x / 0.0; }, 1.0, "its value is not finite"},
  };
  for (const Case& each : cases) {
    VehicleGraph vehicle;
    const Expression x = Expression::input(*vehicle.graph, "x");
    vehicle.states = {x.node_in(*vehicle.graph)};
    vehicle.rates = {each.of(x).node_in(*vehicle.graph)};
    ModelDescription about;
    about.states = {{.name = "x", .unit = "1", .meaning = "x"}};
    const FormulaTrace trace = trace_formula(vehicle, about, {{each.at}, {}, {}});
    ASSERT_TRUE(trace.parts[0].first.has_value()) << each.why;
    EXPECT_CONTAINS(trace.parts[0].first->why, each.why);
  }
}

TEST(FormulaTrace, StartsStraightAheadWithinBounds) {
  const TankGraph tank;
  GraphModel model(tank.vehicle, tank.about);
  const FormulaPoint point = straight_point(model, tank.about);
  EXPECT_THAT(point.states, ElementsAre(0.0, 2.0));
  EXPECT_THAT(point.parameters, ElementsAre(0.5));
  EXPECT_EQ(point.inputs.size(), 1u);
}

TEST(FormulaTrace, IsWrittenAsJson) {
  const TankGraph tank;
  const FormulaPoint point{{1.0, 0.0}, {3.0}, {0.5}};
  const Json json = Json::parse(trace_json(trace_formula(tank.vehicle, tank.about, point), tank.about, point));
  EXPECT_EQ(json["at"]["wheel"].as_number(), 0.0);
  EXPECT_FALSE(json["finite"].as_flag());
  EXPECT_EQ(json["values"]["first_not_finite"]["term"].as_text(), "1 / wheel");
  EXPECT_TRUE(json["values"]["first_not_finite"]["value"].is_null());
  EXPECT_EQ(json["values"]["nodes"][0]["name"].as_text(), "hole");
}

}  // namespace formula_trace_test
}  // namespace rhec::sim
