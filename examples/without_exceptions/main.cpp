// A program without exceptions and without run-time types, as firmware often is, that drives a robot with rhec.
#include <cmath>
#include <cstdio>

#include "drive_loop.hpp"

int main(int count, char** words) {
  if (count != 2) {
    std::fprintf(stderr, "expected one argument, a file such as robot.yaml\n");
    return 2;
  }
  DriveLoop::Waypoint path[41];
  for (int i = 0; i <= 40; ++i) path[i] = {0.5 * i, std::sin(0.25 * i), 2.0};
  DriveLoop loop;
  if (!loop.set_up(words[1], path, 41)) {
    std::fprintf(stderr, "%s\n", loop.problem());
    return 1;
  }
  // A bicycle whose wheels move it by 0.7 of what they turn stands in for the vehicle.
  double x = 0.0, y = 0.0, heading = 0.0, steering = 0.0;
  const double step = loop.step(), wheelbase = 1.4, antenna = 0.4, slip = 0.7;
  for (double time = 0.0; !loop.finished() && time < 60.0; time += step) {
    const double outputs[] = {x - antenna * std::cos(heading), y - antenna * std::sin(heading), steering};
    loop.measure(time, outputs);
    const double* inputs = loop.inputs(time);
    std::printf("%4.1f s  x %6.2f m  y %5.2f m  kappa %.3f\n", time, x, y, loop.slip(0));
    for (int i = 0; i < 100; ++i) {
      const double part = step / 100.0, speed = slip * inputs[0];
      x += part * speed * std::cos(heading);
      y += part * speed * std::sin(heading);
      heading += part * speed / wheelbase * std::tan(steering);
      steering += part * inputs[1];
    }
    loop.prepare();
  }
  return loop.finished() && std::abs(loop.slip(0) - slip) < 0.05 ? 0 : 1;
}
