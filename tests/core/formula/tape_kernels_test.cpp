#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "rhec/core/base/aligned.hpp"
#include "rhec/core/formula/tape.hpp"

namespace rhec {
namespace tape_kernels_test {

struct RowsTest : testing::TestWithParam<const TapeKernels*> {};
INSTANTIATE_TEST_SUITE_P(Sets, RowsTest, testing::ValuesIn(runnable_tape_kernels()),
                         [](const auto& set) { return std::string(set.param->name); });

TEST_P(RowsTest, ColumnsBecomeRegistersAndTheLastRowIsRepeated) {
  for (const int lanes : {8, 16, 32}) {
    for (int count = 1; count <= lanes; ++count) {
      for (const int columns : {1, 3, 8, 11}) {
        const int step = 24;
        std::vector<double> rows(static_cast<std::size_t>(count) * step);
        for (std::size_t k = 0; k < rows.size(); ++k) rows[k] = static_cast<double>(k);
        AlignedDoubles registers(static_cast<std::size_t>(columns + 1) * lanes);
        std::fill_n(registers.data(), registers.size(), -1.0);
        GetParam()->load_rows(rows.data(), step, count, columns, registers.data(), lanes, lanes);
        for (int c = 0; c < columns; ++c)
          for (int i = 0; i < lanes; ++i)
            ASSERT_EQ(registers.data()[c * lanes + i],
                      rows[static_cast<std::size_t>(std::min(i, count - 1)) * step + c]);
        for (int i = 0; i < lanes; ++i) ASSERT_EQ(registers.data()[columns * lanes + i], -1.0);  // and no others
      }
    }
  }
}

TEST_P(RowsTest, StoresGroupsOfEveryKindToTheRowsThatThereAre) {
  using Kind = StoredEight::Kind;
  const StoredEight groups[] = {{Kind::all, {16, 8, 0, 8, 8, 8, 16, 0}, {}},
                                {Kind::first_4, {8, 0, 16, 16, 24, 24, 24, 24}, {}},
                                {Kind::constant, {}, {0, 1, 0, 42, 0, 0, 5, 0}},
                                {Kind::all, {0, 0, 8, 16, 0, 8, 16, 16}, {}}};
  constexpr int row_step = 24, step = 56;  // two rows of two groups, with something behind them
  for (const int lanes : {8, 16, 32}) {
    AlignedDoubles registers(static_cast<std::size_t>(4) * lanes);  // the last one of zeros
    for (int k = 0; k < 4 * lanes; ++k) registers.data()[k] = k < 3 * lanes ? 100.0 + k : 0.0;
    for (int count = 1; count <= lanes; ++count) {
      std::vector<double> to(static_cast<std::size_t>(count + 1) * step, -1.0);
      GetParam()->store_rows(groups, 2, 2, registers.data(), lanes, {to.data(), step, row_step}, count);
      for (int i = 0; i <= count; ++i) {
        for (int c = 0; c < step; ++c) {
          const int row = c / row_step, column = c % row_step;
          double expected = -1.0;
          if (i < count && row < 2 && column < 16) {
            const StoredEight& group = groups[2 * row + column / 8];
            const int k = column % 8;
            if (group.kind == Kind::constant)
              expected = group.values[k];
            else if (group.kind == Kind::first_4 && k >= 4)
              expected = 0.0;
            else
              expected = registers.data()[group.sources[k] / 8 * lanes + i];
          }
          ASSERT_EQ(to[static_cast<std::size_t>(i) * step + c], expected) << i << ", " << c << " of " << count;
        }
      }
    }
  }
}

// Each instruction by itself, of ordinary numbers and of those at the edge.
TEST_P(RowsTest, EveryInstruction) {
  const double infinity = std::numeric_limits<double>::infinity();
  const std::vector<double> numbers{0.3, -0.7, 0.9, 1e-9, -2.5, 0.0, 17.0, infinity};
  struct Expected {
    TapeCode code;
    double (*value)(double a, double b, double c);
  };
  const Expected all[] = {
      {TapeCode::add_rr, [](double a, double b, double) { return a + b; }},
      {TapeCode::subtract_rr, [](double a, double b, double) { return a - b; }},
      {TapeCode::multiply_rr, [](double a, double b, double) { return a * b; }},
      {TapeCode::negate, [](double a, double, double) { return -a; }},
      {TapeCode::reciprocal, [](double a, double, double) { return 1.0 / a; }},
      {TapeCode::square_root, [](double a, double, double) { return std::sqrt(a); }},
      {TapeCode::exponential, [](double a, double, double) { return std::exp(a); }},
      {TapeCode::logarithm, [](double a, double, double) { return std::log(a); }},
      {TapeCode::sine, [](double a, double, double) { return std::sin(a); }},
      {TapeCode::cosine, [](double a, double, double) { return std::cos(a); }},
      {TapeCode::tangent, [](double a, double, double) { return std::tan(a); }},
      {TapeCode::arc_sine, [](double a, double, double) { return std::asin(a); }},
      {TapeCode::arc_cosine, [](double a, double, double) { return std::acos(a); }},
      {TapeCode::arc_tangent, [](double a, double, double) { return std::atan(a); }},
      {TapeCode::arc_tangent_2, [](double a, double b, double) { return std::atan2(a, b); }},
      {TapeCode::hyperbolic_tangent, [](double a, double, double) { return std::tanh(a); }},
      {TapeCode::multiply_add_rrr, [](double a, double b, double c) { return a * b + c; }},
      {TapeCode::multiply_subtract_rrr, [](double a, double b, double c) { return a * b - c; }},
      {TapeCode::subtract_product_rrr, [](double a, double b, double c) { return c - a * b; }},
  };
  const double none = 0.0;
  for (const auto& [code, value] : all) {
    for (const int lanes : {8, 16, 32}) {
      AlignedDoubles registers(static_cast<std::size_t>(4) * lanes);
      // The angle of a vector without a direction, infinite both ways, is not what they are for.
      const auto operand = [&](int which, int lane) {
        if (code == TapeCode::arc_tangent_2 && which == 1) return 0.4;
        return numbers[static_cast<std::size_t>(lane * (which + 1) + which) % numbers.size()];
      };
      for (int which = 0; which < 3; ++which)
        for (int lane = 0; lane < lanes; ++lane) registers.data()[which * lanes + lane] = operand(which, lane);
      const TapeRun run{code, 1};
      const TapeOperands operands{3, 0, 1, 2};
      GetParam()->run({&run, 1}, &operands, &none, registers.data(), lanes);
      for (int lane = 0; lane < lanes; ++lane) {
        const double expected = value(operand(0, lane), operand(1, lane), operand(2, lane));
        const double found = registers.data()[3 * lanes + lane];
        if (std::isnan(expected))
          EXPECT_TRUE(std::isnan(found)) << static_cast<int>(code) << " of " << operand(0, lane);
        else if (std::isinf(expected))
          EXPECT_EQ(found, expected) << static_cast<int>(code) << " of " << operand(0, lane);
        else
          EXPECT_NEAR(found, expected, 4e-15 * (1.0 + std::abs(expected)))
              << static_cast<int>(code) << " of " << operand(0, lane);
      }
    }
  }
}

}  // namespace tape_kernels_test
}  // namespace rhec
