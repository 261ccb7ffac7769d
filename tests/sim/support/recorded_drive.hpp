#pragma once

#include <cmath>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "rhec/plugins/yaml/yaml.hpp"
#include "rhec/sim/logs/recorded_log.hpp"
#include "support/temporary_folder.hpp"

namespace rhec::sim {

inline constexpr const char* scenario_text = R"(
name: circle
step: 0.2
model: {name: bicycle_slip, wheelbase: 2.0, gps_offset: 0}
log: {wheel_offset: 0.5}
noise:
  outputs: {x_gps: 0.1, y_gps: 0.1, delta: 0.02}
  inputs: {u1: 0.1, u2: 0.05}
bounds: {kappa: [0.3, 1.3], mu: [0.3, 1.3], u2: [null, null]}
estimator:
  horizon: 10
  heading_starts: 12
  process_noise: {kappa: 0.02, mu: 0.02}
  initial:
    parameters: {kappa: 1, mu: 1}
    sigma: {x_pos: 100, y_pos: 100, beta: 3.14, delta: 0.1, kappa: 0.3, mu: 0.3}
variants:
  rhe: {}
  robust: {estimator: {robust: {outputs: [x_gps, y_gps], delta: 3}}}
  ekf: {estimator: {name: ekf}}
)";

inline LogScenario scenario_of(const std::string& text = scenario_text, const std::vector<std::string>& chosen = {}) {
  return {Host(), parse_yaml(text, "circle.yaml"), chosen};
}

/// A drive that stands for 2 s, heading along `heading`, and then goes round a circle, as files.
class RecordedDriveTest : public FolderTest {
 protected:
  static constexpr double wheelbase = 2.0, kappa = 0.8, speed = 3.0, steering = 0.2, heading = 2.5;

  void SetUp() override {
    double x = 5.0, y = -3.0, angle = heading;
    const double wheel = 1.0 - std::tan(steering) * 0.5 / wheelbase;
    for (int i = 0; i <= 1600; ++i) {
      const double time = 0.025 * i, v = time < 2.0 ? 0.0 : speed;
      // Two rows with one stamp, as of a clock too coarse.
      rows_ += fmt::format("{:.3f},{:.9f},{:.9f}\n", 0.05 * (i / 2), v * wheel, steering);
      if (i % 8 == 0) fixes_ += fmt::format("{:.3f},{:.9f},{:.9f}\n", time, x, y);
      const double rate = kappa * v / wheelbase * std::tan(steering), middle = angle + 0.5 * 0.025 * rate;
      x += 0.025 * kappa * v * std::cos(middle);
      y += 0.025 * kappa * v * std::sin(middle);
      angle += 0.025 * rate;
    }
  }
  RecordedLog log(const LogScenario& scenario) const { return log(scenario, rows_, fixes_); }
  RecordedLog log(const LogScenario& scenario, const std::string& rows, const std::string& fixes) const {
    return read_recorded_log(put("drs.txt", rows), put("gps.txt", fixes), scenario);
  }

  std::string rows_, fixes_;
};

}  // namespace rhec::sim
