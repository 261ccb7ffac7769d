#pragma once

#include <string>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/core/base/infinity.hpp"
#include "rhec/sim/loop/scenario.hpp"
#include "rhec/sim/problems/recording_solver.hpp"
#include "rhec/sim/world/actuators.hpp"
#include "rhec/sim/world/deliveries.hpp"
#include "rhec/sim/world/faults.hpp"
#include "rhec/sim/world/sensor_schedule.hpp"
#include "rhec/sim/world/truth.hpp"

namespace rhec::sim {

/// The noise with which the sensors of a robot measure, as its configuration states it.
RHEC_EXPORT SensorNoise noise_of(const Robot& robot);

/// The world of a closed loop: the true vehicle with its actuators, its sensors, what goes wrong with them, and the way
/// of what they measure to the estimator.
class RHEC_EXPORT LoopWorld {
 public:
  LoopWorld(const Scenario& scenario, const SensorNoise& noise);

  const TruthVehicle& truth() const noexcept { return truth_; }
  const Sensors& sensors() const noexcept { return sensors_; }
  /// The sensors that are due measure, at a sample of the loop.
  void measure(double time) { measure(time, true); }
  /// Hands out what has arrived by now: take(stamp, outputs). What is measured before the vehicle moves arrives at
  /// once: a drive begins with an estimate.
  template <class Take>
  void deliver(double time, const Take& take) {
    const bool is_first = !has_moved_;
    bool has_arrived = false;
    deliveries_.deliver(is_first ? infinity : time, [&](double stamp, const std::vector<double>& outputs) {
      take(stamp, outputs.data());
      has_arrived = true;
    });
    if (is_first && !has_arrived) take(on_robots_clock(time), outputs_.data());
  }
  /// Drives for `duration` with constant inputs; sensors with a rate of their own measure on the way.
  void drive(const std::vector<double>& inputs, double time, double duration);
  /// The inputs as they are measured.
  const std::vector<double>& measured_inputs(const std::vector<double>& inputs);
  /// Now, by the robot's clock [s].
  double on_robots_clock(double time) const { return time + faults_.clock(); }
  /// What has gone wrong since the last call; empty: nothing.
  std::string take_faults() { return faults_.take_names(); }
  /// By output, what faults added to the values measured last; NaN of one that was not measured, or whose value a fault
  /// took away.
  const std::vector<double>& added() const noexcept { return added_; }

 private:
  void measure(double time, bool is_sample);

  TruthVehicle truth_;
  Sensors sensors_;
  Faults faults_;
  SensorSchedule schedule_;
  Actuators actuators_;
  Deliveries deliveries_;
  bool has_moved_ = false;
  bool is_plain_;  ///< all sensors measure at each sample, and arrive together
  std::vector<double> outputs_, row_, added_, measured_, given_;
};

}  // namespace rhec::sim
