#include "rhec/core/model/motion_outputs.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "rhec/core/base/error.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "support/error_of.hpp"

namespace rhec {
namespace motion_outputs_test {

std::shared_ptr<const Model> bicycle(const std::string& outputs) {
  static const Host host;
  return host.make_model("bicycle_slip", parse_yaml("outputs: " + outputs, "test"));
}

TEST(MotionOutputs, AreThoseThatDependOnInputOrSlip) {
  EXPECT_TRUE(outputs_of_motion(*bicycle("[x_gps, heading]")).empty());
  EXPECT_EQ(outputs_of_motion(*bicycle("[ground_speed, x_gps, yaw_rate]")), (std::vector{0, 2}));
}

TEST(MotionOutputs, AreRatesOfTheState) {
  const auto model = bicycle("[x_gps, yaw_rate, ground_speed]");
  const MotionOutputs motion(*model);
  constexpr int points = 11;  // more than one group of lanes
  std::vector<double> x, u, p, y(2 * points);
  for (int i = 0; i < points; ++i) {
    for (int j = 0; j < 4; ++j) x.push_back(0.1 * (i + j));
    for (int j = 0; j < 2; ++j) u.push_back(2.0 + 0.3 * i - j);
    for (int j = 0; j < 2; ++j) p.push_back(0.5 + 0.03 * i + 0.1 * j);
  }
  motion.evaluate(
      {.count = points, .states = x.data(), .inputs = u.data(), .parameters = p.data(), .outputs = y.data()});
  for (int i = 0; i < points; ++i) {
    double rates[4];
    model->rates(x.data() + 4 * i, u.data() + 2 * i, p.data() + 2 * i, rates);
    EXPECT_NEAR(y[2 * i], rates[2], 1e-14);
    EXPECT_NEAR(y[2 * i + 1], std::hypot(rates[0], rates[1]), 1e-14);
  }
  // Who knows the state alone sees nothing of them.
  std::vector<double> of_state(3, 7.0), jacobian(12, 7.0);
  model->observe({.count = 1, .states = x.data(), .outputs = of_state.data(), .jacobians = jacobian.data()});
  EXPECT_EQ(of_state[1], 0.0);
  EXPECT_EQ(of_state[2], 0.0);
  for (int c = 0; c < 4; ++c) EXPECT_EQ(jacobian[3 * c + 1], 0.0);
}

TEST(MotionOutputs, AreRefusedWithTheirName) {
  EXPECT_NO_THROW(refuse_outputs_of_motion(*bicycle("[x_gps]"), "filter"));
  EXPECT_NE(error_of([] {
              refuse_outputs_of_motion(*bicycle("[x_gps, yaw_rate]"), "filter");
            }).find("filter: the output 'yaw_rate' of model 'bicycle_slip' depends on the input"),
            std::string::npos);
}

}  // namespace motion_outputs_test
}  // namespace rhec
