#include "rhec/logs/signals/survey.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace rhec::logs {
namespace {

/// The median of many durations, from a histogram of fixed size: 64 bins for each factor of two, and the mean in a bin.
class Durations {
 public:
  void add(double seconds) noexcept {
    if (!(seconds > 0.0)) return;
    const double place = bins_a_factor * (std::log2(seconds) - least_power);
    Bin& bin = bins_[static_cast<std::size_t>(std::clamp(place, 0.0, double{count_of_bins - 1}))];
    ++bin.count;
    bin.sum += seconds;
    ++count_;
  }
  double median() const noexcept {
    if (count_ == 0) return 0.0;
    std::int64_t below = 0;
    std::size_t bin = 0;
    while (bin + 1 < bins_.size() && (below += bins_[bin].count) * 2 < count_) ++bin;
    return bins_[bin].sum / static_cast<double>(bins_[bin].count);
  }

 private:
  static constexpr int bins_a_factor = 64, least_power = -20, most_power = 20;
  static constexpr int count_of_bins = bins_a_factor * (most_power - least_power);
  struct Bin {
    std::int64_t count = 0;
    double sum = 0.0;
  };
  std::array<Bin, count_of_bins> bins_{};
  std::int64_t count_ = 0;
};

/// Takes in the records of one topic.
class Taker {
 public:
  Taker(const Log& log, int topic) : log_(log) { result_.topic = log.topics()[static_cast<std::size_t>(topic)]; }

  void take(const Record& record, Stamp start) {
    if (result_.count == 0) prepare(record);
    Stamp measured = record.received;
    if (reader_) {
      try {
        measured = reader_->read(record, values_.data());
      } catch (const RecordError& error) {
        if (result_.topic.name.empty()) throw;  // a table has no other topics
        ++result_.count;
        if (result_.broken++ == 0) result_.first_broken = log_.damage_at(record, error).what;
        return;
      }
      for (std::size_t i = 0; i < values_.size(); ++i) take(values_[i], result_.fields[i]);
    }
    if (result_.count++ == 0) result_.first = measured;
    if (measured == no_stamp) return;
    if (result_.last != no_stamp) {
      const double interval = seconds_between(result_.last, measured);
      durations_.add(interval);
      result_.backwards += interval < 0.0;
      if (interval > result_.longest_gap) {
        result_.longest_gap = interval;
        result_.gap_start = seconds_between(start, result_.last);
      }
    }
    result_.last = measured;
    if (record.received != no_stamp)
      result_.largest_lateness = std::max(result_.largest_lateness, seconds_between(measured, record.received));
  }

  TopicSurvey finish() {
    result_.usual_interval = durations_.median();
    return std::move(result_);
  }

 private:
  void prepare(const Record& record) {
    FieldRequest request;
    try {
      request.fields = log_.fields_of(record);
      reader_ = log_.reader(record.topic, request);
    } catch (const Error& error) {  // of a topic that is not understood, the number of records is known at least
      result_.unreadable = error.what();
      request.clock = received_clock;
      try {  // without the times
        reader_ = log_.reader(record.topic, request);
      } catch (const Error&) {
        return;
      }
    }
    values_.resize(request.fields.size());
    for (const std::string& field : request.fields)
      result_.fields.push_back({.name = field, .unit = log_.unit_of(record.topic, field)});
  }

  static void take(double value, FieldSurvey& field) noexcept {
    if (std::isnan(value)) return;
    if (field.count++ == 0) field.first = field.least = field.most = value;
    if (field.count > 1 && !(value > field.last)) field.is_rising = false;
    field.last = value;
    field.least = std::min(field.least, value);
    field.most = std::max(field.most, value);
  }

  const Log& log_;
  TopicSurvey result_;
  std::unique_ptr<FieldReader> reader_;
  std::vector<double> values_;
  Durations durations_;
};

}  // namespace

Survey survey(const Log& log) {
  std::vector<Taker> takers;
  takers.reserve(log.topics().size());
  for (std::size_t i = 0; i < log.topics().size(); ++i) takers.emplace_back(log, static_cast<int>(i));
  Survey result;
  std::optional<Damage> undecoded;
  result.damage = log.read(std::vector<bool>(log.topics().size(), true), [&](const Record& record) {
    if (result.first == no_stamp) result.first = result.last = record.received;
    try {
      takers[static_cast<std::size_t>(record.topic)].take(record, result.first);
    } catch (const RecordError& error) {
      undecoded = log.damage_at(record, error);
      return false;
    }
    if (record.received == no_stamp) return true;
    result.first = std::min(result.first, record.received);
    result.last = std::max(result.last, record.received);
    return true;
  });
  if (undecoded) result.damage = std::move(undecoded);
  for (Taker& taker : takers) result.topics.push_back(taker.finish());
  return result;
}

}  // namespace rhec::logs
