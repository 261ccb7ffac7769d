#include <algorithm>
#include <cmath>

#include "numbers.hpp"
#include "sensor_judge_parts.hpp"

// Before there is an estimate to judge by: where the vehicle begins, and a heading that is searched.

namespace rhec {

namespace {

// A place that is known less does not become more accurate by what rounding leaves of it [m].
constexpr double most_displacement = 1e4;
// A heading that is known as badly may as well be any [rad].
constexpr double any_heading = 1.5;

}  // namespace

/// Where the vehicle begins may be known badly, and said to be known well, as the origin of a map in which nobody has
/// put it. A position that is far from there would then be explained by heading, slip and speed, all of them absurd.
/// It says where the vehicle is, or is wrong itself: the mean goes there, and the covariance has room for both.
///
/// Where it heads may not be known at all, and nothing that is measured says so: then it is searched from the first
/// position on. A filter that begins with one heading and is told that it may be any other takes lever arms, and what
/// is linear about them, at their word: it is soon certain of a heading, of a vehicle that has not moved.
SensorJudge::Finding SensorJudge::place_start(const double* outputs, const double* weights) noexcept {
  raw_weights_.assign(weights, weights ? weights + raw_.size() : nullptr);
  WalkingFilter& filter = own_->filter;
  const Roles& roles = filter.model().description().roles;
  const double most = setup_.initial_covariance.size() > 0 ? filter.covariance().diagonal().maxCoeff() : 0.0;
  if (!(most > 0.0) || roles.position_x < 0 || roles.position_y < 0) return {};
  filter.expect();
  if (is_heading_open(filter, weighed(outputs))) {
    is_active_ = memory_->is_starting = true;
    const double sigma = std::sqrt(filter.covariance()(roles.heading, roles.heading));
    search_from(filter, *memory_->search, outputs, sigma < any_heading ? sigma : infinity);
    memory_->search->moments(filter.mean(), filter.covariance());
    return {.rebase = true};
  }
  bool is_elsewhere = false;
  for (std::size_t s = 0; s < sensors_.size() && !is_elsewhere; ++s)
    is_elsewhere = sees_position(sensors_[s].outputs) && filter.innovation(sensors_[s], weighed(outputs), scratch_) &&
                   !(scratch_.nis <= limits_[static_cast<std::size_t>(scratch_.value.size())]);
  if (!is_elsewhere) return {};
  const double before_x = filter.mean()[roles.position_x], before_y = filter.mean()[roles.position_y];
  filter.forget_place(most_displacement, most_displacement);
  // Twice, for what rounding leaves of a distance that is much larger than that.
  for (int k = 0; k < 2; ++k) filter.update(weighed(outputs));
  const Eigen::Vector2d away{filter.mean()[roles.position_x] - before_x, filter.mean()[roles.position_y] - before_y};
  if (!away.allFinite()) return {};
  const double doubt = std::min(0.25 * away.squaredNorm(), most_displacement * most_displacement);
  for (const int i : {roles.position_x, roles.position_y}) filter.covariance()(i, i) += doubt;
  return {.rebase = true};
}

/// Whether where the vehicle heads is not known, and of what is measured positions alone may tell, the first ones or
/// the first behind a gap: what has come about while they were measured is for a dispute to settle.
bool SensorJudge::is_heading_open(const WalkingFilter& filter, Measured outputs) noexcept {
  const Roles& roles = filter.model().description().roles;
  if (!memory_->is_heading_unknown(filter)) return false;
  for (std::size_t s = 0; s < sensors_.size() && !is_unobserved_; ++s)
    if (is_heard(s) && sees_position(sensors_[s].outputs)) return false;
  bool has_x = false, has_y = false;
  for (std::size_t j = 0; j < raw_.size(); ++j) {
    const bool sees_x = filter.depends_on(static_cast<int>(j), roles.position_x),
               sees_y = filter.depends_on(static_cast<int>(j), roles.position_y);
    raw_[j] = sees_x || sees_y ? Memory::unknown : outputs[j];
    has_x = has_x || (sees_x && !std::isnan(outputs[j]));
    has_y = has_y || (sees_y && !std::isnan(outputs[j]));
  }
  if (!has_x || !has_y) return false;
  WalkingFilter& without = *memory_->unplaced;
  copy_numbers(filter.mean(), without.mean());
  copy_numbers(filter.covariance(), without.covariance());
  without.update({raw_.data(), outputs.weights});
  return memory_->is_heading_unknown(without);
}

bool SensorJudge::is_heading_unknown() const noexcept { return memory_->is_heading_unknown(own_->filter); }

/// Positions of a vehicle that may head anywhere are neither judged nor used by what is linear about one heading: a
/// search begins from them. What else is measured is_heading_open has used.
SensorJudge::Finding SensorJudge::open_heading(double time, const double* outputs) noexcept {
  copy_numbers(memory_->unplaced->mean(), own_->filter.mean());
  copy_numbers(memory_->unplaced->covariance(), own_->filter.covariance());
  copy_numbers(own_->filter.mean(), memory_->before_update);
  for (std::size_t s = 0; s < sensors_.size(); ++s)
    if (std::ranges::any_of(sensors_[s].outputs, [&](int j) { return !std::isnan(outputs[j]); })) heard_[s] = time;
  end_dispute();
  return {.rebase = true};
}

bool SensorJudge::is_searching() const noexcept { return memory_->search && memory_->search->is_active(); }

/// The judge has gone elsewhere at a sample.
void SensorJudge::begin_anew(const double* outputs) noexcept {
  start_search(outputs);
  memory_->loss->follow(own_->filter);
  memory_->recent->disconnect();
}

/// A heading that has become unknown is searched once the position is measured again.
void SensorJudge::start_search(const double* outputs) noexcept {
  if (!is_heading_unknown()) return;
  const Roles& roles = own_->filter.model().description().roles;
  bool is_placed = false;
  for (int j = 0; j < static_cast<int>(raw_.size()); ++j)
    is_placed = is_placed || (!std::isnan(outputs[j]) && own_->filter.depends_on(j, roles.position_x));
  if (!is_placed) return;
  // What a position says of slip, through a motion that nobody knows, is nothing: slip is as it was before. Nor do
  // correlations of what was far too uncertain to be linearised mean anything.
  WalkingFilter& filter = own_->filter;
  const Eigen::Index np = filter.model().parameter_count(), nx = filter.mean().size() - np;
  filter.mean().tail(np) = memory_->before_mean.tail(np);
  for (Eigen::Index j = nx; j < nx + np; ++j) filter.covariance()(j, j) = memory_->before_covariance(j, j);
  search_from(filter, *memory_->search, outputs);
  memory_->search->moments(filter.mean(), filter.covariance());
}

/// Starts a search from what a filter knows of each variable by itself.
void SensorJudge::search_from(WalkingFilter& filter, HeadingSearch& search, const double* outputs,
                              double sigma) noexcept {
  for (Eigen::Index c = 0; c < filter.mean().size(); ++c)
    for (Eigen::Index r = 0; r < filter.mean().size(); ++r)
      if (r != c) filter.covariance()(r, c) = 0.0;
  search.start(filter.mean(), filter.covariance(), weighed(outputs), sigma);
}

/// All measurements are used: there is nothing that they could be judged by. Found or not, the best heading so far is
/// the estimate.
SensorJudge::Finding SensorJudge::search_heading(const double* outputs) noexcept {
  if (memory_->search->update(sensors_, weighed(outputs))) memory_->is_starting = false;
  memory_->search->moments(own_->filter.mean(), own_->filter.covariance());
  return {.rebase = true};
}

}  // namespace rhec
