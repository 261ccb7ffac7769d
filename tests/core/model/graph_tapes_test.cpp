#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <thread>
#include <vector>

#include "models/model_checks.hpp"
#include "rhec/core/model/formula_model.hpp"
#include "rhec/core/model/model_functions.hpp"
#include "support/allocations.hpp"
#include "support/wide_vehicle.hpp"

namespace rhec {

const StraightCode& wide_40_kernels();  // defined by rhec_add_model_kernels

namespace graph_tapes_test {

using testing::about_wide_vehicle;
using testing::Wide100;
using testing::Wide120;
using testing::Wide40;

template <class Scalar>
struct Wide6 : testing::WideVehicle<6, Scalar> {};

/// Derivatives along random directions against differences: of values, and of Jacobians times multipliers.
void expect_derivatives(const Model& model, int count, bool ramp, int substeps) {
  checks::Stages here = checks::random_stages(model, count, ramp, 3);
  here.substeps = substeps;
  model.integrate(here.intervals(true, true, true));
  const int nx = here.nx, nu = here.nu, np = here.np, nz = here.nz;
  for (int which = 0; which < 3; ++which) {
    std::vector<double> direction(static_cast<std::size_t>(nz));
    for (int c = 0; c < nz; ++c) direction[c] = std::sin(1.7 * c + 0.4 + which);
    const double h = 1e-5;
    std::vector<checks::Stages> moved(2, here);
    for (int side = 0; side < 2; ++side) {
      const auto move = [&](std::vector<double>& rows, int columns, int first) {
        for (int i = 0; i < count; ++i)
          for (int c = 0; c < columns; ++c) rows[i * columns + c] += (side ? -h : h) * direction[first + c];
      };
      move(moved[side].x, nx, 0);
      move(moved[side].u, nu, nx);
      move(moved[side].p, np, nx + nu);
      if (ramp) move(moved[side].p_end, np, nx + nu + np);
      model.integrate(moved[side].intervals(true, true, false));
    }
    for (int i = 0; i < count; ++i) {
      for (int r = 0; r < nx; ++r) {
        double slope = 0.0;
        for (int c = 0; c < nz; ++c) slope += here.jacobians[(i * nz + c) * nx + r] * direction[c];
        ASSERT_NEAR(slope, (moved[0].next[i * nx + r] - moved[1].next[i * nx + r]) / (2 * h), 1e-7);
      }
      for (int d = 0; d < nz; ++d) {
        double bend = 0.0, expected = 0.0;
        for (int c = 0; c < nz; ++c) bend += here.hessians[(i * nz + d) * nz + c] * direction[c];
        for (int r = 0; r < nx; ++r)
          expected += here.weights[i * nx + r] *
                      (moved[0].jacobians[(i * nz + d) * nx + r] - moved[1].jacobians[(i * nz + d) * nx + r]) / (2 * h);
        ASSERT_NEAR(bend, expected, 1e-6) << "stage " << i << ", variable " << d;
        for (int c = 0; c < nz; ++c)
          ASSERT_EQ(here.hessians[(i * nz + d) * nz + c], here.hessians[(i * nz + c) * nz + d]);
      }
    }
  }
}

TEST(GraphTapes, ShortStepsAreWholeAndLongOnesStaged) {
  const FormulaModel<Wide6> narrow({}, about_wide_vehicle(6));
  EXPECT_GT(narrow.cost_of_hessians().runs, 0);
  const FormulaModel<Wide40> wide({}, about_wide_vehicle(40));
  EXPECT_GT(wide.cost_of_values().runs, 0) << "values are short";
  EXPECT_EQ(wide.cost_of_hessians().runs, 0);
  EXPECT_GT(wide.cost_of_hessians().instructions, wide.cost_of_jacobians().instructions);
}

// Forty states and a hundred: with ramps and without, in one step and in several.
TEST(GraphTapes, ManyStatesHaveTheDerivativesOfTheirValues) {
  for (const bool ramp : {false, true}) {
    for (const int substeps : {1, 2}) {
      expect_derivatives(FormulaModel<Wide40>({}, about_wide_vehicle(40)), 3, ramp, substeps);
      expect_derivatives(FormulaModel<Wide100>({}, about_wide_vehicle(100)), 2, ramp, substeps);
    }
  }
}

TEST(GraphTapes, RowsOfManyStatesAreThoseOfDenseRequests) {
  FormulaModel<Wide40> model({}, about_wide_vehicle(40));
  for (const std::string& set : model.instruction_sets()) {
    ASSERT_TRUE(model.use_instruction_set(set));
    checks::expect_runge_kutta(model, false, 2);
    for (const int count : {1, 8, 13})
      for (const bool ramp : {false, true})
        for (const int substeps : {1, 2})
          checks::same_steps_by_rows(model, count, ramp, substeps,
                                     [&](const IntervalRows& request) { model.integrate_rows(request); });
  }
}

TEST(GraphTapes, CompiledRatesGiveTheBitsOfTheInterpreter) {
  FormulaModel<Wide40> compiled({}, about_wide_vehicle(40), wide_40_kernels()), interpreted({}, about_wide_vehicle(40));
  for (const std::string& set : compiled.instruction_sets()) {
    if (set == "interpreted") continue;
    SCOPED_TRACE(set);
    ASSERT_TRUE(compiled.use_instruction_set(set));
    ASSERT_TRUE(interpreted.use_instruction_set(set));
    EXPECT_TRUE(compiled.is_compiled());
    EXPECT_FALSE(interpreted.is_compiled());
    EXPECT_EQ(compiled.cost_of_hessians().instructions, interpreted.cost_of_hessians().instructions);
    checks::expect_same_bits(compiled, interpreted);
  }
}

// The memory that requests without scratch share is the model's own, and one of them has it at a time.
TEST(GraphTapes, NeitherAllocateNorShareWhatIsInUse) {
  const FormulaModel<Wide120> model({}, about_wide_vehicle(120));
  checks::Stages alone = checks::random_stages(model, 9, true, 5);
  alone.substeps = 2;
  std::vector<checks::Stages> together(4, alone);
  const auto request = alone.intervals(true, true, true);
  const auto nodes = alone.nodes(true, true, true);
  std::vector<double> rates(120);
  const long before = allocation_count();
  model.integrate(request);
  model.observe(nodes);
  model.rates(alone.x.data(), alone.u.data(), alone.p.data(), rates.data());
  EXPECT_EQ(allocation_count(), before);
  std::vector<std::thread> threads;
  for (checks::Stages& stages : together)
    threads.emplace_back([&] { model.integrate(stages.intervals(true, true, true)); });
  for (std::thread& thread : threads) thread.join();
  for (const checks::Stages& stages : together)
    for (std::size_t k = 0; k + checks::Stages::behind < stages.hessians.size(); ++k)
      ASSERT_EQ(stages.hessians[k], alone.hessians[k]);
}

}  // namespace graph_tapes_test
}  // namespace rhec
