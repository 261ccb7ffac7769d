#include "rhec/core/qp/stage_qp.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "support/random_qp.hpp"

namespace rhec {
namespace stage_qp_test {

using testing::RandomQp;

/// Everything that a QP holds for one stage and that moves with it.
std::vector<double> contents(const StageQp& qp, int i) {
  const Capacity& capacity = qp.capacity();
  std::vector<double> all;
  const auto add = [&](const double* rows, int count) { all.insert(all.end(), rows, rows + count * qp.stride()); };
  add(qp.AB(i), capacity.states);
  add(qp.H(i), capacity.states + capacity.controls);
  add(qp.h(i), 1);
  add(qp.b(i), 1);
  add(qp.G(i), capacity.limits);
  for (const double* row : {qp.limit_lower(i), qp.limit_upper(i), qp.limit_linear(i), qp.limit_quadratic(i)})
    all.insert(all.end(), row, row + capacity.limit_row());
  return all;
}

TEST(StageQp, MovesTowardsTheFrontAndLeavesZerosBehind) {
  RandomQp random(31);
  for (int trial = 0; trial < 20; ++trial) {
    const int most = random.integer(1, 7), states = random.integer(1, 7), controls = random.integer(1, 4);
    const int limits = random.integer(0, 3);
    StageQp qp({most, states, controls, limits});
    int intervals = 0;
    std::vector<std::vector<double>> stages;
    std::vector<int> control_counts, identity_counts, limit_counts;
    double number = 1.0;
    const auto write = [&](int i) {
      const int m = random.integer(0, controls), carried = random.integer(0, states);
      qp.set_sizes(i, states, m, carried);
      for (int k = 0; k < (states + m) * qp.stride(); ++k) qp.H(i)[k] = number++;
      for (double* row : {qp.AB(i), qp.h(i), qp.b(i)}) std::fill_n(row, states, number++);
      qp.set_limits(i, random.integer(0, limits));
      for (int r = 0; r < qp.limits(i); ++r) {
        std::fill_n(qp.G(i) + r * qp.stride(), states, number++);
        for (double* row : {qp.limit_lower(i), qp.limit_upper(i), qp.limit_linear(i), qp.limit_quadratic(i)})
          row[r] = number++;
      }
      limit_counts.push_back(qp.limits(i));
      stages.push_back(contents(qp, i));
      control_counts.push_back(m);
      identity_counts.push_back(carried);
    };
    qp.set_intervals(0);
    write(0);
    for (int move = 0; move < 60; ++move) {
      // Now and then a shorter horizon begins, and grows to the capacity.
      const int steps = random.integer(0, 9) == 0 ? intervals : std::min(intervals, random.integer(0, 2));
      qp.drop_first(steps);
      stages.erase(stages.begin(), stages.begin() + steps);
      control_counts.erase(control_counts.begin(), control_counts.begin() + steps);
      identity_counts.erase(identity_counts.begin(), identity_counts.begin() + steps);
      limit_counts.erase(limit_counts.begin(), limit_counts.begin() + steps);
      intervals -= steps;
      for (int i = 0; i <= intervals; ++i) {
        ASSERT_EQ(contents(qp, i), stages[i]) << "trial " << trial << ", move " << move << ", stage " << i;
        ASSERT_EQ(qp.control_counts()[i], control_counts[i]);
        ASSERT_EQ(qp.identity_counts()[i], identity_counts[i]);
        ASSERT_EQ(qp.limits(i), limit_counts[i]);
      }
      for (int i = intervals + 1; steps > 0 && i <= most; ++i)
        for (const double entry : contents(qp, i)) ASSERT_EQ(entry, 0.0) << "move " << move << ", stage " << i;
      if (intervals < most) write(++intervals);
      qp.set_intervals(intervals);
    }
    qp.drop_identity_rows();
    for (int i = 0; i <= most; ++i) EXPECT_EQ(qp.identity_counts()[i], 0);
  }
}

TEST(StageQp, TakesTheStagesOfAnother) {
  RandomQp random(7);
  for (int trial = 0; trial < 10; ++trial) {
    const int most = random.integer(1, 7), limits = random.integer(0, 2);
    StageQp from({most, 3, 2, limits}), to(from.capacity());
    double number = 1.0;
    const auto write = [&](StageQp& qp, int i) {
      qp.set_sizes(i, 3, random.integer(0, 2), random.integer(0, 3));
      for (double* row : {qp.AB(i), qp.h(i), qp.b(i), qp.H(i), qp.lower(i), qp.upper(i)}) std::fill_n(row, 3, number++);
      qp.set_limits(i, random.integer(0, limits));
      for (int r = 0; r < qp.limits(i); ++r) qp.G(i)[r * qp.stride()] = qp.limit_lower(i)[r] = number++;
    };
    from.set_intervals(most);
    to.set_intervals(random.integer(0, most));
    for (int i = 0; i <= most; ++i) write(from, i);
    for (int i = 0; i <= to.intervals(); ++i) write(to, i);
    const int steps = random.integer(0, most);
    from.drop_first(steps);
    from.set_intervals(most - steps);
    from.initial_state_is_given = trial % 2 == 0;
    from.initial_step()[1] = number;
    to.take_stages(from);
    ASSERT_EQ(to.intervals(), from.intervals());
    EXPECT_EQ(to.initial_state_is_given, from.initial_state_is_given);
    EXPECT_EQ(to.initial_step()[1], number);
    for (int i = 0; i <= from.intervals(); ++i) {
      EXPECT_EQ(contents(to, i), contents(from, i));
      EXPECT_TRUE(std::equal(to.lower(i), to.lower(i) + to.stride(), from.lower(i)));
      EXPECT_TRUE(std::equal(to.upper(i), to.upper(i) + to.stride(), from.upper(i)));
      EXPECT_EQ(to.states(i), from.states(i));
      EXPECT_EQ(to.controls(i), from.controls(i));
      EXPECT_EQ(to.limits(i), from.limits(i));
      EXPECT_EQ(to.identity_counts()[i], from.identity_counts()[i]);
    }
  }
}

}  // namespace stage_qp_test
}  // namespace rhec
