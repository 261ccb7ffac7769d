#include "plugins/equations/statements.hpp"

#include <gmock/gmock.h>

#include <string>
#include <string_view>
#include <vector>

#include "support/error_of.hpp"

namespace rhec::equations {
namespace statements_test {

/// A text whose first line is line 10 of a file, four columns in.
SourceText source_of(std::string_view text) {
  SourceText source{"vehicle.yaml", {}};
  for (int number = 10;; ++number) {
    const std::size_t end = text.find('\n');
    source.lines.push_back({text.substr(0, end), number, 5});
    if (end == std::string_view::npos) return source;
    text.remove_prefix(end + 1);
  }
}

/// A term as it is computed, operands first: "2 x 3 ^ *".
std::string computed(const std::string& text) {
  std::string result;
  const SourceText source = source_of(text);
  for (const Item& item : parse_term(source)) {
    if (!result.empty()) result += ' ';
    switch (item.kind) {
      case Item::Kind::number:
        result += std::to_string(item.value);
        result.erase(result.find_last_not_of('0') + 1);
        if (result.back() == '.') result.pop_back();
        break;
      case Item::Kind::name:
      case Item::Kind::function:
        result += item.name;
        break;
      case Item::Kind::negate:
        result += '~';
        break;
      default:
        result += "+-*/^"[static_cast<int>(item.kind) - static_cast<int>(Item::Kind::add)];
    }
  }
  return result;
}

TEST(Term, FollowsTheUsualPrecedence) {
  EXPECT_EQ(computed("1 + 2 * x"), "1 2 x * +");
  EXPECT_EQ(computed("a - b - c"), "a b - c -");
  EXPECT_EQ(computed("a / b / c"), "a b / c /");
  EXPECT_EQ(computed("(a - b) * c"), "a b - c *");
  EXPECT_EQ(computed("-x^2"), "x 2 ^ ~");
  EXPECT_EQ(computed("2^-x"), "2 x ~ ^");
  EXPECT_EQ(computed("a^b^c"), "a b c ^ ^");
  EXPECT_EQ(computed("a * -b"), "a b ~ *");
  EXPECT_EQ(computed("+x - -y"), "x y ~ -");
  EXPECT_EQ(computed("atan2(y + 1, x) * psi'"), "y 1 + x atan2 psi' *");
}

TEST(Term, ReadsNumbers) {
  EXPECT_EQ(computed("1.5"), "1.5");
  EXPECT_EQ(computed(".25 + 3. + 1e1 + 2.5E-1"), "0.25 3 + 10 + 0.25 +");
  EXPECT_CONTAINS(error_of([] { computed("1e999"); }), "vehicle.yaml:10:5: found '1e999', which is no number in range");
}

TEST(Statements, OneALineWithCommentsAndContinuationsInParentheses) {
  const SourceText source = source_of("# a comment\n\nspeed = kappa * u  # wheels\nx' = speed * (1 +\n    slip)\n");
  const std::vector<Statement> statements = parse_statements(source);
  ASSERT_EQ(statements.size(), 2u);
  EXPECT_EQ(statements[0].target, "speed");
  EXPECT_EQ(statements[1].target, "x'");
  EXPECT_EQ(statements[1].place.line, 13);
  EXPECT_EQ(statements[1].place.column, 5);
  EXPECT_EQ(statements[1].term.back().place.column, 16);  // the product's sign
}

struct Mistake {
  const char *text, *message;
};
TEST(Statements, MistakesNamePlaceExpectationAndRemedy) {
  for (const Mistake& mistake : {
           Mistake{"x = 2 y",
                   "vehicle.yaml:10:11: found 'y', expected an operator or the end of the line; a product "
                   "is written with '*'"},
           {"x = (1 + y", "found the end, expected an operator or ')'"},
           {"x = 1 +", "vehicle.yaml:10:12: found the end of the line, expected a number, a name or '('"},
           {"x", "found the end of the line, expected '=' after the name"},
           {"1 = x", "vehicle.yaml:10:5: found '1', expected an equation"},
           {"x = y ** 2", "write a power as x^2"},
           {"x = y < 2", "values are not compared; use smooth_min, smooth_max or smooth_abs"},
           {"x == 2", "an equation has one sign '='"},
           {"x = abs(y)", "there is no function 'abs'; it has no derivative at 0; use smooth_abs(x, width)"},
           {"x = sine(y)", "there is no function 'sine'; did you mean 'sin'?"},
           {"x = y (2)", "there is no function 'y'; known: sqrt"},
           {"x = sin(y, 2)", "vehicle.yaml:10:14: found ',', expected ')': sin has 1 argument"},
           {"x = atan2(y)", "found ')', expected ',': atan2 has 2 arguments"},
           {"x = y $ 2", "vehicle.yaml:10:11: found '$', which means nothing here"},
           {"x = \x01", "found '\\x01'"},
           {"sin = 2", "'sin' is a function or a constant; choose another name"},
           {"pi = 3", "'pi' is a function or a constant"},
           {"x = 1)", "found ')', expected an operator or the end of the line; there is no '(' for it"},
           {"x = (1 + y\nz = 2",
            "vehicle.yaml:10:9: this '(' is not closed: found 'z' in line 11, expected an operator or ')' (in the "
            "equation of x)\n    x = (1 + y\n        ^"},
           {"x = sin(1 +\n 2\n",
            "vehicle.yaml:10:12: this '(' is not closed: found the end, expected an operator or ')'"},
           {"y' = 2\nx' = 1 + (\n  2 * * y)",
            "vehicle.yaml:12:11: found '*', expected a number, a name or '(' (in the equation of x')\n      2 * * y)\n"
            "          ^"},
           {"x = y +\t+ μ", "(in the equation of x)\n    x = y + + μ\n              ^"},
           {"x = sin y", "'sin' is a function; expected its argument in parentheses, sin(...)"},
           {"x = 0,5", "decimals have a point, as 0.5"},
           {"x'' = y", "a second derivative is the first one of another state"},
           {"x = y % 2", "angles never wrap in equations"},
           {"x = fmod(y, 2)", "angles never wrap in equations"},
           {"x = |y|", "smooth_abs(x, width)"},
           {"x = y;", "an equation ends with its line"},
           {"x = y[2]", "there are no vectors"},
           {"x = \u03bc * y", "found '\u03bc', which means nothing here; names have the letters a to z"},
           {"x = y \u00b7 2", "found '\u00b7', which means nothing here; a product is written with '*'"},
           {"x = \xce", "found '\\xce'"},
       })
    EXPECT_CONTAINS(error_of([&] { parse_statements(source_of(mistake.text)); }), mistake.message) << mistake.text;
}

TEST(Statements, LongLinesAreShownAroundTheMistake) {
  std::string text = "x = 1";
  for (int k = 0; k < 100; ++k) text += k == 50 ? " + * y" : " + y";
  const std::string error = error_of([&] { parse_statements(source_of(text)); });
  const std::size_t shown = error.find("\n    ..."), caret = error.rfind("\n    ");
  ASSERT_NE(shown, std::string::npos) << error;
  EXPECT_LT(error.size() - shown, 250u) << error;
  const std::size_t at = error.find('^') - caret;
  EXPECT_EQ(error.substr(shown + at, 3), "* y") << error;
  EXPECT_CONTAINS(error, "y + y ...\n");
}

TEST(Statements, NameTheirLineWhereNoFileHasThem) {
  const SourceText source{"configuration", {{"a = 1"}, {"b = a a"}}, "configuration: model.equations"};
  EXPECT_EQ(
      error_of([&] { parse_statements(source); }),
      "configuration: model.equations: line 2, column 7: found 'a', expected an operator or the end of the line; a "
      "product is written with '*' (in the equation of b)\n    b = a a\n          ^");
}

TEST(Statements, DeepTermsAreRefusedAndLongOnesAreNot) {
  const std::string open(100000, '('), minus(100000, '-'), powers = [] {
    std::string text = "x";
    for (int k = 0; k < 100000; ++k) text += "^x";
    return text;
  }();
  for (const std::string& text : {open, minus, powers, "sin(" + open})
    EXPECT_CONTAINS(error_of([&] { parse_statements(source_of("y = " + text)); }), "nested deeper than 100 levels");
  std::string sum = "y = x";
  for (int k = 0; k < 100000; ++k) sum += " + x";
  EXPECT_EQ(parse_statements(source_of(sum))[0].term.size(), 200001u);
}

TEST(Names, AreLettersDigitsAndUnderscores) {
  EXPECT_TRUE(is_name("u_1"));
  EXPECT_TRUE(is_name("_x"));
  for (const char* wrong : {"", "1x", "x'", "a b", "ä", "a-b"}) EXPECT_FALSE(is_name(wrong)) << wrong;
  EXPECT_TRUE(is_reserved("smooth_min"));
  EXPECT_FALSE(is_reserved("speed"));
}

}  // namespace statements_test
}  // namespace rhec::equations
