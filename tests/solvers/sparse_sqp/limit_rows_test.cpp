#include "solvers/sparse_sqp/limit_rows.hpp"

#include <gtest/gtest.h>

#include <numeric>
#include <vector>

#include "rhec/core/base/infinity.hpp"

namespace rhec::sparse_sqp {
namespace limit_rows_test {

using State = LimitRows::State;

/// -1 <= value <= 2, but for the fourth, which is 0.5: hard, soft, soft without a quadratic weight, soft without a
/// linear one, soft equation.
struct Rows {
  Rows() { rows.take_structure(5); }
  LimitRows::Data data() const { return {all, lower.data(), upper.data(), linear.data(), quadratic.data()}; }
  State next(int row, State now, double value, double multiplier) {
    std::vector<double> values(5, 0.0), multipliers(5, 0.0);
    for (int r = 0; r < 5; ++r) rows.set(r, State::off);
    rows.set(row, now);
    values[4] = 0.5;
    values[row] = value;
    multipliers[row] = multiplier;
    change = rows.update(data(), values.data(), multipliers.data(), 1e-9, 1e-9);
    return rows.state(row);
  }
  std::vector<int> all{0, 1, 2, 3, 4};
  std::vector<double> lower{-1.0, -1.0, -1.0, -1.0, 0.5}, upper{2.0, 2.0, 2.0, 2.0, 0.5},
      linear{infinity, 3.0, 3.0, 0.0, 3.0}, quadratic{0.0, 4.0, 0.0, 4.0, 4.0};
  LimitRows rows;
  LimitRows::Change change;
};

TEST(LimitRows, GoFromOffToTheirSidesAndBeyondAndBack) {
  Rows of;
  for (const int r : {0, 1, 2}) {
    EXPECT_EQ(of.next(r, State::off, 1.0, 0.0), State::off);
    EXPECT_EQ(of.change.added + of.change.released, 0);
    EXPECT_EQ(of.next(r, State::off, 2.1, 0.0), State::upper);
    EXPECT_EQ(of.change.added, 1);
    EXPECT_EQ(of.next(r, State::off, -1.1, 0.0), State::lower);
    EXPECT_EQ(of.next(r, State::upper, 2.0, 2.5), State::upper);
    EXPECT_EQ(of.next(r, State::upper, 2.0, -0.5), State::off);
    EXPECT_EQ(of.change.released, 1);
    EXPECT_EQ(of.next(r, State::lower, -1.0, 0.5), State::off);
    EXPECT_EQ(of.next(r, State::upper, 2.0, 3.5), r == 0 ? State::upper : State::above);
    EXPECT_EQ(of.next(r, State::lower, -1.0, -3.5), r == 0 ? State::lower : State::below);
  }
  for (const int r : {1, 2}) {
    EXPECT_EQ(of.next(r, State::above, 2.5, 3.0), State::above);
    EXPECT_EQ(of.next(r, State::above, 1.5, 3.0), State::upper);
    EXPECT_EQ(of.next(r, State::below, -0.5, -3.0), State::lower);
  }
  // Without a linear weight, and for an equation.
  EXPECT_EQ(of.next(3, State::off, 2.1, 0.0), State::above);
  EXPECT_EQ(of.next(3, State::above, 1.9, 0.0), State::off);
  EXPECT_EQ(of.next(4, State::both, 0.5, 2.0), State::both);
  EXPECT_EQ(of.next(4, State::both, 0.5, -3.5), State::below);
  EXPECT_EQ(of.next(4, State::below, 0.6, -3.0), State::both);
}

TEST(LimitRows, AreGuessedFromMultipliersThatTheyDescribe) {
  Rows of;
  const State states[] = {State::off, State::lower, State::upper, State::below, State::above, State::both};
  for (int r = 0; r < 5; ++r) {
    for (const State state : states) {
      const bool is_beyond = state == State::below || state == State::above;
      if (r == 0 && is_beyond) continue;
      if (r == 3 && !is_beyond && state != State::off) continue;
      if ((r == 4) != (state == State::both) && !(r == 4 && is_beyond)) continue;
      std::vector<double> multipliers(5, 0.0);
      of.rows.set(r, state);
      of.rows.describe(of.data(), multipliers.data());
      of.rows.guess(of.data(), multipliers.data());
      EXPECT_EQ(of.rows.state(r), state) << "row " << r;
    }
  }
}

TEST(LimitRows, BeyondTheirSidesTheyAreRegularisedEquationsOrKnown) {
  Rows of;
  const State states[] = {State::lower, State::above, State::above, State::below, State::off};
  for (int r = 0; r < 5; ++r) of.rows.set(r, states[r]);
  std::vector<std::uint8_t> off(5);
  std::vector<double> dual(5);
  of.rows.write_matrix(of.data(), off.data(), dual.data());
  EXPECT_EQ(off, (std::vector<std::uint8_t>{0, 0, 1, 0, 1}));
  EXPECT_EQ(dual, (std::vector<double>{0.0, 0.25, 0.0, 0.25, 0.0}));
  EXPECT_EQ(of.rows.known_multiplier(of.data(), 2), 3.0);
  EXPECT_EQ(of.rows.known_multiplier(of.data(), 4), 0.0);
  EXPECT_EQ(of.rows.unmet(of.data(), 0, -0.75, 0.0), 0.25);
  // A violation of a half has the price 3 + 4 * 0.5 above, and 4 * 0.5 below.
  EXPECT_EQ(of.rows.unmet(of.data(), 1, 2.5, 5.0), 0.0);
  EXPECT_EQ(of.rows.unmet(of.data(), 1, 2.75, 5.0), 0.25);
  EXPECT_EQ(of.rows.unmet(of.data(), 3, -1.5, -2.0), 0.0);
  EXPECT_EQ(of.rows.unmet(of.data(), 2, 7.0, 3.0), 0.0) << "no equation";
}

TEST(LimitRows, MultipliersKeepTheirSignsAndPrices) {
  Rows of;
  const State states[] = {State::lower, State::upper, State::above, State::off, State::both};
  for (int r = 0; r < 5; ++r) of.rows.set(r, states[r]);
  std::vector<double> multipliers{1e-12, 3.0 + 1e-12, 3.0 - 1e-12, 1e-12, -3.0 - 1e-12};
  of.rows.clip(of.data(), multipliers.data());
  EXPECT_EQ(multipliers, (std::vector<double>{0.0, 3.0, 3.0, 0.0, -3.0}));
}

}  // namespace limit_rows_test
}  // namespace rhec::sparse_sqp
