#include "models/drive.hpp"

namespace rhec {
namespace bicycle_slip_test {

using namespace testing;

constexpr double wheelbase = 1.7, antenna = 0.5;

std::shared_ptr<Model> bicycle(const std::string& outputs = "[x_gps, y_gps, delta, heading]") {
  return vehicle("bicycle_slip", "{wheelbase: 1.7, gps_offset: 0.5, outputs: " + outputs + "}");
}

TEST(BicycleSlip, DrivesAlongTheCircleThatItsSlipLeavesOfIts) {
  const auto model = bicycle();
  for (const double kappa : {1.0, 0.7}) {
    for (const double mu : {1.0, 0.4}) {
      const double wheels = 3.0, delta = 0.3, speed = kappa * wheels;
      Numbers expected = along_circle(1.0, -2.0, 0.5, speed, speed * std::tan(mu * delta) / wheelbase, 4.0);
      expected.push_back(delta);
      expect_near(drive(*model, {1.0, -2.0, 0.5, delta}, {wheels, 0.0}, {kappa, mu}, 4.0), expected);
    }
  }
}

TEST(BicycleSlip, SteersAsFastAsItIsTold) {
  const Numbers end = drive(*bicycle(), {0.0, 0.0, 0.0, 0.1}, {0.0, -0.2}, {0.8, 0.5}, 2.0);
  expect_near(end, {0.0, 0.0, 0.0, -0.3});
}

TEST(BicycleSlip, HasItsAntennaBehindTheRearAxle) {
  const double heading = 2.0;
  expect_near(seen(*bicycle(), {3.0, 4.0, heading, 0.2}),
              {3.0 - antenna * std::cos(heading), 4.0 - antenna * std::sin(heading), 0.2, heading}, 1e-14);
  EXPECT_EQ(seen(*bicycle("[delta]"), {3.0, 4.0, heading, 0.2}), Numbers{0.2}) << "the outputs that were chosen";
}

TEST(BicycleSlip, TurnsItsWheelsFasterWhereTheySlip) {
  const auto [state, inputs] = straight(*bicycle(), 2.0, {0.8, 0.3});
  EXPECT_EQ(inputs, (Numbers{2.5, 0.0}));
  expect_near(drive(*bicycle(), state, inputs, {0.8, 0.3}, 3.0), {6.0, 0.0, 0.0, 0.0});
}

TEST(BicycleSlip, RefusesAnAxleOnTheOther) {
  EXPECT_THROW(vehicle("bicycle_slip", "{wheelbase: 0}"), Error);
  EXPECT_THROW(vehicle("bicycle_slip", "{wheelbase: -1.4}"), Error);
}

}  // namespace bicycle_slip_test
}  // namespace rhec
