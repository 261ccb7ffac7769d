#pragma once

#include <cstddef>
#include <vector>

#include "rhec/core/estimation/prior_bank.hpp"
#include "rhec/core/kernels/bank_kernels.hpp"

namespace rhec {

/// What the kernels are given.
struct PriorBank::Views {
  std::vector<BankProcess> processes;
  std::vector<BankOutput> outputs;
};

/// The bank, or the wider vector that it is within an interval, with the outputs' gradients.
struct PriorBank::Frame {
  BankView view;
  const double* gradient;  ///< n_y x view.vehicle_states, lanes
  /// Means before: entry e of lane m is at e * before_entry + m * before_lane.
  const double* before;
  std::ptrdiff_t before_entry, before_lane;
  bool is_between = true;  ///< the outputs are of a time between two nodes
};

}  // namespace rhec
