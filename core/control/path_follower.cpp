#include "rhec/core/control/path_follower.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "rhec/core/base/error.hpp"

namespace rhec {

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
  last_ = {.arc_length = arc_length};
  section_ = 0;
  while (section_ + 1 < path_->section_count() && arc_length >= path_->section_end(section_)) ++section_;
  is_finished_ = false;
}

void PathFollower::project(double x, double y) noexcept {
  const double from = std::max(path_->section_start(section_), last_.arc_length - window_.behind);
  double to = std::max(from, last_.arc_length + window_.ahead);
  if (section_ + 1 < path_->section_count()) to = std::min(to, path_->section_end(section_));
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
  is_finished_ =
      last_.arc_length >= path_->length() || (other.is_finished_ && path_->stops_after(path_->section_count() - 1));
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
