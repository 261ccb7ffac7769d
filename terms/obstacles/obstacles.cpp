// The vehicle stays out of circles and ellipses, at rest or moving (docs/terms.md).
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <vector>

#include "rhec/core/base/error.hpp"
#include "rhec/core/base/infinity.hpp"
#include "rhec/core/term/term.hpp"
#include "rhec/core/term/term_options.hpp"
#include "rhec/core/term/term_writer.hpp"
#include "rhec/plugins/kit/sdk.hpp"

namespace rhec {
namespace {

/// Rounds off the tip that the distance from the centre has there, as a share of the obstacle.
constexpr double rounding = 0.1;
constexpr double least_semi_axis = 0.01;  // [m]

/// An obstacle as it is written in a configuration.
struct GivenObstacle {
  double x = 0.0, y = 0.0, radius = 1.0, length = 0.0, width = 0.0, heading = 0.0, velocity_x = 0.0, velocity_y = 0.0;

  static const OptionTable<GivenObstacle>& table() {
    using G = GivenObstacle;
    static const auto options =
        OptionTable<G>()
            .number("x", &G::x, "centre at time 0 [m]")
            .number("y", &G::y, "centre at time 0 [m]")
            .number("radius", &G::radius, "of a circle [m]", greater_than(0.0))
            .number("length", &G::length, "of an ellipse, along its heading [m]; 0: it is a circle", at_least(0.0))
            .number("width", &G::width, "of an ellipse, across [m]; 0: it is a circle", at_least(0.0))
            .number("heading", &G::heading, "of an ellipse [rad]")
            .number("velocity_x", &G::velocity_x, "[m/s]")
            .number("velocity_y", &G::velocity_y, "[m/s]");
    return options;
  }
  Obstacle obstacle() const {
    const bool is_circle = length == 0.0 && width == 0.0;
    if (!is_circle && !(length > 0.0 && width > 0.0))
      throw Error("an ellipse has a length and a width; expected both above 0");
    return {.x = x,
            .y = y,
            .semi_axis_along = is_circle ? radius : 0.5 * length,
            .semi_axis_across = is_circle ? radius : 0.5 * width,
            .heading = heading,
            .velocity_x = velocity_x,
            .velocity_y = velocity_y};
  }
};

struct ObstaclesOptions : LimitOptions {
  double vehicle_radius = 0.5;
  std::optional<int> most;
  Settings obstacles;

  static const OptionTable<ObstaclesOptions>& table() {
    using O = ObstaclesOptions;
    static const auto options = with_limit_options(
        OptionTable<O>()
            .number("vehicle_radius", &O::vehicle_radius,
                    "how far the point that follows the path stays away from what is in the way [m]", at_least(0.0))
            .automatic_integer("most", &O::most,
                               "number of obstacles at a time, those that are seen at run time included; auto: as many "
                               "as are given here",
                               between(0, 1000))
            .map("obstacles", &O::obstacles, GivenObstacle::table().schema()));
    return options;
  }
};

class Obstacles final : public Term {
 public:
  using Options = ObstaclesOptions;
  explicit Obstacles(const Options& options) : options_(options) {
    const Settings& list = options.obstacles;
    if (!list.is_null() && list.kind() != Settings::Kind::list)
      throw list.mismatch("a list of obstacles, e.g. [{x: 3, y: 1, radius: 0.5}]");
    for (const Settings& item : list.items()) given_.push_back(read(item));
    most_ = options.most.value_or(static_cast<int>(given_.size()));
    if (most_ < static_cast<int>(given_.size()))
      throw Error("most: more obstacles are given than that; raise it, or leave it out");
  }

  int most_obstacles() const noexcept override { return most_ - static_cast<int>(given_.size()); }

  /// For each obstacle min(a, b) (sqrt(xi^2 / a^2 + eta^2 / b^2 + r^2) - sqrt(1 + r^2)) >= 0, with the semi-axes a and
  /// b, the position (xi, eta) from the centre along them, and a small rounding r: about the distance from the edge of
  /// a circle, and smooth at the centre.
  void write(TermWriter& writer) const override {
    const Expression &x = writer.position_x(), &y = writer.position_y();
    for (int k = 0; k < most_; ++k) {
      const Expression dx = x - writer.data("x"), dy = y - writer.data("y");
      const Expression along_x = writer.data("along x"), along_y = writer.data("along y");
      const Expression across_x = writer.data("across x"), across_y = writer.data("across y");
      const Expression along = along_x * dx + along_y * dy, across = across_x * dx + across_y * dy;
      const Expression beyond =
          sqrt(along * along + across * across + rounding * rounding) - std::sqrt(1.0 + rounding * rounding);
      const Expression size = writer.data("size");
      writer.limit(size * beyond, options_.softness(), "obstacle " + std::to_string(k + 1));
    }
  }

  void write_data(const TermPlace& place, double* data, double* lower, double* upper) const noexcept override {
    std::fill_n(upper, most_, infinity);
    int k = 0;
    const auto add = [&](const Obstacle& obstacle, double seconds) {
      // A point is in the way of a vehicle that is one.
      const double a = std::max(least_semi_axis, std::max(0.0, obstacle.semi_axis_along) + options_.vehicle_radius);
      const double b = std::max(least_semi_axis, std::max(0.0, obstacle.semi_axis_across) + options_.vehicle_radius);
      const double sine = std::sin(obstacle.heading), cosine = std::cos(obstacle.heading);
      const double numbers[numbers_each] = {obstacle.x + seconds * obstacle.velocity_x,
                                            obstacle.y + seconds * obstacle.velocity_y,
                                            cosine / a,
                                            sine / a,
                                            -sine / b,
                                            cosine / b,
                                            std::min(a, b)};
      std::copy_n(numbers, numbers_each, data + static_cast<std::ptrdiff_t>(k) * numbers_each);
      lower[k++] = 0.0;
    };
    for (const Obstacle& obstacle : given_) add(obstacle, place.time);
    for (const Obstacle& obstacle : place.obstacles)
      if (k < most_) add(obstacle, place.time - place.seen);
    // Rows without an obstacle bound nothing.
    std::fill(data + static_cast<std::ptrdiff_t>(k) * numbers_each,
              data + static_cast<std::ptrdiff_t>(most_) * numbers_each, 0.0);
    std::fill(lower + k, lower + most_, -infinity);
  }

 private:
  static constexpr int numbers_each = 7;

  static Obstacle read(const Settings& item) {
    const GivenObstacle given = GivenObstacle::table().parse(item, "term 'obstacles'");
    if (const Settings* radius = item.find("radius"); radius && (item.find("length") || item.find("width")))
      throw radius->error(
          "found a radius beside the length and width of an ellipse; expected the radius of a circle, or these");
    try {
      return given.obstacle();
    } catch (const Error& mistake) {
      throw item.error(mistake.what());
    }
  }

  Options options_;
  std::vector<Obstacle> given_;
  int most_ = 0;
};

}  // namespace
}  // namespace rhec

RHEC_PLUGIN(rhec::PluginKind::term, rhec::Obstacles,
            {.name = "obstacles",
             .version = "1.0.0",
             .licence = "BSD-2-Clause",
             .capabilities = "keeps the vehicle out of circles and ellipses that move with given velocities"});
