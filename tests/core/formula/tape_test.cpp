#include "rhec/core/formula/tape.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "rhec/core/base/aligned.hpp"
#include "rhec/core/formula/expression.hpp"
#include "support/error_of.hpp"

namespace rhec {
namespace tape_test {

/// A random formula of many operations of every kind, some of which are needed twice and some of which are results.
struct RandomFormula {
  Graph graph;
  std::vector<int> inputs, results;

  RandomFormula(unsigned seed, int operations) {
    std::mt19937 random(seed);
    std::vector<Expression> made;
    for (int k = 0; k < 5; ++k) {
      made.push_back(Expression::input(graph, "x"));
      inputs.push_back(made.back().node_in(graph));
    }
    made.emplace_back(0.5);
    const auto any = [&] { return made[random() % made.size()]; };
    for (int k = 0; k < operations; ++k) {
      const Expression a = any(), b = any();
      switch (random() % 12) {
        case 0:
          made.push_back(a - b);
          break;
        case 1:
          made.push_back(-a);
          break;
        case 2:
          made.push_back(sin(a) + cos(a));
          break;
        case 3:
          made.push_back(a / (2 + b * b));
          break;
        case 4:
          made.push_back(tanh(a));
          break;
        case 5:
          made.push_back(1.5 - 0.5 * a);
          break;
        case 6:
          made.push_back(pow(tanh(a), 3));
          break;
        case 7:
          made.push_back(atan2(a, 1 + b * b));
          break;
        case 8:
          made.push_back(tanh(a) * tanh(b) - 0.25);
          break;
        case 9:
          made.push_back(0.3 * b - sin(a));
          break;
        default:
          made.push_back(tanh(b) * 0.5 + a);
      }
    }
    for (int k = 0; k < 6; ++k) results.push_back(any().node_in(graph));
    results.push_back(inputs[1]);
    results.push_back(graph.constant(2.5));
  }
};

TEST(Tape, ComputesWhatTheGraphDoes) {
  for (unsigned seed = 1; seed <= 30; ++seed) {
    RandomFormula f(seed, 60);
    const Tape tape(f.graph, f.inputs, f.results);
    for (const TapeKernels* kernels : runnable_tape_kernels()) {
      for (const int lanes : {8, 16, 32}) {
        AlignedDoubles registers(tape.scratch(lanes));
        std::mt19937 random(seed);
        std::uniform_real_distribution<double> uniform(-1.0, 1.0);
        std::vector<double> rows(static_cast<std::size_t>(lanes) * 8);
        std::generate(rows.begin(), rows.end(), [&] { return uniform(random); });
        kernels->load_rows(rows.data(), 8, lanes, 5, registers.data(), lanes, lanes);
        tape.run(*kernels, registers.data(), lanes, lanes);
        for (int lane = 0; lane < lanes; ++lane) {
          const std::vector<double> expected =
              f.graph.evaluate(f.results, f.inputs, {rows.data() + static_cast<std::ptrdiff_t>(lane) * 8, 5});
          for (std::size_t r = 0; r < expected.size(); ++r)
            ASSERT_NEAR(tape.result(r, registers.data(), lanes, lane), expected[r],
                        1e-12 * (1.0 + std::abs(expected[r])))
                << kernels->name << ", seed " << seed << ", result " << r;
        }
      }
    }
  }
}

TEST(Tape, ReusesRegisters) {
  Graph g;
  const Expression x = Expression::input(g, "x");
  Expression chain = x;
  for (int k = 0; k < 100; ++k) chain = sin(chain);
  const int input = x.node_in(g), result = chain.node_in(g);
  const Tape tape(g, {&input, 1}, {&result, 1});
  EXPECT_EQ(tape.instruction_count(), 100);
  EXPECT_EQ(tape.register_count(), 1);
}

TEST(Tape, FusesProductsWithSumsAndSineWithCosine) {
  Graph g;
  const Expression x = Expression::input(g, "x"), y = Expression::input(g, "y"), z = Expression::input(g, "z");
  const std::vector<int> inputs{x.node_in(g), y.node_in(g), z.node_in(g)};
  const auto instructions = [&](const std::vector<Expression>& of) {
    std::vector<int> results;
    for (const Expression& result : of) results.push_back(result.node_in(g));
    return Tape(g, inputs, results).instruction_count();
  };
  EXPECT_EQ(instructions({x * y + z}), 1);
  EXPECT_EQ(instructions({z - x * y}), 1);
  EXPECT_EQ(instructions({x * y - z}), 1);
  EXPECT_EQ(instructions({2 * x - 3}), 1);
  EXPECT_EQ(instructions({sin(x), cos(x)}), 1);
  EXPECT_EQ(instructions({x * y + z, x * y}), 2);  // the product is needed by itself
}

TEST(Tape, ComputesWhatIsKnownOnce) {
  Graph g;
  const Expression x = Expression::input(g, "x"), length = Expression::input(g, "length");
  const int input = x.node_in(g), option = length.node_in(g), result = (x / (sqrt(length) + 1)).node_in(g),
            known = exp(length).node_in(g);
  const std::vector<int> results{result, known};
  const Tape tape(g, {&input, 1}, results, std::vector<Tape::Known>{{option, 4.0}});
  EXPECT_EQ(tape.instruction_count(), 1);
  alignas(64) double registers[8] = {6, 6, 6, 6, 6, 6, 6, 6};
  tape.run(*runnable_tape_kernels().back(), registers, 8, 8);
  EXPECT_DOUBLE_EQ(tape.result(0, registers, 8, 3), 2.0);
  EXPECT_DOUBLE_EQ(tape.result(1, registers, 8, 0), std::exp(4.0));
}

TEST(Tape, RefusesAnInputThatItIsNotGiven) {
  Graph g;
  const Expression x = Expression::input(g, "x"), speed = Expression::input(g, "speed");
  const int input = x.node_in(g), result = (x * speed).node_in(g);
  EXPECT_EQ(error_of([&] {
              const Tape tape(g, {&input, 1}, {&result, 1});
            }),
            "the formula reads 'speed', which is none of its arguments");
}

}  // namespace tape_test
}  // namespace rhec
