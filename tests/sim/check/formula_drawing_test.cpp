#include "rhec/sim/check/formula_drawing.hpp"

#include <gtest/gtest.h>

#include <string>

#include "sim/support/tank_graph.hpp"
#include "support/error_of.hpp"

namespace rhec::sim {
namespace formula_drawing_test {

std::size_t count(const std::string& text, const std::string& part) {
  std::size_t found = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++found;
  return found;
}

TEST(FormulaDrawing, ShowsNodesNamesAndPatterns) {
  const TankGraph tank;
  const std::string drawing = formula_drawing(tank.vehicle, tank.about, size_of_formula(tank.vehicle, tank.about));
  EXPECT_CONTAINS(drawing, "tank: 7 operations, depth 3");
  for (const char* label : {">level<", ">hole<", ">outflow<", ">sqrt(level)<", ">log(level)<", ">seen<", ">1 / wheel<"})
    EXPECT_CONTAINS(drawing, label);
  // Two edges of products, sums; one of functions; one to each result.
  EXPECT_EQ(count(drawing, "marker-end"), 3u * 2 + 4 + 4);
  EXPECT_EQ(count(drawing, "fill=\"#1f4e79\""), 3u + 1 + 3);  // entries that vary
  EXPECT_EQ(drawing, formula_drawing(tank.vehicle, tank.about, size_of_formula(tank.vehicle, tank.about)));
}

TEST(FormulaDrawing, RefusesWhatNobodyCouldRead) {
  TankGraph tank;
  Graph& graph = *tank.vehicle.graph;
  Expression x(graph, tank.vehicle.states[0]);
  for (int k = 0; k <= most_drawn; ++k) x = sin(x);
  tank.vehicle.rates[0] = x.node_in(graph);
  EXPECT_CONTAINS(error_of([&] { formula_drawing(tank.vehicle, tank.about, {}); }),
                  "too many for a drawing of at most 1500");
}

}  // namespace formula_drawing_test
}  // namespace rhec::sim
