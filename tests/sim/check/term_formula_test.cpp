#include "sim/check/term_formula.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include "rhec/core/base/error.hpp"
#include "sim/support/written_term.hpp"

namespace rhec::sim {
namespace term_formula_test {

using testing::ElementsAre;

TEST(TermFormula, HasLimitsThenCostsInTheOrderOfTheFunctions) {
  const TermFormula formula(right_term(), unicycle());
  EXPECT_THAT(formula.limit_names(), ElementsAre("eastward", "wall"));
  EXPECT_THAT(names_of(formula.about().outputs), ElementsAre("wall", "eastward", "aside", "along"));  // inputs last
  EXPECT_THAT(formula.data_names(), ElementsAre("path_x", "path_y"));
}

TEST(TermFormula, EvaluatesWhatIsWritten) {
  const TermFormula formula(right_term(), unicycle());
  const ModelDescription& about = formula.about();
  const StagePoints stages = random_stages(about, 5, 2);
  std::vector<double> data;
  for (int i = 0; i < stages.count; ++i) data.insert(data.end(), {0.5 + i, -i * 0.25});
  const std::vector<double> values = formula.values(stages, data), slopes = formula.jacobians(stages, data),
                            bends = formula.hessians(stages, data, std::vector<double>(20, 1.0));
  const int nx = 4, nz = nx + 2 + 2;
  const Roles& roles = about.roles;
  for (int i = 0; i < stages.count; ++i) {
    const double* x = stages.states.data() + i * nx;
    const double speed = stages.inputs[i * 2 + roles.speed], psi = x[roles.heading];
    EXPECT_NEAR(values[i * 4], x[roles.position_x], 1e-14);
    EXPECT_NEAR(values[i * 4 + 1], speed * std::cos(psi), 1e-13);
    EXPECT_NEAR(values[i * 4 + 2], x[roles.position_x] - 0.5 - i, 1e-14);
    EXPECT_NEAR(values[i * 4 + 3], x[roles.position_y] + i * 0.25, 1e-14);
    EXPECT_NEAR(slopes[(i * nz + nx + roles.speed) * 4 + 1], std::cos(psi), 1e-13);
    EXPECT_NEAR(slopes[(i * nz + roles.heading) * 4 + 1], -speed * std::sin(psi), 1e-13);
    EXPECT_EQ(slopes[(i * nz + roles.heading) * 4], 0.0);
    const double mixed = -std::sin(psi);
    EXPECT_NEAR(bends[(i * nz + nx + roles.speed) * nz + roles.heading], mixed, 1e-13);
    EXPECT_NEAR(bends[(i * nz + roles.heading) * nz + nx + roles.speed], mixed, 1e-13);
  }
}

TEST(TermFormula, KnowsWhatIsWrittenForANode) {
  const TermFormula formula(right_term(), unicycle());
  const NodeNumbers numbers = formula.at({.time = 10.0, .x = 3.0, .y = 4.0});
  EXPECT_THAT(numbers.data, ElementsAre(3.0, 4.0));
  EXPECT_THAT(numbers.upper, ElementsAre(testing::DoubleEq(2.9), 100.0));
  EXPECT_FALSE(numbers.is_beyond);
  const VehicleGraph graph = formula.graph_with(numbers.data);
  ASSERT_EQ(graph.options.size(), 2U);
  EXPECT_EQ(graph.options[1].value, 4.0);
  EXPECT_EQ(graph.outputs.size(), 4U);
}

TEST(TermFormula, RefusesAVehicleWithoutWhatItNames) {
  const NamedTerm term = written([](TermWriter& writer) { writer.limit(writer.state("boom"), {}, "boom"); },
                                 [](const TermPlace&, double*, double*, double*) {});
  EXPECT_THROW(TermFormula(term, unicycle()), Error);
}

}  // namespace term_formula_test
}  // namespace rhec::sim
