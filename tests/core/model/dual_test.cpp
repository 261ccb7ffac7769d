// Every function of Dual and SecondOrder against finite differences, and their arithmetic against the rules of
// calculus.
#include "rhec/core/model/dual.hpp"

#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <vector>

namespace rhec {
namespace {

using First = Dual<double, 2>;
using Second = SecondOrder<double, 2>;

/// Value, gradient and Hessian (its lower triangle) of a function of two variables.
struct Expansion {
  double value, x, y, xx, xy, yy;
};

/// By fourth-order differences; h balances truncation and rounding errors.
template <class Function>
Expansion differences(Function f, double x, double y) {
  const double h = 2e-3;
  const auto slope = [h](auto g) { return (g(-2 * h) - 8 * g(-h) + 8 * g(h) - g(2 * h)) / (12 * h); };
  const auto by_x = [&](double s, double t) { return slope([&](double d) { return f(s + d, t); }); };
  const auto by_y = [&](double s, double t) { return slope([&](double d) { return f(s, t + d); }); };
  return {f(x, y),
          by_x(x, y),
          by_y(x, y),
          slope([&](double d) { return by_x(x + d, y); }),
          slope([&](double d) { return by_x(x, y + d); }),
          slope([&](double d) { return by_y(x, y + d); })};
}

template <class Function>
void expect_derivatives(const std::string& name, Function f, double x, double y) {
  SCOPED_TRACE(name + " at " + std::to_string(x) + ", " + std::to_string(y));
  const Expansion expected = differences(f, x, y);
  const First first = f(First::variable<0>(x), First::variable<1>(y));
  const Second second = f(Second::variable<0>(x), Second::variable<1>(y));
  EXPECT_NEAR(first.value, expected.value, 1e-14 * (1 + std::abs(expected.value)));
  EXPECT_NEAR(second.value, expected.value, 1e-14 * (1 + std::abs(expected.value)));
  const auto near = [](double found, double wanted, double tolerance) {
    EXPECT_NEAR(found, wanted, tolerance * (1 + std::abs(wanted)));
  };
  near(first.d[0], expected.x, 1e-8);
  near(first.d[1], expected.y, 1e-8);
  near(second.dd[0], expected.xx, 1e-6);
  near(second.dd[1], expected.xy, 1e-6);
  near(second.dd[2], expected.yy, 1e-6);
  for (int j = 0; j < 2; ++j) near(second.d[j], first.d[j], 1e-15);
}

// A function of one variable is applied to x * y + x, so that the chain rule meets a nonlinear inner function.
#define EXPECT_DERIVATIVES_OF(FUNCTION, X, Y)                                         \
  expect_derivatives(                                                                 \
      #FUNCTION,                                                                      \
      [](auto x, auto y) {                                                            \
        using std::sqrt, std::exp, std::log, std::sin, std::cos, std::tan, std::tanh; \
        using std::asin, std::acos, std::atan;                                        \
        return FUNCTION(x * y + x);                                                   \
      },                                                                              \
      X, Y)

TEST(Dual, FunctionsOfOneVariable) {
  for (const double at : {0.6, 0.9, 1.7}) {
    EXPECT_DERIVATIVES_OF(sqrt, at, 0.6);
    EXPECT_DERIVATIVES_OF(log, at, 0.6);
    EXPECT_DERIVATIVES_OF(1.0 /, at, 0.6);
  }
  for (const double at : {-0.5, -0.2, 0.0, 0.3, 0.5}) {
    EXPECT_DERIVATIVES_OF(exp, at, 0.6);
    EXPECT_DERIVATIVES_OF(sin, at, 0.6);
    EXPECT_DERIVATIVES_OF(cos, at, 0.6);
    EXPECT_DERIVATIVES_OF(tan, at, 0.6);
    EXPECT_DERIVATIVES_OF(tanh, at, 0.6);
    EXPECT_DERIVATIVES_OF(asin, at, 0.6);
    EXPECT_DERIVATIVES_OF(acos, at, 0.6);
    EXPECT_DERIVATIVES_OF(atan, at, 0.6);
    EXPECT_DERIVATIVES_OF(-, at, 0.6);
  }
}

TEST(Dual, AngleOfAVectorInEveryQuadrantAndOnTheAxes) {
  const auto angle = [](auto y, auto x) {
    using std::atan2;
    return atan2(y, x);
  };
  for (const double degrees : {-170., -135., -90., -45., 0., 30., 90., 120., 170.}) {
    const double radians = degrees * M_PI / 180;
    expect_derivatives("atan2", angle, 2 * std::sin(radians), 2 * std::cos(radians));
  }
  // On the cut the value jumps, the derivatives do not.
  const First cut = angle(First::variable<0>(0.0), First::variable<1>(-2.0));
  EXPECT_EQ(cut.value, M_PI);
  EXPECT_DOUBLE_EQ(cut.d[0], -0.5);
  EXPECT_NEAR(cut.d[1], 0.0, 1e-15);
  const First with_constant = atan2(First::variable<0>(1.0), 1.0), constant_first = atan2(1.0, First::variable<0>(1.0));
  EXPECT_DOUBLE_EQ(with_constant.d[0], 0.5);
  EXPECT_DOUBLE_EQ(constant_first.d[0], -0.5);
}

TEST(Dual, ArithmeticOfTwoVariables) {
  const auto all = [](auto x, auto y) {
    auto z = x * y - y / x + (x - y) * (x + y);
    z += x;
    z -= y * y;
    z *= x;
    z /= y;
    return z;
  };
  expect_derivatives("arithmetic", all, 0.7, -1.3);
  expect_derivatives("arithmetic", all, -2.0, 0.9);
}

TEST(Dual, ArithmeticWithConstantsOnEverySide) {
  const auto all = [](auto x, auto y) {
    auto z = 2 * x + 1.5 * y * 3 - (4 - x) / 2.0 + (y - 1) * (2.5 + x) + 3.0 / y + 1 / x;
    z += 1;
    z -= 0.25;
    z *= 2;
    z /= 3.0;
    return z;
  };
  expect_derivatives("constants", all, 0.7, -1.3);
}

TEST(Dual, AConstantHasNoDerivatives) {
  const Second constant = 3;
  EXPECT_EQ(constant.value, 3.0);
  for (const double d : constant.d) EXPECT_EQ(d, 0.0);
  for (const double dd : constant.dd) EXPECT_EQ(dd, 0.0);
}

}  // namespace
}  // namespace rhec
