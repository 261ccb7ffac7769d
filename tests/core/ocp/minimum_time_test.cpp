// A kind of problem that derives from Ocp itself, with limits, against public headers: examples/minimum_time.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "examples/minimum_time/minimum_time_problem.hpp"
#include "rhec/core/ocp/solver.hpp"

namespace rhec {
namespace minimum_time_test {

struct Case {
  MinimumTimeProblem problem{setup()};
  Iterate point{problem.capacity()};
  std::vector<double> scratch = std::vector<double>(problem.scratch_size());

  static MinimumTimeProblem::Setup setup() {
    MinimumTimeProblem::Setup setup;
    setup.intervals = 6;
    setup.start = {0.0, 0.0, 0.0, 0.0, 0.0};
    setup.goal = {0.0, 3.0, std::numbers::pi, 0.0, 0.0};
    setup.car.obstacle_x = 4.0;
    return setup;
  }
  Case() {
    std::mt19937 random(7);
    std::uniform_real_distribution<double> number(-0.5, 0.5);
    for (int i = 0; i <= problem.intervals(); ++i) {
      for (int j = 0; j < MinimumTimeProblem::ns; ++j) point.state(i)[j] = number(random);
      point.state(i)[MinimumTimeProblem::nx] += 5.0;
      for (int j = 0; j < MinimumTimeProblem::ns; ++j) point.costate(i)[j] = number(random);
      for (int j = 0; j < problem.limit_count(i); ++j) point.limit_bound(i)[j] = number(random);
      for (int j = 0; i < problem.intervals() && j < MinimumTimeProblem::nu; ++j) point.control(i)[j] = number(random);
    }
  }
};

constexpr double step = 1e-5;

TEST(MinimumTime, LinearisesWhatItEvaluates) {
  Case of;
  const int N = of.problem.intervals(), ns = MinimumTimeProblem::ns;
  StageQp qp(of.problem.capacity());
  const double objective = of.problem.linearise(all_stages(of.problem), of.point, Hessian::exact, qp, of.scratch);
  EXPECT_NEAR(objective, of.problem.evaluate(of.point, nullptr, of.scratch), 1e-12);
  for (int i = 0; i <= N; ++i)
    for (int c = 0; c < ns + (i < N ? MinimumTimeProblem::nu : 0); ++c) {
      StageQp sides[2] = {StageQp(of.problem.capacity()), StageQp(of.problem.capacity())};
      double costs[2];
      for (const int side : {0, 1}) {
        Iterate moved = of.point;
        moved.row(i)[c] += side == 0 ? -step : step;
        of.problem.linearise(all_stages(of.problem), moved, Hessian::none, sides[side], of.scratch);
        costs[side] = of.problem.evaluate(moved, nullptr, of.scratch);
      }
      const auto slope = [&](const auto& value) { return (value(sides[1]) - value(sides[0])) / (2.0 * step); };
      EXPECT_NEAR(qp.h(i)[c], (costs[1] - costs[0]) / (2.0 * step), 1e-7);
      for (int r = 0; i < N && r < ns; ++r)
        EXPECT_NEAR(qp.AB(i)[r * qp.stride() + c], slope([&](const StageQp& at) { return at.b(i)[r]; }), 1e-7)
            << i << ' ' << r << ' ' << c;
      for (int r = 0; r < qp.limits(i); ++r)
        EXPECT_NEAR(qp.G(i)[r * qp.stride() + c], slope([&](const StageQp& at) { return -at.limit_lower(i)[r]; }),
                    1e-7);
      // The Hessian: differences of the gradient h + AB' costate + G' multiplier.
      for (int k = 0; k < ns + (i < N ? MinimumTimeProblem::nu : 0); ++k) {
        const auto gradient = [&](const StageQp& at) {
          double sum = at.h(i)[k];
          for (int r = 0; i < N && r < ns; ++r) sum += at.AB(i)[r * at.stride() + k] * of.point.costate(i + 1)[r];
          for (int r = 0; r < at.limits(i); ++r) sum += at.G(i)[r * at.stride() + k] * of.point.limit_bound(i)[r];
          return sum;
        };
        EXPECT_NEAR(qp.H(i)[c * qp.stride() + k], slope(gradient), 1e-6) << i << ' ' << c << ' ' << k;
      }
    }
}

TEST(MinimumTime, TheTimeIsCarriedAlong) {
  Case of;
  roll_out(of.problem, of.point, of.scratch);
  std::vector<double> defects(static_cast<std::size_t>(of.problem.intervals()) * MinimumTimeProblem::ns);
  of.problem.evaluate(of.point, defects.data(), of.scratch);
  for (const double defect : defects) EXPECT_EQ(defect, 0.0);
  for (int i = 0; i <= of.problem.intervals(); ++i) EXPECT_EQ(of.point.state(i)[5], of.point.state(0)[5]);
}

}  // namespace minimum_time_test
}  // namespace rhec
