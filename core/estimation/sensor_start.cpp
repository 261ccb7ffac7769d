#include <algorithm>
#include <cmath>

#include "sensor_watch_parts.hpp"

// Before there is an estimate to judge by.

namespace rhec {

namespace {

// A place that is known less does not become more accurate by what rounding leaves of it [m].
constexpr double most_displacement = 1e4;
// A start that is known to be turned by less needs no search [rad].
constexpr double roughly_known_heading = 1.0;

}  // namespace

/// Where the vehicle begins may be known badly, and said to be known well, as the origin of a map in which nobody has
/// put it. A position that is far from there would then be explained by heading, slip and speed, all of them absurd.
/// It says where the vehicle is, or is wrong itself: the mean goes there, and the covariance has room for both.
SensorWatch::Finding SensorWatch::place_start(const double* outputs) noexcept {
  WalkingFilter& filter = own_->filter;
  const Roles& roles = filter.model().description().roles;
  const double most = setup_.initial_covariance.size() > 0 ? filter.covariance().diagonal().maxCoeff() : 0.0;
  if (!(most > 0.0) || roles.position_x < 0 || roles.position_y < 0) return {};
  filter.expect();
  bool is_elsewhere = false;
  for (std::size_t s = 0; s < sensors_.size() && !is_elsewhere; ++s)
    is_elsewhere = sees_position(sensors_[s].outputs) && filter.innovation(sensors_[s], weighed(outputs), scratch_) &&
                   !(scratch_.nis <= limits_[static_cast<std::size_t>(scratch_.value.size())]);
  if (!is_elsewhere) return {};
  const double before_x = filter.mean()[roles.position_x], before_y = filter.mean()[roles.position_y];
  for (const int i : {roles.position_x, roles.position_y}) {
    filter.covariance().row(i).setZero();
    filter.covariance().col(i).setZero();
    filter.covariance()(i, i) = most_displacement * most_displacement;
  }
  // Twice, for what rounding leaves of a distance that is much larger than that.
  for (int k = 0; k < 2; ++k) filter.update(weighed(outputs));
  const Eigen::Vector2d away{filter.mean()[roles.position_x] - before_x, filter.mean()[roles.position_y] - before_y};
  if (!away.allFinite()) return {};
  const double doubt = std::min(0.25 * away.squaredNorm(), most_displacement * most_displacement);
  for (const int i : {roles.position_x, roles.position_y}) filter.covariance()(i, i) += doubt;
  if (roles.heading >= 0 &&
      filter.covariance()(roles.heading, roles.heading) > roughly_known_heading * roughly_known_heading) {
    is_active_ = true;
    search_from(filter, *memory_->search);
  }
  return {.rebase = true};
}

}  // namespace rhec
