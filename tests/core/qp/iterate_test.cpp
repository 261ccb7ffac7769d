#include "rhec/core/qp/iterate.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>

namespace rhec {
namespace iterate_test {

TEST(Capacity, HasRowsAsLongAsRegistersAreWide) {
  EXPECT_EQ((Capacity{5, 3, 2}.row()), 8);
  EXPECT_EQ((Capacity{5, 6, 2}.row()), 8);
  EXPECT_EQ((Capacity{5, 7, 2}.row()), 16);
  EXPECT_EQ((Capacity{5, 20, 12}.row()), 32);
  EXPECT_EQ((Capacity{5, 20, 13}.row()), 64) << "wide rows begin at whole lines of the cache";
}

TEST(Iterate, BeginsAsZerosAndKeepsWhatIsWritten) {
  const Capacity capacity{3, 2, 2};
  Iterate point(capacity);
  EXPECT_EQ(point.capacity(), capacity);
  double next = 0.0;
  for (int i = 0; i <= 3; ++i) {
    for (double* row :
         {point.state(i), point.control(i), point.costate(i), point.state_bound(i), point.control_bound(i)})
      for (int j = 0; j < 2; ++j) {
        EXPECT_EQ(row[j], 0.0) << "places overlap";
        row[j] = next += 1.0;
      }
  }
  const Iterate copy = point;
  next = 0.0;
  for (int i = 0; i <= 3; ++i)
    for (const double* row :
         {copy.state(i), copy.control(i), copy.costate(i), copy.state_bound(i), copy.control_bound(i)})
      for (int j = 0; j < 2; ++j) EXPECT_EQ(row[j], next += 1.0);
}

TEST(Iterate, HasTheControlBehindTheStateInARow) {
  Iterate point(Capacity{2, 3, 2});
  EXPECT_EQ(point.row(1), point.state(1));
  EXPECT_EQ(point.control(1), point.row(1) + 3);
  EXPECT_EQ(point.row(2), point.row(1) + point.capacity().row());
  EXPECT_EQ(point.bound_row(1), point.state_bound(1));
  EXPECT_EQ(point.control_bound(1), point.bound_row(1) + 3);
  EXPECT_EQ(reinterpret_cast<std::uintptr_t>(point.row(1)) % 64, 0U);
}

TEST(Iterate, IsFiniteAsLongAsEveryNumberIs) {
  Iterate point(Capacity{2, 3, 2});
  EXPECT_TRUE(point.is_finite());
  point.costate(1)[2] = HUGE_VAL;
  EXPECT_FALSE(point.is_finite());
  point.costate(1)[2] = 0.0;
  point.control_bound(1)[1] = std::nan("");
  EXPECT_FALSE(point.is_finite());
}

TEST(Iterate, LosesItsMultipliersAlone) {
  Iterate point(Capacity{2, 3, 2});
  for (double* row : {point.state(2), point.control(1), point.costate(2), point.state_bound(2), point.control_bound(1)})
    row[1] = 5.0;
  point.clear_multipliers();
  EXPECT_EQ(point.state(2)[1], 5.0);
  EXPECT_EQ(point.control(1)[1], 5.0);
  for (const double* row : {point.costate(2), point.state_bound(2), point.control_bound(1)}) EXPECT_EQ(row[1], 0.0);
}

}  // namespace iterate_test
}  // namespace rhec
