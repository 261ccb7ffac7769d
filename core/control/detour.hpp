#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "approach.hpp"
#include "detour_way.hpp"
#include "multi_point_turn.hpp"
#include "retreat.hpp"

namespace rhec {

/// How the controller brings a vehicle that stands on its way again: what it drives in place of the path, and for how
/// long it has waited for that.
struct Detour {
  /// A vehicle turns around on arcs that are wider than the tightest by this factor, so that it can correct what it
  /// does.
  static constexpr double arc_margin = 1.15;

  Approach approach;
  MultiPointTurn turn;
  Retreat retreat;
  // For how long plans began with standing, the vehicle has stood, had when a way was last looked for, and has not
  // moved on on one [s].
  double rested = 0.0, standing = 0.0, searched = 0.0, stalled = 0.0;
  double margin = arc_margin;   ///< of arcs to turn around on, over the tightest
  int turns = 0, retreats = 0;  ///< turns in several moves, and ways back, that have begun since one has helped
  // Where on the path the vehicle is farther on than before the last of them [m], and with what least heading error one
  // has begun [rad]: beyond either it has helped.
  double regained = 0.0, least_off = std::numbers::pi;
  std::vector<double> excess_now, excess_ahead;  ///< over limits of terms: of the vehicle, and on a way back
  std::vector<double> undisturbed;               ///< n_x, at the end of a drive straight ahead
  double beyond_now = 0.0;                       ///< of the vehicle, over the path's room [m]

  /// Another one begins.
  void note_place(double heading_error, double farther_on) noexcept {
    least_off = std::min(least_off, std::abs(heading_error));
    regained = farther_on;
  }
  /// The way that is being driven, of which there is one at most; null: none.
  DetourWay* way() noexcept {
    for (DetourWay* each :
         {static_cast<DetourWay*>(&approach), static_cast<DetourWay*>(&turn), static_cast<DetourWay*>(&retreat)})
      if (each->is_under_way()) return each;
    return nullptr;
  }
  void forget() noexcept {
    if (DetourWay* const driven = way()) driven->end();
    margin = arc_margin;
    rested = standing = searched = stalled = 0.0;
    turns = retreats = 0;
    regained = 0.0;
    least_off = std::numbers::pi;
  }
};

}  // namespace rhec
