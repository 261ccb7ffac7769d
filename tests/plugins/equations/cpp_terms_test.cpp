#include "plugins/equations/cpp_terms.hpp"

#include <gtest/gtest.h>

#include <string>

namespace rhec::equations {
namespace cpp_terms_test {

class CppTermsTest : public ::testing::Test {
 protected:
  std::string text(const std::string& term) { return terms_.text(parse_term({"vehicle.yaml", {{term, 1, 1}}})); }
  Graph graph_;
  Definitions definitions_{
      graph_, "vehicle.yaml", {{"x", graph_.input("x")}, {"y", graph_.input("y")}, {"int", graph_.input("int")}}};
  CppNames names_;
  CppTerms terms_{definitions_, names_, "Scalar"};
};

TEST_F(CppTermsTest, KeepOrderAndParenthesesThatMatter) {
  EXPECT_EQ(text("x - y - 1"), "x - y - 1.0");
  EXPECT_EQ(text("x - (y - 1)"), "x - (y - 1.0)");
  EXPECT_EQ(text("(x * y) / (x * 2)"), "x * y / (x * 2.0)");
  EXPECT_EQ(text("x * (y / 2)"), "x * (y / 2.0)");
  EXPECT_EQ(text("(x + y) * 3"), "(x + y) * 3.0");
  EXPECT_EQ(text("x + (y + 1)"), "x + (y + 1.0)");
}

// Two signs in a row would be another operator; a power binds tighter than a sign.
TEST_F(CppTermsTest, KeepSignsApart) {
  EXPECT_EQ(text("--x"), "-(-x)");
  EXPECT_EQ(text("x - -y"), "x - (-y)");
  EXPECT_EQ(text("-x * y"), "-x * y");
  EXPECT_EQ(text("x * -y"), "x * (-y)");
  EXPECT_EQ(text("-(x + y)"), "-(x + y)");
  EXPECT_EQ(text("-x^2"), "-(x * x)");
  EXPECT_EQ(text("(-x)^2"), "pow(-x, 2)");
  EXPECT_EQ(text("1 - (-x + y)"), "1.0 - (-x + y)");
}

TEST_F(CppTermsTest, WritePowersAsTheGraphHasThem) {
  EXPECT_EQ(text("x^3"), "pow(x, 3)");
  EXPECT_EQ(text("x^-2"), "pow(x, -2)");
  EXPECT_EQ(text("x^(1 + 1)"), "x * x");
  EXPECT_EQ(text("(x + 1)^2"), "pow(x + 1.0, 2)");
  EXPECT_EQ(text("x^0.5"), "sqrt(x)");
  EXPECT_EQ(text("x^y"), "exp(y * log(x))");
  EXPECT_EQ(text("x^(y + 1)"), "exp((y + 1.0) * log(x))");
  EXPECT_EQ(text("x^2 / y^2"), "x * x / (y * y)");
  EXPECT_EQ(text("2^x"), "exp(x * log(Scalar(2.0)))");
  // Constant by its structure, though not by its letters.
  EXPECT_EQ(text("x^(2 + 0 * y)"), "x * x");
}

TEST_F(CppTermsTest, GiveFunctionsNumbersOfTheirType) {
  EXPECT_EQ(text("atan2(1, x)"), "atan2(Scalar(1.0), x)");
  EXPECT_EQ(text("smooth_max(1, x, 0.1)"), "smooth_max<Scalar>(1.0, x, 0.1)");
  EXPECT_EQ(text("sin(2 * pi)"), "sin(Scalar(2.0 * std::numbers::pi))");
  EXPECT_TRUE(terms_.uses_pi());
  EXPECT_EQ(terms_.called(), (std::set<std::string>{"atan2", "sin", "smooth_max"}));
}

TEST(CppNames, AvoidWhatTheLanguageHasTaken) {
  CppNames names;
  EXPECT_EQ(names.of("speed"), "speed");
  EXPECT_EQ(names.of("int"), "int_");
  EXPECT_EQ(names.of("int_"), "int_2");
  EXPECT_EQ(names.of("int"), "int_");
  EXPECT_EQ(names.of("psi'"), "psi_rate");
  EXPECT_EQ(names.of("psi_rate"), "psi_rate_2");
  EXPECT_EQ(names.of("__a"), "v_a");
  EXPECT_EQ(names.of("NAN"), "NAN_");
  EXPECT_EQ(names.of("L"), "L");
  EXPECT_EQ(names.unused("x", "state"), "x");
  EXPECT_EQ(names.unused("x", "state"), "state");
}

TEST(CppTexts, AreLiteralsAndComments) {
  EXPECT_EQ(cpp_number(2.0), "2.0");
  EXPECT_EQ(cpp_number(0.1), "0.1");
  EXPECT_EQ(cpp_number(1e300), "1e+300");
  EXPECT_EQ(cpp_text("a \"b\" \\ c\n"), "\"a \\\"b\\\" \\\\ c \"");
  EXPECT_EQ(cpp_comment("goes on \\"), "goes on");
  EXPECT_EQ(cpp_comment("two\nlines"), "two lines");
}

TEST(CppTexts, MentionWholeWords) {
  EXPECT_TRUE(cpp_mentions("a + speed", "speed"));
  EXPECT_FALSE(cpp_mentions("wheel_speed + speed2", "speed"));
  EXPECT_TRUE(cpp_mentions("speed2 * (speed)", "speed"));
  EXPECT_FALSE(cpp_mentions("named(a, \"speed\")", "speed"));
}

TEST(CppTexts, BreakLinesOutsideOfWords) {
  std::string long_sum = "  y = a";
  for (int k = 0; k < 40; ++k) long_sum += " + bcd" + std::to_string(k);
  std::string joined;
  const std::string wrapped = cpp_wrapped(long_sum, "    ");
  for (std::size_t at = 0, end = 0; at < wrapped.size(); at = end + 1) {
    end = std::min(wrapped.find('\n', at), wrapped.size());
    EXPECT_LE(end - at, 120u);
    joined += (at == 0 ? "" : " ") + wrapped.substr(at == 0 ? 0 : at + 4, end - at - (at == 0 ? 0 : 4));
  }
  EXPECT_EQ(joined, long_sum);
  // A literal becomes two, which the compiler joins.
  const std::string literal =
      cpp_wrapped("  f(\"" + std::string(70, 'a') + " " + std::string(70, 'b') + "\");", "    ");
  EXPECT_EQ(literal, "  f(\"" + std::string(70, 'a') + " \"\n    \"" + std::string(70, 'b') + "\");");
  EXPECT_EQ(cpp_aligned({{"a;", "first"}, {"long;", "second"}, {"b;", ""}}, "//"),
            "a;     // first\nlong;  // second\nb;\n");
}

}  // namespace cpp_terms_test
}  // namespace rhec::equations
