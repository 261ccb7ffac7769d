#include "rhec/core/term/term_functions.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "rhec/core/base/error.hpp"
#include "support/error_of.hpp"
#include "support/unicycle.hpp"

namespace rhec {
namespace term_functions_test {

using ::testing::DoubleNear;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::unicycle;
using Stage = TermFunctions::Stage;

/// One limit of an input and one of the state, with a number of its own each.
class Two final : public Term {
 public:
  explicit Two(bool is_idle = false) : is_idle_(is_idle) {}
  void write(TermWriter& writer) const override {
    if (is_idle_) return writer.limit(writer.data("number"), {}, "idle");
    writer.limit(writer.input("curvature") * writer.data("gain"), {}, "curvature");
    writer.limit(writer.position_x() * writer.position_y() + writer.data("offset"), {.linear = 7.0}, "product");
    writer.residual(writer.position_y(), {.weight = 2.0}, "y");
  }
  void write_data(const TermPlace&, double*, double*, double*) const noexcept override {}
  int most_obstacles() const noexcept override { return 3; }

 private:
  bool is_idle_;
};

TEST(TermFunctions, SortsLimitsByWhatTheyNeed) {
  const auto model = unicycle();
  const TermFunctions functions(*model, {{"one", std::make_shared<Two>()}, {"two", std::make_shared<Two>()}});
  EXPECT_EQ(functions.limit_count(), 4);
  EXPECT_THAT(functions.limit_names(), ElementsAre("one: product", "two: product", "one: curvature", "two: curvature"));
  EXPECT_EQ(functions.linear()[0], 7.0);
  EXPECT_EQ(functions.linear()[2], std::numeric_limits<double>::infinity());
  EXPECT_EQ(functions.place_of(0, 0), 2);
  EXPECT_EQ(functions.place_of(1, 1), 1);
  EXPECT_EQ(functions.first_data_of(1), 2);
  EXPECT_EQ(functions.data_count(), 4);
  EXPECT_EQ(functions.most_obstacles(), 3);
  EXPECT_EQ(functions.rows(Stage::first).first_limit, 2);
  EXPECT_EQ(functions.rows(Stage::first).limits, 2);
  EXPECT_TRUE(functions.rows(Stage::first).residuals.empty());
  EXPECT_EQ(functions.rows(Stage::middle).limits, 4);
  EXPECT_EQ(functions.rows(Stage::last).first_limit, 0);
  EXPECT_EQ(functions.rows(Stage::last).limits, 2);
  EXPECT_THAT(functions.rows(Stage::last).residuals, ElementsAre(0, 1));
}

TEST(TermFunctions, EvaluatesManyStagesAsItDoesEach) {
  const auto model = unicycle();
  const TermFunctions functions(*model, {{"one", std::make_shared<Two>()}});
  constexpr int count = 45;  // packs of several widths, and a rest
  const int row = functions.argument_row();
  ASSERT_EQ(functions.argument_count(), 3 + 1 + 2 + 1 + 2);
  std::vector<double> arguments(static_cast<std::size_t>(count) * row, 0.0), scratch(functions.scratch_size());
  for (int i = 0; i < count; ++i)
    for (int j = 0; j < functions.argument_count(); ++j) arguments[i * row + j] = 0.1 * i - 0.3 * j;
  const TermFunctions::Rows& rows = functions.rows(Stage::middle);
  ASSERT_EQ(rows.count(), 3);
  std::vector<double> values(count * 3), slopes(count * rows.slopes.size()), bends(count * rows.bends.size()),
      weights(count * 3), only_values(values);
  functions.evaluate(Stage::middle, count, arguments.data(), values.data(), slopes.data(), scratch.data());
  functions.evaluate(Stage::middle, count, arguments.data(), only_values.data(), nullptr, scratch.data());
  for (int i = 0; i < count * 3; ++i) weights[i] = 0.5 + 0.01 * i;
  functions.curve(Stage::middle, count, arguments.data(), weights.data(), bends.data(), scratch.data());
  ASSERT_EQ(rows.slopes.size(), 4u) << "x and y of the product, the curvature, y";
  ASSERT_EQ(rows.bends.size(), 1u) << "of x and y";
  EXPECT_EQ(rows.bends[0].row, 1);
  EXPECT_EQ(rows.bends[0].column, 0);
  for (int i = 0; i < count; ++i) {
    const double* a = arguments.data() + i * row;
    const double expected[3] = {a[0] * a[1] + a[8], a[5] * a[7], a[1]};
    for (int r = 0; r < 3; ++r) {
      EXPECT_NEAR(values[i * 3 + r], expected[r], 1e-14) << i;
      EXPECT_NEAR(only_values[i * 3 + r], expected[r], 1e-14) << i;
    }
    for (std::size_t e = 0; e < rows.slopes.size(); ++e) {
      const auto& [r, c] = rows.slopes[e];
      const double slope = r == 0 ? (c == 0 ? a[1] : a[0]) : r == 1 ? a[7] : 1.0;
      EXPECT_NEAR(slopes[i * rows.slopes.size() + e], slope, 1e-15) << i;
    }
    EXPECT_EQ(bends[static_cast<std::size_t>(i)], weights[i * 3]);
  }
}

TEST(TermFunctions, WritesLimitsWhereTheyAreWanted) {
  const auto model = unicycle();
  const TermFunctions functions(*model, {{"one", std::make_shared<Two>()}});
  constexpr int count = 45;
  const int row = functions.argument_row();
  std::vector<double> arguments(static_cast<std::size_t>(count) * row, 0.0), scratch(functions.scratch_size());
  for (int i = 0; i < count; ++i)
    for (int j = 0; j < functions.argument_count(); ++j) arguments[i * row + j] = 0.1 * i - 0.3 * j;
  constexpr int values_step = 5, slopes_step = 20, row_length = 8;
  std::vector<double> values(count * values_step, -1.0), slopes(count * slopes_step, -1.0), only_values(values);
  functions.evaluate_limits(Stage::middle, count, arguments.data(),
                            {.values = values.data(),
                             .values_step = values_step,
                             .slopes = slopes.data(),
                             .slopes_step = slopes_step,
                             .row_length = row_length},
                            scratch.data());
  functions.evaluate_limits(Stage::middle, count, arguments.data(),
                            {.values = only_values.data(), .values_step = values_step}, scratch.data());
  for (int i = 0; i < count; ++i) {
    const double* a = arguments.data() + i * row;
    const std::vector<double> of_stage(values.begin() + i * values_step, values.begin() + (i + 1) * values_step);
    EXPECT_THAT(of_stage,
                ElementsAre(DoubleNear(a[0] * a[1] + a[8], 1e-14), DoubleNear(a[5] * a[7], 1e-14), -1.0, -1.0, -1.0));
    for (int r = 0; r < 2; ++r) EXPECT_NEAR(only_values[i * values_step + r], of_stage[r], 1e-14);
    for (int r = 0; r < 2; ++r)
      for (int c = 0; c < row_length; ++c) {
        const double expected = r == 0 && c == 0 ? a[1] : r == 0 && c == 1 ? a[0] : r == 1 && c == 5 ? a[7] : -1.0;
        EXPECT_NEAR(slopes[i * slopes_step + r * row_length + c], expected, 1e-15) << i << ": " << r << ", " << c;
      }
  }
}

TEST(TermFunctions, RefusesWhatDecidesNothing) {
  const auto model = unicycle();
  EXPECT_THAT(error_of([&] {
                TermFunctions(*model, {{"lazy", std::make_shared<Two>(true)}});
              }),
              HasSubstr("term 'lazy': 'idle' depends neither on the state nor on an input"));
}

}  // namespace term_functions_test
}  // namespace rhec
