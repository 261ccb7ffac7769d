#pragma once

#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "rhec/plugins/yaml/yaml.hpp"
#include "rhec/sim/logs/recorded_log.hpp"
#include "rhec/sim/numbers/random.hpp"

namespace rhec::sim {

/// A drive whose log has errors that are known: it weaves at 1 to 4 m/s.
struct WeavingDrive {
  double seconds = 100.0, noise = 0.1, offset = 0.7, delay = 0.15, bias = 0.02;
  std::uint64_t seed = 1;

  LogTables tables() const {
    RandomStream random(seed, "weaving drive");
    constexpr double dt = 0.01;
    std::string rows, fixes;
    double x = 0.0, y = 0.0, heading = 0.7;
    std::vector<std::pair<double, double>> antenna;
    const auto late = static_cast<std::size_t>(std::lround(delay / dt));
    for (std::size_t i = 0; static_cast<double>(i) * dt < seconds; ++i) {
      const double time = dt * static_cast<double>(i);
      const double speed = 2.5 + 1.5 * std::sin(0.31 * time);
      const double steering = 0.25 * std::sin(0.5 * time + 1.0) + 0.15 * std::sin(0.13 * time + 2.0);
      antenna.emplace_back(x - offset * std::cos(heading), y - offset * std::sin(heading));
      if (i % 5 == 0)
        rows += fmt::format("{:.3f},{:.6f},{:.6f}\n", time, speed + 0.05 * random.normal(),
                            steering + bias + 0.002 * random.normal());
      if (i % 20 == 0 && i >= late) {
        const auto [at_x, at_y] = antenna[i - late];
        fixes +=
            fmt::format("{:.3f},{:.6f},{:.6f}\n", time, at_x + noise * random.normal(), at_y + noise * random.normal());
      }
      const double rate = 0.8 * speed / 2.0 * std::tan(0.9 * steering), middle = heading + 0.5 * dt * rate;
      x += dt * 0.8 * speed * std::cos(middle);
      y += dt * 0.8 * speed * std::sin(middle);
      heading += dt * rate;
    }
    return {parse_csv(rows, "drs.txt", {.columns = 3}), parse_csv(fixes, "gps.txt", {.columns = 3})};
  }
};

/// Knows nothing of the errors.
inline Settings weaving_settings(const std::string& estimator = "ekf") {
  return parse_yaml(R"(
name: weaving
step: 0.2
model: {name: bicycle_slip, wheelbase: 2.0, gps_offset: 0}
noise:
  outputs: {x_gps: 0.3, y_gps: 0.3, delta: 0.005}
  inputs: {u1: 0.05, u2: 0.1}
bounds: {kappa: [0.3, 1.3], mu: [0.3, 1.3], u2: [null, null]}
estimator:
  name: )" + estimator + R"(
  heading_starts: 12
  process_noise: {kappa: 0.002, mu: 0.001}
  initial:
    parameters: {kappa: 1, mu: 1}
    sigma: {x_pos: 100, y_pos: 100, beta: 3.14, delta: 0.1, kappa: 0.3, mu: 0.3}
)",
                    "weaving.yaml");
}

}  // namespace rhec::sim
