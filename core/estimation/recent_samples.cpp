#include "recent_samples.hpp"

#include <algorithm>
#include <cmath>

#include "past_moments.hpp"
#include "rhec/core/base/angle.hpp"

namespace rhec {

RecentSamples::RecentSamples(const WalkingFilter& like) {
  const Model& model = like.model();
  const int ny = model.output_count();
  for (Entry& entry : entries_) {
    entry.mean = like.mean();
    entry.covariance = like.covariance();
    entry.inputs.assign(static_cast<std::size_t>(model.input_count()), 0.0);
    entry.expected.assign(static_cast<std::size_t>(ny), 0.0);
    entry.outputs = entry.rejected = entry.contradicting = MeasuredOutputs(ny);
  }
  values_ = weights_ = entries_[0].expected;
  for (const Variable& each : model.description().outputs) is_angle_.push_back(each.is_angle);
}

void RecentSamples::note_inputs(const std::vector<double>& inputs) noexcept {
  if (count_ > 0) std::copy(inputs.begin(), inputs.end(), entry(0).inputs.begin());
}

/// Whether a sample belongs to the newest entry. What was known before that is kept.
bool RecentSamples::joins(double time, bool has_position) noexcept {
  if (has_position || connected_ < 2 || entry(0).has_position || entry(0).is_kept) return false;
  return time - entry(1).time <= apart_;
}

/// Takes it into the newest entry, which is that of its time now.
void RecentSamples::join(double time, const std::vector<double>& expected, Measured used) noexcept {
  Entry &newest = entry(0), &before = entry(1);
  double duration = newest.time - before.time;
  PastMoments::add_to_mean(time - newest.time, newest.inputs.data(), duration, before.inputs);
  const Measured old = newest.outputs.measured();
  for (std::size_t j = 0; j < values_.size(); ++j) {
    const auto output = static_cast<std::ptrdiff_t>(j);
    const auto off = [&](double value, double from) {
      return is_angle_[j] ? angle_difference(value, from) : value - from;
    };
    double sum = 0.0, information = 0.0;
    const auto add = [&](Measured measured, double from) {
      if (std::isnan(measured[output])) return;
      sum += measured.weight(output) * off(measured[output], from);
      information += measured.weight(output);
    };
    add(old, newest.expected[j]);
    add(used, expected[j]);
    values_[j] = information > 0.0 ? expected[j] + sum / information : std::numeric_limits<double>::quiet_NaN();
    weights_[j] = information > 0.0 ? information : 1.0;
  }
  newest.time = time;
  newest.outputs.assign({values_.data(), weights_.data()});
}

void RecentSamples::remember(double time, const WalkingFilter& filter, const std::vector<double>& expected,
                             Measured used, const Besides& besides, bool has_position) noexcept {
  if (joins(time, has_position)) {
    join(time, expected, used);
  } else {
    newest_ = static_cast<std::size_t>(count_) % entries_.size();
    ++count_;
    ++connected_;
    Entry& fresh = entry(0);
    fresh.time = time;
    fresh.outputs.assign(used);
    fresh.rejected.assign(besides.rejected);
    fresh.contradicting.clear();
    fresh.has_position = has_position;
    fresh.is_kept = false;
    fresh.samples = 0;
  }
  Entry& newest = entry(0);
  ++newest.samples;
  newest.contradicting.add(besides.contradicting);
  newest.note(filter);
  std::copy(expected.begin(), expected.end(), newest.expected.begin());
}

int RecentSamples::with_positions(int positions, int count) noexcept {
  for (int ago = 1; ago < count; ++ago) {
    positions -= entry(ago - 1).has_position;
    if (positions == 0) return ago;
  }
  return 0;
}

int RecentSamples::since_position() noexcept {
  for (int ago = 0; ago < connected(); ++ago)
    if (entry(ago).has_position) return ago;
  return 0;
}

int RecentSamples::behind(double time) noexcept {
  for (int ago = 0; ago < known(); ++ago)
    if (entry(ago).time <= time) return ago;
  return -1;
}

int RecentSamples::since(double time) noexcept {
  int count = 0;
  while (count < known() && entry(count).time >= time) ++count;
  return count;
}

}  // namespace rhec
