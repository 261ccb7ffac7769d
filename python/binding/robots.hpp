#pragma once

#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "rhec/plugins/robot/robot.hpp"
#include "rhec/sim/maps/map_keeper.hpp"

namespace rhec::python {

/// Estimator, controller and what they are made of belong to objects of their own, which keep what they refer to. One
/// thread uses an object at a time; others wait.
struct RobotObject {
  explicit RobotObject(const Robot& made) : robot(made) {}
  Robot robot;
};

struct EstimatorObject {
  std::shared_ptr<const RobotObject> robot;
  std::shared_ptr<sim::MapKeeper> keeper;
  std::unique_ptr<Estimator> estimator;
  std::mutex mutex;
};

}  // namespace rhec::python
