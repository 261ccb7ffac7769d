// Measurements between the nodes of an estimation problem: what they cost, and the derivatives of that.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <vector>

#include "rhec/core/horizon/rhe_problem.hpp"
#include "rhec/core/ocp/linearisation.hpp"
#include "rhec/core/prior/prior.hpp"
#include "support/cart.hpp"
#include "support/random_problem.hpp"

namespace rhec {
namespace rhe_between_test {

using namespace testing;

constexpr double missing = std::numeric_limits<double>::quiet_NaN();

/// A problem on the cart: an interval with few measurements, to which each is integrated, two with many, whose states
/// are interpolated, and one without. With `weighed`, measurements have weights of their own, at nodes, too.
std::unique_ptr<RheProblem> problem_of(RandomProblem::RheSpec spec, bool weighed = false) {
  spec.intervals = 4;
  spec.adjust = [](RheProblem::Setup& setup, const RandomProblem::Drive&) { setup.most_between = 40; };
  RandomProblem random(cart(), 7);
  auto problem = random.rhe(spec);
  for (int i = 0; i < 4; ++i) {
    const int count = std::array{3, 11, 0, 40}[static_cast<std::size_t>(i)];  // 40: more than at once
    for (int k = 0; k < count; ++k) {
      double* const y = problem->between(i).add(problem->duration(i) * (k + 0.5) / count);
      for (int j = 0; j < 2; ++j) y[j] = (j + k) % 3 ? random.normal() : missing;
      const double values[] = {y[0], y[1]}, weights[] = {0.5 + 0.1 * k, k % 4 ? 1.0 : 3.0};
      if (weighed) problem->between(i).add_outputs(k, {values, weights});
    }
  }
  for (int i = 0; weighed && i <= 4; ++i) {
    const double values[] = {random.normal(), random.normal()}, weights[] = {0.3 + i, 2.0 / (1.0 + i)};
    problem->set_output(i, {values, weights});
  }
  return problem;
}

std::vector<RandomProblem::RheSpec> specs() {
  std::vector<RandomProblem::RheSpec> all(4);
  all[1].block = all[2].block = 2;
  all[2].transition = Transition::ramp;
  all[3].block = 1;
  all[3].robust = true;
  return all;
}

/// Problems of all kinds.
template <class Use>
void for_each_problem(const Use& use) {
  for (const RandomProblem::RheSpec& spec : specs())
    for (const bool weighed : {false, true}) use(spec, problem_of(spec, weighed));
}

double cost_of(const RheProblem& problem, const Iterate& point) {
  std::vector<double> scratch(problem.scratch_size());
  return problem.evaluate(point, nullptr, scratch);
}

class OfMeasurements : public ::testing::TestWithParam<bool> {};
INSTANTIATE_TEST_SUITE_P(RheBetween, OfMeasurements, ::testing::Bool(),
                         [](const auto& each) { return each.param ? "Weighed" : "Alike"; });

TEST_P(OfMeasurements, CostsTheResidualAtItsTime) {
  const auto problem = problem_of(specs()[1], GetParam());
  const Iterate point = scattered_point(*problem);
  double expected = 0.0;
  for (int i = 0; i < 4; ++i) {
    const double u = point.control(i)[0];
    double p[2];
    for (int j = 0; j < 2; ++j) {
      const int start = problem->structure().control_of_lifted(i, j);
      p[j] = start >= 0 ? point.control(i)[start] : point.state(i)[2 + j];
    }
    for (int k = 0; k < problem->between(i).count(); ++k) {
      double x[2], y[2];
      const double time = problem->between(i).time(k);
      problem->model().integrate(
          {.count = 1, .states = point.state(i), .inputs = &u, .parameters = p, .durations = &time, .next_states = x});
      problem->model().observe({.count = 1, .states = x, .outputs = y});
      for (int j = 0; j < 2; ++j) {
        const double measured = problem->between(i).outputs(k)[j];
        const double weight = problem->setup().output_weights[j] * problem->between(i).measured(k).weight(j);
        if (!std::isnan(measured)) expected += weight * std::pow(y[j] - measured, 2);
      }
    }
  }
  const double all = cost_of(*problem, point);
  std::vector<double> scratch(problem->scratch_size()), stages(5);
  EXPECT_NEAR(problem->evaluate_stages(point, nullptr, stages.data(), scratch), all, 1e-9 * all);
  double sum = 0.0;
  for (const double each : stages) sum += each;
  EXPECT_NEAR(sum, all, 1e-9 * all);
  for (int i = 0; i < 4; ++i) problem->between(i).clear();
  EXPECT_NEAR(all - cost_of(*problem, point), expected, 1e-6 * expected);
}

/// Of every variable of every stage.
template <class Use>
void for_each_variable(const RheProblem& problem, Iterate& point, const Use& use) {
  for (int i = 0; i <= problem.intervals(); ++i) {
    for (int j = 0; j < problem.capacity().states; ++j) use(i, j, point.state(i)[j]);
    for (int j = 0; i < problem.intervals() && j < problem.control_count(i); ++j)
      use(i, problem.capacity().states + j, point.control(i)[j]);
  }
}

TEST(RheBetween, HasExactDerivatives) {
  for_each_problem([](const RandomProblem::RheSpec&, const std::unique_ptr<RheProblem>& problem) {
    Iterate point = scattered_point(*problem);
    point.clear_multipliers();  // so that the exact Hessian is that of the cost
    std::vector<double> scratch(problem->scratch_size());
    StageQp qp(problem->capacity()), ahead(problem->capacity()), behind(problem->capacity());
    problem->linearise(all_stages(*problem), point, Hessian::exact, qp, scratch);
    for_each_variable(*problem, point, [&](int stage, int variable, double& value) {
      const double at = value, step = 1e-5;
      const auto cost_at = [&](double shifted, StageQp& to) {
        value = shifted;
        problem->linearise(all_stages(*problem), point, Hessian::none, to, scratch);
        return cost_of(*problem, point);
      };
      const double more = cost_at(at + step, ahead), less = cost_at(at - step, behind);
      value = at;
      const double slope = (more - less) / (2.0 * step), scale = std::abs(more) + 1.0;
      ASSERT_NEAR(qp.h(stage)[variable], slope, 1e-5 * scale) << stage << ", " << variable;
      const int count = problem->capacity().states + (stage < problem->intervals() ? problem->control_count(stage) : 0);
      for (int other = 0; other < count; ++other) {
        const double curvature = (ahead.h(stage)[other] - behind.h(stage)[other]) / (2.0 * step);
        ASSERT_NEAR(qp.H(stage)[variable * qp.stride() + other], curvature, 1e-5 * scale)
            << stage << ", " << variable << ", " << other;
      }
    });
  });
}

/// Where residuals vanish, Gauss-Newton's Hessian is the exact one.
TEST(RheBetween, GaussNewtonIsExactWithoutResiduals) {
  for_each_problem([](const RandomProblem::RheSpec& spec, const std::unique_ptr<RheProblem>& problem) {
    Iterate point = scattered_point(*problem);
    point.clear_multipliers();
    std::vector<double> scratch(problem->scratch_size()), weights(40 * 2), rows(40 * 2 * 8);
    const int length = 1 + 2 + 2 + 1 + (problem->structure().any_ramp() ? 2 : 0);
    for (int i = 0; i <= 4; ++i)
      problem->model().observe({.count = 1, .states = point.state(i), .outputs = problem->output(i)});
    for (int i = 0; i < 4; ++i) {
      problem->linearise_between(i, point, weights.data(), rows.data(), scratch);
      for (int k = 0; k < problem->between(i).count(); ++k)
        for (int j = 0; j < 2; ++j)
          if (!std::isnan(problem->between(i).outputs(k)[j]))
            problem->between(i).outputs(k)[j] += rows[(k * 2 + j) * length];
    }
    double left = 0.0;
    for (int i = 0; i < 4; ++i) {
      problem->linearise_between(i, point, weights.data(), rows.data(), scratch);
      for (int k = 0; k < 2 * problem->between(i).count(); ++k) left = std::max(left, std::abs(rows[k * length]));
    }
    ASSERT_LT(left, 1e-12);
    StageQp exact(problem->capacity()), own(problem->capacity());
    problem->linearise(all_stages(*problem), point, Hessian::exact, exact, scratch);
    problem->linearise(all_stages(*problem), point, Hessian::gauss_newton, own, scratch);
    for (int i = 0; i <= 4; ++i) {
      const int count = problem->capacity().states + (i < 4 ? problem->control_count(i) : 0);
      for (int c = 0; c < count; ++c)
        for (int r = 0; r < count; ++r)
          ASSERT_NEAR(own.H(i)[c * own.stride() + r], exact.H(i)[c * own.stride() + r],
                      1e-7 * (1.0 + std::abs(exact.H(i)[c * own.stride() + c])))
              << i << ", ramp " << problem->structure().any_ramp() << ", robust " << spec.robust;
    }
  });
}

/// A solver's linearisation, which keeps what it knows as the horizon moves on, and a problem's own.
TEST_P(OfMeasurements, ALinearisationFollowsThemAsTheHorizonMoves) {
  const auto problem = problem_of(specs()[0], GetParam());
  Iterate point = scattered_point(*problem);
  std::vector<double> scratch(problem->scratch_size());
  const auto linearisation = problem->make_linearisation();
  StageQp fresh(problem->capacity());
  for (int round = 0; round < 3; ++round) {
    linearisation->prepare(point, Hessian::gauss_newton);
    linearisation->refresh(point);
    problem->linearise(all_stages(*problem), point, Hessian::gauss_newton, fresh, scratch);
    for (int i = 0; i <= 4; ++i) {
      const int count = problem->capacity().states + (i < 4 ? problem->control_count(i) : 0);
      for (int c = 0; c < count; ++c) {
        ASSERT_NEAR(linearisation->qp().h(i)[c], fresh.h(i)[c], 1e-9 * (1.0 + std::abs(fresh.h(i)[c])));
        for (int r = 0; r < count; ++r)
          ASSERT_NEAR(linearisation->qp().H(i)[c * fresh.stride() + r], fresh.H(i)[c * fresh.stride() + r],
                      1e-9 * (1.0 + std::abs(fresh.H(i)[c * fresh.stride() + r])))
              << "round " << round << ", stage " << i;
      }
    }
    const std::vector<double> first(problem->between(1).outputs(0), problem->between(1).outputs(0) + 2);
    problem->drop_first_interval();
    EXPECT_TRUE(round > 0 || std::equal(first.begin() + 1, first.end(), problem->between(0).outputs(0) + 1));
    problem->between(3).clear();
    for (int i = 0; i < 4; ++i) std::copy_n(point.row(i + 1), point.capacity().row(), point.row(i));
    std::copy_n(point.control(2), 1, point.control(3));
    point.state(4)[0] += 0.3;
  }
}

/// An output that comes late, with the stamp of others, changes neither the states nor the times.
TEST(RheBetween, ALinearisationKnowsOutputsThatComeLater) {
  const auto problem = problem_of(specs()[0]);
  const Iterate point = scattered_point(*problem);
  std::vector<double> scratch(problem->scratch_size());
  const auto linearisation = problem->make_linearisation();
  StageQp fresh(problem->capacity());
  const auto refresh = [&] {
    linearisation->prepare(point, Hessian::gauss_newton);
    linearisation->refresh(point);
  };
  refresh();
  for (int i : {0, 1, 3})
    for (int k = 0; k < problem->between(i).count(); ++k)
      for (int j = 0; j < 2; ++j)
        if (std::isnan(problem->between(i).outputs(k)[j])) problem->between(i).outputs(k)[j] = 0.3;
  refresh();
  problem->linearise(all_stages(*problem), point, Hessian::gauss_newton, fresh, scratch);
  for (int i = 0; i < 4; ++i)
    for (int c = 0; c < problem->capacity().states; ++c)
      ASSERT_NEAR(linearisation->qp().h(i)[c], fresh.h(i)[c], 1e-9 * (1.0 + std::abs(fresh.h(i)[c]))) << i;
}

/// Weights that come and go, with outputs and times that stay.
TEST(RheBetween, ALinearisationFollowsTheirWeights) {
  const auto problem = problem_of(specs()[0]), weighed = problem_of(specs()[0], true);
  const Iterate point = scattered_point(*problem);
  std::vector<double> scratch(problem->scratch_size());
  const auto linearisation = problem->make_linearisation();
  StageQp fresh(problem->capacity());
  std::vector<BetweenNodes> plain;
  for (int i = 0; i < 4; ++i) plain.push_back(problem->between(i));
  for (int round = 0; round < 5; ++round) {
    for (int i = 0; i < 4; ++i) problem->between(i).assign(round % 2 ? weighed->between(i) : plain[i]);
    for (int k = 0; k < problem->between(3).count(); ++k) {
      const double weights[] = {1.0 + k, 0.25};
      if (round == 3) problem->between(3).add_outputs(k, {plain[3].outputs(k), weights});
    }
    linearisation->prepare(point, Hessian::gauss_newton);
    linearisation->refresh(point);
    problem->linearise(all_stages(*problem), point, Hessian::gauss_newton, fresh, scratch);
    for (int i = 0; i < 4; ++i) {
      for (int c = 0; c < problem->capacity().states; ++c) {
        ASSERT_NEAR(linearisation->qp().h(i)[c], fresh.h(i)[c], 1e-9 * (1.0 + std::abs(fresh.h(i)[c]))) << round;
        for (int r = 0; r < problem->capacity().states; ++r)
          ASSERT_NEAR(linearisation->qp().H(i)[c * fresh.stride() + r], fresh.H(i)[c * fresh.stride() + r],
                      1e-9 * (1.0 + std::abs(fresh.H(i)[c * fresh.stride() + r])))
              << "round " << round << ", stage " << i;
      }
    }
  }
}

}  // namespace rhe_between_test
}  // namespace rhec
