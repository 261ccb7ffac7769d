#include "rhec/sim/world/deliveries.hpp"

#include <gmock/gmock.h>

namespace rhec::sim {
namespace deliveries_test {

TEST(Deliveries, ArriveInOrderAndOnce) {
  Deliveries deliveries;
  deliveries.add(2.0, 0.0, {1.0});
  deliveries.add(1.0, 1.0, {2.0});
  deliveries.add(2.0, 2.0, {3.0});
  std::vector<double> stamps, values;
  const auto take = [&](double stamp, const std::vector<double>& outputs) {
    stamps.push_back(stamp);
    values.push_back(outputs[0]);
  };
  deliveries.deliver(0.5, take);
  EXPECT_THAT(stamps, testing::IsEmpty());
  deliveries.deliver(1.0, take);
  EXPECT_THAT(stamps, testing::ElementsAre(1.0));
  deliveries.deliver(5.0, take);
  deliveries.deliver(5.0, take);
  EXPECT_THAT(stamps, testing::ElementsAre(1.0, 0.0, 2.0));
  EXPECT_THAT(values, testing::ElementsAre(2.0, 1.0, 3.0));
}

}  // namespace deliveries_test
}  // namespace rhec::sim
