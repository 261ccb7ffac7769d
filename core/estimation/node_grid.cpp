#include "rhec/core/estimation/node_grid.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "rhec/core/base/infinity.hpp"

namespace rhec {
namespace {

constexpr double missing = std::numeric_limits<double>::quiet_NaN();
constexpr int most_parts = 1000;     // of a gap
constexpr double near_share = 0.05;  // of a step: so far nodes are moved to measurements

}  // namespace

NodeGrid::NodeGrid(const Setup& setup)
    : setup_(setup),
      near_(std::max(near_share * setup.step, setup.tolerance)),
      measurements_(setup.capacity, setup.outputs),
      inputs_(setup.capacity, setup.inputs),
      nodes_(static_cast<std::size_t>(setup.reach) + 2),
      between_(setup.outputs, setup.most_between),
      outputs_(setup.outputs),
      mean_(setup.inputs, 0.0),
      weight_(setup.inputs, 0.0) {
  jumps_.reserve(nodes_.size());
  clear();
}

void NodeGrid::clear() noexcept {
  measurements_.clear();
  inputs_.clear();
  jumps_.clear();
  count_ = 0;
  dropped_ = 0;
  changed_ = changed_input_ = infinity;
  lost_ = -infinity;
}

/// The first node that is still in the ring.
std::int64_t NodeGrid::oldest() const noexcept {
  return std::max<std::int64_t>(0, count_ - static_cast<std::int64_t>(nodes_.size()));
}

/// The newest node that a measurement at a time leaves as it is: one before it, and not within a gap that it divides
/// anew; one before `oldest()` if there is none.
std::int64_t NodeGrid::last_before(double time) const noexcept {
  const auto leaves = [&](const Node& node) {
    const bool is_divided_anew = node.parts > 0 && time < node.gap_end - setup_.tolerance;
    return node.time < time - setup_.tolerance - 2.0 * near_ && !is_divided_anew;
  };
  std::int64_t number = count_ - 1;
  while (number >= oldest() && !leaves(node(number))) --number;
  return number;
}

NodeGrid::Place NodeGrid::push_measurement(double time, Measured outputs, int reach) noexcept {
  const bool is_late = count_ > 0 && time <= this->time() + setup_.tolerance;
  if (is_late) {
    const std::int64_t kept = last_before(time);
    if (count_ - 1 - kept > reach || (kept >= 0 && node(kept).time < lost_)) {
      ++dropped_;
      return Place::forgotten;
    }
  }
  const bool was_full = measurements_.is_full();
  const double oldest_row = was_full ? measurements_.time(0) : 0.0;
  const bool is_taken = measurements_.insert(time, outputs) < measurements_.size();
  if (was_full) {
    // What a node has used is not lost, but cannot be used anew.
    const bool is_used = count_ > 0 && oldest_row <= this->time() + setup_.tolerance;
    if (is_used && is_taken) lost_ = std::max(lost_, oldest_row);
    if (!is_used || !is_taken) ++dropped_;
    if (!is_taken) return Place::forgotten;
  }
  if (!is_late) return Place::waits;
  changed_ = std::min(changed_, time);
  return Place::late;
}

NodeGrid::Place NodeGrid::put_measurement(double time, Measured outputs, int reach) noexcept {
  const std::size_t end = measurements_.first_after(time + setup_.tolerance);
  if (end == 0 || measurements_.time(end - 1) < time - setup_.tolerance) return push_measurement(time, outputs, reach);
  const bool is_late = count_ > 0 && time <= this->time() + setup_.tolerance;
  if (!measurements_.replace(end - 1, outputs) || !is_late) return Place::waits;
  changed_ = std::min(changed_, time);
  return Place::late;
}

void NodeGrid::push_input(double time, const double* inputs) noexcept {
  inputs_.insert(time, inputs);
  if (count_ > 0 && time < this->time() - setup_.tolerance) changed_input_ = std::min(changed_input_, time);
}

/// When the interval begins that a time lies in; NaN if its first node is forgotten.
double NodeGrid::last_node_up_to(double time) const noexcept {
  std::int64_t number = count_ - 1;
  while (number >= oldest() && node(number).time > time + setup_.tolerance) --number;
  return number < oldest() ? missing : node(number).time;
}

void NodeGrid::push_jump(double time, int reach) noexcept {
  const double begin = last_node_up_to(time);
  const std::int64_t kept = last_before(begin);
  const bool is_lost = kept >= 0 && node(kept).time < lost_;
  if (std::isnan(begin) || count_ - 1 - kept > reach || is_lost || jumps_.size() == jumps_.capacity()) return;
  jumps_.insert(std::ranges::upper_bound(jumps_, time), time);
  changed_ = std::min(changed_, begin);
}

void NodeGrid::retract(double jumps_from, double outputs_from, const double* y) noexcept {
  std::erase_if(jumps_, [&](double jump) { return jump >= jumps_from - setup_.tolerance; });
  for (std::size_t row = measurements_.first_after(outputs_from + setup_.tolerance); row < measurements_.size(); ++row)
    measurements_.remove(row, y);
  const double begin = last_node_up_to(jumps_from);
  changed_ = std::min(changed_, std::isnan(begin) ? jumps_from : begin);
}

int NodeGrid::outdated(double until, int reach) const noexcept {
  if (count_ == 0) return 0;
  // What is stamped later than `until` waits, even where it lies behind a node.
  double first = changed_ <= until + setup_.tolerance ? changed_ : infinity;
  const std::size_t next = measurements_.first_after(time() + setup_.tolerance);
  const bool has_next = next < measurements_.size() && measurements_.time(next) <= until + setup_.tolerance;
  if (has_next) first = std::min(first, measurements_.time(next));
  std::int64_t kept = count_ - 1;
  if (has_next && ends_open()) --kept;
  if (first < infinity) kept = std::min(kept, last_before(first));
  while (kept >= oldest() && kept >= 0 && node(kept).time > changed_input_ + setup_.tolerance) --kept;
  return static_cast<int>(std::min<std::int64_t>(count_ - 1 - kept, reach));
}

void NodeGrid::take_back(int nodes, double until) noexcept {
  count_ = std::max<std::int64_t>(0, count_ - nodes);
  // What has changed is behind the newest node now, or out of reach.
  changed_ = changed_ <= until + setup_.tolerance ? infinity : changed_;
  changed_input_ = infinity;
}

void NodeGrid::skip_to(double time) noexcept {
  if (count_ == 0 || !(time > this->time())) return;
  nodes_[static_cast<std::size_t>(count_ - 1) % nodes_.size()] = {time, time, Kind::grid, 0};
  if (count_ == 1) start_ = time;
}

/// The row behind those that have the stamp of a row.
std::size_t NodeGrid::group_end(std::size_t row) const noexcept {
  std::size_t end = row + 1;
  while (end < measurements_.size() && measurements_.time(end) <= measurements_.time(row) + setup_.tolerance) ++end;
  return end;
}

void NodeGrid::make_next(double until) noexcept {
  const std::size_t from = next_row(), end = measurements_.first_after(until + setup_.tolerance);
  Node next{measurements_.time(from), measurements_.time(from), Kind::grid, 0};
  duration_ = 0.0;
  if (count_ > 0) {
    const Node& last = node(count_ - 1);
    next = next_node(last, from, end);
    duration_ = next.time - last.time;
    mean_input(last.time, next.time);
  }
  collect(next, from, end);
  ends_with_jump_ = has_jump(next, end);
  if (count_ == 0) start_ = next.time;
  nodes_[static_cast<std::size_t>(count_++) % nodes_.size()] = next;
}

/// The node that follows, given the measurements behind the last one.
NodeGrid::Node NodeGrid::next_node(const Node& last, std::size_t from, std::size_t end) const noexcept {
  const double first = measurements_.time(from), gap = first - last.time;
  const double asked = std::ceil(gap / setup_.step - 1e-6);
  const int parts = last.parts > 0               ? last.parts
                    : gap <= setup_.step + near_ ? 0
                    : asked < double{most_parts} ? static_cast<int>(asked)
                                                 : most_parts;
  if (parts == 1) return {first, first, Kind::grid, 0};
  if (parts > 1) return {last.time + gap / parts, last.grid, Kind::gap, parts - 1, first};
  const double grid = last.grid + setup_.step;
  Node next{grid, grid, Kind::grid, 0};
  double nearest = infinity, newest = last.time;
  int between = 0;
  for (std::size_t row = from; row < end; row = group_end(row)) {
    newest = measurements_.time(row);
    if (newest > grid + near_) break;
    if (std::abs(newest - grid) < nearest && std::abs(newest - grid) <= near_) {
      nearest = std::abs(newest - grid);
      next.time = next.grid = newest;
    }
  }
  if (newest < grid - near_) next = {newest, last.grid, Kind::end, 0};
  for (std::size_t row = from; row < end && measurements_.time(row) < next.time - setup_.tolerance;
       row = group_end(row))
    if (++between > setup_.most_between) return {measurements_.time(row), last.grid, Kind::extra, 0};
  return next;
}

/// Whether the parameters jump between a node and the one that follows it.
bool NodeGrid::has_jump(const Node& next, std::size_t end) const noexcept {
  const auto jump = std::ranges::lower_bound(jumps_, next.time - setup_.tolerance);
  if (jump == jumps_.end()) return false;
  const std::size_t from = measurements_.first_after(next.time + setup_.tolerance);
  return from >= end || next_node(next, from, end).time > *jump + setup_.tolerance;
}

/// What was measured up to a node, and at it; of an output that several rows of one stamp have, the last.
void NodeGrid::collect(const Node& next, std::size_t from, std::size_t end) noexcept {
  const double start = next.time - duration_;
  between_.clear();
  outputs_.clear();
  for (std::size_t row = from; row < end && measurements_.time(row) <= next.time + setup_.tolerance;) {
    const std::size_t behind = std::min(group_end(row), end);
    if (measurements_.time(row) < next.time - setup_.tolerance) {
      if (between_.add(measurements_.time(row) - start))
        for (; row < behind; ++row) between_.add_outputs(between_.count() - 1, measurements_.measured(row));
    } else {
      for (; row < behind; ++row) outputs_.add(measurements_.measured(row));
    }
    row = behind;
  }
}

const double* NodeGrid::mean_input(double from, double to) noexcept {
  std::fill(mean_.begin(), mean_.end(), 0.0);
  std::fill(weight_.begin(), weight_.end(), 0.0);
  const std::size_t behind = inputs_.first_after(from);
  for (std::size_t i = behind > 0 ? behind - 1 : 0; i < inputs_.size(); ++i) {
    const double start = std::max(inputs_.time(i), from);
    const double last = i + 1 < inputs_.size() ? std::min(inputs_.time(i + 1), to) : to,
                 end = std::min(last, inputs_.time(i) + hold_);
    if (inputs_.time(i) >= to - setup_.tolerance) break;
    const double seconds = end - start;
    if (seconds <= 0.0) continue;
    for (std::size_t j = 0; j < mean_.size(); ++j) {
      const double value = inputs_.values(i)[j];
      if (std::isnan(value)) continue;
      mean_[j] += value * seconds;
      weight_[j] += seconds;
    }
  }
  for (std::size_t j = 0; j < mean_.size(); ++j) mean_[j] = weight_[j] > 0.0 ? mean_[j] / weight_[j] : missing;
  std::fill(mean_.end() - setup_.noises, mean_.end(), 0.0);
  return mean_.data();
}

void NodeGrid::settle(int reach) noexcept {
  const std::int64_t first = count_ - 1 - reach;  // the oldest node that may become the newest
  if (first < 0) return;
  const double time = node(first).time;
  measurements_.drop_front(measurements_.first_after(time + setup_.tolerance));
  std::erase_if(jumps_, [&](double jump) { return jump < time - setup_.tolerance; });
  // Of the input rows up to there, only the last one still holds.
  const std::size_t used = inputs_.first_after(time);
  if (used > 1) inputs_.drop_front(used - 1);
}

}  // namespace rhec
