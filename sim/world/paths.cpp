#include "rhec/sim/world/paths.hpp"

#include <fmt/format.h>

#include <cmath>
#include <numbers>

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

std::vector<Waypoint> load_waypoints(const std::filesystem::path& file, const WaypointFile& options) {
  require_positive("waypoint file", "speed", options.speed);
  const CsvTable table = read_csv(file, {.header = CsvHeader::optional});
  if (table.columns() != 2 && table.columns() != 3) {
    throw Error(fmt::format("{}: {} column(s); expected x,y or x,y,speed", table.name, table.columns()));
  }
  if (table.rows() < 2) {
    throw Error(fmt::format("{}: {} waypoint(s); a path needs at least 2 rows of x,y", table.name, table.rows()));
  }
  std::vector<Waypoint> waypoints;
  waypoints.reserve(static_cast<std::size_t>(table.rows()));
  for (std::int64_t row = 0; row < table.rows(); ++row) {
    const double speed = table.columns() == 3 ? table.at(row, 2) : options.speed;
    const Waypoint waypoint{table.at(row, 0), table.at(row, 1), speed};
    if (std::isnan(waypoint.x) || std::isnan(waypoint.y)) {
      throw Error(fmt::format("{}:{}: a coordinate is missing; give both x and y, or leave the row out", table.name,
                              table.line_of(row)));
    }
    if (!(speed > 0.0)) {
      throw Error(fmt::format("{}:{}: the speed is {}; expected a number greater than 0, or no speed column at all",
                              table.name, table.line_of(row), std::isnan(speed) ? "missing" : fmt::to_string(speed)));
    }
    waypoints.push_back(waypoint);
  }
  return waypoints;
}

}  // namespace rhec::sim
