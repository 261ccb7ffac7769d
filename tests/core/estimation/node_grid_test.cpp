#include "rhec/core/estimation/node_grid.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace rhec {
namespace node_grid_test {

constexpr int reach = 20;

struct Grid {
  NodeGrid grid{{.step = 0.2, .outputs = 1, .inputs = 1, .most_between = 4, .reach = reach}};

  void measure(double time) {
    const double y = time;
    grid.push_measurement(time, &y, reach);
  }
  struct Node {
    double time;
    bool ends_with_jump;  ///< the interval up to there
    bool operator==(const Node&) const = default;
  };
  /// The nodes that are made anew.
  std::vector<Node> advance(double until) {
    grid.take_back(grid.outdated(until, reach), until);
    std::vector<Node> made;
    while (grid.has_next(until)) {
      grid.make_next(until);
      made.push_back({grid.time(), grid.interval().ends_with_jump});
    }
    return made;
  }
};

std::vector<double> times_of_jumps(const std::vector<Grid::Node>& nodes) {
  std::vector<double> times;
  for (const Grid::Node& node : nodes)
    if (node.ends_with_jump) times.push_back(node.time);
  return times;
}

TEST(NodeGrid, PutsAJumpAtTheNodeBehindWhichItWas) {
  Grid nodes;
  for (const double time : {0.0, 0.2, 0.4, 0.6, 0.8}) nodes.measure(time);
  EXPECT_EQ(nodes.advance(0.8).size(), 5U);
  nodes.grid.push_jump(0.4, reach);
  const auto made = nodes.advance(0.8);
  ASSERT_EQ(made.size(), 3U) << "from that node on";
  EXPECT_EQ(times_of_jumps(made), std::vector{0.4});
  EXPECT_TRUE(nodes.advance(0.8).empty()) << "once";
  // It stays there when nodes are made anew for something else.
  nodes.measure(0.3);
  EXPECT_EQ(times_of_jumps(nodes.advance(0.8)), std::vector{0.4});
}

TEST(NodeGrid, PutsAJumpBetweenTwoNodesAtTheFirstOfThem) {
  Grid nodes;
  for (int k = 0; k <= 20; ++k) nodes.measure(0.05 * k);
  const auto usual = nodes.advance(1.0);
  ASSERT_EQ(usual.size(), 6U) << "at 0, 0.2 and so on";
  EXPECT_TRUE(times_of_jumps(usual).empty());
  nodes.grid.push_jump(0.55, reach);
  const auto made = nodes.advance(1.0), again = (nodes.grid.push_jump(0.85, reach), nodes.advance(1.0));
  EXPECT_EQ(times_of_jumps(made), std::vector{usual[2].time});
  EXPECT_EQ(times_of_jumps(again), std::vector{usual[4].time});
}

TEST(NodeGrid, LeavesOutAJumpThatIsOutOfReach) {
  Grid nodes;
  for (int k = 0; k <= 40; ++k) nodes.measure(0.2 * k);
  nodes.advance(8.0);
  nodes.grid.push_jump(1.0, reach);
  EXPECT_TRUE(nodes.advance(8.0).empty());
  nodes.grid.settle(reach);
  nodes.grid.push_jump(7.0, 2);
  EXPECT_TRUE(nodes.advance(8.0).empty());
  nodes.grid.push_jump(-1.0, reach);
  EXPECT_TRUE(nodes.advance(8.0).empty()) << "before there was a node";
}

TEST(NodeGrid, TakesBackJumpsAndWhatWasMeasuredBehindThem) {
  NodeGrid grid{{.step = 0.2, .outputs = 2, .inputs = 1, .most_between = 4, .reach = reach}};
  const auto outputs_of = [&] {
    std::vector<double> seen;
    grid.take_back(grid.outdated(1.0, reach), 1.0);
    while (grid.has_next(1.0)) {
      grid.make_next(1.0);
      EXPECT_FALSE(grid.interval().ends_with_jump);
      seen.insert(seen.end(), {grid.outputs()[0], grid.outputs()[1]});
    }
    return seen;
  };
  for (int k = 0; k <= 5; ++k) grid.push_measurement(0.2 * k, std::vector{1.0 * k, 10.0 * k}.data(), reach);
  EXPECT_EQ(outputs_of().size(), 12U);
  grid.push_jump(0.6, reach);
  const double first_output[] = {1.0, std::nan("")};
  grid.retract(0.4, 0.6, first_output);
  const std::vector<double> seen = outputs_of();
  ASSERT_EQ(seen.size(), 8U) << "from the node on at which jumps are taken back";
  for (const std::size_t k : {0U, 2U}) EXPECT_EQ(seen[k], 2.0 + 0.5 * static_cast<double>(k)) << "not behind 0.6 s";
  for (const std::size_t k : {4U, 6U}) EXPECT_TRUE(std::isnan(seen[k])) << k;
  EXPECT_EQ(seen[5], 40.0);
  EXPECT_EQ(seen[7], 50.0);
}

TEST(NodeGrid, WhatWasMeasuredBecomesSomethingElse) {
  Grid nodes;
  const auto put = [&](double time, double y) { return nodes.grid.put_measurement(time, &y, reach); };
  for (int k = 0; k <= 5; ++k) EXPECT_EQ(put(0.2 * k, k), NodeGrid::Place::waits) << "as a new one";
  EXPECT_EQ(nodes.advance(1.0).size(), 6U);
  EXPECT_EQ(put(0.8, 4.0), NodeGrid::Place::waits) << "it is what it was";
  EXPECT_TRUE(nodes.advance(1.0).empty());
  EXPECT_EQ(put(0.8, 7.0), NodeGrid::Place::late);
  EXPECT_EQ(nodes.advance(0.8).size(), 1U);
  EXPECT_EQ(nodes.grid.outputs()[0], 7.0);
  EXPECT_EQ(put(0.8, std::nan("")), NodeGrid::Place::late);
  EXPECT_EQ(nodes.advance(0.8).size(), 1U);
  EXPECT_TRUE(std::isnan(nodes.grid.outputs()[0]));
  EXPECT_EQ(put(0.8, std::nan("")), NodeGrid::Place::waits) << "nothing, as before";
  EXPECT_EQ(nodes.advance(1.0).size(), 1U);
  nodes.grid.outdate(0.6);
  EXPECT_EQ(nodes.advance(0.6).size(), 1U) << "nodes from there on are taken back";
  EXPECT_EQ(nodes.advance(1.0).size(), 2U);
}

}  // namespace node_grid_test
}  // namespace rhec
