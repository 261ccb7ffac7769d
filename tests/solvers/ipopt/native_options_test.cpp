#include "solvers/ipopt/native_options.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "problems.hpp"

namespace rhec::ipopt {
namespace native_options_test {

using namespace testing;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

TEST(IpoptNativeOptions, AreSetAsTheTypeThatIpoptHasForThem) {
  const Ipopt::SmartPtr<Ipopt::IpoptApplication> application = new Ipopt::IpoptApplication(false, false);
  EXPECT_THAT(set_native_options(Settings(), *application), IsEmpty());
  const Settings native = parse_yaml(
      "{mu_strategy: adaptive, acceptable_iter: 3, acceptable_tol: 1.0e-3, fast_step_computation: true}", "native");
  EXPECT_THAT(set_native_options(native, *application),
              ElementsAre("acceptable_iter", "acceptable_tol", "fast_step_computation", "mu_strategy"));
  std::string text;
  int integer = 0;
  double number = 0.0;
  bool flag = false;
  EXPECT_TRUE(application->Options()->GetStringValue("mu_strategy", text, ""));
  EXPECT_EQ(text, "adaptive");
  EXPECT_TRUE(application->Options()->GetIntegerValue("acceptable_iter", integer, ""));
  EXPECT_EQ(integer, 3);
  EXPECT_TRUE(application->Options()->GetNumericValue("acceptable_tol", number, ""));
  EXPECT_EQ(number, 1e-3);
  EXPECT_TRUE(application->Options()->GetBoolValue("fast_step_computation", flag, ""));
  EXPECT_TRUE(flag);
  EXPECT_THROW(set_native_options(parse_yaml("[mu_strategy]", "native"), *application), Error);
}

TEST(IpoptNativeOptions, PassesNativeOptionsOn) {
  RandomProblem random(bicycle(), 4);
  RandomProblem::RhcSpec spec;
  spec.off = 0.3;
  const auto problem = random.rhc(spec);
  const auto report_with = [&](const std::string& options) {
    const auto solver = ipopt_with(options);
    solver->setup(*problem);
    Iterate point = RandomProblem::cold_start(*problem);
    return solver->solve(point);
  };
  const Report usual = report_with("{}");
  ASSERT_EQ(usual.status, Status::solved);
  // A number, an integer that wins over ours, and a choice written as a flag.
  // (None of them is a time: clocks of the processor may stand still for as long as a solve takes.)
  const Report diverged = report_with("{native: {diverging_iterates_tol: 1e-6}}");
  EXPECT_NE(diverged.status, Status::solved);
  EXPECT_EQ(diverged.iterations, 0);
  EXPECT_GT(report_with("{hessian: limited_memory, native: {limited_memory_max_history: 1}}").iterations,
            report_with("{hessian: limited_memory}").iterations);
  const Report restored = report_with("{native: {start_with_resto: true}}");
  EXPECT_EQ(restored.status, Status::solved);
  EXPECT_NE(restored.iterations, usual.iterations);
}

TEST(IpoptNativeOptions, RefusesNativeOptionsWithTheirPlace) {
  EXPECT_EQ(error_of_options("native:\n  mu_strategy: adaptive\n  mu_stategy: adaptive"),
            "options.yaml:3: native.mu_stategy: solver 'ipopt': Ipopt has no option 'mu_stategy'; did you mean "
            "'mu_strategy'?");
  EXPECT_NE(error_of_options("native: {mu_strategy: often}").find("found 'often', expected monotone | adaptive"),
            std::string::npos);
  EXPECT_NE(error_of_options("native: {mu_init: -1}").find("found '-1', expected a number, above 0"),
            std::string::npos);
  EXPECT_NE(error_of_options("native: {max_soc: many}").find("found 'many', expected an integer, at least 0"),
            std::string::npos);
  EXPECT_NE(error_of_options("native: {mu_init: [1]}").find("options.yaml:1: native.mu_init"), std::string::npos);
  EXPECT_NE(error_of_options("native: adaptive").find("expected a map of options of Ipopt"), std::string::npos);
  // What would print, read files or contradict an option of ours.
  EXPECT_NE(error_of_options("native: {print_level: 5}").find("a solver prints nothing"), std::string::npos);
  EXPECT_NE(error_of_options("native: {option_file_name: mine.opt}").find("cannot be set here"), std::string::npos);
  EXPECT_NE(error_of_options("native: {tol: 1e-3}").find("option 'tolerance'"), std::string::npos);
  // Only Ipopt itself knows that this one is not there, and only when it starts.
  EXPECT_NE(error_of_options("native:\n  mu_init: 0.1\n  linear_solver: pardiso")
                .find("options.yaml:3: native.linear_solver: solver 'ipopt': Ipopt cannot start"),
            std::string::npos);
}

}  // namespace native_options_test
}  // namespace rhec::ipopt
