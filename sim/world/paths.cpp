#include "rhec/sim/world/paths.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>
#include <string>
#include <utility>

#include "rhec/core/base/error.hpp"
#include "rhec/sim/files/csv.hpp"

namespace rhec::sim {
namespace {

void require_positive(const char* path, const char* key, double value) {
  if (!(std::isfinite(value) && value > 0.0)) {
    throw Error(fmt::format("{}: {} is {}; expected a number greater than 0", path, key, value));
  }
}

void require_at_least(const char* path, const char* key, int value, int least) {
  if (value < least) throw Error(fmt::format("{}: {} is {}; expected {} or more", path, key, value, least));
}

// Generates waypoints along straights and arcs from a start pose.
class Pen {
 public:
  Pen(double x, double y, double spacing, double speed) : x_(x), y_(y), spacing_(spacing), speed_(speed) {
    waypoints_.push_back({x_, y_, speed_});
  }

  void straight(double length) {
    const double x0 = x_, y0 = y_;
    const int steps = steps_of(length);
    for (int i = 1; i <= steps; ++i) {
      const double along = length * i / steps;
      put(x0 + along * std::cos(heading_), y0 + along * std::sin(heading_));
    }
  }
  void reverse(double length) {
    stop();
    speed_ = -speed_;
    heading_ += std::numbers::pi;
    straight(length);
    heading_ -= std::numbers::pi;
    speed_ = -speed_;
    stop();
  }
  void stop() { waypoints_.back().speed = 0.0; }

  // A positive angle turns left.
  void arc(double radius, double angle) {
    const double side = std::copysign(radius, angle);
    const double centre_x = x_ - side * std::sin(heading_), centre_y = y_ + side * std::cos(heading_);
    const double start = heading_;
    const int steps = steps_of(radius * std::abs(angle));
    for (int i = 1; i <= steps; ++i) {
      heading_ = start + angle * i / steps;
      put(centre_x + side * std::sin(heading_), centre_y - side * std::cos(heading_));
    }
  }

  std::vector<Waypoint> take() && { return std::move(waypoints_); }

 private:
  int steps_of(double length) const { return static_cast<int>(std::ceil(length / spacing_)); }
  void put(double x, double y) {
    x_ = x;
    y_ = y;
    waypoints_.push_back({x, y, speed_});
  }

  double x_, y_, heading_ = 0.0, spacing_, speed_;
  std::vector<Waypoint> waypoints_;
};

}  // namespace

std::vector<Waypoint> figure_eight(const FigureEight& options) {
  constexpr const char* path = "figure-8 path";
  require_positive(path, "speed", options.speed);
  require_at_least(path, "laps", options.laps, 1);
  require_positive(path, "radius", options.radius);
  require_positive(path, "spacing", options.spacing);
  Pen pen(0.0, 0.0, options.spacing, options.speed);
  for (int lap = 0; lap < options.laps; ++lap) {
    pen.arc(options.radius, 2.0 * std::numbers::pi);
    pen.arc(options.radius, -2.0 * std::numbers::pi);
  }
  return std::move(pen).take();
}

std::vector<Waypoint> zig_zag(const ZigZag& options) {
  constexpr const char* path = "zig-zag path";
  require_positive(path, "speed", options.speed);
  require_at_least(path, "legs", options.legs, 1);
  require_positive(path, "leg_length", options.leg_length);
  require_positive(path, "radius", options.radius);
  require_positive(path, "spacing", options.spacing);
  Pen pen(0.0, -20.0, options.spacing, options.speed);
  for (int leg = 0; leg < options.legs; ++leg) {
    if (leg > 0) pen.arc(options.radius, leg % 2 == 1 ? std::numbers::pi : -std::numbers::pi);
    pen.straight(options.leg_length);
  }
  return std::move(pen).take();
}

std::vector<Waypoint> headland(const Headland& options) {
  constexpr const char* path = "headland path";
  require_positive(path, "speed", options.speed);
  require_at_least(path, "rows", options.rows, 1);
  require_positive(path, "row_length", options.row_length);
  require_positive(path, "row_spacing", options.row_spacing);
  require_positive(path, "turn_radius", options.turn_radius);
  require_positive(path, "spacing", options.point_spacing);
  Pen pen(0.0, 0.0, options.point_spacing, options.speed);
  const double too_wide = 2.0 * options.turn_radius - options.row_spacing;
  for (int row = 0; row < options.rows; ++row) {
    if (row > 0) {
      const double quarter = (row % 2 == 1 ? 0.5 : -0.5) * std::numbers::pi;
      pen.arc(options.turn_radius, quarter);
      if (too_wide > 0.0) pen.reverse(too_wide);
      if (too_wide < 0.0) pen.straight(-too_wide);
      pen.arc(options.turn_radius, quarter);
    }
    pen.straight(options.row_length);
  }
  pen.stop();
  return std::move(pen).take();
}

namespace {

/// Where the columns of a waypoint file are; -1: not there.
struct WaypointColumns {
  int x = 0, y = 1, speed = -1, left = -1, right = -1;
};

WaypointColumns columns_of(const CsvTable& table) {
  WaypointColumns columns;
  if (table.header.empty()) {
    if (table.columns() != 2 && table.columns() != 3)
      throw Error(fmt::format(
          "{}: {} column(s); expected x,y or x,y,speed, or a first line that names the columns x, y, speed, "
          "left, right",
          table.name, table.columns()));
    if (table.columns() == 3) columns.speed = 2;
    return columns;
  }
  columns.x = columns.y = -1;
  const std::pair<const char*, int*> known[] = {{"x", &columns.x},
                                                {"y", &columns.y},
                                                {"speed", &columns.speed},
                                                {"left", &columns.left},
                                                {"right", &columns.right}};
  for (std::size_t j = 0; j < table.header.size(); ++j) {
    const auto found = std::find_if(std::begin(known), std::end(known),
                                    [&](const auto& each) { return table.header[j] == each.first; });
    if (found == std::end(known) || *found->second >= 0)
      throw Error(fmt::format("{}:1: a column '{}'; expected x, y, speed, left and right, each once", table.name,
                              table.header[j]));
    *found->second = static_cast<int>(j);
  }
  if (columns.x < 0 || columns.y < 0)
    throw Error(fmt::format("{}:1: no column '{}'; expected x,y or x,y,speed", table.name, columns.x < 0 ? "x" : "y"));
  return columns;
}

void require_drivable(const std::vector<Waypoint>& waypoints, const CsvTable& table) {
  int obstacle = 0;
  std::string reason;
  try {
    const Path path(waypoints);
    obstacle = path.obstacle_waypoint();
    reason = path.why_not_drivable();
  } catch (const Error& error) {
    throw Error(fmt::format("{}: {}", table.name, error.what()));
  }
  if (obstacle > 0) throw Error(fmt::format("{}:{}: {}", table.name, table.line_of(obstacle - 1), reason));
}

}  // namespace

std::vector<Waypoint> load_waypoints(const std::filesystem::path& file, const WaypointFile& options) {
  require_positive("waypoint file", "speed", options.speed);
  const CsvTable table = read_csv(file, {.header = CsvHeader::optional});
  const WaypointColumns columns = columns_of(table);
  if (table.rows() < 2) {
    throw Error(fmt::format("{}: {} waypoint(s); a path needs at least 2 rows of x,y", table.name, table.rows()));
  }
  std::vector<Waypoint> waypoints;
  waypoints.reserve(static_cast<std::size_t>(table.rows()));
  for (std::int64_t row = 0; row < table.rows(); ++row) {
    const auto room = [&](int column) {
      const double value = column >= 0 ? table.at(row, column) : infinity;
      if (value < 0.0)
        throw Error(
            fmt::format("{}:{}: room of {} m beside the path; expected 0 or more, or nothing where there is no "
                        "limit",
                        table.name, table.line_of(row), value));
      return std::isnan(value) ? infinity : value;
    };
    const double speed = columns.speed >= 0 ? table.at(row, columns.speed) : options.speed;
    const Waypoint waypoint{table.at(row, columns.x), table.at(row, columns.y), speed, room(columns.left),
                            room(columns.right)};
    if (std::isnan(waypoint.x) || std::isnan(waypoint.y)) {
      throw Error(fmt::format("{}:{}: a coordinate is missing; give both x and y, or leave the row out", table.name,
                              table.line_of(row)));
    }
    if (std::isnan(speed)) {
      throw Error(
          fmt::format("{}:{}: the speed is missing; expected a number (negative: in reverse; 0: a stop), or no "
                      "column of speeds at all",
                      table.name, table.line_of(row)));
    }
    waypoints.push_back(waypoint);
  }
  require_drivable(waypoints, table);
  return waypoints;
}

}  // namespace rhec::sim
