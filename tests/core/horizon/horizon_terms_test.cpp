#include "rhec/core/horizon/horizon_terms.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "rhec/core/base/error.hpp"
#include "rhec/core/base/infinity.hpp"
#include "rhec/core/control/input_rate_model.hpp"
#include "rhec/core/control/slip_ahead_model.hpp"
#include "rhec/core/horizon/rhc_problem.hpp"
#include "rhec/core/horizon/shift.hpp"
#include "rhec/core/ocp/linearisation.hpp"
#include "rhec/core/qp/kkt.hpp"
#include "support/cart.hpp"
#include "support/unicycle.hpp"

namespace rhec {
namespace horizon_terms_test {

using ::testing::ElementsAre;
using testing::scattered_point;
using testing::unicycle;

/// Limits of the state and of inputs, written in this order so that they have to be sorted, and two residuals.
class Everything final : public Term {
 public:
  void write(TermWriter& writer) const override {
    const Expression side = writer.data("side");
    writer.limit(writer.wheel_speed() * writer.heading_rate(), {.linear = infinity}, "lateral acceleration");
    writer.limit(sqrt(pow(writer.position_x() - side, 2) + pow(writer.position_y(), 2) + 0.1),
                 {.linear = 3.0, .quadratic = 5.0}, "distance");
    writer.residual(writer.ground_speed() - writer.data("wanted"), {.weight = 0.7, .delta = 0.4}, "speed");
    writer.residual(writer.position_x() * sin(writer.heading()), {.weight = 0.3}, "product");
  }
  void write_data(const TermPlace& place, double* data, double* lower, double* upper) const noexcept override {
    data[0] = 0.3 + 0.1 * place.time;
    data[1] = 0.8;
    lower[0] = -0.5;
    upper[0] = 0.5;
    lower[1] = 0.4 + place.time;
    upper[1] = infinity;
  }
};

enum class Layers { none, blocked, rates, slip_ahead, rates_and_slip_ahead };

std::unique_ptr<RhcProblem> make_problem(Layers layers, int intervals = 5) {
  std::shared_ptr<const Model> model = unicycle();
  const bool has_rates = layers == Layers::rates || layers == Layers::rates_and_slip_ahead;
  const bool looks_ahead = layers == Layers::slip_ahead || layers == Layers::rates_and_slip_ahead;
  if (looks_ahead) model = std::make_shared<SlipAheadModel>(model);
  RhcProblem::Setup setup;
  setup.max_intervals = intervals;
  setup.state_weights = setup.terminal_weights = {1.0, 2.0, 0.5};
  setup.input_weights = {0.1, 0.2};
  setup.terms = {{"everything", std::make_shared<Everything>()}};
  if (has_rates) {
    model = std::make_shared<InputRateModel>(model, std::vector{1});
    setup.state_weights.push_back(0.1);
    setup.terminal_weights.push_back(0.1);
    setup.rates = {{1, 3}};
  }
  if (layers == Layers::blocked) setup.blocked_inputs = {1};
  auto problem = std::make_unique<RhcProblem>(model, setup);
  problem->set_intervals(intervals);
  if (layers == Layers::blocked) problem->set_blocks(1, std::vector<std::uint8_t>{1, 0, 1, 0, 0}.data());
  for (int i = 0; i < intervals; ++i) {
    problem->set_duration(i, 0.2 + 0.05 * i);
    if (looks_ahead) problem->interval_data(i)[0] = 0.02 * i - 0.05;
  }
  for (int i = 0; i <= intervals; ++i) problem->terms().place(i, {.time = 0.2 * i});
  problem->given_parameters()[0] = 0.9;
  std::vector<double> scratch(problem->scratch_size());
  problem->finish(scratch);
  return problem;
}

/// Points with multipliers of limits.
Iterate point_of(const RhcProblem& problem) {
  Iterate point = scattered_point(problem);
  for (int i = 0; i <= problem.intervals(); ++i)
    for (int r = 0; r < problem.limit_count(i); ++r) point.limit_bound(i)[r] = 0.3 - 0.2 * i + 0.5 * r;
  return point;
}

class HorizonTermsTest : public ::testing::TestWithParam<Layers> {};

TEST_P(HorizonTermsTest, DerivativesAreThoseOfWhatIsEvaluated) {
  const auto problem = make_problem(GetParam());
  const int N = problem->intervals(), row = problem->capacity().limit_row();
  ASSERT_EQ(problem->capacity().limits, 2);
  const Iterate point = point_of(*problem);
  std::vector<double> scratch(problem->scratch_size());
  std::vector<double> values(static_cast<std::size_t>(N + 1) * row), up_values(values), down_values(values);
  StageQp qp(problem->capacity()), exact(problem->capacity()), up_qp(problem->capacity()), down_qp(problem->capacity());
  problem->linearise(all_stages(*problem), point, Hessian::gauss_newton, qp, scratch);
  problem->linearise(all_stages(*problem), point, Hessian::exact, exact, scratch);
  problem->evaluate_limits(point, values.data(), scratch);
  const int stride = qp.stride();
  /// Row [s; w] of the gradient of the Lagrangian of a stage.
  const auto gradient = [&](const StageQp& of, int i, int j) {
    double sum = of.h(i)[j];
    for (int r = 0; r < problem->capacity().states && i < N; ++r)
      sum += of.AB(i)[r * stride + j] * point.costate(i + 1)[r];
    for (int r = 0; r < of.limits(i); ++r) sum += of.G(i)[r * stride + j] * point.limit_bound(i)[r];
    return sum;
  };
  constexpr double h = 1e-6;
  double largest_bend = 0.0;
  for (int i = 0; i <= N; ++i) {
    ASSERT_EQ(qp.limits(i), problem->limit_count(i));
    for (int r = 0; r < qp.limits(i); ++r) {
      EXPECT_EQ(qp.limit_lower(i)[r], problem->limit_lower(i)[r] - values[i * row + r]);
      EXPECT_EQ(qp.limit_upper(i)[r], problem->limit_upper(i)[r] - values[i * row + r]);
      EXPECT_EQ(qp.limit_linear(i)[r], problem->limit_linear(i)[r]);
      EXPECT_EQ(qp.limit_quadratic(i)[r], problem->limit_quadratic(i)[r]);
    }
    const int ns = problem->state_count(i), used = ns + (i < N ? problem->control_count(i) : 0);
    std::vector<std::uint8_t> flags(static_cast<std::size_t>(2 * stride), 7), control_flags(flags);
    problem->mark_limits(i, flags.data(), control_flags.data());
    for (int j = 0; j < used; ++j) {
      Iterate up = point, down = point;
      up.row(i)[j] += h;
      down.row(i)[j] -= h;
      const double slope =
          (problem->evaluate(up, nullptr, scratch) - problem->evaluate(down, nullptr, scratch)) / (2 * h);
      EXPECT_NEAR(qp.h(i)[j], slope, 1e-7 * (1.0 + std::abs(slope))) << i << ", " << j;
      problem->evaluate_limits(up, up_values.data(), scratch);
      problem->evaluate_limits(down, down_values.data(), scratch);
      for (int r = 0; r < qp.limits(i); ++r) {
        const double of_limit = (up_values[i * row + r] - down_values[i * row + r]) / (2 * h);
        const double entry = qp.G(i)[r * stride + j];
        EXPECT_NEAR(entry, of_limit, 1e-8) << "limit " << r << " at " << i << ", " << j;
        const int flag = j < ns ? flags[j * qp.limits(i) + r] : control_flags[(j - ns) * qp.limits(i) + r];
        EXPECT_TRUE(flag == 1 || (flag == 0 && entry == 0.0));
      }
      problem->linearise(all_stages(*problem), up, Hessian::none, up_qp, scratch);
      problem->linearise(all_stages(*problem), down, Hessian::none, down_qp, scratch);
      for (int k = 0; k < used; ++k) {
        const double bend = (gradient(up_qp, i, k) - gradient(down_qp, i, k)) / (2 * h);
        EXPECT_NEAR(exact.H(i)[j * stride + k], bend, 1e-6 * (1.0 + std::abs(bend))) << i << ": " << j << ", " << k;
        largest_bend = std::max(largest_bend, std::abs(exact.H(i)[j * stride + k] - qp.H(i)[j * stride + k]));
      }
    }
  }
  EXPECT_GT(largest_bend, 0.1) << "the Gauss-Newton Hessian has no second derivatives";
}

TEST_P(HorizonTermsTest, RowsStandWhereSomethingCanBeDecided) {
  const auto problem = make_problem(GetParam());
  EXPECT_EQ(problem->limit_count(0), 1) << "the state is given, the inputs are not";
  EXPECT_EQ(problem->limit_linear(0)[0], infinity);
  EXPECT_EQ(problem->limit_upper(0)[0], 0.5);
  for (int i = 1; i < 5; ++i) {
    EXPECT_EQ(problem->limit_count(i), 2);
    EXPECT_NEAR(problem->limit_lower(i)[0], 0.4 + 0.2 * i, 1e-15);
    EXPECT_EQ(problem->limit_lower(i)[1], -0.5);
  }
  EXPECT_EQ(problem->limit_count(5), 1) << "there are no inputs";
  EXPECT_EQ(problem->limit_linear(5)[0], 3.0);
  EXPECT_EQ(problem->limit_quadratic(5)[0], 5.0);
  EXPECT_NEAR(problem->limit_lower(5)[0], 1.4, 1e-15);
}

TEST_P(HorizonTermsTest, ACacheGivesWhatALinearisationGives) {
  const auto problem = make_problem(GetParam());
  std::vector<double> scratch(problem->scratch_size());
  for (const Hessian hessian : {Hessian::gauss_newton, Hessian::exact}) {
    const auto cache = problem->make_linearisation();
    GuessShifter shifter(*problem);
    Iterate point = point_of(*problem);
    for (int sample = 0; sample < 3; ++sample) {
      cache->prepare(point, hessian);
      // Data that are known late.
      for (int i = 0; i <= 5; ++i) problem->terms().place(i, {.time = 0.2 * i + 0.05 * (sample + 1)});
      cache->refresh(point);
      StageQp expected(problem->capacity());
      problem->linearise(all_stages(*problem), point, hessian, expected, scratch);
      const StageQp& found = cache->qp();
      for (int i = 0; i <= 5; ++i) {
        const int used = problem->state_count(i) + (i < 5 ? problem->control_count(i) : 0), stride = found.stride();
        ASSERT_EQ(found.limits(i), expected.limits(i));
        for (int j = 0; j < used; ++j) EXPECT_NEAR(found.h(i)[j], expected.h(i)[j], 1e-12);
        for (int r = 0; r < found.limits(i); ++r) {
          EXPECT_NEAR(found.limit_lower(i)[r], expected.limit_lower(i)[r], 1e-12);
          for (int j = 0; j < used; ++j) EXPECT_NEAR(found.G(i)[r * stride + j], expected.G(i)[r * stride + j], 1e-12);
        }
        for (int k = 0; k < used; ++k)
          for (int j = 0; j < used && i < 5; ++j)
            EXPECT_NEAR(found.AB(i)[std::min(k, problem->state_count(i) - 1) * stride + j],
                        expected.AB(i)[std::min(k, problem->state_count(i) - 1) * stride + j], 1e-12);
      }
      // H is that of the data when it was prepared: the same data now.
      cache->prepare(point, hessian);
      for (int i = 0; i <= 5; ++i) {
        const int used = problem->state_count(i) + (i < 5 ? problem->control_count(i) : 0), stride = found.stride();
        for (int k = 0; k < used; ++k)
          for (int j = 0; j < used; ++j)
            EXPECT_NEAR(found.H(i)[k * stride + j], expected.H(i)[k * stride + j], 1e-12) << sample << ": " << i;
      }
      shifter.take(*problem, point);
      std::copy_n(point.state(1), problem->model().state_count(), problem->given_state());
      problem->finish(scratch);
      ASSERT_TRUE(shifter.apply(1, *problem, point));
    }
  }
}

TEST_P(HorizonTermsTest, AStepWithoutMultipliersIsJudgedWithoutTheSlopesOfLimits) {
  const auto problem = make_problem(GetParam());
  std::vector<double> scratch(problem->scratch_size());
  const auto cache = problem->make_linearisation();
  Iterate point = point_of(*problem);
  for (const bool pulls : {false, true, false}) {
    for (int i = 0; i <= 5; ++i)
      for (int r = 0; r < problem->limit_count(i); ++r) point.limit_bound(i)[r] = pulls ? 0.4 - 0.1 * i + r : 0.0;
    point.state(2)[0] += 0.01;
    cache->linearise_for_residual(point, Hessian::exact);
    StageQp expected(problem->capacity());
    problem->linearise(all_stages(*problem), point, Hessian::exact, expected, scratch);
    const KktResidual found = kkt_residual(cache->qp(), point), wanted = kkt_residual(expected, point);
    EXPECT_NEAR(found.stationarity, wanted.stationarity, 1e-12);
    EXPECT_NEAR(found.bound_violation, wanted.bound_violation, 1e-12);
    EXPECT_NEAR(found.complementarity, wanted.complementarity, 1e-12);
    // The same, and one whose multipliers are new.
    for (const bool will_pull : {pulls, true}) {
      for (int i = 0; will_pull && i <= 5; ++i) point.limit_bound(i)[0] = 0.3;
      cache->prepare(point, Hessian::exact);
      cache->refresh(point);
      for (int i = 0; i <= 5; ++i)
        for (int r = 0; r < expected.limits(i); ++r) {
          EXPECT_NEAR(cache->qp().limit_lower(i)[r], expected.limit_lower(i)[r], 1e-12);
          for (int j = 0; j < expected.stride(); ++j)
            EXPECT_NEAR(cache->qp().G(i)[r * expected.stride() + j], expected.G(i)[r * expected.stride() + j], 1e-12);
        }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Problems, HorizonTermsTest,
                         ::testing::Values(Layers::none, Layers::blocked, Layers::rates, Layers::slip_ahead,
                                           Layers::rates_and_slip_ahead));

TEST(HorizonTerms, MultipliersMoveAlongWithTheHorizon) {
  const auto problem = make_problem(Layers::none);
  Iterate point = point_of(*problem);
  for (int i = 1; i < 5; ++i) {
    point.limit_bound(i)[0] = -0.1 * i;  // distances have a lower bound only
    point.limit_bound(i)[1] = 0.2 * i;
  }
  point.limit_bound(5)[0] = -0.5;
  GuessShifter shifter(*problem);
  shifter.take(*problem, point);
  ASSERT_TRUE(shifter.apply(1, *problem, point));
  EXPECT_EQ(point.limit_bound(0)[0], 0.2);
  for (int i = 1; i < 4; ++i) {
    EXPECT_EQ(point.limit_bound(i)[0], -0.1 * (i + 1));
    EXPECT_EQ(point.limit_bound(i)[1], 0.2 * (i + 1));
  }
  EXPECT_EQ(point.limit_bound(4)[0], -0.5);
  EXPECT_EQ(point.limit_bound(4)[1], 0.0) << "the last node has no inputs";
  EXPECT_EQ(point.limit_bound(5)[0], 0.0) << "new";
  point.limit_bound(2)[0] = 1.0;
  shifter.take(*problem, point);
  shifter.apply(1, *problem, point);
  EXPECT_EQ(point.limit_bound(1)[0], 0.0) << "there is no upper bound";
}

TEST(HorizonTerms, HardLimitsMayHaveAPriceForSomeTime) {
  const auto problem = make_problem(Layers::none);
  const auto weights = [&](int stage) {
    const double* const linear = problem->limit_linear(stage);
    return std::vector(linear, linear + problem->limit_count(stage));
  };
  const auto of_qp = [&](int stage) {
    StageQp qp(problem->capacity());
    std::vector<double> scratch(problem->scratch_size());
    problem->linearise(all_stages(*problem), scattered_point(*problem), Hessian::none, qp, scratch);
    return std::vector(qp.limit_linear(stage), qp.limit_linear(stage) + qp.limits(stage));
  };
  ASSERT_THAT(weights(1), ElementsAre(3.0, infinity));  // sorted: limits of states first
  for (const double price : {7.0, 700.0}) {
    problem->terms().set_price(price);
    EXPECT_EQ(problem->terms().price(), price);
    EXPECT_THAT(weights(1), ElementsAre(3.0, price));
    EXPECT_THAT(of_qp(1), ElementsAre(3.0, price));
    EXPECT_FALSE(problem->is_hard_limit(1, 0));
    EXPECT_TRUE(problem->is_hard_limit(1, 1));
  }
  problem->terms().set_price(infinity);
  EXPECT_EQ(problem->terms().price(), infinity);
  EXPECT_THAT(of_qp(1), ElementsAre(3.0, infinity));
}

TEST(HorizonTerms, DataAreTakenFromAnotherProblem) {
  const auto from = make_problem(Layers::none), to = make_problem(Layers::none);
  from->terms().place(3, {.time = 7.0});
  from->terms().set_price(20.0);
  to->take_data(*from);
  EXPECT_EQ(to->limit_lower(3)[0], from->limit_lower(3)[0]);
  EXPECT_EQ(to->terms().data(3)[0], from->terms().data(3)[0]);
  EXPECT_EQ(to->limit_linear(1)[1], 20.0);
  const RhcProblem copy(*from);
  EXPECT_EQ(copy.limit_lower(3)[0], 7.4);
  EXPECT_EQ(copy.limit_linear(1)[1], 20.0);
}

}  // namespace horizon_terms_test
}  // namespace rhec
