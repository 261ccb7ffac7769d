#include "rhec/sim/check/formula_size.hpp"

#include <gmock/gmock.h>

#include "rhec/sim/files/json.hpp"
#include "sim/support/tank_graph.hpp"

namespace rhec::sim {
namespace formula_size_test {

using testing::ElementsAre;
using testing::Pair;

FormulaSize size() {
  const TankGraph tank;
  return size_of_formula(tank.vehicle, tank.about);
}

TEST(FormulaSize, CountsOperationsAndDepth) {
  const FormulaSize found = size();
  // sqrt, *, negate; 1/, *, +; log
  EXPECT_EQ(found.depth, 3);
  EXPECT_THAT(found.kinds, ElementsAre(Pair("*", 2), Pair("+", 1), Pair("1/", 1), Pair("log", 1), Pair("negate", 1),
                                       Pair("sqrt", 1)));
  ASSERT_EQ(found.counts.size(), 8u);
  EXPECT_THAT(found.counts[0], Pair("f", 6));
  EXPECT_THAT(found.counts[3], Pair("h", 1));
  EXPECT_THAT(found.counts[4], Pair("h, dh/dx", 2));
  for (const std::size_t more : {1, 2, 4, 6, 7}) EXPECT_GT(found.counts[more].second, found.counts[more - 1].second);
}

TEST(FormulaSize, ShowsWhichDerivativesThereAre) {
  const FormulaSize found = size();
  EXPECT_THAT(found.rates.lines(), ElementsAre("        l w", "        e h", "        v e", "        e e",
                                               "        l l k u", "level'  x . . .", "wheel'  . x c x"));
  EXPECT_EQ(found.rates.count(), 4);
  EXPECT_EQ(found.outputs.count(), 2);
  EXPECT_EQ(found.outputs.at(1, 1), DerivativePattern::Entry::constant);
  // d2 level'/d level2, d2 wheel'/d wheel2, d2 wheel' / d wheel d u: the lower triangle alone.
  EXPECT_EQ(found.hessian.count(), 3);
  EXPECT_EQ(found.hessian.at(3, 1), DerivativePattern::Entry::varies);
  EXPECT_EQ(found.hessian.at(1, 3), DerivativePattern::Entry::zero);
}

TEST(FormulaSize, IsWrittenAsJson) {
  const Json json = Json::parse(size_json(size()));
  EXPECT_EQ(json["operations"]["f"].as_integer(), 6);
  EXPECT_EQ(json["kinds"]["sqrt"].as_integer(), 1);
  EXPECT_EQ(json["rates"]["lines"][1].as_text(), ".xcx");
}

}  // namespace formula_size_test
}  // namespace rhec::sim
