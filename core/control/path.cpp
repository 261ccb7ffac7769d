#include "rhec/core/control/path.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "rhec/core/base/error.hpp"

namespace rhec {
namespace {

// Waypoints closer than this are one point: the heading of so short a segment is meaningless.
constexpr double smallest_segment = 1e-9;  // [m]
// Number of segments to step along before a binary search.
constexpr int near = 32;

void check(const Waypoint& waypoint, std::size_t number) {
  if (std::isfinite(waypoint.x) && std::isfinite(waypoint.y) && std::isfinite(waypoint.speed)) return;
  throw Error(
      fmt::format("path: waypoint {} holds a value that is not finite; x, y and speed must be numbers", number));
}

}  // namespace

Path::Path(const std::vector<Waypoint>& waypoints) {
  for (auto* of : {&x_, &y_, &speeds_, &arc_lengths_, &direction_x_, &direction_y_, &headings_})
    of->reserve(waypoints.size());
  for (std::size_t i = 0; i < waypoints.size(); ++i) {
    const Waypoint& waypoint = waypoints[i];
    check(waypoint, i + 1);
    double arc_length = 0.0;
    if (!x_.empty()) {
      const double dx = waypoint.x - x_.back(), dy = waypoint.y - y_.back();
      const double step = std::hypot(dx, dy);
      if (step < smallest_segment) continue;
      arc_length = arc_lengths_.back() + step;
      direction_x_.push_back(dx / step);
      direction_y_.push_back(dy / step);
      headings_.push_back(std::atan2(direction_y_.back(), direction_x_.back()));
    }
    x_.push_back(waypoint.x);
    y_.push_back(waypoint.y);
    speeds_.push_back(waypoint.speed);
    arc_lengths_.push_back(arc_length);
  }
  if (x_.size() < 2) {
    throw Error(fmt::format("path: {} distinct waypoint(s) among the {} given; a path needs at least 2", x_.size(),
                            waypoints.size()));
  }
}

int Path::segment_at(double arc_length) const noexcept {
  // The first and the last waypoint are not searched, so that the end segments extend beyond the ends.
  const auto after = std::upper_bound(arc_lengths_.begin() + 1, arc_lengths_.end() - 1, arc_length);
  return static_cast<int>(after - arc_lengths_.begin()) - 1;
}

/// The same by a few steps from the segment expected if all segments were as long as the nearby one.
int Path::segment_near(int known, double arc_length) const noexcept {
  const int last = size() - 2;
  known = std::clamp(known, 0, last);
  const double on = (arc_length - arc_lengths_[known]) / (arc_lengths_[known + 1] - arc_lengths_[known]);
  int i = static_cast<int>(std::min(std::max(0.0, known + on), static_cast<double>(last))), steps = near;
  while (steps > 0 && i < last && arc_lengths_[i + 1] <= arc_length) ++i, --steps;
  while (steps > 0 && i > 0 && arc_lengths_[i] > arc_length) --i, --steps;
  return steps > 0 ? i : segment_at(arc_length);
}

PathPoint Path::point_on(int i, double arc_length) const noexcept {
  const double along = arc_length - arc_lengths_[i];
  const double fraction = std::clamp(along / (arc_lengths_[i + 1] - arc_lengths_[i]), 0.0, 1.0);
  return {.x = x_[i] + along * direction_x_[i],
          .y = y_[i] + along * direction_y_[i],
          .heading = headings_[i],
          .speed = (1.0 - fraction) * speeds_[i] + fraction * speeds_[i + 1]};
}

double Path::top_speed() const noexcept { return *std::max_element(speeds_.begin(), speeds_.end()); }

PathPoint Path::point_at(double arc_length) const noexcept { return point_on(segment_at(arc_length), arc_length); }

PathPoint Path::point_at(double arc_length, int& segment) const noexcept {
  segment = segment_near(segment, arc_length);
  return point_on(segment, arc_length);
}

PathProjection Path::closest(double x, double y, double from, double to) const noexcept {
  struct Nearest {
    double along, off_x, off_y, square;
  };
  const int last = size() - 2;
  const double evenly = from / length() * (last + 1);  // the segment if all were of equal length
  const int first = segment_near(static_cast<int>(std::min(std::max(0.0, evenly), static_cast<double>(last))), from);
  const auto nearest_on = [&](int i) -> Nearest {
    // The part of this segment within the range, as distances from the segment's start.
    const double begin = from - arc_lengths_[i];
    const double end = i == last ? to - arc_lengths_[i] : std::min(to, arc_lengths_[i + 1]) - arc_lengths_[i];
    const double dx = x - x_[i], dy = y - y_[i];
    const double along =
        std::clamp(dx * direction_x_[i] + dy * direction_y_[i], i == 0 ? begin : std::max(begin, 0.0), end);
    const double off_x = dx - along * direction_x_[i], off_y = dy - along * direction_y_[i];
    return {along, off_x, off_y, off_x * off_x + off_y * off_y};
  };
  // Upper bound on the smallest distance: that of a point about as far along as the position is away, which is close to
  // the best one unless the path winds.
  double at_most = std::sqrt(nearest_on(first).square);
  const double ahead = std::min(at_most * (last + 1) / length(), static_cast<double>(last - first));
  if (const int guess = first + static_cast<int>(ahead); arc_lengths_[guess] <= to)
    at_most = std::min(at_most, std::sqrt(nearest_on(guess).square));

  PathProjection best{.arc_length = from};
  double best_square = std::numeric_limits<double>::infinity();
  for (int i = first; i <= last; ++i) {
    const auto [along, off_x, off_y, square] = nearest_on(i);
    const double distance = std::sqrt(square);
    if (square < best_square) {
      best_square = square;
      const double left = direction_x_[i] * off_y - direction_y_[i] * off_x;
      best = {.arc_length = arc_lengths_[i] + along, .lateral = std::copysign(distance, left)};
      at_most = std::min(at_most, distance);
    }
    if (to <= arc_lengths_[i + 1]) break;
    // The distance to the path changes by at most the arc length travelled: skip segments that cannot come closer than
    // the best point so far.
    const double reach = std::min(arc_lengths_[i + 1] + distance - at_most - smallest_segment, to);
    while (i + 1 < last && arc_lengths_[i + 2] < reach) ++i;
  }
  return best;
}

PathFollower::PathFollower(const Path& path, Window window) : path_(&path), window_(window) {
  if (!(std::isfinite(window.ahead) && window.ahead > 0.0 && std::isfinite(window.behind) && window.behind >= 0.0)) {
    throw Error(
        fmt::format("path follower: the search window is {} m ahead and {} m behind; expected ahead > 0 (more than "
                    "the vehicle travels in one step) and behind >= 0",
                    window.ahead, window.behind));
  }
}

double PathFollower::advance(double x, double y) noexcept {
  if (!std::isfinite(x) || !std::isfinite(y)) return last_.arc_length;
  const double from = std::max(0.0, last_.arc_length - window_.behind);
  last_ = path_->closest(x, y, from, std::max(from, last_.arc_length + window_.ahead));
  return last_.arc_length;
}

}  // namespace rhec
