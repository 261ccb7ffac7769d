#include "core/control/multi_point_turn.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

namespace rhec {
namespace multi_point_turn_test {

constexpr double pi = std::numbers::pi, nan = std::numeric_limits<double>::quiet_NaN();
constexpr TurningCircle forwards{.radius = 2.0, .speed = 1.0, .steering = 0.6};
constexpr TurningCircle backwards{.radius = 3.0, .speed = 0.5, .steering = 0.4};

/// The path beside which it turns.
Path straight() { return Path({{0.0, 0.0, 2.0}, {100.0, 0.0, 2.0}}); }

MultiPointTurn begun(int rotation, bool in_reverse) {
  MultiPointTurn turn;
  turn.begin({.vehicle = {10.0, 5.0, 0.3},
              .rotation = rotation,
              .in_reverse = in_reverse,
              .forwards = forwards,
              .backwards = backwards,
              .section = 0,
              .arc_length = 10.0});
  return turn;
}

TEST(MultiPointTurn, MovesTurnTheHeadingInOneSense) {
  const Path path = straight();
  for (const int rotation : {1, -1}) {
    for (const bool in_reverse : {false, true}) {
      MultiPointTurn turn = begun(rotation, in_reverse);
      EXPECT_FALSE(turn.is_under_way());
      ASSERT_TRUE(turn.add(1.0));
      ASSERT_TRUE(turn.add(0.8));
      EXPECT_EQ(turn.moves(), 2);
      EXPECT_NEAR(turn.last_angle(), 0.8, 1e-12);
      turn.set_off();
      const double first = in_reverse ? 3.0 : 2.0, second = in_reverse ? 2.0 : 3.0;
      EXPECT_NEAR(turn.last_start(), first, 1e-12);
      EXPECT_NEAR(turn.length(), first + 0.8 * second, 1e-12);
      double last_x = 10.0, last_y = 5.0;
      for (double along = 0.01; along < turn.length(); along += 0.01) {
        const PathPoint there = turn.point_at(path, along);
        const bool is_second = along > first;
        const double turned = is_second ? 1.0 + (along - first) / second : along / first;
        EXPECT_NEAR(std::remainder(there.heading - 0.3 - rotation * turned, 2.0 * pi), 0.0, 1e-9);
        EXPECT_EQ(there.in_reverse, in_reverse != is_second);
        EXPECT_EQ(there.speed, there.in_reverse ? -0.5 : 1.0);
        // It moves along its heading, or against it, as a vehicle without slip does.
        const double middle = there.heading - 0.5 * rotation * 0.01 / (is_second ? second : first);
        const double ahead = (there.x - last_x) * std::cos(middle) + (there.y - last_y) * std::sin(middle);
        const double aside = (there.y - last_y) * std::cos(middle) - (there.x - last_x) * std::sin(middle);
        if (std::abs(along - first) > 0.011) {
          EXPECT_NEAR(ahead, there.in_reverse ? -0.01 : 0.01, 1e-6) << along;
          EXPECT_NEAR(aside, 0.0, 1e-6) << along;
        }
        last_x = there.x;
        last_y = there.y;
      }
    }
  }
}

TEST(MultiPointTurn, IsDrivenMoveByMove) {
  const Path path = straight();
  MultiPointTurn turn = begun(1, true);
  ASSERT_TRUE(turn.add(1.0));
  turn.end_last_at(1.5);
  EXPECT_NEAR(turn.last_angle(), 0.5, 1e-12);
  turn.end_last_at(9.0);
  EXPECT_NEAR(turn.last_angle(), 0.5, 1e-12) << "a move does not get longer";
  ASSERT_TRUE(turn.add(0.5));
  turn.set_off();
  EXPECT_TRUE(turn.in_reverse());
  EXPECT_TRUE(turn.waits()) << "it steers before it drives";
  const double wait = MultiPointTurn::standing_share * backwards.steering;
  EXPECT_NEAR(turn.arc_length_after(0.0, wait + 1.0), 0.5, 1e-12);
  EXPECT_EQ(turn.arc_length_after(0.0, wait), 0.0);
  EXPECT_EQ(turn.point_at(path, 0.0).speed, 0.0) << "until then";
  EXPECT_NEAR(turn.arc_length_after(0.0, 100.0), 1.5, 1e-12) << "to the end of the move";
  EXPECT_EQ(turn.point_at(path, 1.5).speed, 0.0) << "where it rests";
  double time = 0.0;
  bool has_changed = false;
  for (double along = 0.0; along < 1.45; along += 0.05, time += 0.1) {
    const PathPoint there = turn.point_at(path, along);
    has_changed = turn.advance(path, {there.x, there.y, there.heading}, 0.1);
    EXPECT_TRUE(turn.is_under_way());
    if (has_changed) break;
    EXPECT_NEAR(turn.arc_length(), along, 0.05);
  }
  EXPECT_TRUE(has_changed);
  EXPECT_GT(time, 2.0) << "the first move is all but driven";
  EXPECT_FALSE(turn.in_reverse());
  EXPECT_TRUE(turn.waits());
  const double longer = 2.0 * MultiPointTurn::standing_share * forwards.steering;
  EXPECT_NEAR(turn.arc_length_after(1.5, longer + 0.2), 1.7, 1e-12) << "from lock to lock takes twice as long";
  EXPECT_FALSE(turn.advance(path, {nan, 0.0, 0.0}, 0.1));
  EXPECT_TRUE(turn.is_under_way()) << "what is no number says nothing";
  const PathPoint end = turn.point_at(path, turn.length());
  for (double along = 1.5; along < turn.length(); along += 0.1) {
    const PathPoint there = turn.point_at(path, along);
    turn.advance(path, {there.x, there.y, there.heading}, 0.1);
  }
  turn.advance(path, {end.x, end.y, end.heading}, 0.1);
  EXPECT_FALSE(turn.is_under_way());
  EXPECT_TRUE(turn.has_arrived());
}

TEST(MultiPointTurn, EndsWhereTheVehicleHasLeftIt) {
  const Path path = straight();
  for (const bool aside : {true, false}) {
    MultiPointTurn turn = begun(1, false);
    ASSERT_TRUE(turn.add(2.0));
    turn.set_off();
    aside ? turn.advance(path, {13.0, 5.0, 0.3}, 0.1) : turn.advance(path, {10.0, 5.0, 1.3}, 0.1);
    EXPECT_FALSE(turn.is_under_way());
    EXPECT_FALSE(turn.has_arrived());
  }
}

TEST(MultiPointTurn, IsNoneForWhoDoesNotTurn) {
  MultiPointTurn turn = begun(1, false);
  EXPECT_FALSE(turn.add(0.0));
  EXPECT_FALSE(turn.add(nan));
  for (int i = 0; i < MultiPointTurn::most_moves; ++i) ASSERT_TRUE(turn.add(0.1));
  EXPECT_FALSE(turn.add(0.1)) << "there are enough";
  turn.begin(
      {.vehicle = {}, .forwards = {.radius = infinity}, .backwards = {.radius = 1.0}, .section = 0, .arc_length = 0.0});
  EXPECT_FALSE(turn.add(1.0)) << "it does not turn";
  EXPECT_FALSE(turn.is_under_way());
}

TEST(MultiPointTurn, KnowsThePathBesideIt) {
  const Path path = straight();
  MultiPointTurn turn = begun(1, false);
  ASSERT_TRUE(turn.add(1.0));
  const PathProjection place = turn.beside(path, 11.0, 5.2);
  EXPECT_NEAR(place.arc_length, 11.0, 1e-12);
  EXPECT_NEAR(place.lateral, 5.2, 1e-12);
  EXPECT_NEAR(turn.path_beside(path, 0.0), 10.0, 1e-12) << "where it begins";
  EXPECT_NEAR(turn.beside(path, 90.0, 0.0).arc_length, 15.0, 1e-12) << "no other part of the path";
  EXPECT_EQ(turn.goes_on_at(path, 11.0, 5.2), place.arc_length);
}

}  // namespace multi_point_turn_test
}  // namespace rhec
