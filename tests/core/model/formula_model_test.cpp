// A formula with everything that formulas may use, compiled for every instruction set, as models are.
#include "support/every_function.hpp"

#include "models/model_checks.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/core/model/formula_model.hpp"
#include "support/error_of.hpp"

namespace rhec {

const StraightCode& every_function_kernels();  // defined by rhec_add_model_kernels

namespace formula_model_test {

std::vector<Variable> variables(const std::vector<std::string>& names) {
  std::vector<Variable> all;
  all.reserve(names.size());
  for (const std::string& name : names) all.push_back({.name = name, .unit = "1", .meaning = name});
  return all;
}

ModelDescription describe() {
  ModelDescription description;
  description.name = "every_function";
  description.states = variables({"a", "b", "c"});
  description.inputs = variables({"u"});
  description.parameters = variables({"p", "q"});
  description.outputs = variables({"sqrt", "exp", "log", "sin", "cos", "tan", "tanh", "asin", "acos", "atan", "atan2"});
  return description;
}

FormulaModel<EveryFunction> make_model() {
  return FormulaModel<EveryFunction>({}, describe(), every_function_kernels());
}

std::string why_refused(const ModelDescription& description) {
  return error_of([&] { const FormulaModel<EveryFunction> model({}, description); });
}

TEST(EveryFunction, IsRefusedWithADescriptionThatDoesNotFit) {
  ModelDescription one_too_few = describe();
  one_too_few.outputs.pop_back();
  EXPECT_EQ(why_refused(one_too_few),
            "model 'every_function': its formula has 11 outputs and its description 10; describe each of them, in the "
            "formula's order");
  ModelDescription no_such_input = describe();
  no_such_input.roles.speed = 1;
  EXPECT_EQ(
      why_refused(no_such_input),
      "model 'every_function': the role speed names number 1 of its 1 inputs; expected an index from 0, or -1 for "
      "none");
  for (auto kind : {&ModelDescription::states, &ModelDescription::inputs, &ModelDescription::parameters}) {
    ModelDescription one_too_many = describe();
    (one_too_many.*kind).push_back((one_too_many.*kind).front());
    EXPECT_NE(why_refused(one_too_many).find("its formula has"), std::string::npos) << why_refused(one_too_many);
  }
  EXPECT_EQ(why_refused(describe()), "");
}

/// noipa keeps the compiler from seeing what is wrong with the formula.
template <class Scalar>
[[gnu::noipa]] void write(const Scalar& value, int count, Scalar* results) {
  for (int j = 0; j < count; ++j) results[j] = value * 1.0;
}

/// A formula that writes other results than it declares.
template <class Scalar>
struct Forgetful {
  static constexpr int state_count = 2, input_count = 0, parameter_count = 0, output_count = 1;
  int rates = 2, measured = 1;

  template <class Visitor>
  void options(Visitor&& option) {
    option("rates", rates, "how many it writes");
    option("measured", measured, "how many it writes");
  }
  void dynamics(const Scalar* x, const Scalar*, const Scalar*, Scalar* dxdt) const { write(x[0], rates, dxdt); }
  void outputs(const Scalar* x, Scalar* y) const { write(x[0], measured, y); }
};

std::string why_refused(const Forgetful<double>& formula) {
  ModelDescription description;
  description.name = "forgetful";
  description.states = variables({"a", "b"});
  description.outputs = variables({"y"});
  return error_of([&] { const FormulaModel<Forgetful> model(formula, description); });
}

TEST(FormulaModel, RefusesAFormulaThatForgetsAResultOrWritesOneTooMany) {
  EXPECT_EQ(why_refused(Forgetful<double>{}), "");
  EXPECT_EQ(why_refused(Forgetful<double>{.rates = 1}),
            "model 'forgetful': the formula's dynamics leaves out number 1; let it write all 2, from 0 on");
  EXPECT_EQ(why_refused(Forgetful<double>{.measured = 0}),
            "model 'forgetful': the formula's outputs leaves out number 0; let it write all 1, from 0 on");
  EXPECT_EQ(
      why_refused(Forgetful<double>{.measured = 2}),
      "model 'forgetful': the formula's outputs writes number 1, and it has but 1, counted from 0; mend its counts");
}

TEST(EveryFunction, HasTheDerivativesOfItsValues) {
  auto model = make_model();
  for (const std::string& set : model.instruction_sets()) {
    SCOPED_TRACE(set);
    ASSERT_TRUE(model.use_instruction_set(set));
    for (const bool ramp : {false, true}) checks::expect_derivatives(model, ramp, 2, 7);
    checks::expect_runge_kutta(model, true, 2);
  }
}

TEST(EveryFunction, IsTheSameOnEveryInstructionSet) {
  auto model = make_model();
  auto generic = make_model();
  ASSERT_TRUE(generic.use_instruction_set("generic"));
  for (const std::string& set : model.instruction_sets()) {
    SCOPED_TRACE(set);
    ASSERT_TRUE(model.use_instruction_set(set));
    checks::same_as_generic(model, generic);
    for (const int count : {1, 8, 13})
      checks::same_by_rows(model, count, [&](const NodeRows& request) { model.observe_rows(request); });
  }
}

// What is compiled and what is interpreted has the same bits on the same instruction set.
TEST(EveryFunction, IsCompiledToWhatIsInterpreted) {
  auto compiled = make_model();
  GraphModel interpreted(compiled.vehicle(), describe());
  ASSERT_TRUE(compiled.is_compiled());
  ASSERT_FALSE(interpreted.is_compiled());
  for (const std::string& set : compiled.instruction_sets()) {
    if (set == "interpreted") continue;
    SCOPED_TRACE(set);
    ASSERT_TRUE(compiled.use_instruction_set(set));
    ASSERT_TRUE(interpreted.use_instruction_set(set));
    checks::expect_same_bits(compiled, interpreted);
  }
}

// Packs use another reduction for large arguments of sine and cosine, which must not lose digits.
TEST(EveryFunction, KnowsLargeAngles) {
  auto model = make_model();
  for (const std::string& set : model.instruction_sets()) {
    SCOPED_TRACE(set);
    ASSERT_TRUE(model.use_instruction_set(set));
    for (const double angle : {0.0, 0.7, 1.5, 3.2, -40.0, 90.0, 1e3, -1e5, 1e7, -1e12}) {
      const double x[3] = {angle, 0.3, 0.4};
      double y[11], jacobian[33];
      model.observe({.count = 1, .states = x, .outputs = y, .jacobians = jacobian});
      EXPECT_NEAR(y[3], std::sin(angle), 1e-15) << angle;
      EXPECT_NEAR(y[4], std::cos(10 * angle), 1e-15) << angle;
      EXPECT_NEAR(jacobian[3], std::cos(angle), 1e-15) << angle;
    }
  }
}

}  // namespace formula_model_test
}  // namespace rhec
