#include "multi_point_turn.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "rhec/core/base/angle.hpp"

namespace rhec {
namespace {

// The vehicle's place is looked for this far ahead [radii].
constexpr double search_ahead = 0.5;
// A vehicle that looks away from its way by more than this [rad], or is farther from it than this [radii], has left it.
constexpr double farthest_off = 0.25 * std::numbers::pi, farthest_aside = 1.0;

}  // namespace

void MultiPointTurn::begin(const Begin& begin) noexcept {
  begin_ = begin;
  move_ = count_ = 0;
  done_ = wait_ = 0.0;
}

void MultiPointTurn::set_off() noexcept {
  move_ = 0;
  done_ = 0.0;
  wait_ = wait_of(0);
}

bool MultiPointTurn::add(double angle) noexcept {
  if (count_ == most_moves || !(angle > 0.0)) return false;
  const TurningCircle& turn = turn_of(count_);
  if (!(turn.radius > 0.0) || !std::isfinite(turn.radius) || !(turn.speed > 0.0)) return false;
  const auto at = static_cast<std::size_t>(count_);
  starts_[at] = begin_.vehicle;
  if (count_ > 0) {
    starts_[at] = pose_at(count_ - 1, length());
    if (is_reverse(count_ - 1)) starts_[at].direction -= std::numbers::pi;
  }
  done_ = length();
  ends_[at] = done_ + angle * turn.radius;
  move_ = count_++;
  return true;
}

void MultiPointTurn::end_last_at(double arc_length) noexcept {
  double& end = ends_[static_cast<std::size_t>(count_ - 1)];
  end = std::min(std::max(arc_length, last_start()), end);
}

double MultiPointTurn::last_angle() const noexcept { return (length() - last_start()) / turn_of(count_ - 1).radius; }

double MultiPointTurn::wait_of(int move) const noexcept {
  return (move > 0 ? 2.0 : 1.0) * standing_share * turn_of(move).steering;
}

double MultiPointTurn::time_of(int moves) const noexcept {
  double time = 0.0;
  for (int i = 0; i < moves; ++i)
    time += wait_of(i) + (ends_[static_cast<std::size_t>(i)] - start_of(i)) / turn_of(i).speed;
  return time;
}

int MultiPointTurn::move_at(double arc_length) const noexcept {
  int move = move_;
  while (move + 1 < count_ && arc_length > ends_[static_cast<std::size_t>(move)]) ++move;
  return move;
}

Pose MultiPointTurn::pose_at(int move, double arc_length) const noexcept {
  Pose start = starts_[static_cast<std::size_t>(move)];
  if (is_reverse(move)) start.direction += std::numbers::pi;
  return pose_after(start, begin_.rotation, arc_length - start_of(move), turn_of(move).radius);
}

bool MultiPointTurn::advance(const Path& /*path*/, const Pose& vehicle, double time) noexcept {
  if (!is_under_way() || !is_finite(vehicle)) return false;
  wait_ = std::max(0.0, wait_ - time);
  const double radius = turn_of(move_).radius, end = ends_[static_cast<std::size_t>(move_)];
  const NearestPose nearest = nearest_pose([&](double along) { return pose_at(move_, along); }, done_,
                                           std::min(done_ + search_ahead * radius, end), vehicle.x, vehicle.y);
  done_ = nearest.along;
  const double direction = vehicle.direction + (is_reverse(move_) ? std::numbers::pi : 0.0);
  const double off = std::abs(angle_difference(direction, pose_at(move_, done_).direction));
  if (off > farthest_off || nearest.distance > farthest_aside * radius) {
    this->end();
    return false;
  }
  if (end - done_ > least_way) return false;
  done_ = end;
  ++move_;
  wait_ = move_ < count_ ? wait_of(move_) : 0.0;
  return true;
}

double MultiPointTurn::arc_length_after(double arc_length, double time) const noexcept {
  const int move = move_at(arc_length);
  return std::min(arc_length + std::max(0.0, time - wait_) * turn_of(move).speed,
                  std::max(arc_length, ends_[static_cast<std::size_t>(move)]));
}

PathPoint MultiPointTurn::point_at(const Path& /*path*/, double arc_length) const noexcept {
  const int move = move_at(arc_length);
  const bool in_reverse = is_reverse(move);
  const Pose pose = pose_at(move, arc_length);
  const double heading = pose.direction - (in_reverse ? std::numbers::pi : 0.0);
  PathPoint point;
  point.x = pose.x;
  point.y = pose.y;
  point.heading = std::remainder(heading, 2.0 * std::numbers::pi);
  point.curvature = begin_.rotation / turn_of(move).radius;
  // A reference that rests has no speed: inputs that drive on would count there, against all that is before.
  const bool rests = arc_length >= ends_[static_cast<std::size_t>(move)] || (wait_ > 0.0 && arc_length <= done_);
  const double speed = rests ? 0.0 : turn_of(move).speed;
  point.speed = in_reverse ? -speed : speed;
  point.in_reverse = in_reverse;
  return point;
}

PathProjection MultiPointTurn::beside(const Path& path, double x, double y) const noexcept {
  const double reach = length() + std::max(begin_.forwards.radius, begin_.backwards.radius);
  const double first = path.section_start(begin_.section), last = path.section_end(begin_.section);
  const double from = std::min(std::max(first, begin_.arc_length - reach), last);
  return path.closest(x, y, from, std::max(from, std::min(last, begin_.arc_length + reach)));
}

double MultiPointTurn::path_beside(const Path& path, double arc_length) const noexcept {
  const PathPoint there = point_at(path, arc_length);
  return beside(path, there.x, there.y).arc_length;
}

std::optional<double> MultiPointTurn::goes_on_at(const Path& path, double x, double y) const noexcept {
  return beside(path, x, y).arc_length;
}

}  // namespace rhec
