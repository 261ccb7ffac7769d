#include "solvers/nlopt/nlopt_options.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "problems.hpp"

namespace rhec::nlopt {
namespace nlopt_options_test {

using namespace testing;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::Pair;

TEST(NloptTraits, AreThoseThatTheNamesSay) {
  EXPECT_GT(algorithms().size(), 20U);
  for (const auto& [name, algorithm] : algorithms()) {
    EXPECT_EQ(name_of(algorithm), name);
    // "LD_...", "GN_...": local or global, with derivatives or none; "AUGLAG" and "G_MLSL" have a local algorithm.
    if (name[2] == '_') {
      EXPECT_EQ(traits_of(algorithm).gradients, name[1] == 'D') << name;
    }
  }
  const Traits slsqp = traits_of(NLOPT_LD_SLSQP), mma = traits_of(NLOPT_LD_MMA), newuoa = traits_of(NLOPT_LN_NEWUOA);
  EXPECT_TRUE(slsqp.inequalities && slsqp.equalities && slsqp.bounds && slsqp.from_start);
  EXPECT_TRUE(mma.inequalities && !mma.equalities);
  EXPECT_TRUE(!newuoa.bounds && !newuoa.inequalities && newuoa.fewest_variables > 1);
  EXPECT_TRUE(traits_of(NLOPT_GN_DIRECT_L).finite_bounds && !traits_of(NLOPT_GN_DIRECT_L).from_start);
}

TEST(NloptTraits, NameTheAlgorithmsForAKindOfConstraints) {
  const std::string both = names_of_those_with(true, true), inequalities = names_of_those_with(true, false);
  EXPECT_THAT(both, HasSubstr("LD_SLSQP"));
  EXPECT_THAT(both, Not(HasSubstr("LD_MMA")));
  EXPECT_THAT(inequalities, HasSubstr("LD_SLSQP"));
  EXPECT_THAT(inequalities, HasSubstr("LD_MMA"));
  EXPECT_THAT(inequalities, Not(HasSubstr("LD_LBFGS")));
}

TEST(NloptTraits, OfALocalAlgorithmDecideOnGradients) {
  NloptOptions options;
  options.local_algorithm = NLOPT_LN_COBYLA;
  EXPECT_FALSE(uses_gradients(NLOPT_AUGLAG, options));
  EXPECT_TRUE(uses_gradients(NLOPT_LD_SLSQP, options));
  options.local_algorithm = NLOPT_LD_LBFGS;
  EXPECT_TRUE(uses_gradients(NLOPT_AUGLAG, options));
  EXPECT_FALSE(uses_gradients(NLOPT_LN_COBYLA, options));
}

TEST(NloptOptions, HandOnNativeParametersAsNumbers) {
  EXPECT_THAT(native_parameters(Settings()), IsEmpty());
  EXPECT_THAT(native_parameters(parse_yaml("{inner_maxeval: 3, rho_init: 0.5}", "options")),
              ElementsAre(Pair("inner_maxeval", 3.0), Pair("rho_init", 0.5)));
  EXPECT_THROW(native_parameters(parse_yaml("[inner_maxeval, 3]", "options")), Error);
  EXPECT_THROW(native_parameters(parse_yaml("{verbosity: 1}", "options")), Error);
}

TEST(NloptOptions, RefuseWhatAnAlgorithmCannotTake) {
  const auto states = integrator(5, limited_states), inputs = integrator(5, limited_inputs),
             free = integrator(5, unlimited);
  Limits fixed_limits = limited_states;
  fixed_limits.state_lower = fixed_limits.state_upper = {0.5};
  const auto fixed = integrator(5, fixed_limits);
  struct Case {
    const char* options;
    const Ocp* problem;
    const char* reason;  // a part of it; empty: taken
  };
  const Case cases[] = {
      {"{}", states.get(), ""},
      {"{algorithm: LD_MMA}", states.get(), ""},
      {"{algorithm: LD_CCSAQ}", states.get(), ""},
      {"{algorithm: LN_COBYLA}", states.get(), ""},
      {"{algorithm: LD_AUGLAG}", states.get(), ""},
      {"{algorithm: LD_LBFGS}", states.get(), "LD_LBFGS takes no inequality constraints"},
      {"{algorithm: LD_LBFGS}", inputs.get(), ""},
      {"{algorithm: LD_MMA}", fixed.get(), "LD_MMA takes no equality constraints"},
      {"{algorithm: LD_SLSQP}", fixed.get(), ""},
      {"{algorithm: LN_NEWUOA}", inputs.get(), "LN_NEWUOA takes no bounds"},
      {"{algorithm: LN_NEWUOA}", free.get(), ""},
      {"{algorithm: GN_DIRECT_L}", inputs.get(), "some decisions unbounded"},  // s_0 is
      {"{algorithm: GN_ISRES}", states.get(), ""},
      {"{algorithm: GN_CRS2_LM}", states.get(), "takes no inequality constraints"},
      {"{algorithm: AUGLAG_EQ, local_algorithm: LD_LBFGS}", states.get(), "leaves inequality constraints"},
      {"{max_variables: 5}", states.get(), "6 decision variables, more than max_variables: 5"},
  };
  for (const Case& each : cases) {
    const std::string reason = nlopt_with(each.options)->why_not(*each.problem);
    if (std::string(each.reason).empty()) {
      EXPECT_EQ(reason, "") << each.options;
    } else {
      EXPECT_NE(reason.find(each.reason), std::string::npos) << each.options << ": " << reason;
    }
  }
  const std::string reason = nlopt_with("{algorithm: LD_LBFGS}")->why_not(*states);
  for (const char* name : {"LD_SLSQP", "LD_MMA", "LN_COBYLA"}) EXPECT_NE(reason.find(name), std::string::npos);
}

TEST(NloptOptions, SayWhatIsWrongWithThem) {
  EXPECT_NE(error_of_options("{algorithm: LD_SLSPQ}").find("LD_SLSQP"), std::string::npos);
  EXPECT_NE(error_of_options("{algorithm: LD_LBFGS, scaling: full}").find("diagonal"), std::string::npos);
  EXPECT_NE(error_of_options("{algorithm: AUGLAG, local_algorithm: G_MLSL}").find("local_algorithm"),
            std::string::npos);
  EXPECT_NE(error_of_options("{native: {verbosity: 1}}").find("prints nothing"), std::string::npos);
  EXPECT_NE(error_of_options("{native: {inner_maxeval: many}}").find("options:1"), std::string::npos);
}

}  // namespace nlopt_options_test
}  // namespace rhec::nlopt
