#include "core/model/chain_rule.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "rhec/core/base/aligned.hpp"

namespace rhec {
namespace chain_rule_test {

/// x' = u + x^2 / 2 of one state and one input.
const RatesStructure parabola{.nx = 1, .np = 0, .nu = 1, .slopes = {{0, 0}, {0, 1}}, .bends = {{0, 0}}};

/// A step of it from x = 0 with the length h: f_x = x_k, so that all that has moved can be said by hand.
struct Step {
  ChainRulePlaces at{parabola, false};
  ChainRule rule;
  AlignedDoubles memory = AlignedDoubles(static_cast<std::size_t>(at.count) * 8, NAN);

  explicit Step(bool single) : rule(parabola, at, single) {}
  void set(std::uint32_t place, double value) { std::fill_n(memory.data() + place * 8, 8, value); }
  double value(std::uint32_t place) const { return memory[place * 8 + 5]; }

  void take(double x, double u, double h, double weight) {
    const TapeKernels& kernels = *runnable_tape_kernels().back();
    const auto multiply = [&](ChainRule::Products products) { kernels.add_products(products, memory.data()); };
    set(at.zero, 0.0);
    set(at.one, 1.0);
    const double reach[] = {0.0, 0.5, 0.5, 1.0}, share[] = {1.0 / 6, 1.0 / 3, 1.0 / 3, 1.0 / 6};
    for (std::uint32_t k = 0; k < 4; ++k) {
      set(at.reach + k, h * reach[k]);
      set(at.share + k, h * share[k]);
    }
    set(at.z, x);
    set(at.z + 1, u);
    set(at.x, x);
    set(at.weights, weight);
    for (int k = 0; k < 4; ++k) {
      multiply(rule.arguments(k));
      const double here = value(at.arguments[k]), input = value(at.arguments[k] + 1);
      set(at.rates[k], input + here * here / 2);
      set(at.slopes[k], here);
      set(at.slopes[k] + 1, 1.0);
      multiply(rule.forward(k));
    }
    multiply(rule.next());
    for (int k = 3; k >= 0; --k) {
      multiply(rule.adjoints(k));
      set(at.bends, value(at.adjoints[k]));  // of x^2 / 2
      multiply(rule.backward(k));
    }
    multiply(rule.weights());
  }
};

double step_of(double x, double u, double h) {
  const auto f = [&](double at) { return u + at * at / 2; };
  const double a = f(x), b = f(x + h / 2 * a), c = f(x + h / 2 * b), d = f(x + h * c);
  return x + h / 6 * (a + 2 * b + 2 * c + d);
}

TEST(ChainRule, HasTheDerivativesOfAStep) {
  const double x = 0.3, u = 0.7, h = 0.4, w = -1.5, d = 1e-4;
  Step single(true), several(false);
  // The start of several steps: dx/dz = [1 0], nothing behind the end.
  several.set(several.at.entry(several.at.moved[0], 0, 0), 1.0);
  several.set(several.at.entry(several.at.moved[0], 0, 1), 0.0);
  for (int c = 0; c < 2; ++c) {
    several.set(several.at.entry(several.at.pull, 0, c), 0.0);
    several.set(several.at.entry(several.at.hessian, 1, c), 0.0);
  }
  const double expected[] = {(step_of(x + d, u, h) - step_of(x - d, u, h)) / (2 * d),
                             (step_of(x, u + d, h) - step_of(x, u - d, h)) / (2 * d)};
  const double mixed = (step_of(x + d, u + d, h) - step_of(x + d, u - d, h) - step_of(x - d, u + d, h) +
                        step_of(x - d, u - d, h)) /
                       (4 * d * d),
               by_x = (step_of(x + d, u, h) - 2 * step_of(x, u, h) + step_of(x - d, u, h)) / (d * d),
               by_u = (step_of(x, u + d, h) - 2 * step_of(x, u, h) + step_of(x, u - d, h)) / (d * d);
  for (Step* step : {&single, &several}) {
    SCOPED_TRACE(step == &single ? "single" : "several");
    step->take(x, u, h, w);
    EXPECT_NEAR(step->value(step->at.next), step_of(x, u, h), 1e-15);
    for (std::size_t c = 0; c < 2; ++c) EXPECT_NEAR(step->value(step->rule.moved()[c]), expected[c], 1e-8);
    EXPECT_NEAR(step->value(step->at.next_weights), w * expected[0], 1e-8);
    // Of several steps, the rows of states are what is to be pulled back further.
    const double first = step == &single ? step->value(step->rule.hessian()[0]) : step->value(step->at.pull_next);
    EXPECT_NEAR(first, w * by_x, 1e-6);
    EXPECT_NEAR(step->value(step->rule.hessian()[2]), w * mixed, 1e-6);
    EXPECT_NEAR(step->value(step->rule.hessian()[3]), w * by_u, 1e-6);
  }
}

TEST(ChainRule, HasNoProductForWhatIsZeroByStructure) {
  // Two states that know nothing of each other; only one of them bends.
  const RatesStructure apart{.nx = 2, .np = 0, .nu = 0, .slopes = {{0, 0}, {1, 1}}, .bends = {{1, 1}}};
  const ChainRulePlaces at(apart, false);
  const ChainRule rule(apart, at, true);
  EXPECT_EQ(rule.moved()[1], at.zero);
  EXPECT_EQ(rule.moved()[2], at.zero);
  EXPECT_NE(rule.moved()[3], at.zero);
  EXPECT_EQ(rule.hessian()[0], at.zero);
  EXPECT_EQ(rule.hessian()[1], at.zero);
  EXPECT_NE(rule.hessian()[3], at.zero);
  EXPECT_LT(rule.operations(false), rule.operations(true));
  // Rows that are coupled take more.
  const RatesStructure coupled{
      .nx = 2, .np = 0, .nu = 0, .slopes = {{0, 0}, {0, 1}, {1, 0}, {1, 1}}, .bends = {{1, 1}}};
  EXPECT_GT(ChainRule(coupled, ChainRulePlaces(coupled, false), true).operations(true), rule.operations(true));
}

TEST(ChainRulePlaces, AreApart) {
  const RatesStructure of{.nx = 3, .np = 2, .nu = 1, .slopes = {{0, 0}}, .bends = {{0, 0}, {1, 0}}};
  const ChainRulePlaces at(of, true);
  EXPECT_EQ(at.nz, 8);
  std::set<std::uint32_t> begins{at.zero,       at.one,     at.share,   at.reach,        at.run,     at.rest,   at.z,
                                 at.x,          at.next,    at.weights, at.next_weights, at.product, at.bends,  at.sum,
                                 at.moved_next, at.hessian, at.pull,    at.pull_next,    at.bent[0], at.bent[1]};
  for (std::size_t k = 0; k < 4; ++k)
    for (const std::uint32_t place : {at.arguments[k], at.rates[k], at.slopes[k], at.adjoints[k], at.moved[k]})
      begins.insert(place);
  EXPECT_EQ(begins.size(), 40u);
  EXPECT_EQ(at.pull_next + 3u * 8u, at.count);
}

}  // namespace chain_rule_test
}  // namespace rhec
