#include "rhec/core/model/model_functions.hpp"

#include <gtest/gtest.h>

#include <set>
#include <string>
#include <vector>

#include "models/bicycle_slip/bicycle_slip.hpp"
#include "models/unicycle_traction/unicycle_traction.hpp"
#include "rhec/core/model/formula_model.hpp"
#include "support/error_of.hpp"
#include "support/linear_case.hpp"

namespace rhec {
namespace model_functions_test {

TEST(ModelFunctions, ResultsStandInTheirOrder) {
  const VehicleGraph vehicle = trace<BicycleSlip>();
  ModelFunctions functions(vehicle);
  const std::size_t nx = 4, np = 2, nu = 2, ny = 6, nz = nx + np + nu;
  const auto sizes = [&](ModelFunction function) {
    return std::pair(functions.inputs(function).size(), functions.results(function).size());
  };
  // z, h and the weights; a ramp has p_end and two numbers more.
  EXPECT_EQ(sizes(ModelFunction::step), std::pair(nz + 1 + nx, nx));
  EXPECT_EQ(sizes(ModelFunction::step_jacobian), std::pair(nz + 1 + nx, nx + nx * nz));
  EXPECT_EQ(sizes(ModelFunction::step_hessian), std::pair(nz + 1 + nx, nx + nx * nz + nz * nz));
  EXPECT_EQ(sizes(ModelFunction::ramp), std::pair(nz + np + 3 + nx, nx));
  EXPECT_EQ(sizes(ModelFunction::outputs), std::pair(nx, ny));
  EXPECT_EQ(sizes(ModelFunction::output_jacobian), std::pair(nx, ny + ny * nx));
  EXPECT_EQ(sizes(ModelFunction::output_hessian), std::pair(nx + ny, nx * nx));
  std::set<std::string_view> names;
  for (int k = 0; k < static_cast<int>(ModelFunction::count); ++k) names.insert(name_of(static_cast<ModelFunction>(k)));
  EXPECT_EQ(names.size(), static_cast<std::size_t>(ModelFunction::count));
}

/// A train of carts: how many is its structure.
template <class Scalar>
struct Train {
  Scalar stiffness{2.0};
  int carts = 2;

  template <class Visitor>
  void options(Visitor&& option) {
    option("stiffness", stiffness, "of the couplings [1/s]");
    option("carts", carts, "how many");
  }
  FormulaCounts counts() const { return {.states = carts, .inputs = 1, .parameters = 0, .outputs = 1}; }
  void dynamics(const Scalar* x, const Scalar* u, const Scalar*, Scalar* dxdt) const {
    for (int j = 0; j < carts; ++j) dxdt[j] = stiffness * ((j > 0 ? x[j - 1] : u[0]) - x[j]);
  }
  void outputs(const Scalar* x, Scalar* y) const { y[0] = x[carts - 1]; }
};

TEST(Fingerprint, IsThatOfTheFormulaAndNotOfItsOptions) {
  const auto of_train = [](double stiffness, int carts) {
    Train<double> train;
    train.stiffness = stiffness;
    train.carts = carts;
    return fingerprint_of(trace<Train>(train));
  };
  EXPECT_EQ(of_train(2.0, 2), of_train(5.0, 2));
  EXPECT_NE(of_train(2.0, 2), of_train(2.0, 3));
  EXPECT_NE(fingerprint_of(trace<BicycleSlip>()), fingerprint_of(trace<UnicycleTraction>()));
  EXPECT_EQ(fingerprint_of(trace<BicycleSlip>()), fingerprint_of(trace<BicycleSlip>({}, {{"a", "b"}, {}, {}})));
}

/// x' = a (b + c) + d / e of sines, whose operands are recorded from the left or from the right.
VehicleGraph recorded(bool from_the_left) {
  VehicleGraph made;
  Graph& graph = *made.graph;
  for (int j = 0; j < 5; ++j) made.states.push_back(graph.input("x"));
  std::vector<int> sines(5);
  for (int k = 0; k < 5; ++k) {
    const auto j = static_cast<std::size_t>(from_the_left ? k : 4 - k);
    sines[j] = graph.function(Operation::sine, made.states[j]);
  }
  const auto product = [&] { return graph.multiply(sines[0], graph.add(sines[1], sines[2])); };
  const auto quotient = [&] { return graph.divide(sines[3], sines[4]); };
  int first = 0, second = 0;
  if (from_the_left) first = product(), second = quotient();
  if (!from_the_left) second = quotient(), first = product();
  made.rates.assign(5, graph.add(first, second));
  made.outputs = {graph.subtract(first, second)};
  return made;
}

TEST(Fingerprint, DoesNotDependOnTheOrderOfRecording) {
  EXPECT_EQ(fingerprint_of(recorded(true)), fingerprint_of(recorded(false)));
  VehicleGraph other = recorded(true);
  other.outputs = {other.graph->negate(other.outputs[0])};
  EXPECT_NE(fingerprint_of(recorded(true)), fingerprint_of(other)) << "a - b is not b - a";
}

// Kernels that were compiled of another formula are not used.
TEST(FormulaModel, LeavesAnotherStructureToTheInterpreter) {
  static constexpr StraightCode other{.fingerprint = 1};
  ModelDescription about;
  about.name = "train";
  about.states.resize(3);
  about.inputs.resize(1);
  about.outputs.resize(1);
  Train<double> three;
  three.carts = 3;
  const FormulaModel<Train> model(three, about, other);
  EXPECT_FALSE(model.is_compiled());
  EXPECT_EQ(model.state_count(), 3);
  const double x[] = {0.0, 0.0, 1.0}, u[] = {0.0};
  double rates[3];
  model.rates(x, u, nullptr, rates);
  EXPECT_EQ(rates[2], -2.0);
}

TEST(FormulaOptions, AreThoseThatTheFormulaShows) {
  const auto rows = FormulaOptions<Train>::table().schema();
  ASSERT_EQ(rows.size(), 2u);
  EXPECT_EQ(rows[0].name, "stiffness");
  EXPECT_EQ(rows[0].default_value, "2");
  EXPECT_EQ(rows[1].type, "integer");
  Settings settings;
  settings.set("stiffness", Settings::scalar("7"));
  settings.set("carts", Settings::scalar("4"));
  const FormulaOptions<Train> options = FormulaOptions<Train>::table().parse(settings, "a test");
  EXPECT_EQ(options.stiffness, 7.0);
  EXPECT_EQ(options.carts, 4);
}

/// Shows one of its two lengths.
template <class Scalar>
struct Secretive {
  static constexpr int state_count = 1, input_count = 0, parameter_count = 0, output_count = 1;
  Scalar shown{1.0}, hidden{2.0};

  template <class Visitor>
  void options(Visitor&& option) {
    option("shown", shown, "a length [m]");
  }
  void dynamics(const Scalar* x, const Scalar*, const Scalar*, Scalar* dxdt) const { dxdt[0] = shown * hidden * x[0]; }
  void outputs(const Scalar* x, Scalar* y) const { y[0] = x[0]; }
};

TEST(Trace, RefusesAMemberThatIsNotShown) {
  EXPECT_CONTAINS(error_of([] { trace<Secretive>(); }), "16 bytes of members, and its options show 8");
}

// Two robots of one formula in one process: each has its own lengths, in values and in derivatives.
TEST(FormulaModel, TwoRobotsHaveTheirOwnLengths) {
  ModelDescription about;
  about.name = "bicycle";
  about.states.resize(4);
  about.inputs.resize(2);
  about.parameters.resize(2);
  about.outputs.resize(6);
  BicycleSlip<double> longer;
  longer.wheelbase = 2.8;
  const FormulaModel<BicycleSlip> one({}, about), other(longer, about);
  const double x[] = {0, 0, 0.3, 0.2}, u[] = {4.0, 0.0}, p[] = {0.9, 0.8}, h = 0.1;
  const auto heading = [&](const Model& model, const double* inputs, double* jacobian) {
    double next[4];
    model.integrate({.count = 1,
                     .states = x,
                     .inputs = inputs,
                     .parameters = p,
                     .durations = &h,
                     .next_states = next,
                     .jacobians = jacobian});
    return next[2];
  };
  double slopes[32], other_slopes[32];
  const double turned = heading(one, u, slopes) - x[2], other_turned = heading(other, u, other_slopes) - x[2];
  EXPECT_NEAR(turned, 2.0 * other_turned, 1e-12);
  constexpr double step = 1e-5;
  for (const auto& [model, given] : {std::pair<const Model*, const double*>{&one, slopes}, {&other, other_slopes}}) {
    const double faster[] = {4.0 + step, 0.0}, slower[] = {4.0 - step, 0.0};
    EXPECT_NEAR(given[4 * 4 + 2], (heading(*model, faster, nullptr) - heading(*model, slower, nullptr)) / (2 * step),
                1e-9);
  }
}

TEST(WriteModelCode, GivesTheSameTextAndLeavesOutRampsWithoutParameters) {
  const std::vector<std::string> sets{"generic"};
  const ModelCode one = write_model_code(trace<BicycleSlip>(), "bicycle", "BicycleSlip", sets),
                  same = write_model_code(trace<BicycleSlip>(), "bicycle", "BicycleSlip", sets);
  EXPECT_EQ(one.kernels, same.kernels);
  EXPECT_EQ(one.table, same.table);
  const ModelCode train = write_model_code(trace<Train>(), "train", "Train", sets);
  EXPECT_NE(train.kernels.find("&step_hessian, nullptr, nullptr, nullptr, &outputs"), std::string::npos);
}

}  // namespace model_functions_test
}  // namespace rhec
