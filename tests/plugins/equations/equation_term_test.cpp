#include "rhec/plugins/equations/equation_term.hpp"

#include <cmath>
#include <string>

#include "../../terms/view.hpp"
#include "rhec/core/base/infinity.hpp"
#include "rhec/core/term/term_options.hpp"

namespace rhec {
namespace equation_term_test {

using namespace testing;

std::shared_ptr<Term> term(const std::string& text) { return load_inline_term(parse_yaml(text, "scenario.yaml")); }
std::string why_not(const std::string& text) {
  return error_of([&] { term(text); });
}

const std::string gentle = R"(
equations:
  name: gentle
  options:
    most: {default: 2, unit: m/s^2, above: 0, meaning: to either side}
  limits:
    acceleration: {lower: -most, term: ground_speed * heading_rate, upper: most}
)";

TEST(EquationTerm, IsThePluginOfTheSameFormula) {
  const std::vector<double> x{3.0, 4.0, 1.0, 0.2}, u{5.0, 0.1}, p{0.7, 0.9};
  const At ours(bicycle(), term(gentle + "most: 1.25\n"), {}, x, u, p);
  const At theirs(bicycle(), make("lateral_acceleration", "{most: 1.25}"), {}, x, u, p);
  EXPECT_EQ(ours.values, theirs.values);
  EXPECT_EQ(ours.slopes, theirs.slopes);
  EXPECT_EQ(ours.lower, theirs.lower);
  EXPECT_EQ(ours.upper, theirs.upper);
}

TEST(EquationTerm, HasWhatIsKnownOfANode) {
  const std::string text = R"yaml(
equations:
  inputs: [u2]
  states: [delta]
  options: {scale: 3}
  definitions:
    off: path_speed - ground_speed
    twice: 2 * off
  limits:
    first: {term: twice * scale + time, upper: "where(arc_length - 20, 1, infinity)"}
    second: {lower: -room_right, term: delta + arc_length}
  costs:
    steering: {term: u2, weight: scale / 2, delta: 0.5}
    plain: off^2
)yaml";
  const TermPlace place{.time = 7.0, .speed = 4.0, .arc_length = 30.0, .right = 2.0};
  const At at(bicycle(), term(text), place, {0.0, 0.0, 0.0, 0.1}, {5.0, 0.3}, {0.6, 1.0});
  const double off = 4.0 - 3.0;
  ASSERT_EQ(at.values.size(), 2u);
  EXPECT_NEAR(at.values[0], 6.0 * off + 7.0, 1e-12);
  EXPECT_NEAR(at.values[1], 30.1, 1e-12);
  EXPECT_EQ(at.lower[0], -infinity);
  EXPECT_EQ(at.upper[0], 1.0);
  EXPECT_EQ(at.lower[1], -2.0);
  EXPECT_EQ(at.upper[1], infinity);
  ASSERT_EQ(at.residuals.size(), 2u);
  EXPECT_NEAR(at.residuals[0], 0.3, 1e-15);
  EXPECT_NEAR(at.residuals[1], off * off, 1e-12);
  const std::vector<Loss>& losses = at.functions.losses();
  EXPECT_EQ(losses[0].weight, 1.5);
  EXPECT_EQ(losses[0].delta, 0.5);
  EXPECT_EQ(losses[1].weight, 1.0);
  EXPECT_EQ(losses[1].delta, infinity);
}

TEST(EquationTerm, IsSoftUnlessItIsHard) {
  const auto linear = [](const std::string& more) {
    const At at(bicycle(), term(gentle + more), {}, {0.0, 0.0, 0.0, 0.1});
    return at.functions.linear()[0];
  };
  EXPECT_EQ(linear(""), SoftOptions().linear);
  EXPECT_EQ(linear("soft: {linear: 7}\n"), 7.0);
  EXPECT_EQ(linear("hard: true\n"), infinity);
}

TEST(EquationTerm, IsMadeByTheHost) {
  EXPECT_NE(host().make_term("whatever", parse_yaml(gentle, "scenario.yaml")), nullptr);
}

TEST(EquationTerm, RefusesAVehicleWithoutWhatItNames) {
  const auto made = term("equations: {inputs: [thrust], costs: {c: thrust}}");
  EXPECT_THAT(error_of([&] { TermFunctions(*bicycle(), {{"it", made}}); }), HasSubstr("thrust"));
}

TEST(EquationTerm, SaysWhereAMistakeIs) {
  EXPECT_THAT(why_not("{most: 1}"), HasSubstr("expected the key 'equations' with a map of limits and costs"));
  EXPECT_THAT(why_not("equations: {}"), HasSubstr("equations: it has neither limits nor costs"));
  EXPECT_THAT(why_not("equations: {name: it}"), HasSubstr("equations: it has neither limits nor costs"));
  EXPECT_THAT(why_not("equations: {limit: 1}"), HasSubstr("did you mean 'limits'?"));
  EXPECT_THAT(
      why_not("equations:\n  costs:\n    c: ground_spede\n"),
      HasSubstr("scenario.yaml:3: equations.costs.c: 'ground_spede' is not known; did you mean 'ground_speed'?"));
  EXPECT_THAT(why_not("equations: {costs: {c: abs(heading)}}"), HasSubstr("use smooth_abs(x, width)"));
  EXPECT_THAT(why_not("equations: {costs: {c: heading / 0}}"), HasSubstr("equations.costs.c: this divides by 0"));
  EXPECT_THAT(why_not("equations: {costs: {c: room_left}}"), HasSubstr("'room_left' is not known"));
  EXPECT_THAT(why_not("equations: {costs: {c: {weight: 1}}}"), HasSubstr("expected the key 'term'"));
  EXPECT_THAT(why_not("equations: {costs: {c: {term: heading, weight: time}}}"),
              HasSubstr("equations.costs.c.weight: 'time' is not known here"));
  EXPECT_THAT(why_not("equations: {costs: {c: {term: heading, weight: -1}}}"), HasSubstr("the weight is -1"));
  EXPECT_THAT(why_not("equations: {costs: {c: {term: heading, delta: 0}}}"), HasSubstr("delta is 0"));
  EXPECT_THAT(why_not("equations: {limits: {g: {term: heading}}}"), HasSubstr("equations.limits.g: it has no bound"));
  EXPECT_THAT(why_not("equations: {limits: {g: heading}}"), HasSubstr("expected a map of lower, term and upper"));
  EXPECT_THAT(why_not("equations: {limits: {g: {term: heading, upper: heading}}}"),
              HasSubstr("equations.limits.g.upper: 'heading' is not known here"));
  EXPECT_THAT(why_not("equations: {limits: {g: {term: heading, upper: 1}}, costs: {g: heading}}"),
              HasSubstr("there is a limit or a cost 'g' already"));
  EXPECT_THAT(why_not("equations: {options: {sin: 1}, costs: {c: heading}}"), HasSubstr("'sin' is a function"));
  EXPECT_THAT(why_not("equations: {options: {hard: 1}, costs: {c: heading}}"),
              HasSubstr("'hard' is a key of every term"));
  EXPECT_THAT(why_not("equations: {states: [time], costs: {c: heading}}"), HasSubstr("'time' is there already"));
  EXPECT_THAT(why_not("equations: {states: x, costs: {c: heading}}"),
              HasSubstr("expected a list of states of the vehicle"));
  EXPECT_THAT(why_not("equations: {options: {a: {unit: m}}, costs: {c: heading}}"),
              HasSubstr("a: the term has no default for it"));
  EXPECT_THAT(why_not("equations: {options: {a: {default: 1, above: 0, at_least: 0}}, costs: {c: heading}}"),
              HasSubstr("expected one of them"));
  EXPECT_THAT(why_not(gentle + "most: 0\n"), HasSubstr("greater than 0 (term 'gentle': to either side)"));
  EXPECT_THAT(why_not(gentle + "moost: 1\n"), HasSubstr("did you mean 'most'?"));
}

}  // namespace equation_term_test
}  // namespace rhec
