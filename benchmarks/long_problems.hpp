#pragma once

#include "sequences.hpp"

namespace rhec::bench {

/// Where the blocks of a synthetic estimation start.
enum class Blocks {
  moving,  ///< at fixed times, so the starts move through the window from sample to sample
  fixed    ///< as many starts, at the same intervals of every window
};

/// Estimation windows of any length over one long, winding synthetic drive of bicycle_slip on ground of varying slip,
/// with noisy measurements; the guess is the true drive. A block of kappa starts every `block` intervals, linked to the
/// block before; mu has one value.
Sequence long_estimation(const Host& host, int intervals, int samples, int block, Blocks blocks);

/// Control horizons of any length with that drive as the reference, from states slightly off it.
Sequence long_control(const Host& host, int intervals, int samples);

}  // namespace rhec::bench
