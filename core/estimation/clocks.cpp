#include "rhec/core/estimation/clocks.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

namespace rhec {
namespace {

constexpr double unknown = std::numeric_limits<double>::quiet_NaN();
constexpr double usual_room = 1.0;  // [s]
constexpr double usual_intervals = 10.0;
constexpr int confirm_gap = 2, confirm_clock = 3;
// Going through known times again shows only if it lasts: single stamps are late for other reasons.
constexpr int confirm_repetition = 4;
constexpr double same_interval = 0.25;  // relative difference of two that are alike
// A clock was set by little where a source's stamps, against those of all others, are off from where they usually are
// by at least so much [s], and by so many times what they usually are, and stay there.
constexpr double least_step = 0.15, unusual_lead = 8.0;
constexpr double same_step = 0.3;  // relative difference of two that are alike
constexpr int confirm_step = 3, lead_memory = 20, least_leads = 10;

}  // namespace

Clocks::Clocks(int sources, const Setup& setup) : setup_(setup), sources_(sources) { reset(); }

void Clocks::reset() noexcept {
  first_ = now_ = unknown;
  refused_ = settings_ = 0;
  std::ranges::fill(sources_, Source{});
}

double Clocks::usual_interval(const Source& source) const noexcept {
  const double interval = source.rhythm.interval();
  return std::isnan(interval) ? setup_.usual_interval : interval;
}

double Clocks::room_ahead(const Source& source) const noexcept {
  return std::max(usual_room, usual_intervals * usual_interval(source));
}

Clocks::Place Clocks::place(const Source& source, double time) const noexcept {
  if (std::isnan(now_)) return Place::in_order;
  if (time > now_ + room_ahead(source)) return Place::far_ahead;
  if (time < now_ - setup_.behind) return Place::far_behind;
  const double usual = usual_interval(source), newest = source.rhythm.last();
  if (std::isnan(newest) || time >= newest - 0.5 * usual) return Place::in_order;
  // Has the source delivered what lies between this time and its newest?
  const double expected = (newest - time) / usual;
  const std::size_t known = std::min(source.count, remembered);
  const auto later = std::count_if(source.times.begin(), source.times.begin() + static_cast<std::ptrdiff_t>(known),
                                   [&](double other) { return other > time + 0.25 * usual; });
  const bool is_known = static_cast<double>(later) >= 0.5 * std::min(expected, static_cast<double>(remembered));
  return is_known && is_within(source, time) ? Place::repeated : Place::late;
}

/// Of what is older than all that is remembered nobody knows otherwise. A message that came too late has left a gap
/// twice as wide.
bool Clocks::is_within(const Source& source, double time) noexcept {
  constexpr double wide = 1.7;
  const std::size_t known = std::min(source.count, remembered);
  std::array<double, remembered> times = source.times;
  const auto end = times.begin() + static_cast<std::ptrdiff_t>(known);
  std::sort(times.begin(), end);
  const auto above = std::upper_bound(times.begin(), end, time);
  if (above == times.begin() || above == end) return true;
  const double around = *above - *std::prev(above);
  for (std::size_t i = 0; i + 1 < known; ++i) times[i] = times[i + 1] - times[i];
  const auto middle = times.begin() + static_cast<std::ptrdiff_t>((known - 1) / 2);
  std::nth_element(times.begin(), middle, std::prev(end));
  return around < wide * *middle;
}

double Clocks::use(Source& source, double time) noexcept {
  source.rhythm.hear(time);
  source.times[source.count++ % remembered] = time;
  if (!(now_ >= time)) now_ = time;
  if (std::isnan(first_)) first_ = time;
  return time;
}

/// Of a source that is slow, or has become so, intervals are long, but alike.
void Clocks::suspect(Source& source, double stamp) noexcept {
  const double interval = stamp - source.last_suspect;
  const bool is_alike = std::abs(interval - source.suspect_interval) < same_interval * interval;
  const bool is_slow = interval <= setup_.longest_gap && (is_alike || std::isnan(source.rhythm.interval()));
  const bool follows = source.suspects > 0 && interval > 0.0 && (interval < room_ahead(source) || is_slow);
  if (!follows) source.first_suspect = stamp;
  source.suspect_interval = source.suspects > 0 ? interval : 0.0;
  source.suspects = follows ? source.suspects + 1 : 1;
  source.last_suspect = stamp;
}

/// The first stamp by the new clock is an interval after the newest by the old one. Of a source that has always gone by
/// another clock, what it says is as new as what the others say.
double Clocks::new_offset(const Source& source, double stamp) const noexcept {
  const double last = source.rhythm.last();
  return std::isnan(last) ? stamp - now_ : source.first_suspect - (last + usual_interval(source));
}

void Clocks::set_clock(Source& source, double offset) noexcept {
  source.offset = offset;
  source.suspects = source.steps = 0;
  ++settings_;
}

/// The newest time of all others; NaN without any.
double Clocks::newest_of_others(const Source& source) const noexcept {
  double newest = unknown;
  for (const Source& other : sources_)
    if (&other != &source && !(other.rhythm.last() <= newest)) newest = other.rhythm.last();
  return newest;
}

/// A step by less than a gap leaves every stamp where it may be. Of a message that was held up, lost or overtaken,
/// stamps or the others' times do not go on by one interval; of a clock that was set, the others' do, the stamps jump
/// by more or less, and later ones stay there.
bool Clocks::follows_step(Source& source, double time, double others) noexcept {
  const double usual = usual_interval(source), step = time - others - source.usual_lead;
  const double elapsed = others - source.last_others;
  const bool is_next = elapsed > 0.5 * usual && elapsed < 1.5 * usual;
  const bool is_far =
      source.leads >= least_leads && std::abs(step) > std::max(least_step, unusual_lead * source.lead_deviation);
  const auto is_alike = [&](double other) { return std::abs(other - step) < same_step * std::abs(step); };
  // Where the others are as slow, a message of all that was lost looks the same.
  const auto may_be_lost = [&] {
    double quickest = std::numeric_limits<double>::infinity();
    for (const Source& other : sources_)
      if (&other != &source && !std::isnan(other.rhythm.last())) quickest = std::min(quickest, usual_interval(other));
    return quickest > 0.8 * usual && std::abs(step - usual) < same_step * usual;
  };
  const bool follows =
      is_far && is_next &&
      (source.steps > 0 ? is_alike(source.step) : is_alike(time - source.rhythm.last() - usual) && !may_be_lost());
  if (!follows) {
    source.steps = 0;
    return false;
  }
  ++source.steps;
  source.step += (step - source.step) / source.steps;
  return true;
}

void Clocks::note_lead(Source& source, double lead) noexcept {
  if (std::isnan(lead)) return;
  source.leads = std::min(source.leads + 1, lead_memory);
  if (source.leads == 1) source.usual_lead = lead;
  const double off = lead - source.usual_lead;
  source.usual_lead += off / source.leads;
  source.lead_deviation += (std::abs(off) - source.lead_deviation) / source.leads;
}

bool Clocks::take_over_offset(Source& source, double stamp) noexcept {
  for (const Source& other : sources_) {
    if (other.offset == source.offset) continue;
    const Place there = place(source, stamp - other.offset);
    if (there != Place::in_order) continue;
    set_clock(source, other.offset);
    return true;
  }
  return false;
}

double Clocks::take(int index, double stamp) noexcept {
  Source& source = sources_[index];
  if (!std::isfinite(stamp)) {
    ++refused_;
    return unknown;
  }
  const double time = stamp - source.offset;
  const Place there = place(source, time);
  const double others = newest_of_others(source);
  const bool is_near = there == Place::in_order || there == Place::late || there == Place::repeated;
  const bool follows = is_near && follows_step(source, time, others);
  source.last_others = others;
  const auto use_by = [&](double offset) {
    set_clock(source, offset);
    return use(source, stamp - offset);
  };
  if (follows && source.steps >= confirm_step) return use_by(source.offset + source.step);
  // Behind the others there is room for what is just late.
  if (follows && source.step > 0.0) {
    ++refused_;
    return unknown;
  }
  if (there == Place::in_order || there == Place::late) {
    source.suspects = 0;
    if (there == Place::in_order) note_lead(source, time - others);
    return use(source, time);
  }
  if (take_over_offset(source, stamp)) return use(source, stamp - source.offset);
  suspect(source, stamp);
  if (there == Place::repeated) {
    if (source.suspects >= confirm_repetition) return use_by(new_offset(source, stamp));
    return use(source, time);
  }
  const bool is_gap = there == Place::far_ahead && time <= now_ + setup_.longest_gap;
  if (is_gap && source.suspects >= confirm_gap) {
    source.suspects = 0;
    return use(source, time);
  }
  if (source.suspects >= confirm_clock) return use_by(new_offset(source, stamp));
  ++refused_;
  return unknown;
}

double Clocks::offset_of(double time) const noexcept {
  double best = 0.0, least = std::numeric_limits<double>::infinity();
  if (std::isnan(now_)) return best;
  const auto consider = [&](double offset) {
    const double distance = std::abs(time - offset - now_);
    if (distance < least) {
      least = distance;
      best = offset;
    }
  };
  consider(0.0);  // without a reason, a clock was not set
  for (const Source& source : sources_) consider(source.offset);
  return best;
}

}  // namespace rhec
