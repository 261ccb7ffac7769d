#include "core/control/dubins_path.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

namespace rhec {
namespace dubins_path_test {

constexpr double pi = std::numbers::pi;

double off(const Pose& a, const Pose& b) {
  return std::hypot(a.x - b.x, a.y - b.y) + std::abs(std::remainder(a.direction - b.direction, 2.0 * pi));
}

Pose drawn(std::mt19937& random) {
  std::uniform_real_distribution<double> place(-6.0, 6.0), direction(-4.0, 4.0);
  return {place(random), place(random), direction(random)};
}

DubinsPath shortest_path(const Pose& from, const Pose& to, double radius) {
  DubinsPath best;
  for (const DubinsPath::Kind& kind : DubinsPath::kinds) {
    const DubinsPath path(kind, from, to, radius);
    if (path.exists() && (!best.exists() || path.length() < best.length())) best = path;
  }
  return best;
}

TEST(DubinsPath, EachKindThatExistsLeadsThereByItsPieces) {
  std::mt19937 random(3);
  int arcs_in_the_middle = 0;
  for (int k = 0; k < 500; ++k) {
    const Pose from = drawn(random), to = drawn(random);
    const double radius = 0.3 + 0.01 * k;
    for (const DubinsPath::Kind& kind : DubinsPath::kinds) {
      const DubinsPath path(kind, from, to, radius);
      if (!path.exists()) continue;
      arcs_in_the_middle += kind[1] != 0;
      EXPECT_LT(off(path.pose_at(0.0), from), 1e-9);
      EXPECT_LT(off(path.pose_at(path.length()), to), 1e-7) << k << " " << kind[0] << kind[1] << kind[2];
      // It is a curve that its directions and curvatures are those of.
      const double step = path.length() / 1000.0;
      Pose last = from;
      for (int i = 0; i < 1000; ++i) {
        const Pose next = path.pose_at((i + 1) * step);
        const double turn = std::remainder(next.direction - last.direction, 2.0 * pi);
        EXPECT_LE(std::abs(turn), step / radius + 1e-9);
        EXPECT_NEAR(std::hypot(next.x - last.x, next.y - last.y), step, 0.1 * step);
        const double here = path.curvature_at(i * step), there = path.curvature_at((i + 0.999999) * step);
        if (here == there) {
          EXPECT_NEAR(turn, here * step, 1e-9);
        }
        last = next;
      }
    }
  }
  EXPECT_GT(arcs_in_the_middle, 100);
}

TEST(DubinsPath, ThereIsAlwaysOneAndTheShortestIsAsLongBackwards) {
  std::mt19937 random(4);
  for (int k = 0; k < 500; ++k) {
    const Pose from = drawn(random), to = drawn(random);
    const double radius = 0.1 + 0.02 * k;
    const DubinsPath shortest = shortest_path(from, to, radius);
    ASSERT_TRUE(shortest.exists());
    EXPECT_GE(shortest.length(), std::hypot(to.x - from.x, to.y - from.y) - 1e-9);
    // There and back are the same for one that drives in reverse.
    const DubinsPath back =
        shortest_path({to.x, to.y, to.direction + pi}, {from.x, from.y, from.direction + pi}, radius);
    EXPECT_NEAR(back.length(), shortest.length(), 1e-6);
  }
}

// Lengths that are known in closed form.
TEST(DubinsPath, KnownLengths) {
  const double radius = 2.5;
  const auto length = [radius](const Pose& to) { return shortest_path({}, to, radius).length(); };
  EXPECT_NEAR(length({10.0, 0.0, 0.0}), 10.0, 1e-12) << "straight on";
  EXPECT_NEAR(length({0.0, 0.0, pi}), 7.0 / 3.0 * pi * radius, 1e-9) << "on the same place, the other way round";
  EXPECT_NEAR(length({0.0, 2.0 * radius, pi}), pi * radius, 1e-9) << "half a circle";
  EXPECT_NEAR(length({0.0, 2.0 * radius + 3.0, pi}), pi * radius + 3.0, 1e-9);
  EXPECT_NEAR(length({-4.0, 0.0, 0.0}), 2.0 * pi * radius + 4.0, 1e-9) << "behind, round by two half circles";
  EXPECT_NEAR(length({0.0, 0.0, 0.0}), 0.0, 1e-12);
}

}  // namespace dubins_path_test
}  // namespace rhec
