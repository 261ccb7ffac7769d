#include <algorithm>
#include <cmath>

#include "innovation.hpp"
#include "sensor_judge_parts.hpp"

// Two receivers, of which one has moved for good.

namespace rhec {

namespace {

// So far has the vehicle to go until an error counts as constant, or as far as that error is, if that is less [m].
// Coordinates that have turned look the same from one place.
constexpr double far_enough = 10.0;

}  // namespace

/// A receiver that has moved for good, and another one, which is not off, says by how much: it is used without that.
/// What it is off by was known best when it jumped, when the estimate still went by it.
bool SensorJudge::follow_receiver() noexcept {
  const int sensor = disputed_position();
  const auto s = static_cast<std::size_t>(sensor);
  Record& record = records_[s];
  const std::vector<int>& outputs = sensors_[s].outputs;
  const auto is_watched = [&](int j) { return memory_->offsets->is_watched(j); };
  if (!record.has_lasted() || record.mean.size() != std::ssize(outputs) || !is_placed_by_other(sensor) ||
      !std::ranges::all_of(outputs, is_watched) || memory_->offsets->has_any_but(outputs) ||
      (position_of(own_->filter) - record.place).norm() < std::min(record.first.norm(), far_enough))
    return false;
  Innovation::OfSensor<Eigen::Dynamic> covariance = record.covariance;
  for (Eigen::Index i = 0; i < record.mean.size(); ++i) covariance(i, i) += record.variance_of_mean(i);
  if (squared_size(record.mean - record.first, covariance) > close_limits_[outputs.size()]) return false;
  for (Eigen::Index i = 0; i < record.mean.size(); ++i) {
    const double of_first = record.covariance(i, i), of_mean = record.variance_of_mean(i);
    const bool is_first = of_first < of_mean;
    memory_->offsets->adopt(outputs[static_cast<std::size_t>(i)], is_first ? record.first[i] : record.mean[i],
                            is_first ? of_first : of_mean, true);
  }
  record = {};
  return true;
}

/// One that is used without what it is off by, and another one that has not moved contradicts it for long, in single
/// innovations or in their sum: it has moved again, or was off by nothing constant. The vehicle is where the other one
/// says. False if that is not so.
bool SensorJudge::distrust_receiver() noexcept {
  OffsetWatch& offsets = *memory_->offsets;
  if (!offsets.has_sure()) return false;
  int sensor = is_disputed_ ? disputed_position() : -1;
  if (sensor >= 0 && records_[static_cast<std::size_t>(sensor)].failures < setup_.proof) sensor = -1;
  if (const int output = offsets.suspected(); output >= 0 && sees_position(output))
    sensor = sensor_of(output, sensors_);
  if (sensor < 0) return false;
  const std::vector<int>& outputs = sensors_[static_cast<std::size_t>(sensor)].outputs;
  if (std::ranges::any_of(outputs, [&](int j) { return offsets.is_sure(j); })) return false;
  std::vector<double>& measured = memory_->not_accused;
  std::fill(measured.begin(), measured.end(), Memory::unknown);
  for (const int j : outputs)
    measured[static_cast<std::size_t>(j)] = raw_[static_cast<std::size_t>(j)] + offsets.offset(j);
  offsets.forget_receivers();
  WalkingFilter& filter = own_->filter;
  const ModelDescription& about = filter.model().description();
  const auto far_away = [&](int state) { return displacement * about.states[static_cast<std::size_t>(state)].scale; };
  filter.forget_place(far_away(about.roles.position_x), far_away(about.roles.position_y));
  filter.update(weighed(measured.data()));
  std::fill(records_.begin(), records_.end(), Record{});
  end_dispute();
  return true;
}

}  // namespace rhec
