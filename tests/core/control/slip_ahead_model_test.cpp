#include "rhec/core/control/slip_ahead_model.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "rhec/core/base/aligned.hpp"
#include "rhec/core/base/padded.hpp"
#include "rhec/core/control/controller.hpp"
#include "rhec/plugins/robot/robot.hpp"
#include "rhec/plugins/yaml/yaml.hpp"

namespace rhec {
namespace slip_ahead_model_test {

const Host& host() {
  static const Host found;
  return found;
}

TEST(SlipAheadModel, AddsTheDataOfAnIntervalToItsParameters) {
  const std::shared_ptr<const Model> vehicle = host().make_model("bicycle_slip");
  const SlipAheadModel model(vehicle);
  ASSERT_EQ(model.data_count(), 2);
  const std::vector<double> states{0.0, 1.0, 0.3, 0.1, 2.0, 0.0, -0.2, 0.05}, inputs{2.0, 0.1, 3.0, -0.1},
      parameters{0.8, 0.9, 0.8, 0.9}, data{-0.1, 0.05, 0.1, -0.2}, sums{0.7, 0.95, 0.9, 0.7}, durations{0.2, 0.1};
  std::array<double, 8> next{}, expected{};
  std::array<double, std::size_t{2} * 4 * 8> jacobians{}, expected_jacobians{};
  model.integrate({.count = 2,
                   .states = states.data(),
                   .inputs = inputs.data(),
                   .parameters = parameters.data(),
                   .durations = durations.data(),
                   .data = data.data(),
                   .next_states = next.data(),
                   .jacobians = jacobians.data()});
  vehicle->integrate({.count = 2,
                      .states = states.data(),
                      .inputs = inputs.data(),
                      .parameters = sums.data(),
                      .durations = durations.data(),
                      .next_states = expected.data(),
                      .jacobians = expected_jacobians.data()});
  for (std::size_t i = 0; i < next.size(); ++i) EXPECT_NEAR(next[i], expected[i], 1e-12);
  for (std::size_t i = 0; i < jacobians.size(); ++i) EXPECT_NEAR(jacobians[i], expected_jacobians[i], 1e-12);
}

/// The vehicle's own rows say the same as rows that are put together from the dense form, on ramps too.
TEST(SlipAheadModel, HasTheRowsOfItsDenseForm) {
  for (const char* name : {"bicycle_slip", "tractor_trailer", "skid_steer"}) {
    const SlipAheadModel model(host().make_model(name));
    const int nx = model.state_count(), nu = model.input_count(), np = model.parameter_count();
    constexpr int count = 11;
    for (const bool ramp : {false, true}) {
      const int nz = nx + nu + (ramp ? 2 : 1) * np, row = padded(nz), next_row = padded(nx);
      AlignedDoubles z(static_cast<std::size_t>(count) * row), data(static_cast<std::size_t>(count) * np),
          durations(count, 0.2), costates(static_cast<std::size_t>(count) * next_row, 0.3),
          scratch(model.rows_scratch(count));
      for (std::size_t k = 0; k < z.size(); ++k) z[k] = 0.5 + 0.3 * std::sin(static_cast<double>(k));
      for (std::size_t k = 0; k < data.size(); ++k) data[k] = 0.2 * std::cos(static_cast<double>(k));
      const auto results = [&](bool own) {
        AlignedDoubles all(static_cast<std::size_t>(count) * (next_row + nx * row + nz * row));
        const IntervalRows request{.count = count,
                                   .z = z.data(),
                                   .z_step = row,
                                   .ramp = ramp,
                                   .durations = durations.data(),
                                   .data = data.data(),
                                   .next_states = all.data(),
                                   .next_step = next_row,
                                   .jacobians = all.data() + count * next_row,
                                   .jacobian_step = nx * row,
                                   .jacobian_row = row,
                                   .multipliers = costates.data(),
                                   .multiplier_step = next_row,
                                   .hessians = all.data() + count * (next_row + nx * row),
                                   .hessian_step = nz * row,
                                   .hessian_row = row,
                                   .scratch = scratch.data()};
        own ? model.integrate_rows(request) : model.Model::integrate_rows(request);
        return all;
      };
      const AlignedDoubles own = results(true), dense = results(false);
      for (std::size_t k = 0; k < own.size(); ++k)
        ASSERT_NEAR(own[k], dense[k], 1e-11) << name << ' ' << ramp << ' ' << k;
      EXPECT_GT(*std::max_element(own.begin(), own.end()), 0.1);
    }
  }
}

/// Along x; the ground is .8 up to 10 m, and .5 behind.
class Step final : public SlipAhead {
 public:
  void change(const double* here, const double* there, double, const double*, double* change) const noexcept override {
    change[0] = (there[0] > 10.0 ? 0.5 : 0.8) - (here[0] > 10.0 ? 0.5 : 0.8);
    change[1] = 0.0;
  }
};

TEST(SlipAhead, TheControllerTurnsTheWheelsFasterWhereTheyWillSlipMore) {
  const Robot robot(host(),
                    RobotOptions::table().parse(parse_yaml("{model: bicycle_slip, step: 0.2}", "test"), "robot"));
  const Path path({{0.0, 0.0, 2.0}, {100.0, 0.0, 2.0}});
  const auto plain = robot.make_controller(path), ahead = robot.make_controller(path, std::make_shared<Step>());
  Estimate estimate;
  estimate.state = Eigen::Vector4d(8.0, 0.0, 0.0, 0.0);
  estimate.parameters = Eigen::Vector2d(0.8, 1.0);
  for (int k = 0; k < 2; ++k) {
    plain->control(estimate);
    ahead->control(estimate);
  }
  // The reference point is 8 m on: 0.4 m an interval.
  EXPECT_NEAR(ahead->problem().input_reference(2)[0], 2.0 / 0.8, 1e-9);
  EXPECT_NEAR(ahead->problem().input_reference(8)[0], 2.0 / 0.5, 1e-9);
  EXPECT_NEAR(plain->problem().input_reference(8)[0], 2.0 / 0.8, 1e-9);
  // The plan keeps up with the reference over ground all the same.
  EXPECT_NEAR(ahead->plan().state(12)[0], 8.0 + 12 * 0.4, 0.05);
  EXPECT_GT(ahead->plan().control(9)[0], plain->plan().control(9)[0] + 1.0);
}

// Where slip is constant and known, a vehicle beside its path comes back to it: no offset stays, on a circle neither.
TEST(Controller, HasNoSteadyOffsetWhereSlipIsConstant) {
  const Robot robot(host(),
                    RobotOptions::table().parse(parse_yaml("{model: bicycle_slip, step: 0.2}", "test"), "robot"));
  const Model& model = *robot.model();
  for (const double radius : {1e9, 20.0}) {
    std::vector<Waypoint> points;
    for (int i = 0; i <= 2000; ++i) {
      const double s = 0.1 * i;
      points.push_back(
          {radius * std::sin(s / radius), radius > 1e6 ? 0.0 : radius * (1.0 - std::cos(s / radius)), 2.0});
    }
    const auto controller = robot.make_controller(Path(points));
    const std::vector<double> slip{0.6, 0.7};
    std::vector<double> state{0.0, 0.5, 0.0, 0.0}, next(4);
    const double step = 0.2;
    double last = 0.0;
    for (int k = 0; k < 300; ++k) {
      Estimate estimate;
      estimate.state = Eigen::Map<const Eigen::VectorXd>(state.data(), 4);
      estimate.parameters = Eigen::Map<const Eigen::VectorXd>(slip.data(), 2);
      const std::vector<double> inputs = controller->control(estimate).inputs;
      model.integrate({.count = 1,
                       .states = state.data(),
                       .inputs = inputs.data(),
                       .parameters = slip.data(),
                       .durations = &step,
                       .next_states = next.data()});
      state.swap(next);
      last = controller->follower().lateral();
    }
    EXPECT_LT(std::abs(last), 2e-3) << radius;
  }
}

}  // namespace slip_ahead_model_test
}  // namespace rhec
