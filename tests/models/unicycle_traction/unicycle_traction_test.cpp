#include "models/drive.hpp"

namespace rhec {
namespace unicycle_traction_test {

using namespace testing;

std::shared_ptr<Model> robot() {
  return vehicle("unicycle_traction", "{antenna_x: -0.2, antenna_y: 0.1, outputs: [x_gps, y_gps]}");
}

TEST(UnicycleTraction, DrivesAlongTheCircleThatItsTractionLeaves) {
  for (const double mu : {1.0, 0.6})
    for (const double kappa : {1.0, 0.8})
      expect_near(drive(*robot(), {1.0, 2.0, -0.4}, {2.0, 0.5}, {mu, kappa}, 4.0),
                  along_circle(1.0, 2.0, -0.4, mu * 2.0, kappa * 0.5, 4.0));
}

TEST(UnicycleTraction, TurnsOnTheSpot) {
  expect_near(drive(*robot(), {1.0, 2.0, 0.0}, {0.0, 0.7}, {0.9, 0.5}, 2.0), {1.0, 2.0, 0.7});
}

TEST(UnicycleTraction, TurnsItsWheelsFasterWhereTheySlip) {
  const auto [state, inputs] = straight(*robot(), 1.5, {0.75, 0.9});
  EXPECT_EQ(inputs, (Numbers{2.0, 0.0}));
  expect_near(drive(*robot(), state, inputs, {0.75, 0.9}, 2.0), {3.0, 0.0, 0.0});
}

TEST(UnicycleTraction, HasItsAntennaAtItsPlace) {
  const double c = std::cos(0.6), s = std::sin(0.6);
  expect_near(seen(*robot(), {3.0, 4.0, 0.6}), {3.0 - 0.2 * c - 0.1 * s, 4.0 - 0.2 * s + 0.1 * c}, 1e-14);
}

}  // namespace unicycle_traction_test
}  // namespace rhec
