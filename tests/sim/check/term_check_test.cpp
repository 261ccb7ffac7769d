#include "rhec/sim/check/term_check.hpp"

#include <gmock/gmock.h>

#include "rhec/core/base/error.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "sim/support/written_term.hpp"
#include "support/error_of.hpp"

namespace rhec::sim {
namespace term_check_test {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;

const auto no_data = [](const TermPlace&, double*, double*, double*) {};

TermCheck of_cost(const std::function<Expression(TermWriter&)>& cost) {
  return check(written([&](TermWriter& writer) { writer.residual(cost(writer), {}, "it"); }, no_data));
}

TEST(CheckOfATerm, PassesARightOne) {
  const TermCheck found = check(right_term());
  EXPECT_EQ(found.verdict(), Verdict::pass);
  std::vector<std::string> checks;
  for (const Finding& finding : found.findings) checks.push_back(finding.check);
  EXPECT_THAT(checks, ElementsAre("description", "vehicle", "rows", "derivatives", "numbers", "time"));
  ASSERT_EQ(found.vehicles.size(), 1U);
  EXPECT_EQ(found.vehicles.front().limits, 2);
  EXPECT_EQ(found.vehicles.front().costs, 2);
  EXPECT_GT(found.vehicles.front().jacobians.median, 0.0);
  EXPECT_GT(findings_of(found, "derivatives").front().numbers[2].second, 100.0) << "compared";
}

TEST(CheckOfATerm, FindsWhatIsSteeperThanAnyStep) {
  const TermCheck found = of_cost([](TermWriter& writer) { return sin(1e8 * writer.position_x()); });
  const Finding first = findings_of(found, "derivatives").front();
  EXPECT_EQ(first.verdict, Verdict::fail);
  EXPECT_THAT(first.where, HasSubstr("d it / d "));
}

TEST(CheckOfATerm, NamesTheNodeThatIsNotFinite) {
  const TermCheck found = of_cost([](TermWriter& writer) { return 1.0 / writer.wheel_speed(); });
  const Finding finding = findings_of(found, "numbers").front();
  EXPECT_EQ(finding.verdict, Verdict::fail);
  EXPECT_THAT(finding.found, AllOf(HasSubstr("the first that is not finite: n"), HasSubstr("(it) = 1 / "),
                                   HasSubstr("it divides by 0")));
  EXPECT_THAT(finding.advice, HasSubstr("smooth_abs"));
}

TEST(CheckOfATerm, SaysWhereItIsNotFinite) {
  const TermCheck found = of_cost([](TermWriter& writer) { return sqrt(writer.wheel_speed()); });
  const Finding finding = findings_of(found, "numbers").front();
  const ModelDescription about = unicycle_description();
  EXPECT_THAT(finding.where, HasSubstr(about.inputs[about.roles.speed].name + " in ["));
  EXPECT_THAT(finding.found, HasSubstr("square root"));
}

TEST(CheckOfATerm, KnowsWhichVehiclesSuit) {
  const NamedTerm term =
      written([](TermWriter& writer) { writer.residual(writer.state("boom"), {}, "boom"); }, no_data);
  const TermCheck given = check(term);
  EXPECT_EQ(findings_of(given, "vehicle").front().verdict, Verdict::fail);
  EXPECT_THAT(findings_of(given, "vehicle").front().found, HasSubstr("has no state 'boom'"));
  const TermCheck found = check_term(term, right_description(), {unicycle()}, false);
  EXPECT_EQ(findings_of(found, "vehicle").front().verdict, Verdict::warn);
  EXPECT_EQ(findings_of(found, "numbers").front().verdict, Verdict::skip);
  EXPECT_EQ(check_term(right_term(), right_description(), {}, false).verdict(), Verdict::warn);
}

TEST(CheckOfATerm, TakesTheEquationsOfASection) {
  const Host host;
  const Settings section = parse_yaml(
      "{equations: {name: side, meaning: slow in bends, options: {most: {default: 2, unit: m/s^2, meaning: sideways}, "
      "free: 1}, limits: {a: {term: ground_speed * heading_rate, upper: most}}}, most: 3}",
      "test");
  const TermCheck found = check_term(host, section, {unicycle()});
  EXPECT_EQ(found.term, "side");
  EXPECT_EQ(found.verdict(), Verdict::warn);
  EXPECT_THAT(findings_of(found, "description").front().where, "option free");
  const TermGraph graph = graph_of_term(host, section, *unicycle());
  EXPECT_THAT(graph.about.name, AllOf(HasSubstr("side on "), HasSubstr(unicycle_description().name)));
  EXPECT_EQ(graph.formula.outputs.size(), 1U);
}

TEST(CheckOfATerm, TakesAPluginOnAllModels) {
  const Host host;
  const TermCheck found = check_term(host, parse_yaml("{name: lateral_acceleration, most: 2}", "test"));
  EXPECT_EQ(found.verdict(), Verdict::pass);
  EXPECT_FALSE(found.vehicles.empty());
  EXPECT_TRUE(is_name_of_term(host, "lateral_acceleration"));
  EXPECT_FALSE(is_name_of_term(host, "bicycle_slip"));
  EXPECT_FALSE(is_name_of_term(host, "nothing_like_it"));
  EXPECT_THAT(error_of([&] { is_name_of_term(host, "lateral_aceleration"); }),
              HasSubstr("did you mean the term 'lateral_acceleration'?"));
  EXPECT_THAT(error_of([&] { check_term(host, parse_yaml("{most: 2}", "test")); }), HasSubstr("without a name"));
}

TEST(CheckOfATerm, RefusesOptionsThatCannotBe) {
  EXPECT_THROW(check_term(right_term(), right_description(), {unicycle()}, true, {.seed = 1, .samples = 0}), Error);
}

}  // namespace term_check_test
}  // namespace rhec::sim
