#include "core/horizon/output_cache.hpp"

#include <gtest/gtest.h>

namespace rhec {
namespace output_cache_test {

constexpr int nodes = 5, outputs = 2, jacobians = 3;

const auto always = [](int) { return true; };

/// A filled cache, with numbers that show a node's age.
struct Filled {
  explicit Filled(int first_value = 0) {
    int end = 0;
    EXPECT_EQ(cache.mark_unknown(0, nodes - 1, end), 0);
    EXPECT_EQ(end, nodes);
    for (int node = 0; node < nodes; ++node) write(node, first_value + node);
  }
  void write(int node, int value) {
    for (int j = 0; j < outputs; ++j) cache.outputs_of(node)[j] = value + 0.1 * j;
    for (int j = 0; j < jacobians; ++j) cache.jacobians_of(node)[j] = -value - 0.1 * j;
  }
  bool holds(int node, int value) {
    bool same = true;
    for (int j = 0; j < outputs; ++j) same &= cache.outputs_of(node)[j] == value + 0.1 * j;
    for (int j = 0; j < jacobians; ++j) same &= cache.jacobians_of(node)[j] == -value - 0.1 * j;
    return same;
  }
  /// The first unknown node from `node` on.
  int unknown(int node = 0) {
    int end = 0;
    return cache.mark_unknown(node, nodes - 1, end);
  }
  OutputCache cache{nodes, outputs, jacobians};
};

TEST(OutputCache, KnowsNothingAtFirstAndAllThatWasMarked) {
  OutputCache cache(nodes, outputs, jacobians);
  int end = 0;
  EXPECT_EQ(cache.mark_unknown(0, 1, end), 0);
  EXPECT_EQ(end, 2);
  EXPECT_EQ(cache.mark_unknown(0, 1, end), 2) << "there is none";
  EXPECT_EQ(cache.mark_unknown(0, 4, end), 2) << "the next stretch";
  EXPECT_EQ(end, 5);
  cache.forget();
  EXPECT_EQ(cache.mark_unknown(3, 4, end), 3);
}

TEST(OutputCache, FindsStretchesBetweenWhatIsKnown) {
  Filled filled;
  filled.cache.move(0, nodes, [](int node) { return node != 1 && node != 3; });
  int end = 0;
  EXPECT_EQ(filled.cache.mark_unknown(0, 4, end), 1);
  EXPECT_EQ(end, 2);
  EXPECT_EQ(filled.cache.mark_unknown(end, 4, end), 3);
  EXPECT_EQ(end, 4);
  EXPECT_EQ(filled.cache.mark_unknown(end, 4, end), 5);
}

TEST(OutputCache, MovesWithTheHorizonAsOftenAsNeeded) {
  Filled filled;
  // More often than there is spare room, so that rows must move back to the front.
  for (int step = 1; step <= 4 * nodes; ++step) {
    filled.cache.move(1, nodes, always);
    EXPECT_EQ(filled.unknown(), nodes - 1) << step;
    filled.write(nodes - 1, step + nodes - 1);
    for (int node = 0; node < nodes; ++node) EXPECT_TRUE(filled.holds(node, step + node)) << step << ", " << node;
  }
}

TEST(OutputCache, MovesByMoreThanOneAndDropsWhatHasChanged) {
  Filled filled(10);
  filled.cache.move(2, nodes, [](int node) { return node != 1; });
  EXPECT_TRUE(filled.holds(0, 12));
  EXPECT_TRUE(filled.holds(2, 14));
  int end = 0;
  EXPECT_EQ(filled.cache.mark_unknown(0, 4, end), 1);
  EXPECT_EQ(end, 2);
  EXPECT_EQ(filled.cache.mark_unknown(2, 4, end), 3);
  EXPECT_EQ(end, 5);
}

TEST(OutputCache, KeepsWhatAGrowingHorizonHas) {
  Filled filled;
  filled.cache.move(0, 3, always);  // it had three nodes only
  EXPECT_EQ(filled.unknown(), 3);
  EXPECT_TRUE(filled.holds(2, 2));
}

TEST(OutputCache, MovesTheMarksOfCleanStages) {
  Filled filled;
  for (int node = 0; node < nodes; ++node) filled.cache.is_clean()[node] = node % 2 == 0;
  filled.cache.move(1, nodes, always);
  const int expected[nodes] = {0, 1, 0, 1, 0};
  for (int node = 0; node < nodes; ++node) EXPECT_EQ(filled.cache.is_clean()[node], expected[node]) << node;
}

}  // namespace output_cache_test
}  // namespace rhec
