#pragma once

#include "sequences.hpp"

namespace rhec::bench {

/// How the blocks of a synthetic estimation lie.
enum class Blocks {
  moving,  ///< their starts are fixed in time, so that they move through the window from sample to sample
  fixed    ///< as many starts, at the same places of every window
};

/// Windows of any length over one long synthetic drive of bicycle_slip, winding about on ground whose slip varies, with
/// noisy measurements; the guess is the true drive. Kappa starts a block every `block` intervals, linked to the one
/// before; mu has one value.
Sequence long_estimation(const Host& host, int intervals, int samples, int block, Blocks blocks);

/// Windows of any length over that drive as a reference, from states that are a little off it.
Sequence long_control(const Host& host, int intervals, int samples);

}  // namespace rhec::bench
