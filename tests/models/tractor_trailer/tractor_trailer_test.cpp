// The tractor and its trailer against what a hitch and wheels that roll without slip allow.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <complex>
#include <memory>
#include <vector>

#include "rhec/core/model/model.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/yaml/yaml.hpp"

namespace rhec {
namespace tractor_trailer_test {

constexpr double tractor_length = 1.4, trailer_length = 1.3;
using Point = std::complex<double>;
using State = std::array<double, 5>;

class TractorTrailerWithoutSlip : public ::testing::TestWithParam<double> {
 protected:
  static std::shared_ptr<Model> vehicle(double hitch, const std::string& outputs) {
    return Host().make_model("tractor_trailer",
                             parse_yaml("{hitch: " + std::to_string(hitch) + ", outputs: " + outputs + "}", "test"));
  }
};

/// The inputs of a drive that swings the articulation to and fro.
std::array<double, 2> inputs_at(int interval) {
  const double t = 0.2 * interval;
  return {2.0 + std::sin(0.3 * t), 0.35 * std::cos(0.9 * t) + 0.05 * std::cos(2.3 * t)};
}

// The tractor by itself is a bicycle, and the hitch is a point of it. The trailer's axle follows the hitch at a fixed
// distance, and its wheels let it move along the drawbar only: its heading turns by the part of the hitch's velocity
// that is across it. None of this is taken from the model but the order of its states.
TEST_P(TractorTrailerWithoutSlip, RollsAsTheConstraintsSay) {
  const double hitch = GetParam();
  const auto model = vehicle(hitch, "[x_tractor_gps, y_tractor_gps]");
  State state{4.0, -3.0, 0.4, 0.4, 0.0};
  const std::array<double, 3> no_slip{1.0, 1.0, 1.0};

  struct Independent {
    Point rear;
    double tractor, steering, trailer;
  };
  const auto derivative = [&](const Independent& at, double speed, double steering_rate) {
    const double tractor_rate = speed / tractor_length * std::tan(at.steering);
    const Point along = std::polar(1.0, at.tractor), velocity = speed * along;
    const Point hitch_velocity = velocity + Point(0.0, tractor_rate) * (-hitch * along);
    const double across = (std::conj(std::polar(1.0, at.trailer)) * hitch_velocity).imag();
    return Independent{velocity, tractor_rate, steering_rate, across / trailer_length};
  };
  const auto moved = [](const Independent& at, const Independent& rate, double time) {
    return Independent{at.rear + time * rate.rear, at.tractor + time * rate.tractor, at.steering + time * rate.steering,
                       at.trailer + time * rate.trailer};
  };
  Independent independent{Point(state[0], state[1]) + (trailer_length + hitch) * std::polar(1.0, 0.4), state[3],
                          state[4], state[2]};

  double largest_articulation = 0.0;
  for (int interval = 0; interval < 200; ++interval) {
    const auto inputs = inputs_at(interval);
    const double duration = 0.2;
    constexpr int steps = 200;
    State next{};
    model->integrate({.count = 1,
                      .states = state.data(),
                      .inputs = inputs.data(),
                      .parameters = no_slip.data(),
                      .durations = &duration,
                      .substeps = steps,
                      .next_states = next.data()});
    state = next;
    for (int i = 0; i < 4 * steps; ++i) {  // the midpoint rule
      const double h = duration / (4 * steps);
      const auto middle = moved(independent, derivative(independent, inputs[0], inputs[1]), 0.5 * h);
      independent = moved(independent, derivative(middle, inputs[0], inputs[1]), h);
    }
    const Point hitch_at = independent.rear - hitch * std::polar(1.0, independent.tractor);
    const Point axle = hitch_at - trailer_length * std::polar(1.0, independent.trailer);
    ASSERT_NEAR(state[0], axle.real(), 2e-6) << interval;
    ASSERT_NEAR(state[1], axle.imag(), 2e-6) << interval;
    ASSERT_NEAR(state[2], independent.trailer, 1e-6) << interval;
    ASSERT_NEAR(state[3], independent.tractor, 1e-6) << interval;
    std::array<double, 2> tractor{};
    model->observe({.count = 1, .states = state.data(), .outputs = tractor.data()});
    ASSERT_NEAR(tractor[0], independent.rear.real(), 2e-6) << interval;
    ASSERT_NEAR(tractor[1], independent.rear.imag(), 2e-6) << interval;
    largest_articulation = std::max(largest_articulation, std::abs(state[3] - state[2]));
  }
  EXPECT_GT(largest_articulation, 0.2) << "a drive that bends the vehicle";
}

TEST_P(TractorTrailerWithoutSlip, TheTrailersAxleMovesAlongItsHeading) {
  const auto model = vehicle(GetParam(), "all");
  const std::array<double, 3> no_slip{1.0, 1.0, 1.0}, slip{0.8, 0.7, 0.6};
  const std::array<double, 2> inputs{2.0, 0.1};
  double drift_with_slip = 0.0;
  for (const double articulation : {-1.2, -0.3, 0.0, 0.5, 1.4}) {
    for (const double steering : {-0.5, 0.0, 0.3}) {
      const State state{1.0, 2.0, 0.7, 0.7 + articulation, steering};
      State rates{};
      const auto across = [&] { return -std::sin(state[2]) * rates[0] + std::cos(state[2]) * rates[1]; };
      model->rates(state.data(), inputs.data(), no_slip.data(), rates.data());
      EXPECT_NEAR(across(), 0.0, 1e-14);
      model->rates(state.data(), inputs.data(), slip.data(), rates.data());
      drift_with_slip = std::max(drift_with_slip, std::abs(across()));
    }
  }
  EXPECT_GT(drift_with_slip, 0.1) << "with slip it does not";
}

// The rates of both headings as published, for slip that is not 1.
TEST_P(TractorTrailerWithoutSlip, HeadingsTurnAsPublished) {
  const double l = GetParam(), mu = 0.8, kappa = 0.7, eta = 0.6, v = 2.5, delta = 0.3, beta = -0.45;
  const State state{0.0, 0.0, 0.2, 0.2 + beta, delta};
  const std::array<double, 2> inputs{v, 0.0};
  const std::array<double, 3> slip{mu, kappa, eta};
  State rates{};
  vehicle(l, "all")->rates(state.data(), inputs.data(), slip.data(), rates.data());
  EXPECT_NEAR(rates[3], mu * v * std::tan(kappa * delta) / tractor_length, 1e-14);
  EXPECT_NEAR(rates[2],
              mu * v / trailer_length *
                  (std::sin(eta * beta) - l / tractor_length * std::tan(kappa * delta) * std::cos(eta * beta)),
              1e-14);
}

INSTANTIATE_TEST_SUITE_P(Hitch, TractorTrailerWithoutSlip, ::testing::Values(1.1, 0.0, -0.6), [](const auto& found) {
  return found.param > 0.0 ? "Behind" : found.param < 0.0 ? "Ahead" : "AtTheAxle";
});

}  // namespace tractor_trailer_test
}  // namespace rhec
