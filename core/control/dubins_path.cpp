#include "dubins_path.hpp"

#include <cmath>
#include <cstddef>
#include <numbers>

namespace rhec {
namespace {

constexpr double full_turn = 2.0 * std::numbers::pi;

/// An angle to turn by, in [0, 2 pi). One that is a full turn but for rounding is none.
double turn_of(double angle) noexcept {
  constexpr double rounding = 1e-9;
  angle = std::fmod(angle, full_turn);
  if (angle < 0.0) angle += full_turn;
  return angle > full_turn - rounding ? 0.0 : angle;
}

}  // namespace

Pose pose_after(const Pose& from, int turn, double length, double radius) noexcept {
  if (turn == 0)
    return {from.x + length * std::cos(from.direction), from.y + length * std::sin(from.direction), from.direction};
  const double direction = from.direction + turn * length / radius;
  return {from.x + turn * radius * (std::sin(direction) - std::sin(from.direction)),
          from.y - turn * radius * (std::cos(direction) - std::cos(from.direction)), direction};
}

DubinsPath::DubinsPath(const Kind& kind, const Pose& from, const Pose& to, double radius) noexcept
    : kind_(kind), from_(from), radius_(radius) {
  if (kind[1] == 0)
    join_by_line(from, to);
  else
    join_by_arc(from, to);
}

/// The way from the centre of the circle that is left to that of the circle that is reached.
struct Centres {
  double distance = 0.0, direction = 0.0;
  Centres(const Pose& from, int first, const Pose& to, int last, double radius) noexcept {
    const double dx = to.x - from.x - radius * (last * std::sin(to.direction) - first * std::sin(from.direction));
    const double dy = to.y - from.y + radius * (last * std::cos(to.direction) - first * std::cos(from.direction));
    distance = std::hypot(dx, dy);
    direction = distance > 0.0 ? std::atan2(dy, dx) : from.direction;
  }
};

void DubinsPath::join_by_line(const Pose& from, const Pose& to) noexcept {
  const int first = kind_[0], last = kind_[2];
  const Centres centres(from, first, to, last, radius_);
  // Between circles that are turned on in different senses the line crosses from one side to the other.
  const double across = first == last ? 0.0 : 2.0 * radius_;
  exists_ = centres.distance >= across;
  if (!exists_) return;
  const double line = std::sqrt((centres.distance - across) * (centres.distance + across));
  const double direction = centres.direction + first * std::atan2(across, line);
  lengths_ = {radius_ * turn_of(first * (direction - from.direction)), line,
              radius_ * turn_of(last * (to.direction - direction))};
}

void DubinsPath::join_by_arc(const Pose& from, const Pose& to) noexcept {
  const int turn = kind_[0];
  const Centres centres(from, turn, to, turn, radius_);
  exists_ = centres.distance <= 4.0 * radius_;
  if (!exists_) return;
  // The circle in the middle touches both, on one side of the line between them or on the other.
  const double beside = std::acos(centres.distance / (4.0 * radius_));
  double least = HUGE_VAL;
  for (const double side : {beside, -beside}) {
    const double first = centres.direction + side + turn * 0.5 * std::numbers::pi;
    const double last = centres.direction + std::numbers::pi - side + turn * 0.5 * std::numbers::pi;
    const std::array<double, 3> turns{turn_of(turn * (first - from.direction)), turn_of(-turn * (last - first)),
                                      turn_of(turn * (to.direction - last))};
    const double sum = turns[0] + turns[1] + turns[2];
    if (sum >= least) continue;
    least = sum;
    for (std::size_t i = 0; i < 3; ++i) lengths_[i] = radius_ * turns[i];
  }
}

double DubinsPath::length() const noexcept { return lengths_[0] + lengths_[1] + lengths_[2]; }

Pose DubinsPath::pose_at(double arc_length) const noexcept {
  if (arc_length < 0.0) return pose_after(from_, 0, arc_length, radius_);
  Pose pose = from_;
  for (std::size_t i = 0; i < 3; ++i) {
    const double way = std::fmin(arc_length, lengths_[i]);
    pose = pose_after(pose, kind_[i], way, radius_);
    arc_length -= way;
  }
  return pose_after(pose, 0, arc_length, radius_);
}

double DubinsPath::curvature_at(double arc_length) const noexcept {
  if (arc_length < 0.0) return 0.0;
  for (std::size_t i = 0; i < 3; ++i) {
    if (arc_length < lengths_[i]) return kind_[i] / radius_;
    arc_length -= lengths_[i];
  }
  return 0.0;
}

}  // namespace rhec
