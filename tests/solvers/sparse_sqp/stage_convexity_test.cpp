#include "solvers/sparse_sqp/stage_convexity.hpp"

#include <gtest/gtest.h>

#include <vector>

#include "rhec/core/qp/stage_qp_views.hpp"
#include "test_qps.hpp"

namespace rhec::sparse_sqp {
namespace stage_convexity_test {

using namespace testing;

TEST(StageConvexity, TakesOverTheStagesThatBringTheNegativeCurvature) {
  RandomQp random(21);
  int bent = 0, untouched = 0, stages_seen = 0, stages_taken = 0;
  for (int trial = 0; trial < 200; ++trial) {
    const StageQp gauss_newton = random_stages(random);
    const int N = gauss_newton.intervals();
    StageQp exact = gauss_newton;
    const int from = random.integer(0, N), to = std::min(N, from + random.integer(0, 1));
    const double shift = random.uniform(0.0, 3.0);
    for (int i = from; i <= to; ++i) {
      Q_of(exact, i).diagonal().array() -= shift;
      R_of(exact, i).diagonal().array() -= shift;
    }
    const TestQp before(exact);
    std::vector<std::uint8_t> fixed(before.n, 0);
    // Controls, or states in place of them: of a node as many as there are controls that lead to it.
    std::ptrdiff_t variable = exact.initial_state_is_given ? 0 : exact.states(0);
    for (int i = 0; trial % 2 == 1 && i < N; ++i) {
      const bool is_state = random.uniform(0.0, 1.0) < 0.5;
      for (int j = 0; j < exact.controls(i); ++j)
        if (random.uniform(0.0, 1.0) < 0.4 && (!is_state || j < exact.states(i + 1)))
          fixed[variable + j + (is_state ? exact.controls(i) : 0)] = 1;
      variable += exact.controls(i) + exact.states(i + 1);
    }
    const double least = least_reduced_eigenvalue(before, fixed);
    if (std::abs(least) < 1e-4) continue;
    StageQp convex = exact;
    const int taken = convexify_by_stages(convex, gauss_newton, fixed);
    if (least > 0.0) {
      EXPECT_EQ(taken, 0) << trial;
      ++untouched;
    } else {
      EXPECT_GT(taken, 0) << trial;
      EXPECT_GT(least_reduced_eigenvalue(TestQp(convex), fixed), 0.0) << trial;
      ++bent;
      stages_seen += N + 1;
      stages_taken += taken;
    }
    int differ = 0;
    for (int i = 0; i <= N; ++i) {
      const bool is_exact = Q_of(exact, i) == Q_of(convex, i) &&
                            (i == N || (S_of(exact, i) == S_of(convex, i) && R_of(exact, i) == R_of(convex, i)));
      const bool is_gauss_newton =
          Q_of(gauss_newton, i) == Q_of(convex, i) &&
          (i == N || (S_of(gauss_newton, i) == S_of(convex, i) && R_of(gauss_newton, i) == R_of(convex, i)));
      EXPECT_TRUE(is_exact || is_gauss_newton) << trial << ", stage " << i;
      differ += is_exact ? 0 : 1;
    }
    EXPECT_LE(differ, taken);
  }
  EXPECT_GT(bent, 30);
  EXPECT_GT(untouched, 30);
  EXPECT_LT(2 * stages_taken, stages_seen) << "curvature was given up where there was no need";
}

}  // namespace stage_convexity_test
}  // namespace rhec::sparse_sqp
