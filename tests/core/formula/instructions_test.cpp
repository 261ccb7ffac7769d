#include "core/formula/instructions.hpp"

#include <gmock/gmock.h>

#include <vector>

#include "rhec/core/formula/expression.hpp"
#include "support/error_of.hpp"

namespace rhec {
namespace instructions_test {

struct Selected {
  Graph graph;
  Expression x = Expression::input(graph, "x"), y = Expression::input(graph, "y"),
             length = Expression::input(graph, "length");

  Instructions operator()(const std::vector<Expression>& of) {
    std::vector<int> results;
    for (const Expression& result : of) results.push_back(result.node_in(graph));
    const std::vector<int> inputs{x.node_in(graph), y.node_in(graph)}, options{length.node_in(graph)};
    return Instructions::select(graph, inputs, results, options);
  }
};

TEST(Instructions, WhatDependsOnOptionsAloneIsUniform) {
  Selected select;
  const Instructions made = select({select.x / sqrt(select.length), exp(select.length)});
  ASSERT_EQ(made.steps.size(), 1u);
  EXPECT_EQ(made.steps[0].code, TapeCode::multiply_ru);
  // Zero, 1 / sqrt(length), exp(length).
  ASSERT_EQ(made.uniforms.size(), 3u);
  EXPECT_EQ(made.uniforms[0], UniformNode{});
  EXPECT_EQ(made.steps[0].uniforms[1], 1);
  EXPECT_EQ(made.uniforms[2].node, exp(select.length).node_in(select.graph));
}

TEST(Instructions, ADifferenceWithAUniformIsASumWithItsNegative) {
  Selected select;
  const Instructions made = select({select.x - select.length});
  ASSERT_EQ(made.steps.size(), 1u);
  EXPECT_EQ(made.steps[0].code, TapeCode::add_ru);
  EXPECT_EQ(made.uniforms.at(1), (UniformNode{select.length.node_in(select.graph), true}));
}

TEST(Instructions, ProductsThatOneSumReadsArePartOfIt) {
  Selected select;
  const Expression product = select.x * select.y;
  EXPECT_EQ(select({product + select.x}).steps.size(), 1u);
  EXPECT_EQ(select({product + select.x, product}).steps.size(), 2u);
}

TEST(Instructions, SineAndCosineOfAnAngleAreOne) {
  Selected select;
  const Instructions made = select({cos(select.x), sin(select.x)});
  ASSERT_EQ(made.steps.size(), 1u);
  EXPECT_EQ(made.steps[0].code, TapeCode::sine_cosine);
  EXPECT_EQ(made.steps[0].out, sin(select.x).node_in(select.graph));
  EXPECT_EQ(made.steps[0].second_out, cos(select.x).node_in(select.graph));
}

TEST(Instructions, RefusesAnInputThatIsNotGiven) {
  Selected select;
  const Expression other = Expression::input(select.graph, "speed");
  EXPECT_EQ(error_of([&] { select({select.x * other}); }), "the formula reads 'speed', which is none of its arguments");
}

}  // namespace instructions_test
}  // namespace rhec
