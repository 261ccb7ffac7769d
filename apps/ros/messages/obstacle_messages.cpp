#include "obstacle_messages.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <utility>
#include <vector>

#include "rhec/logs/cdr/cdr_cursor.hpp"
#include "rhec/logs/signals/log.hpp"

namespace rhec::apps::ros {
namespace {

using logs::CdrCursor;
using logs::Kind;

// What moves faster, or is larger, is no obstacle on the ground but a mistake [m/s], [m].
constexpr double fastest_obstacle = 1000.0, largest = 1e6;
// What is thinner states no width [m].
constexpr double thinnest = 1e-3;

double read_bounded(CdrCursor& cursor, double least, double most, const char* what) {
  const double value = cursor.number(Kind::f64);
  if (!(value >= least && value <= most))
    throw logs::RecordError(
        fmt::format("found an obstacle with a {} of {}, expected {} to {}", what, value, least, most));
  return value;
}

/// The rectangle around an outline that has a side in a direction.
struct Rectangle {
  double cosine = 1.0, sine = 0.0;  ///< the direction
  double along_least = std::numeric_limits<double>::infinity(), along_most = -along_least;
  double across_least = along_least, across_most = -along_least;

  Rectangle(double cosine_of, double sine_of, std::span<const Position> outline) : cosine(cosine_of), sine(sine_of) {
    for (const Position& corner : outline) {
      const double along = cosine * corner.x + sine * corner.y, across = cosine * corner.y - sine * corner.x;
      along_least = std::min(along_least, along);
      along_most = std::max(along_most, along);
      across_least = std::min(across_least, across);
      across_most = std::max(across_most, across);
    }
  }
  double half_along() const { return 0.5 * (along_most - along_least); }
  double half_across() const { return 0.5 * (across_most - across_least); }
};

/// The corners of the convex hull, anticlockwise (Andrew's monotone chain).
std::vector<Position> hull_of(std::span<const Position> outline) {
  std::vector<Position> corners(outline.begin(), outline.end());
  std::ranges::sort(corners, {}, [](const Position& corner) { return std::pair(corner.x, corner.y); });
  const auto is_same = [](const Position& a, const Position& b) { return a.x == b.x && a.y == b.y; };
  corners.erase(std::unique(corners.begin(), corners.end(), is_same), corners.end());
  if (corners.size() < 3) return corners;
  std::vector<Position> hull;
  const auto add = [&hull](const Position& corner, std::size_t kept) {
    const auto turns_left = [&] {
      const Position &a = hull[hull.size() - 2], &b = hull.back();
      return (b.x - a.x) * (corner.y - a.y) > (b.y - a.y) * (corner.x - a.x);
    };
    while (hull.size() >= kept + 2 && !turns_left()) hull.pop_back();
    hull.push_back(corner);
  };
  for (const Position& corner : corners) add(corner, 0);
  const std::size_t lower = hull.size() - 1;
  for (auto corner = corners.rbegin() + 1; corner != corners.rend(); ++corner) add(*corner, lower);
  hull.pop_back();  // the first one again
  return hull;
}

/// The smallest rectangle around an outline with a belt around it, whose area between two edges' directions is a
/// product of concave functions: one side lies on an edge of the hull. The corners that the other sides touch only move
/// on from edge to edge (Toussaint's rotating calipers), since a message may have a million corners.
Rectangle smallest_around(std::span<const Position> outline, double radius) {
  const std::vector<Position> hull = hull_of(outline);
  const std::size_t count = hull.size();
  const auto corner = [&](std::size_t k) -> const Position& { return hull[k % count]; };
  const auto area = [radius](const Rectangle& r) { return (r.half_along() + radius) * (r.half_across() + radius); };
  Rectangle best(1.0, 0.0, outline);
  std::size_t ahead = 0, beside = 0, behind = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const double dx = corner(i + 1).x - corner(i).x, dy = corner(i + 1).y - corner(i).y, length = std::hypot(dx, dy);
    if (!(length > 0.0)) continue;
    const double cosine = dx / length, sine = dy / length;
    const auto along = [&](std::size_t k) {
      return cosine * (corner(k + 1).x - corner(k).x) + sine * (corner(k + 1).y - corner(k).y);
    };
    const auto across = [&](std::size_t k) {
      return cosine * (corner(k + 1).y - corner(k).y) - sine * (corner(k + 1).x - corner(k).x);
    };
    const std::size_t end = i + count;  // once around, also where rounding sees no end
    for (ahead = std::max(ahead, i + 1); ahead < end && along(ahead) > 0.0;) ++ahead;
    for (beside = std::max(beside, ahead); beside < end && across(beside) > 0.0;) ++beside;
    for (behind = std::max(behind, beside); behind < end && along(behind) < 0.0;) ++behind;
    const Rectangle touched(cosine, sine, std::array{corner(i), corner(ahead), corner(beside), corner(behind)});
    if (area(touched) < area(best)) best = touched;
  }
  return {best.cosine, best.sine, outline};
}

}  // namespace

Obstacle ellipse_around(std::span<const Position> outline, double radius) {
  const Rectangle best = smallest_around(outline, radius);
  const double along = 0.5 * (best.along_least + best.along_most),
               across = 0.5 * (best.across_least + best.across_most);
  const bool is_point = best.half_along() == 0.0 && best.half_across() == 0.0;
  const double growth = is_point ? 1.0 : std::numbers::sqrt2;
  return {.x = best.cosine * along - best.sine * across,
          .y = best.sine * along + best.cosine * across,
          .semi_axis_along = growth * (best.half_along() + radius),
          .semi_axis_across = growth * (best.half_across() + radius),
          .heading = std::atan2(best.sine, best.cosine)};
}

SeenObstacles read_obstacle_poses(std::span<const std::byte> message, double radius) {
  const Positions poses = read_pose_array(message);
  SeenObstacles seen{poses.header, {}};
  seen.obstacles.reserve(poses.places.size());
  for (const Position& place : poses.places)
    seen.obstacles.push_back({.x = place.x, .y = place.y, .semi_axis_along = radius, .semi_axis_across = radius});
  return seen;
}

SeenObstacles read_obstacle_array(std::span<const std::byte> message, double radius) {
  constexpr std::size_t least_obstacle = 400;  // without a corner and without padding: mostly covariances
  constexpr std::size_t corner_bytes = 12;
  constexpr int numbers_of_rotation = 4, numbers_of_covariance = 36;
  CdrCursor cursor(message);
  SeenObstacles seen{read_header(cursor), {}};
  std::vector<Position> outline;
  for (std::uint64_t left = cursor.length(least_obstacle); left > 0; --left) {
    const MessageHeader own = read_header(cursor);
    if (!own.frame.empty() && own.frame != seen.header.frame)
      throw logs::RecordError(fmt::format("found an obstacle in the frame {} in a message in the frame {}",
                                          logs::in_quotes(own.frame), logs::in_quotes(seen.header.frame)));
    outline.clear();
    for (std::uint64_t corners = cursor.length(corner_bytes); corners > 0; --corners) {
      Position corner;
      corner.x = read_coordinate(cursor, Kind::f32);
      corner.y = read_coordinate(cursor, Kind::f32);
      cursor.skip_numbers(Kind::f32, 1);  // z
      outline.push_back(corner);
    }
    if (outline.empty()) throw logs::RecordError("found an obstacle without a corner, expected one at least");
    const double own_radius = read_bounded(cursor, 0.0, largest, "radius");
    cursor.skip_numbers(Kind::i64, 1);  // its id
    cursor.skip_numbers(Kind::f64, numbers_of_rotation);
    Obstacle obstacle = ellipse_around(outline, own_radius);
    if (std::min(obstacle.semi_axis_along, obstacle.semi_axis_across) < thinnest)
      obstacle = ellipse_around(outline, radius);
    obstacle.velocity_x = read_bounded(cursor, -fastest_obstacle, fastest_obstacle, "velocity");
    obstacle.velocity_y = read_bounded(cursor, -fastest_obstacle, fastest_obstacle, "velocity");
    cursor.skip_numbers(Kind::f64, 4 + numbers_of_covariance);  // upwards, and turning
    seen.obstacles.push_back(obstacle);
  }
  return seen;
}

}  // namespace rhec::apps::ros
