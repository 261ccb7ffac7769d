#include "core/horizon/interval_dynamics.hpp"

#include <gtest/gtest.h>

#include <vector>

#include "support/cart.hpp"

namespace rhec {
namespace interval_dynamics_test {

using testing::cart;
using testing::cart_control;
using testing::cart_estimation;
using testing::scattered_point;

/// Intervals with and without blocks that start, blocked inputs, and ramps.
class Intervals : public ::testing::TestWithParam<int> {
 protected:
  static constexpr int count = 4;
  Intervals() {
    const std::uint8_t begins[count] = {1, 0, 1, 0}, drag[count] = {0, 1, 0, 1};
    if (GetParam() == 0) {
      problem = cart_control(count);
    } else if (GetParam() == 1) {
      auto control = cart_control(count, {0});
      control->set_blocks(0, begins);
      std::vector<double> memory(control->scratch_size());
      control->finish(memory);
      problem = std::move(control);
    } else {
      auto estimation = cart_estimation(count);
      if (GetParam() > 2) {
        estimation->set_blocks(0, drag, GetParam() == 4 ? Transition::ramp : Transition::step);
        estimation->finish();
      }
      problem = std::move(estimation);
    }
    for (int i = 0; i < count; ++i) durations.push_back(0.1 + 0.05 * i);
    point = scattered_point(*problem);
    scratch.assign(IntervalDynamics::scratch_size(*model, problem->structure(), count + 1), 0.0);
  }
  IntervalDynamics dynamics() const { return {*model, problem->structure(), durations.data(), nullptr, 2}; }
  std::vector<double> defects(const Iterate& at) {
    std::vector<double> found(static_cast<std::size_t>(count) * states(), 7.0);
    dynamics().write_defects(at, found.data(), scratch.data());
    return found;
  }
  int states() const { return problem->capacity().states; }

  std::shared_ptr<const Model> model = cart();
  std::unique_ptr<HorizonProblem> problem;
  std::vector<double> durations, scratch;
  Iterate point;
};

INSTANTIATE_TEST_SUITE_P(Structures, Intervals, ::testing::Range(0, 5));

TEST_P(Intervals, SimulateToWhereThereIsNoDefect) {
  for (const double defect : defects(point)) EXPECT_NE(defect, 0.0);
  for (int i = 0; i < count; ++i) dynamics().simulate(i, point, scratch.data());
  for (const double defect : defects(point)) EXPECT_EQ(defect, 0.0);
}

TEST_P(Intervals, HaveTheDefectsOfTheModelsOwnIntegration) {
  const std::vector<double> found = defects(point);
  for (int i = 0; i < count; ++i) {
    double u = 0.0, p[2], begin[2], next[2];
    problem->structure().inputs_on(point, i, &u);
    problem->structure().parameters_on(point, i, p);
    for (int j = 0; j < 2; ++j) begin[j] = problem->structure().is_ramp(j) ? point.state(i)[2 + j] : p[j];
    model->integrate({.count = 1,
                      .states = point.state(i),
                      .inputs = &u,
                      .parameters = begin,
                      .parameters_end = p,
                      .durations = &durations[i],
                      .substeps = 2,
                      .next_states = next});
    for (int j = 0; j < 2; ++j) EXPECT_NEAR(found[i * states() + j], next[j] - point.state(i + 1)[j], 1e-15) << i;
  }
}

TEST_P(Intervals, LineariseToTheDifferencesOfTheirDefects) {
  StageQp qp(problem->capacity());
  dynamics().write_sizes({0, count}, problem->initial_state() != nullptr, qp);
  dynamics().linearise({0, count - 1}, point, {.hessian = Hessian::gauss_newton}, qp, scratch.data());
  const std::vector<double> here = defects(point);
  const double h = 1e-6;
  for (int i = 0; i < count; ++i) {
    EXPECT_EQ(qp.states(i), states());
    EXPECT_EQ(qp.controls(i), problem->control_count(i));
    for (int r = 0; r < states(); ++r) EXPECT_NEAR(qp.b(i)[r], here[i * states() + r], 1e-14) << i;
    for (int c = 0; c < states() + problem->control_count(i); ++c) {
      Iterate right = point, left = point;
      right.row(i)[c] += h;
      left.row(i)[c] -= h;
      const std::vector<double> up = defects(right), down = defects(left);
      for (int r = 0; r < states(); ++r) {
        const int at = i * states() + r;
        EXPECT_NEAR(qp.AB(i)[r * qp.stride() + c], (up[at] - down[at]) / (2.0 * h), 1e-8) << i << ": " << r << "," << c;
      }
    }
  }
}

TEST_P(Intervals, HaveTheCurvatureOfTheirDerivatives) {
  StageQp exact(problem->capacity()), right(problem->capacity()), left(problem->capacity());
  for (StageQp* qp : {&exact, &right, &left}) dynamics().write_sizes({0, count}, false, *qp);
  dynamics().linearise({0, count - 1}, point, {.hessian = Hessian::exact}, exact, scratch.data());
  const double h = 1e-5;
  for (int i = 0; i < count; ++i) {
    const int width = states() + problem->control_count(i);
    for (int c = 0; c < width; ++c) {
      Iterate up = point, down = point;
      up.row(i)[c] += h;
      down.row(i)[c] -= h;
      dynamics().linearise({i, i}, up, {}, right, scratch.data());
      dynamics().linearise({i, i}, down, {}, left, scratch.data());
      for (int r = 0; r < width; ++r) {
        double difference = 0.0;  // of the Lagrangian's gradient
        for (int k = 0; k < states(); ++k)
          difference += point.costate(i + 1)[k] *
                        (right.AB(i)[k * right.stride() + r] - left.AB(i)[k * left.stride() + r]) / (2.0 * h);
        EXPECT_NEAR(exact.H(i)[r * exact.stride() + c], difference, 1e-7) << i << ": " << r << "," << c;
      }
    }
  }
}

}  // namespace interval_dynamics_test
}  // namespace rhec
