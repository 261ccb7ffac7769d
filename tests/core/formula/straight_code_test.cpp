// The text of straight code. That it compiles, and computes what the interpreter does, bit by bit, is in
// tests/core/model/formula_model_test.cpp and in the tests of every vehicle.
#include "rhec/core/formula/straight_code.hpp"

#include <gmock/gmock.h>

#include <string>
#include <vector>

#include "rhec/core/formula/expression.hpp"

namespace rhec {
namespace straight_code_test {

using ::testing::HasSubstr;
using ::testing::Not;

struct Written {
  std::string kernels, table;
};

/// The function "both" of x and an option l: x / l + 0.1, and sin and cos of it; -l; x.
Written write(int most = 1000) {
  Graph graph;
  const Expression x = Expression::input(graph, "x"), length = Expression::input(graph, "l");
  const Expression angle = named(x / length + 0.1, "the angle");
  const int input = x.node_in(graph);
  StraightWriter writer(graph, {length.node_in(graph)}, most);
  const std::vector<int> results{sin(angle).node_in(graph), cos(angle).node_in(graph), (-length).node_in(graph), input};
  writer.add("both", {&input, 1}, results);
  writer.skip();
  const std::vector<std::string> sets{"generic", "avx2"};
  return {writer.kernels("mine", "A formula."), writer.table("mine", "A formula.", 0x1234, sets)};
}

TEST(StraightWriter, WritesAnInstructionALine) {
  const std::string text = write().kernels;
  EXPECT_THAT(text, HasSubstr("// 2 instructions.\n"));
  // A product with an option is fused with the sum, and the constant has all its bits.
  EXPECT_THAT(text,
              HasSubstr("  const Lane x0 = get(in, 0);\n"
                        "  const Lane v0 = multiply_add(x0, Lane(u[1]), Lane(0x1.999999999999ap-4));  // the angle\n"
                        "  const auto [v1, v2] = sincos(v0);\n"
                        "  put(out, 1, v1);\n"
                        "  put(out, 2, v2);\n"
                        "}\n"));
  EXPECT_THAT(text, HasSubstr("runs[] = {&both, nullptr};"));
  EXPECT_THAT(text, HasSubstr("RHEC_JOIN(mine_straight_, RHEC_STRAIGHT_SET)"));
}

TEST(StraightWriter, ATableSaysWhereResultsAreAndWhatOptionsGive) {
  const std::string text = write().table;
  // Registers of the sines, uniforms of -l (number 3), and the input itself.
  EXPECT_THAT(text, HasSubstr("both_results[] = {1, 2, -4, 0};"));
  EXPECT_THAT(text, HasSubstr("{\"both\", 3, 2, both_results}"));
  EXPECT_THAT(text, HasSubstr("value_of(Operation::reciprocal, o[0], -1)"));
  EXPECT_THAT(text, HasSubstr("value_of(Operation::negate, o[0], -1)"));
  EXPECT_THAT(text, HasSubstr("0x1234u"));
  EXPECT_THAT(text, HasSubstr("{mine_straight_generic, mine_straight_avx2}"));
}

TEST(StraightWriter, TheSameCallsGiveTheSameText) {
  EXPECT_EQ(write().kernels, write().kernels);
  EXPECT_EQ(write().table, write().table);
}

TEST(StraightWriter, LeavesOutWhatIsTooLong) {
  const Written text = write(1);
  EXPECT_THAT(text.kernels, HasSubstr("runs[] = {nullptr, nullptr};"));
  EXPECT_THAT(text.kernels, Not(HasSubstr("both")));
  EXPECT_THAT(text.table, HasSubstr("{.instructions = 2}"));
}

TEST(StraightWriter, ALongFunctionIsWrittenInPieces) {
  Graph graph;
  const Expression x = Expression::input(graph, "x");
  Expression chain = x;
  for (int k = 0; k < 3 * StraightWriter::piece / 4; ++k) chain = sin(chain) + x;
  const int input = x.node_in(graph), result = chain.node_in(graph);
  StraightWriter writer(graph, {}, 10 * StraightWriter::piece);
  writer.add("chain", {&input, 1}, {&result, 1});
  const std::string text = writer.kernels("mine", "A formula.");
  // Not printed where it fails: it is long.
  const auto has = [&](const char* part) { return text.find(part) != std::string::npos; };
  EXPECT_TRUE(has("void chain_pack_2(const double* in,"));
  EXPECT_FALSE(has("chain_pack_3"));
  // One value is carried from one piece to the next.
  EXPECT_TRUE(has("double carried[1 * rhec::StraightFunction::rows];"));
  EXPECT_TRUE(has("  put(carried, 0, "));
  EXPECT_TRUE(has(" = get(carried, 0);"));
}

}  // namespace straight_code_test
}  // namespace rhec
