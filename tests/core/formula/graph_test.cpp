#include "rhec/core/formula/graph.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>

#include "support/error_of.hpp"

namespace rhec {
namespace graph_test {

using testing::ElementsAre;

class GraphTest : public testing::Test {
 protected:
  Graph g_;
  const int x_ = g_.input("x"), y_ = g_.input("y");
  int c(double value) { return g_.constant(value); }
  double value(int node, double x = 0.7, double y = -0.3) {
    const int inputs[] = {x_, y_};
    const double values[] = {x, y};
    return g_.evaluate({&node, 1}, inputs, values)[0];
  }
};

TEST_F(GraphTest, EqualNodesAreOne) {
  EXPECT_EQ(g_.add(x_, y_), g_.add(y_, x_));
  EXPECT_EQ(g_.multiply(x_, y_), g_.multiply(y_, x_));
  EXPECT_NE(g_.subtract(x_, y_), g_.subtract(y_, x_));
  EXPECT_EQ(g_.function(Operation::sine, x_), g_.function(Operation::sine, x_));
  EXPECT_NE(g_.input("x"), x_);  // inputs are told apart, whatever their names
}

TEST_F(GraphTest, SimplifiesWhatHoldsForRealNumbers) {
  EXPECT_EQ(g_.add(x_, c(0.0)), x_);
  EXPECT_EQ(g_.subtract(x_, c(0.0)), x_);
  EXPECT_EQ(g_.subtract(c(0.0), x_), g_.negate(x_));
  EXPECT_EQ(g_.multiply(x_, c(1.0)), x_);
  EXPECT_EQ(g_.multiply(x_, c(0.0)), c(0.0));
  EXPECT_EQ(g_.multiply(c(-1.0), x_), g_.negate(x_));
  EXPECT_EQ(g_.subtract(x_, x_), c(0.0));
  EXPECT_EQ(g_.add(x_, x_), g_.multiply(c(2.0), x_));
  EXPECT_EQ(g_.negate(g_.negate(x_)), x_);
  EXPECT_EQ(g_.reciprocal(g_.reciprocal(x_)), x_);
  EXPECT_EQ(g_.add(x_, g_.negate(y_)), g_.subtract(x_, y_));
  EXPECT_EQ(g_.subtract(x_, g_.negate(y_)), g_.add(x_, y_));
  EXPECT_EQ(g_.negate(g_.subtract(x_, y_)), g_.subtract(y_, x_));
  EXPECT_EQ(g_.multiply(g_.negate(x_), y_), g_.negate(g_.multiply(x_, y_)));
  EXPECT_EQ(g_.multiply(c(2.0), g_.multiply(x_, c(3.0))), g_.multiply(c(6.0), x_));
  EXPECT_EQ(g_.multiply(g_.multiply(c(2.0), x_), y_), g_.multiply(c(2.0), g_.multiply(x_, y_)));
  EXPECT_EQ(g_.function(Operation::sine, g_.negate(x_)), g_.negate(g_.function(Operation::sine, x_)));
  EXPECT_EQ(g_.function(Operation::cosine, g_.negate(x_)), g_.function(Operation::cosine, x_));
  EXPECT_EQ(g_.divide(x_, y_), g_.multiply(x_, g_.reciprocal(y_)));
}

TEST_F(GraphTest, Powers) {
  EXPECT_EQ(g_.power(x_, 0), c(1.0));
  EXPECT_EQ(g_.power(x_, 1), x_);
  EXPECT_EQ(g_.power(x_, 2), g_.multiply(x_, x_));
  EXPECT_EQ(g_.power(g_.negate(x_), 4), g_.power(x_, 4));
  for (const int exponent : {-7, -2, -1, 0, 1, 2, 3, 5, 16})
    EXPECT_NEAR(value(g_.power(x_, exponent), 1.3), std::pow(1.3, exponent), 1e-13 * std::pow(1.3, exponent))
        << exponent;
}

TEST_F(GraphTest, FoldsConstants) {
  EXPECT_EQ(g_.add(c(2.0), c(3.0)), c(5.0));
  EXPECT_EQ(g_.function(Operation::arc_tangent_2, c(1.0), c(2.0)), c(std::atan2(1.0, 2.0)));
  EXPECT_EQ(c(-0.0), c(0.0));
  // What is not finite stays so, and one NaN is one node.
  EXPECT_TRUE(std::isinf(g_[g_.divide(c(1.0), c(0.0))].value));
  EXPECT_TRUE(std::isnan(g_[g_.function(Operation::square_root, c(-1.0))].value));
  EXPECT_EQ(g_.function(Operation::square_root, c(-1.0)), g_.function(Operation::square_root, c(-2.0)));
}

// The one place where the rules are not those of IEEE 754.
TEST_F(GraphTest, ZeroTimesAnythingIsZero) {
  const int node = g_.multiply(c(0.0), g_.reciprocal(x_));
  EXPECT_EQ(value(node, 0.0), 0.0);
  EXPECT_TRUE(std::isnan(value(g_.multiply(x_, g_.reciprocal(x_)), 0.0)));  // not known to be zero
}

TEST_F(GraphTest, EvaluatesEveryOperation) {
  const double x = 0.7, y = -0.3;
  const auto of = [&](Operation operation) { return value(g_.function(operation, x_)); };
  EXPECT_DOUBLE_EQ(value(g_.add(x_, y_)), x + y);
  EXPECT_DOUBLE_EQ(value(g_.subtract(x_, y_)), x - y);
  EXPECT_DOUBLE_EQ(value(g_.multiply(x_, y_)), x * y);
  EXPECT_DOUBLE_EQ(value(g_.negate(x_)), -x);
  EXPECT_DOUBLE_EQ(value(g_.reciprocal(x_)), 1.0 / x);
  EXPECT_DOUBLE_EQ(of(Operation::square_root), std::sqrt(x));
  EXPECT_DOUBLE_EQ(of(Operation::exponential), std::exp(x));
  EXPECT_DOUBLE_EQ(of(Operation::logarithm), std::log(x));
  EXPECT_DOUBLE_EQ(of(Operation::sine), std::sin(x));
  EXPECT_DOUBLE_EQ(of(Operation::cosine), std::cos(x));
  EXPECT_DOUBLE_EQ(of(Operation::tangent), std::tan(x));
  EXPECT_DOUBLE_EQ(of(Operation::arc_sine), std::asin(x));
  EXPECT_DOUBLE_EQ(of(Operation::arc_cosine), std::acos(x));
  EXPECT_DOUBLE_EQ(of(Operation::arc_tangent), std::atan(x));
  EXPECT_DOUBLE_EQ(of(Operation::hyperbolic_tangent), std::tanh(x));
  EXPECT_DOUBLE_EQ(value(g_.function(Operation::arc_tangent_2, x_, y_)), std::atan2(x, y));
}

TEST_F(GraphTest, ReachesWhatIsNeeded) {
  const int sum = g_.add(x_, y_), product = g_.multiply(sum, x_), aside = g_.function(Operation::sine, y_);
  EXPECT_THAT(g_.reach({&product, 1}), ElementsAre(x_, y_, sum, product));
  EXPECT_THAT(g_.reach({&product, 1}, {&sum, 1}), ElementsAre(x_, sum, product));
  EXPECT_EQ(g_.count_operations({&product, 1}), 2);
  EXPECT_EQ(g_.count_operations({&aside, 1}), 1);
}

TEST_F(GraphTest, SubstitutesAndSimplifiesAgain) {
  const int formula = g_.add(g_.multiply(x_, y_), g_.function(Operation::sine, x_));
  const int from[] = {x_}, zero[] = {c(0.0)}, to[] = {g_.add(y_, c(1.0))};
  EXPECT_EQ(g_.substitute({&formula, 1}, from, zero)[0], c(0.0));
  EXPECT_NEAR(value(g_.substitute({&formula, 1}, from, to)[0], 9.0, 0.2), 1.2 * 0.2 + std::sin(1.2), 1e-15);
}

TEST_F(GraphTest, KeepsNames) {
  const int sum = g_.add(x_, y_);
  g_.name(sum, "total");
  g_.name(sum, "another");
  EXPECT_EQ(g_.name_of(sum), "total");
  EXPECT_EQ(g_.name_of(x_), "x");
  EXPECT_EQ(g_.name_of(g_.negate(sum)), "");
}

TEST_F(GraphTest, SaysWhichInputHasNoValue) {
  const int sum = g_.add(x_, y_);
  const double one = 1.0;
  EXPECT_EQ(error_of([&] {
              g_.evaluate({&sum, 1}, {&x_, 1}, {&one, 1});
            }),
            "the input 'y' has no value; give one for each input that is needed");
}

}  // namespace graph_test
}  // namespace rhec
