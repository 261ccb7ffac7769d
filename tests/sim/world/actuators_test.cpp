#include "rhec/sim/world/actuators.hpp"

#include <gmock/gmock.h>

#include <array>
#include <cmath>

#include "rhec/plugins/yaml/yaml.hpp"
#include "rhec/sim/world/slip_field.hpp"
#include "sim/support/bicycle.hpp"
#include "support/error_of.hpp"

namespace rhec::sim {
namespace actuators_test {

std::vector<ActuatorOptions> actuators_of(const std::string& yaml) {
  return read_actuators(parse_yaml(yaml, "vehicle.yaml"), Bicycle().description());
}

/// The true state after five seconds of constant inputs.
Eigen::VectorXd driven(const std::string& yaml, std::array<double, 2> given) {
  const Bicycle model;
  const auto field = constant_field({1.0, 1.0});
  TruthVehicle vehicle(model, *field, Eigen::Vector4d::Zero());
  Actuators actuators(actuators_of(yaml));
  for (int k = 0; k < 25; ++k) actuators.advance(vehicle, given.data(), 0.2);
  return vehicle.state();
}

TEST(Actuators, WithoutOptionsTheVehicleGetsWhatIsAsked) {
  const Bicycle model;
  const auto field = constant_field({1.0, 1.0});
  TruthVehicle vehicle(model, *field, Eigen::Vector4d::Zero());
  const std::array<double, 2> given{3.0, 0.05};
  for (int k = 0; k < 25; ++k) vehicle.advance(given.data(), 0.2);
  EXPECT_EQ(driven("{}", given), vehicle.state());
}

TEST(Actuators, ALagIsThatOfItsTimeConstant) {
  const double lag = 0.7, time = 5.0;
  // The way of a speed 1 - exp(-t / lag).
  EXPECT_NEAR(driven("{u1: {lag: 0.7}}", {1.0, 0.0})[0], time - lag * (1.0 - std::exp(-time / lag)), 1e-9);
}

TEST(Actuators, LimitsAreKept) {
  EXPECT_NEAR(driven("{u1: {upper: 2}}", {5.0, 0.0})[0], 10.0, 1e-9);
  EXPECT_NEAR(driven("{u1: {lower: 1}}", {-5.0, 0.0})[0], 5.0, 1e-9);
}

TEST(Actuators, MistakesAreTold) {
  EXPECT_THAT(error_of([] { actuators_of("{u3: {lag: 1}}"); }), testing::HasSubstr("u3"));
  EXPECT_THAT(error_of([] { actuators_of("{u1: {lower: 2, upper: 1}}"); }),
              testing::HasSubstr("expected lower <= upper"));
  EXPECT_THAT(error_of([] { actuators_of("{u1: {lag: -1}}"); }), testing::HasSubstr("vehicle.yaml:1"));
}

}  // namespace actuators_test
}  // namespace rhec::sim
