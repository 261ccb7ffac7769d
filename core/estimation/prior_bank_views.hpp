#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <vector>

#include "prior_bank_filters.hpp"
#include "rhec/core/base/aligned.hpp"
#include "rhec/core/estimation/curvature.hpp"
#include "rhec/core/estimation/kalman_filter.hpp"
#include "rhec/core/kernels/bank_kernels.hpp"

#include "excitation.hpp"

namespace rhec {

/// Of a parameter.
struct PriorBank::Filters::Process {
  int first = 0, count = 0;  ///< entries of [x; z]: all states that any of its priors has
  /// Per kind of state: its place among them, or -1, and the variance with which a member that lacks it is filled up.
  std::array<int, process_state_kinds> place{};
  std::array<double, process_state_kinds> filler{};
  std::vector<const Prior*> kinds;  ///< the different priors of this parameter
  std::vector<int> kind_of;         ///< per member
  AlignedDoubles F, Q, ramp;        ///< lanes
  /// Lanes; beside outputs of motion: of how far a ramp is from the parameter at the share s of the interval, the
  /// variance over s (1 - s). 0 where the parameter is held.
  AlignedDoubles off_course;
  AlignedDoubles offset;  ///< lanes; of the value, where a map is followed
};

/// What outputs of motion ask for: a filter on the mixture's [x; p], and the way to where an interval is linearised.
struct PriorBank::Filters::LookAhead {
  KalmanFilter mixture;
  Excitation excitation;            ///< of slip: what it keeps stands behind the noise in `learnt_`
  std::vector<int> curved_outputs;  ///< of motion
  Curvature output_curvature = {};  ///< of these, by the state
  AlignedDoubles next_point = {}, moved = {}, trial_mean = {}, trial_covariance = {};  ///< of the wide vector
  std::vector<double> ramp_variances = {};
  std::vector<double> shares = {};  ///< of the interval, at its measurements
  std::vector<double> part = {};    ///< n_y: some of the outputs of a time
  AlignedDoubles surprises = {};    ///< n_y, lanes
  Measured end_outputs = {};        ///< of the interval
  AlignedDoubles kept_rows = {};    ///< lanes, of scaled outputs: value and derivatives
  /// Raises the variances of outputs of motion (n_y, lanes) whose innovations are far larger than expected.
  void bound_surprises(const BankView& view, const Views& views, const double* y,
                       const std::vector<int>& motion_outputs, double* variances) noexcept;
  /// Whether an output is measured again on the interval after measurement number `which`, or at its end.
  static bool is_measured_later(const MeasuredInterval& interval, int which, std::ptrdiff_t output_count, int output,
                                Measured end_outputs) noexcept {
    for (int k = which + 1; k < interval.between; ++k)
      if (!std::isnan(interval.outputs[k * output_count + output])) return true;
    return end_outputs && !std::isnan(end_outputs[output]);
  }
};

/// What the kernels are given.
struct PriorBank::Filters::Views {
  std::vector<BankProcess> processes;
  std::vector<BankOutput> outputs;  ///< room for n_y
  int taken = 0;                    ///< of them
  void add(const Variable& output, const double* predicted, const double* gradient, const double* variance,
           double measured) noexcept {
    outputs[taken++] = {predicted, gradient, variance, measured, output.is_angle ? 2.0 * std::numbers::pi : 0.0};
  }
};

/// The bank, or the wider vector that it is within an interval, with the outputs' gradients.
struct PriorBank::Filters::Frame {
  BankView view;
  double* gradient;  ///< n_y x view.vehicle_states, lanes
  /// Means before: entry e of lane m is at e * before_entry + m * before_lane.
  const double* before;
  std::ptrdiff_t before_entry, before_lane;
  bool is_between = true;           ///< the outputs are of a time between two nodes
  const double* weights = nullptr;  ///< n_y: how many measurements of usual accuracy each stands for; null: one
  bool tells_laws = true;           ///< whether the outputs weigh the members
};

}  // namespace rhec
