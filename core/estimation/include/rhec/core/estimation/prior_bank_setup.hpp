#pragma once

#include <limits>
#include <memory>
#include <vector>

#include "rhec/core/estimation/scaled_output.hpp"
#include "rhec/core/horizon/rhe_problem.hpp"
#include "rhec/core/place/slip_map.hpp"
#include "rhec/core/prior/standard_bank.hpp"

namespace rhec {

/// How a parameter differs from what a map says of a place: an Ornstein-Uhlenbeck process along the way.
struct MapDeviation {
  double length = 5.0;     ///< over which the difference is forgotten [m]
  double inflation = 1.0;  ///< of the map's standard deviation
  double least = 0.0;      ///< standard deviation that the map has at least
};

/// An interval, as far as processes depend on it.
struct ProcessInterval {
  double duration = 0.0, distance = 0.0;  ///< [s, m]
  bool ends_with_jump = false;            ///< as in MeasuredInterval
  bool operator==(const ProcessInterval&) const = default;
};

/// What a PriorBank is made of.
struct PriorBankSetup {
  std::vector<PriorCombination> members;
  std::vector<double> output_variances;  ///< n_y
  std::vector<double> input_variances;   ///< n_u, of measured inputs
  int substeps = 1;
  /// What else is known of the parameters at the start (n_p, or none): it is fused with the starts of the processes
  /// as a measurement would be. An infinite variance: nothing.
  struct Knowledge {
    double mean = 0.0, variance = std::numeric_limits<double>::infinity();
  };
  std::vector<Knowledge> initial_parameters;
  double memory = 40.0;  ///< ground after which another law may hold [m]: exp(-d / memory) is the share that stays
  double least_speed = 0.025;      ///< a vehicle that stands counts as creeping at this speed [m/s]
  std::vector<RobustLoss> robust;  ///< as in a window; each weighs its group's outputs by their innovations
  /// Whether the variances of outputs are learnt from the residuals, and how far standard deviations may go from the
  /// stated ones, up and down.
  bool adapts_noise = false;
  double most_noise_change = 5.0;
  /// Of a bank that follows a map, where that knows something: how far a parameter is from the map, by member and
  /// parameter. Elsewhere the members' priors hold. See `follow_map`.
  std::shared_ptr<const SlipMap> map;
  std::vector<std::vector<MapDeviation>> deviations;
  int most_between = 0;  ///< measurements that an interval can have between its nodes
  /// Outputs of motion, ascending: an interval is linearised where its measurements of these put it, as by a
  /// KalmanFilter.
  std::vector<int> motion_outputs = {};
  std::vector<ScaledOutput> scaled_outputs = {};  ///< as of a KalmanFilter
  double gate = 16.0;  ///< largest squared innovation, in variances, by which one output changes the weights
};

}  // namespace rhec
