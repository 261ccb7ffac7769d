// A robot in its control loop. The model itself, on slipping ground, stands in for the vehicle.
#include <cmath>
#include <cstdio>

#include "rhec/plugins/robot/robot.hpp"

int main(int count, char** words) try {
  if (count != 2) throw rhec::Error("expected one argument, a file such as robot.yaml");
  const rhec::Host host;  // finds plugins in RHEC_PLUGIN_PATH, then the installed ones
  const rhec::Robot robot = rhec::Robot::from_file(host, words[1]);
  const rhec::Model& model = *robot.model();
  std::vector<rhec::Waypoint> line;  // x, y [m], 2 m/s
  for (int i = 0; i <= 40; ++i) line.push_back({0.5 * i, std::sin(0.25 * i), 2.0});
  const auto estimator = robot.make_estimator();
  const auto controller = robot.make_controller(rhec::Path(line));

  std::vector<double> state(4, 0.0), next(4), outputs(3), slip{0.7, 0.9};
  const double step = robot.step();
  for (double time = 0.0; !controller->finished() && time < 60.0; time += step) {
    model.observe({.count = 1, .states = state.data(), .outputs = outputs.data()});  // your sensors
    estimator->push_measurement(time, outputs.data());
    const auto deadline = robot.deadline();  // one step from now
    const rhec::Estimate& now = estimator->estimate(time, deadline);
    const std::vector<double>& inputs = controller->control(now, deadline).inputs;
    std::printf("%4.1f s  x %6.2f m  y %5.2f m  kappa %.3f\n", time, now.state[0], now.state[1], now.parameters[0]);

    model.integrate({.count = 1,  // your actuators
                     .states = state.data(),
                     .inputs = inputs.data(),
                     .parameters = slip.data(),
                     .durations = &step,
                     .next_states = next.data()});
    state.swap(next);
    estimator->push_input(time, inputs.data());  // applied from `time` on
    estimator->prepare();                        // work that does not need the next sample
    controller->prepare();
  }
  return controller->finished() ? 0 : 1;
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
