#include "sim/check/differences.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include "sim/support/unicycle.hpp"

namespace rhec::sim {
namespace differences_test {

/// Two results of the four states of a unicycle: r0 = x0 sin(x1), r1 = x2^2.
class Differences : public ::testing::Test {
 protected:
  const ModelDescription about_ = unicycle_description();
  const StagePoints stages_ = random_stages(about_, 4, 3);
  std::vector<Variable> rows_ = std::vector<Variable>(2);
  std::vector<DifferenceEntry> entries_;
  double slip_ = 1.0;  ///< of one slope, and of one bend
  void SetUp() override {
    rows_[0].name = "product";
    rows_[1].name = "square";
    append_entries(entries_, about_.states);
  }
  template <class Row>
  std::vector<double> each(const StagePoints& points, const Row& row) const {
    std::vector<double> all;
    for (int i = 0; i < points.count; ++i)
      for (const double value : row(points.states.data() + i * 4)) all.push_back(value);
    return all;
  }
  std::vector<double> values(const StagePoints& points) const {
    return each(points, [](const double* x) { return std::vector{x[0] * std::sin(x[1]), x[2] * x[2]}; });
  }
  std::vector<double> jacobians(const StagePoints& points) const {
    return each(points, [&](const double* x) {
      return std::vector{std::sin(x[1]), 0.0, slip_ * x[0] * std::cos(x[1]), 0.0, 0.0, 2.0 * x[2], 0.0, 0.0};
    });
  }
  std::vector<double> hessians(const StagePoints& points, const std::vector<double>& weights) const {
    int i = 0;
    return each(points, [&](const double* x) {
      const double *w = weights.data() + 2 * i++, mixed = w[0] * std::cos(x[1]);
      std::vector<double> h(16, 0.0);
      h[1] = h[4] = mixed;
      h[5] = -w[0] * x[0] * std::sin(x[1]);
      h[10] = bend_ * 2.0 * w[1];
      return h;
    });
  }
  double bend_ = 1.0;
  WorstEntry first_, second_;
  DerivativeErrors compare() {
    DerivativeErrors all;
    compare_first_derivatives(
        stages_, about_, entries_, {&rows_, ""}, [&](const StagePoints& points) { return values(points); },
        [&](const StagePoints& points) { return jacobians(points); }, first_, all);
    compare_second_derivatives(
        stages_, about_, entries_, {&rows_, ""}, [&](const StagePoints& points) { return jacobians(points); },
        [&](const StagePoints& points, const std::vector<double>& weights) { return hessians(points, weights); },
        second_, all);
    return all;
  }
};

TEST_F(Differences, AgreeWithRightDerivatives) {
  const DerivativeErrors all = compare();
  EXPECT_LT(first_.error, 1e-8);
  EXPECT_LT(second_.error, 1e-8);
  EXPECT_EQ(all.skipped, 0);
  EXPECT_GT(all.compared, 4 * 2 * 4);
}

TEST_F(Differences, FindAWrongSlope) {
  slip_ = 1.001;
  compare();
  EXPECT_GT(first_.error, 1e-5);
  EXPECT_EQ(first_.where, "d product / d " + about_.states[1].name);
  EXPECT_NEAR(first_.given / first_.expected, 1.001, 1e-6);
}

TEST_F(Differences, FindAWrongBend) {
  bend_ = 0.5;
  compare();
  EXPECT_LT(first_.error, 1e-8);
  EXPECT_NEAR(second_.given, 1.0, 1e-6);
  EXPECT_NEAR(second_.expected, 2.0, 1e-6);
  EXPECT_THAT(second_.where, testing::HasSubstr("d2 square"));
}

TEST(TypicalRange, IsNarrowerThanWideBounds) {
  Variable wide;
  wide.scale = 2.0;
  wide.lower = -1000.0;
  wide.upper = 5.0;
  EXPECT_EQ(typical_range(wide), std::pair(-20.0, 5.0));
}

}  // namespace differences_test
}  // namespace rhec::sim
