// A formula with all that formulas may use, compiled for every instruction set as models are.
#include "every_function.hpp"

#include "model_checks.hpp"
#include "rhec/core/error.hpp"
#include "rhec/core/formula_model.hpp"

namespace rhec {

WideKernels every_function_wide_kernels();  // defined by rhec_add_wide_kernels

namespace {

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
  return FormulaModel<EveryFunction>({}, describe(), every_function_wide_kernels());
}

std::string why_refused(const ModelDescription& description) {
  try {
    const FormulaModel<EveryFunction> model({}, description);
    return "it is not refused";
  } catch (const Error& error) {
    return error.what();
  }
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
  EXPECT_EQ(why_refused(describe()), "it is not refused");
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
  }
}

// Packs reduce the arguments of sine and cosine by another way when they are large, and must not lose digits there.
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

}  // namespace
}  // namespace rhec
