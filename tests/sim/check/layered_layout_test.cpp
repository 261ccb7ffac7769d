#include "sim/check/layered_layout.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

namespace rhec::sim {
namespace layered_layout_test {

TEST(LayeredLayout, PutsAChainIntoColumns) {
  const std::vector<LayoutNode> nodes(3, {40.0, 20.0, false});
  const std::vector<LayoutEdge> edges{{0, 1}, {1, 2}};
  const LayeredLayout layout = layered_layout(nodes, edges, 10.0, 5.0);
  EXPECT_EQ(layout.width, 140.0);
  EXPECT_EQ(layout.height, 20.0);
  EXPECT_EQ(layout.centres[1].x, 70.0);
  EXPECT_EQ(layout.centres[1].y, layout.centres[0].y);
  ASSERT_EQ(layout.routes.size(), 2u);
  EXPECT_EQ(layout.routes[0].front().x, 40.0);
  EXPECT_EQ(layout.routes[0].back().x, 50.0);
}

TEST(LayeredLayout, FindsTheOrderWithoutCrossings) {
  // Three pairs that cross as they are numbered.
  const std::vector<LayoutNode> nodes(6, {10.0, 10.0, false});
  const std::vector<LayoutEdge> edges{{0, 5}, {1, 4}, {2, 3}};
  EXPECT_EQ(layered_layout(nodes, edges, 10.0, 5.0).crossings, 0);
  // A complete bipartite graph of two and two has one at least.
  const std::vector<LayoutEdge> all{{0, 2}, {0, 3}, {1, 2}, {1, 3}};
  EXPECT_EQ(layered_layout(std::vector<LayoutNode>(4, {10.0, 10.0, false}), all, 10.0, 5.0).crossings, 1);
}

TEST(LayeredLayout, OfNothingIsNothing) { EXPECT_EQ(layered_layout({}, {}, 1.0, 1.0).width, 0.0); }

// Whatever the graph: boxes of a column do not touch, edges lead to the right, what is last stands last.
TEST(LayeredLayout, HoldsItsRules) {
  std::mt19937 random(3);
  for (int trial = 0; trial < 40; ++trial) {
    const int count = 2 + static_cast<int>(random() % 40);
    std::vector<LayoutNode> nodes;
    std::vector<LayoutEdge> edges;
    for (int k = 0; k < count; ++k) {
      nodes.push_back(
          {10.0 + static_cast<double>(random() % 50), 10.0 + static_cast<double>(random() % 30), k == count - 1});
      for (int e = 0; k > 0 && e < 2; ++e) edges.push_back({static_cast<int>(random() % static_cast<unsigned>(k)), k});
    }
    const LayeredLayout layout = layered_layout(nodes, edges, 20.0, 6.0);
    for (int a = 0; a < count; ++a) {
      const Point at = layout.centres[a];
      EXPECT_GE(at.x - nodes[a].width / 2, -1e-9);
      EXPECT_LE(at.x + nodes[a].width / 2, layout.width + 1e-9);
      EXPECT_GE(at.y - nodes[a].height / 2, -1e-9);
      EXPECT_LE(at.y + nodes[a].height / 2, layout.height + 1e-9);
      EXPECT_LE(at.x, layout.centres[count - 1].x + 1e-9);
      for (int b = 0; b < a; ++b) {
        const Point other = layout.centres[b];
        const bool apart = std::abs(at.x - other.x) > 1e-9 ||
                           std::abs(at.y - other.y) >= (nodes[a].height + nodes[b].height) / 2 + 6.0 - 1e-9;
        EXPECT_TRUE(apart) << a << " and " << b;
      }
    }
    for (std::size_t e = 0; e < edges.size(); ++e)
      for (std::size_t k = 1; k < layout.routes[e].size(); ++k)
        EXPECT_GE(layout.routes[e][k].x, layout.routes[e][k - 1].x - 1e-9);
  }
}

}  // namespace layered_layout_test
}  // namespace rhec::sim
