#include "plugins/equations/definitions.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "support/error_of.hpp"

namespace rhec::equations {
namespace definitions_test {

SourceText source_of(std::string_view text) {
  SourceText source{"vehicle.yaml", {}};
  for (int number = 1;; ++number) {
    const std::size_t end = text.find('\n');
    source.lines.push_back({text.substr(0, end), number, 1});
    if (end == std::string_view::npos) return source;
    text.remove_prefix(end + 1);
  }
}

/// Equations of the variables x and y.
class Equations {
 public:
  explicit Equations(const std::string& text) {
    definitions_.add(parse_statements(source_of(text)));
    definitions_.build();
  }
  double value(const std::string& name, double x, double y) const {
    const int node = definitions_.node(name), inputs[] = {x_, y_};
    const double values[] = {x, y};
    return graph_.evaluate({&node, 1}, inputs, values)[0];
  }
  Graph graph_;
  int x_ = graph_.input("x"), y_ = graph_.input("y");
  Definitions definitions_{graph_, "vehicle.yaml", {{"x", x_}, {"y", y_}}};
};

std::string why_not(const std::string& text) {
  return error_of([&] { const Equations equations(text); });
}

TEST(Definitions, MayStandInAnyOrderAndUseEachOther) {
  const Equations equations("d' = a * b\nb = a + pi\na = 2 * x\ne = 3 * d' + smooth_max(x, y, 0.1)");
  EXPECT_DOUBLE_EQ(equations.value("d'", 0.5, 0.0), 1.0 * (1.0 + std::numbers::pi));
  EXPECT_NEAR(equations.value("e", 0.5, 0.0), 3.0 * (1.0 + std::numbers::pi) + 0.5 * (0.5 + std::sqrt(0.26)), 1e-15);
}

TEST(Definitions, EveryFunctionIsTheOneOfItsName) {
  const double x = 0.4, y = -0.7;
  const auto of = [&](const std::string& term) { return Equations("f = " + term).value("f", x, y); };
  EXPECT_DOUBLE_EQ(of("sqrt(x)"), std::sqrt(x));
  EXPECT_DOUBLE_EQ(of("exp(y)"), std::exp(y));
  EXPECT_DOUBLE_EQ(of("log(x)"), std::log(x));
  EXPECT_DOUBLE_EQ(of("sin(x) + cos(y)"), std::sin(x) + std::cos(y));
  EXPECT_DOUBLE_EQ(of("tan(x)"), std::tan(x));
  EXPECT_DOUBLE_EQ(of("asin(x) - acos(y)"), std::asin(x) - std::acos(y));
  EXPECT_DOUBLE_EQ(of("atan(x)"), std::atan(x));
  EXPECT_DOUBLE_EQ(of("atan2(y, x)"), std::atan2(y, x));
  EXPECT_DOUBLE_EQ(of("tanh(x)"), std::tanh(x));
  EXPECT_DOUBLE_EQ(of("hypot(x, y)"), std::hypot(x, y));
  EXPECT_DOUBLE_EQ(of("smooth_abs(y, 0.2)"), std::sqrt(y * y + 0.04));
  EXPECT_DOUBLE_EQ(of("smooth_min(x, y, 0.2)"), 0.5 * (x + y - std::sqrt((x - y) * (x - y) + 0.04)));
  EXPECT_DOUBLE_EQ(of("x^0.5"), std::sqrt(x));
  EXPECT_DOUBLE_EQ(of("y^3"), y * y * y);
  EXPECT_DOUBLE_EQ(of("y^-2"), 1 / (y * y));
  EXPECT_DOUBLE_EQ(of("x^y"), std::pow(x, y));
  EXPECT_DOUBLE_EQ(of("2^10 - 1"), 1023.0);
}

TEST(Definitions, RefuseWhatIsNotKnownNotOnceOrNotWithoutItself) {
  EXPECT_EQ(why_not("a = 2 * speeed\nspeed = x"),
            "vehicle.yaml:1:9: 'speeed' is not known; did you mean 'speed'? (in the equation of a)\n"
            "    a = 2 * speeed\n"
            "            ^");
  EXPECT_CONTAINS(why_not("a = somewhere_else"), "'somewhere_else' is not known; expected a state, an input");
  EXPECT_CONTAINS(why_not("a = x\n\na = y"),
                  "vehicle.yaml:3:1: there is an equation for 'a' in line 1 already; remove one of them");
  EXPECT_CONTAINS(why_not("x = 2"),
                  "the value of 'x' is given; expected an equation for the derivative of a state (x' = ..., if it is "
                  "one)");
  EXPECT_CONTAINS(why_not("a = 2 * t"), "equations do not depend on time");
  EXPECT_CONTAINS(why_not("a = b + 1\nb = sin(c)\nc = a"),
                  "vehicle.yaml:3:5: 'a' needs itself: a -> b -> c -> a; write one of them without the others");
  EXPECT_CONTAINS(why_not("a = a"), "vehicle.yaml:1:5: 'a' needs itself: a -> a");
}

TEST(Definitions, RefuseWhatIsFiniteForNoValues) {
  EXPECT_CONTAINS(why_not("a = x / 0"), "vehicle.yaml:1:7: this divides by 0");
  EXPECT_CONTAINS(why_not("a = x / (1 - 1)"), "this divides by 0");
  EXPECT_CONTAINS(why_not("a = x + sqrt(-1)"),
                  "vehicle.yaml:1:9: sqrt(...) is not a finite number, whatever the values");
  EXPECT_CONTAINS(why_not("a = log(0)"), "log(...) is not a finite number");
  EXPECT_CONTAINS(why_not("a = x * 10^400"), "this power is not a finite number");
}

TEST(Definitions, RefuseAnglesThatAreWrappedByHand) {
  EXPECT_CONTAINS(why_not("a = 2 + atan2(sin(x + y), cos(x + y))"), "vehicle.yaml:1:9: this wraps an angle");
  EXPECT_EQ(why_not("a = atan2(sin(x), cos(y))"), "");
}

TEST(Definitions, TellTheNodeOfEachPart) {
  Equations of("two = 1 + 1");
  const std::vector<int> nodes = of.definitions_.build_items(parse_term(source_of("x * two + 0 * y")));
  ASSERT_EQ(nodes.size(), 7u);
  EXPECT_EQ(nodes[0], of.x_);
  EXPECT_EQ(of.definitions_.constant_value(nodes[1]), 2.0);
  EXPECT_EQ(of.definitions_.constant_value(nodes[5]), 0.0);  // by its structure
  EXPECT_FALSE(of.definitions_.constant_value(nodes[6]).has_value());
}

TEST(Definitions, LongChainsTakeNoStack) {
  std::string text = "a0 = x";
  for (int k = 1; k < 20000; ++k) text = "a" + std::to_string(k) + " = a" + std::to_string(k - 1) + " + y\n" + text;
  EXPECT_EQ(Equations(text).value("a19999", 1.0, 2.0), 1.0 + 19999 * 2.0);
}

}  // namespace definitions_test
}  // namespace rhec::equations
