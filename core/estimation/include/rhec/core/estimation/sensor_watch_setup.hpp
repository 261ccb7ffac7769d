#pragma once

#include <vector>

#include <Eigen/Core>

#include "rhec/core/estimation/kalman_filter.hpp"

namespace rhec {

/// What a SensorWatch is made of.
struct SensorWatchSetup {
  KalmanFilter::Noise noise;
  std::vector<double> walk;              ///< n_p, standard deviation per square root of a step
  std::vector<double> parameter_sigmas;  ///< n_p, of slip of which nothing is known
  /// Of [x; p] at the start; empty: a position that is far from there is taken as it is.
  Eigen::VectorXd initial_mean = {};
  Eigen::MatrixXd initial_covariance = {};
  bool has_ramps = false;      ///< as in FilterEstimation::Setup
  double step = 0.2;           ///< [s]
  int substeps = 1;            ///< of a step
  double gate = 5.0;           ///< innovations less probable than this many standard deviations are rejected
  int proof = 11;              ///< samples that a sensor must have moved for before the estimate follows
  int slip_proof = 2;          ///< samples that a jump of slip must explain
  int gap_proof = 3;           ///< like `proof`, of a sensor that had said nothing for some time
  int calm = 5;                ///< samples without a finding after which health is ok again
  int calm_after_moving = 10;  ///< the same of a sensor that was followed: a transient that ends is still doubted
  bool offsets = true;         ///< whether sensors that are off by little for long are found and corrected
  bool whiteness = true;       ///< whether covariances are larger where innovations are correlated
  double lost_position = 3.0;  ///< standard deviation above which the vehicle is lost [m]
  double lost_heading = 0.5;   ///< likewise [rad]
};

}  // namespace rhec
