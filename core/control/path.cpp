#include "rhec/core/control/path.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "rhec/core/base/angle.hpp"
#include "rhec/core/base/error.hpp"

namespace rhec {
namespace {

// Waypoints closer than this are one point: the heading of so short a segment is meaningless.
constexpr double smallest_segment = 1e-9;  // [m]
// Number of segments to step along before a binary search.
constexpr int near = 32;
// A vehicle that turns by more than this at one point was meant to change its direction.
constexpr double sharpest_turn = 150.0 * std::numbers::pi / 180.0;

void check(const Waypoint& waypoint, std::size_t number) {
  if (!std::isfinite(waypoint.x) || !std::isfinite(waypoint.y) || !std::isfinite(waypoint.speed))
    throw Error(
        fmt::format("path: waypoint {} holds a value that is not finite; x, y and speed must be numbers", number));
  if (!(waypoint.left >= 0.0) || !(waypoint.right >= 0.0))
    throw Error(fmt::format("path: waypoint {} has room of {} m on its left and {} m on its right; expected 0 or more",
                            number, waypoint.left, waypoint.right));
}

/// Linear from a to b; either may be infinite.
double between(double a, double b, double fraction) noexcept {
  if (a == b || fraction <= 0.0) return a;
  return fraction >= 1.0 ? b : (1.0 - fraction) * a + fraction * b;
}

double square(double value) noexcept { return value * value; }

}  // namespace

Path::Path(const std::vector<Waypoint>& waypoints, const Limits& limits) {
  for (std::size_t i = 0; i < waypoints.size(); ++i) {
    const Waypoint& waypoint = waypoints[i];
    check(waypoint, i + 1);
    double arc_length = 0.0;
    if (!x_.empty()) {
      const double dx = waypoint.x - x_.back(), dy = waypoint.y - y_.back();
      const double step = std::hypot(dx, dy);
      if (step < smallest_segment) continue;
      arc_length = arc_lengths_.back() + step;
      if (!std::isfinite(arc_length))
        throw Error(
            fmt::format("path: the way to waypoint {} has no finite length; expected coordinates in metres", i + 1));
      direction_x_.push_back(dx / step);
      direction_y_.push_back(dy / step);
      directions_.push_back(given_speeds_.back() + waypoint.speed < 0.0 ? -1.0 : 1.0);
      const double sign = directions_.back();
      headings_.push_back(std::atan2(sign * direction_y_.back(), sign * direction_x_.back()));
    }
    x_.push_back(waypoint.x);
    y_.push_back(waypoint.y);
    given_speeds_.push_back(waypoint.speed);
    arc_lengths_.push_back(arc_length);
    left_.push_back(waypoint.left);
    right_.push_back(waypoint.right);
    numbers_.push_back(static_cast<int>(i) + 1);
  }
  if (x_.size() < 2) {
    throw Error(fmt::format("path: {} distinct waypoint(s) among the {} given; a path needs at least 2", x_.size(),
                            waypoints.size()));
  }
  find_curvatures();
  lower_speeds(limits);
  find_times();
  find_sections();
  why_not_drivable_ = find_obstacle();
}

void Path::find_curvatures() {
  const std::size_t count = x_.size();
  curvatures_.assign(count, 0.0);
  for (std::size_t i = 1; i + 1 < count; ++i)
    curvatures_[i] =
        angle_difference(headings_[i], headings_[i - 1]) / (0.5 * (arc_lengths_[i + 1] - arc_lengths_[i - 1]));
}

void Path::lower_speeds(const Limits& limits) {
  const std::size_t count = x_.size();
  speeds_.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    speeds_[i] = std::abs(given_speeds_[i]);
    const double bend = std::abs(curvatures_[i]);
    if (bend > 0.0) speeds_[i] = std::min(speeds_[i], std::sqrt(limits.lateral_acceleration / bend));
  }
  if (!std::isfinite(limits.acceleration)) return;
  const auto slow_down = [&](std::size_t i, std::size_t from) {
    const double length = std::abs(arc_lengths_[i] - arc_lengths_[from]);
    const double most = std::sqrt(square(speeds_[from]) + 2.0 * limits.acceleration * length);
    speeds_[i] = std::min(speeds_[i], most);
  };
  for (std::size_t i = 1; i < count; ++i) slow_down(i, i - 1);
  for (std::size_t i = count - 1; i-- > 0;) slow_down(i, i + 1);
}

void Path::find_times() {
  times_.assign(1, 0.0);
  for (std::size_t i = 0; i + 1 < x_.size(); ++i)
    times_.push_back(times_[i] + time_on(static_cast<int>(i), arc_lengths_[i + 1] - arc_lengths_[i]));
}

void Path::find_sections() {
  for (std::size_t i = 1; i + 1 < x_.size(); ++i)
    if (speeds_[i] == 0.0 && (speeds_[i - 1] > 0.0 || speeds_[i + 1] > 0.0)) section_ends_.push_back(arc_lengths_[i]);
  section_ends_.push_back(length());
}

std::string Path::find_obstacle() {
  for (std::size_t i = 0; i + 1 < x_.size(); ++i) {
    obstacle_waypoint_ = numbers_[i + 1];
    const double from = given_speeds_[i], to = given_speeds_[i + 1];
    if (from == 0.0 && to == 0.0)
      return fmt::format(
          "path: the speed is 0 at waypoint {} and at waypoint {}, so that no vehicle gets from one to the other; give "
          "one of them a speed",
          numbers_[i], numbers_[i + 1]);
    if (from * to < 0.0)
      return fmt::format(
          "path: the speed is {} m/s at waypoint {} and {} m/s at waypoint {}; a vehicle that changes its direction "
          "stops in between: give the waypoint where it does the speed 0",
          from, numbers_[i], to, numbers_[i + 1]);
    const double turn = i > 0 ? std::abs(angle_difference(headings_[i], headings_[i - 1])) : 0.0;
    if (turn > sharpest_turn) {
      obstacle_waypoint_ = numbers_[i];
      return fmt::format(
          "path: a vehicle would have to turn by {:.0f} degrees on the spot at waypoint {}; where a path turns back, "
          "the speed is 0 and has the other sign from there on (negative: in reverse), and where it goes straight on "
          "the sign stays",
          turn * 180.0 / std::numbers::pi, numbers_[i]);
    }
  }
  obstacle_waypoint_ = 0;
  return {};
}

/// The segment on which `of`, which increases from waypoint to waypoint, has a value.
int Path::segment_of(const std::vector<double>& of, double value) noexcept {
  // The first and the last waypoint are not searched, so that the end segments extend beyond the ends.
  return static_cast<int>(std::upper_bound(of.begin() + 1, of.end() - 1, value) - of.begin()) - 1;
}

/// The same by a few steps from the segment expected if all segments were as long as the known one.
int Path::segment_near(int known, const std::vector<double>& of, double value) const noexcept {
  const int last = size() - 2;
  known = std::clamp(known, 0, last);
  const double on = (value - of[known]) / (of[known + 1] - of[known]);
  int i = static_cast<int>(std::min(std::max(0.0, known + on), static_cast<double>(last))), steps = near;
  while (steps > 0 && i < last && of[i + 1] <= value) ++i, --steps;
  while (steps > 0 && i > 0 && of[i] > value) --i, --steps;
  return steps > 0 ? i : segment_of(of, value);
}

double Path::speed_on(int i, double along) const noexcept {
  const double from = speeds_[i], to = speeds_[i + 1];
  if (from == to) return from;
  const double fraction = std::clamp(along / (arc_lengths_[i + 1] - arc_lengths_[i]), 0.0, 1.0);
  return std::sqrt((1.0 - fraction) * square(from) + fraction * square(to));
}

/// Time from the first waypoint of a segment. Where the speed is 0 beyond an end of the path, there is no way.
double Path::time_on(int i, double along) const noexcept {
  const double length = arc_lengths_[i + 1] - arc_lengths_[i], from = speeds_[i], to = speeds_[i + 1];
  if (along <= 0.0) return from > 0.0 ? along / from : 0.0;
  if (along <= length) return 2.0 * along / (from + speed_on(i, along));
  const double beyond = to > 0.0 ? (along - length) / to : 0.0;
  return 2.0 * length / (from + to) + beyond;
}

double Path::arc_length_after(double arc_length, double time, int& segment) const noexcept {
  segment = segment_near(segment, arc_lengths_, arc_length);
  const double at = times_[segment] + time_on(segment, arc_length - arc_lengths_[segment]) + time;
  if (!std::isfinite(at) || !std::isfinite(times_.back())) return arc_length;
  segment = segment_near(segment, times_, at);
  const int i = segment;
  const double length = arc_lengths_[i + 1] - arc_lengths_[i], from = speeds_[i], to = speeds_[i + 1];
  const double within = at - times_[i], whole = times_[i + 1] - times_[i];
  if (from == to || within <= 0.0) return arc_lengths_[i] + from * within;
  if (within > whole) return arc_lengths_[i + 1] + to * (within - whole);
  const double acceleration = (square(to) - square(from)) / (2.0 * length);
  return arc_lengths_[i] + std::min(length, (from + 0.5 * acceleration * within) * within);
}

double Path::time_to_section_end(double arc_length, int section) const noexcept {
  const auto time_at = [this](double at) {
    const int i = segment_of(arc_lengths_, at);
    return times_[i] + time_on(i, at - arc_lengths_[i]);
  };
  return time_at(section_ends_[section]) - time_at(arc_length);
}

PathPoint Path::point_on(int i, double arc_length) const noexcept {
  const double along = arc_length - arc_lengths_[i];
  const double fraction = std::clamp(along / (arc_lengths_[i + 1] - arc_lengths_[i]), 0.0, 1.0);
  return {.x = x_[i] + along * direction_x_[i],
          .y = y_[i] + along * direction_y_[i],
          .heading = headings_[i],
          .speed = directions_[i] * speed_on(i, along),
          .curvature = between(curvatures_[i], curvatures_[i + 1], fraction),
          .in_reverse = directions_[i] < 0.0,
          .left = between(left_[i], left_[i + 1], fraction),
          .right = between(right_[i], right_[i + 1], fraction)};
}

double Path::top_speed() const noexcept { return *std::max_element(speeds_.begin(), speeds_.end()); }

PathPoint Path::point_at(double arc_length) const noexcept {
  return point_on(segment_of(arc_lengths_, arc_length), arc_length);
}

PathPoint Path::point_at(double arc_length, int& segment) const noexcept {
  segment = segment_near(segment, arc_lengths_, arc_length);
  return point_on(segment, arc_length);
}

PathProjection Path::closest(double x, double y, double from, double to) const noexcept {
  struct Nearest {
    double along, off_x, off_y, square;
  };
  const int last = size() - 2;
  const double evenly = from / length() * (last + 1);  // the segment if all were of equal length
  const int first =
      segment_near(static_cast<int>(std::min(std::max(0.0, evenly), static_cast<double>(last))), arc_lengths_, from);
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
  const double ahead = std::min(static_cast<double>(last - first), at_most * (last + 1) / length());  // also if NaN
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

Path::Place Path::locate(double x, double y, double heading, const Search& search) const noexcept {
  struct Candidate {
    double along, distance;
  };
  const int last = size() - 2;
  const auto on = [&](int i) -> Candidate {
    const double dx = x - x_[i], dy = y - y_[i];
    const double along =
        std::clamp(dx * direction_x_[i] + dy * direction_y_[i], 0.0, arc_lengths_[i + 1] - arc_lengths_[i]);
    const double turn = std::isnan(heading) ? 0.0 : angle_difference(heading, headings_[i]);
    return {along, std::hypot(dx - along * direction_x_[i], dy - along * direction_y_[i], search.turn_length * turn)};
  };
  double least = std::numeric_limits<double>::infinity();
  for (int i = 0; i <= last; ++i) least = std::min(least, on(i).distance);
  int found = 0;
  while (found < last && on(found).distance > least + search.margin) ++found;
  Candidate best = on(found);
  for (int i = found + 1; i <= last; ++i) {
    const Candidate next = on(i);
    if (!(next.distance < best.distance)) break;
    found = i;
    best = next;
  }
  const auto passed = std::upper_bound(section_ends_.begin(), section_ends_.end() - 1, arc_lengths_[found]);
  return {arc_lengths_[found] + best.along, static_cast<int>(passed - section_ends_.begin())};
}

}  // namespace rhec
