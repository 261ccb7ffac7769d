#pragma once

#include <vector>

#include "rhec/core/horizon/rhe_problem.hpp"

namespace rhec {

/// Poses of a track from the model's motion over each interval and from measured positions (docs/method.md, section 6):
/// an initial guess for estimating a whole log that does not depend on whether a causal estimate had found the right
/// heading.
///
/// Around every node, the motions of nearby intervals are chained to a piece of track, which is rotated, scaled and
/// shifted to fit the measured positions (least sum of distances, so that single outliers do not matter). In the plane
/// this has a closed solution: with points as complex numbers, minimise sum w |a z + b - measured|^2 over a and b.
/// Pieces are as long as needed to determine the heading. Where too few positions were measured, intervals are chained
/// from the last known pose, and the gap is closed where positions resume: its track is rotated and scaled about its
/// start, since a wrong heading there is the usual cause of the gap.
///
/// Writes the poses (`states`, N + 1 rows) and, if a gap was scaled, the speeds (among `inputs`, N rows, or states).
/// `parameters` are those of the intervals. `vehicle` is the problem's model, or the one inside of a ProcessModel; data
/// are taken from the problem. Does nothing if the model has no pose, or no output that is a position.
void align_track(const RheProblem& problem, const Model& vehicle, std::vector<double>& states,
                 std::vector<double>& inputs, const std::vector<double>& parameters);

}  // namespace rhec
