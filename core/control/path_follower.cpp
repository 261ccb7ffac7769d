#include "rhec/core/control/path_follower.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "rhec/core/base/error.hpp"

namespace rhec {
namespace {

// A place is further on the path, and no other pass of the last one, if it is this share of the way to it apart from
// that. So it is on both sides of the sharpest turn that a path may have (Path::why_not_drivable): the sine of 15
// degrees.
constexpr double apart = 0.25;
// Another pass counts as progress only where it is nearer by this share of how far the way to it leads away: a lap has
// the same distance as the one before, and a vehicle that has left out a loop gets on (docs/method.md, section 3).
constexpr double gain = 0.75;
// The way is looked at in steps of this share of how far the position is from the last place, and in no more than this
// many for a whole window.
constexpr double step_share = 0.25;
constexpr int most_steps = 256;

/// How far from an arc length, in the direction of a step, the stretch of the path goes on that the vehicle may have
/// come to: no further than `limit` [m], and not to another pass of the same place.
double reach(const Path& path, double arc_length, double x, double y, double step, double limit) noexcept {
  struct Place {
    double way, x, y, distance;
  };
  int segment = 0;
  const auto place_at = [&](double way) -> Place {
    const PathPoint point = path.point_at(arc_length + std::copysign(way, step), segment);
    return {way, point.x, point.y, std::hypot(x - point.x, y - point.y)};
  };
  Place nearest = place_at(0.0), last = nearest;
  double farthest = nearest.distance;  // since the nearest one
  double border = 0.0;
  bool is_leaving = true;  // the stretch of the nearest one has not come to its end
  while (last.way < limit) {
    const Place place = place_at(std::min(last.way + std::abs(step), limit));
    const double way = place.way - nearest.way, hill = std::max(farthest, place.distance) - nearest.distance;
    // Nowhere else, however near, is progress any more.
    if (nearest.distance < gain * hill && 2.0 * nearest.distance < apart * way) {
      if (is_leaving) border = place.way;
      break;
    }
    const bool is_further =
        place.distance < nearest.distance && (nearest.distance - place.distance >= gain * hill ||
                                              std::hypot(place.x - nearest.x, place.y - nearest.y) >= apart * way);
    if (is_further) {
      nearest = place;
      farthest = place.distance;
      border = place.way;
      is_leaving = true;
    } else {
      farthest = std::max(farthest, place.distance);
      is_leaving = is_leaving && place.distance >= last.distance;
      if (is_leaving) border = place.way;
    }
    last = place;
  }
  return border;
}

}  // namespace

PathFollower::PathFollower(const Path& path, Window window) : path_(&path), window_(window) {
  if (!(std::isfinite(window.ahead) && window.ahead > 0.0 && std::isfinite(window.behind) && window.behind >= 0.0)) {
    throw Error(
        fmt::format("path follower: the search window is {} m ahead and {} m behind; expected ahead > 0 (more than "
                    "the vehicle travels in one step) and behind >= 0",
                    window.ahead, window.behind));
  }
  if (!(window.stop_distance >= 0.0 && window.stop_time >= 0.0))
    throw Error(fmt::format("path follower: stops are reached within {} m or {} s; expected 0 or more",
                            window.stop_distance, window.stop_time));
}

void PathFollower::reset(double arc_length) noexcept {
  arc_length = std::min(std::max(arc_length, 0.0), path_->length());
  last_ = {.arc_length = arc_length};
  section_ = 0;
  while (section_ + 1 < path_->section_count() && arc_length >= path_->section_end(section_)) ++section_;
  is_finished_ = false;
}

void PathFollower::project(double x, double y) noexcept {
  double from = std::max(path_->section_start(section_), last_.arc_length - window_.behind);
  double to = std::max(from, last_.arc_length + window_.ahead);
  if (section_ + 1 < path_->section_count()) to = std::min(to, path_->section_end(section_));
  // The window may hold several passes of the same place. Progress is continuous: the vehicle is on that of the last
  // place.
  const double last = std::min(std::max(from, last_.arc_length), to);
  const PathPoint place = path_->point_at(last);
  const double moved = std::hypot(x - place.x, y - place.y);
  const double step = std::max(step_share * moved, (window_.ahead + window_.behind) / most_steps);
  // Beyond its end the path goes straight on, which is no other pass of any place.
  const double end = std::min(to, path_->length());
  const double ahead = last + reach(*path_, last, x, y, step, end - last);
  if (ahead < end) to = ahead;
  from = last - reach(*path_, last, x, y, -step, last - from);
  last_ = path_->closest(x, y, from, to);
}

bool PathFollower::has_reached_stop() const noexcept {
  if (!path_->stops_after(section_)) return false;
  return path_->section_end(section_) - last_.arc_length <= window_.stop_distance ||
         path_->time_to_section_end(last_.arc_length, section_) <= window_.stop_time;
}

double PathFollower::advance(double x, double y) noexcept {
  if (!std::isfinite(x) || !std::isfinite(y)) return last_.arc_length;
  project(x, y);
  const bool is_last = section_ + 1 == path_->section_count();
  const bool has_reached = has_reached_stop();
  if (has_reached && !is_last) {
    last_.arc_length = path_->section_start(++section_);
    project(x, y);
  }
  is_finished_ = last_.arc_length >= path_->length() || (has_reached && is_last);
  return last_.arc_length;
}

double PathFollower::advance_with(const PathFollower& other, double x, double y) noexcept {
  if (!std::isfinite(x) || !std::isfinite(y)) return last_.arc_length;
  if (other.section_ != section_) {
    section_ = other.section_;
    last_.arc_length = path_->section_start(section_);
  }
  project(x, y);
  is_finished_ = last_.arc_length >= path_->length();
  return last_.arc_length;
}

void PathFollower::locate(double x, double y, double heading) noexcept {
  if (!std::isfinite(x) || !std::isfinite(y)) return;
  const Path::Place place = path_->locate(x, y, heading, window_.place);
  section_ = place.section;
  last_ = {.arc_length = place.arc_length};
  is_finished_ = false;
}

}  // namespace rhec
