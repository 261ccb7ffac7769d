#include "drive_loop.hpp"

#include <cstdio>
#include <exception>
#include <optional>
#include <vector>

#include "rhec/plugins/robot/robot.hpp"

struct DriveLoop::Parts {
  Parts(const char* file, const Waypoint* path, int count) : robot(rhec::Robot::from_file(rhec::Host(), file)) {
    std::vector<rhec::Waypoint> waypoints;
    for (int i = 0; i < count; ++i) waypoints.push_back({path[i].x, path[i].y, path[i].speed});
    estimator = robot.make_estimator();
    controller = robot.make_controller(rhec::Path(waypoints));
  }
  rhec::Robot robot;
  std::unique_ptr<rhec::Estimator> estimator;
  std::unique_ptr<rhec::Controller> controller;
  const rhec::Estimate* estimate = nullptr;
};

DriveLoop::DriveLoop() noexcept = default;
DriveLoop::~DriveLoop() = default;

// All that can throw happens here, before the robot moves.
bool DriveLoop::set_up(const char* robot_file, const Waypoint* path, int count) noexcept {
  try {
    parts_ = std::make_unique<Parts>(robot_file, path, count);
    return true;
  } catch (const std::exception& error) {
    std::snprintf(problem_, sizeof problem_, "%s", error.what());
    return false;
  }
}

double DriveLoop::step() const noexcept { return parts_->robot.step(); }

void DriveLoop::measure(double time, const double* outputs) noexcept {
  parts_->estimator->push_measurement(time, outputs);
}

const double* DriveLoop::inputs(double time) noexcept {
  const auto deadline = parts_->robot.deadline();
  parts_->estimate = &parts_->estimator->estimate(time, deadline);
  const double* inputs = parts_->controller->control(*parts_->estimate, deadline).inputs.data();
  parts_->estimator->push_input(time, inputs);
  return inputs;
}

void DriveLoop::prepare() noexcept {
  parts_->estimator->prepare();
  parts_->controller->prepare();
}

bool DriveLoop::finished() const noexcept { return parts_->controller->finished(); }

double DriveLoop::slip(int parameter) const noexcept { return parts_->estimate->parameters[parameter]; }
