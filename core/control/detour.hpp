#pragma once

#include <vector>

#include "approach.hpp"
#include "retreat.hpp"

namespace rhec {

/// How the controller brings a vehicle that stands on its way again: what it drives in place of the path, and for how
/// long it has waited for that.
struct Detour {
  /// A vehicle turns around on arcs that are wider than the tightest by this factor, so that it can correct what it
  /// does.
  static constexpr double arc_margin = 1.15;

  Approach approach;
  Retreat retreat;
  // For how long plans began with standing, the vehicle has stood, had when a way was last looked for, and has not
  // moved on on one [s].
  double rested = 0.0, standing = 0.0, searched = 0.0, stalled = 0.0;
  double margin = arc_margin;                    ///< of arcs to turn around on, over the tightest
  int retreats = 0;                              ///< so far, without a way on along the path behind them
  std::vector<double> excess_now, excess_ahead;  ///< over limits of terms: of the vehicle, and on a way back
  double regained = 0.0;  ///< where on the path the vehicle is farther on than before the last retreat [m]

  bool is_under_way() const noexcept { return approach.is_under_way() || retreat.is_under_way(); }
  void forget() noexcept {
    approach.end();
    retreat.end();
    margin = arc_margin;
    rested = standing = searched = stalled = 0.0;
    retreats = 0;
    regained = 0.0;
  }
};

}  // namespace rhec
