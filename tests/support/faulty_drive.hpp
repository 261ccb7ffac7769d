#pragma once

// A vehicle that is driven on slipping ground while its sensors fail, and what an estimator makes of that.

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "rhec/plugins/robot/robot.hpp"

namespace rhec::testing {

/// What goes to the estimator at one sample, to be spoilt.
struct Delivery {
  int since = 0;                ///< samples since the fault began
  double stamp = 0.0;           ///< of measurements and inputs [s]
  double asked = 0.0;           ///< time of the question [s]
  std::vector<double> outputs;  ///< measured y
  std::vector<double> inputs;   ///< measured u of the interval that follows
  std::vector<double> sigmas;   ///< that measurements state, NaN: none
  bool has_outputs = true, has_inputs = true;
};

struct Fault {
  std::function<void(Delivery&)> spoil;  ///< while it lasts
  int length = 1;                        ///< samples
  double moved = 0.0;                    ///< by how much the world has moved from then on, along x [m]
  double slip = 0.0;                     ///< by how much the first parameter falls
  int slip_after = 0;                    ///< samples since the fault began
  bool is_hurried = false;               ///< deadlines have passed already, from its begin on
};

/// What is seen from the first sample of the fault on.
struct Episode {
  struct Sample {
    double error = 0.0;  ///< of the position, in the world as it is from the fault on [m]
    bool inside = true;  ///< whether the position is within three standard deviations of the estimate
    HealthLevel health = HealthLevel::ok;
    std::string words = {};   ///< the health's
    double slip_error = 0.0;  ///< of the first parameter
    double slip_sigma = 0.0;  ///< and its standard deviation
  };
  std::vector<Sample> before, during, after;
  Estimator::Counts counts;
  bool is_finite = true;

  double largest_error_during() const;
  /// Samples after the fault's end from which on the error stays below a limit [m].
  int samples_to_recover(double limit) const;
  /// Share of the samples during and after the fault that are inside, or whose health is not ok.
  double honest_share() const;
  /// Samples after the fault's end from which on the health stays ok.
  int samples_to_ok() const;
};

/// Drives a robot open-loop along bends, at a step of `robot.step()`: a steered one at 2 to 8 m/s, one that turns by
/// the wheels of its sides at 0.5 to 2 m/s.
Episode drive_with_fault(const Robot& robot, const Fault& fault, std::uint64_t seed, int samples_after = 120);

}  // namespace rhec::testing
