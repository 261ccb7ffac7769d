#pragma once

#include <vector>

#include "rhec/core/horizon/rhe_problem.hpp"

namespace rhec {

/// The poses of a track, from what the model says of each interval by itself and from measured positions: a start for
/// estimating a whole log that does not depend on whether the track so far had found the right heading.
///
/// Around every node, the motions of the intervals nearby are chained to a piece of track, which is turned, stretched
/// and shifted to where it fits the positions measured along it best (least sum of distances, so that single wrong
/// positions do not matter). For a plane that has a closed solution: with points as complex numbers, minimise
/// sum w |a z + b - measured|^2 over a and b. Pieces are as long as they must be to tell the heading. Where too few
/// positions were measured, intervals are chained from the last pose that is known, and the gap is closed where
/// positions come again: its track is turned and stretched about its start, since a wrong heading there is what mostly
/// opens it.
///
/// Writes the poses (`states`, N + 1 rows) and, where a gap was stretched, the speeds (among `inputs`, N rows, or
/// states). `parameters` are those of the intervals. Nothing changes where the model has no pose, or no output that is
/// a position.
void align_track(const RheProblem& problem, std::vector<double>& states, std::vector<double>& inputs,
                 const std::vector<double>& parameters);

}  // namespace rhec
