#include "rhec/logs/mapping/signal_stream.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "signal_value.hpp"

namespace rhec::logs {
namespace {

constexpr double no_value = std::numeric_limits<double>::quiet_NaN();

// Two fixes of one vector belong together if their stamps differ by no more than this [s].
constexpr double same_time = 0.02;
// An angle beyond so many turns counts them.
constexpr double turn_counted = 1.000001;

bool waits_for_all(SignalForm form) { return form == SignalForm::mean || form == SignalForm::turn; }

std::string source_of(const MappedSignal& signal) {
  std::string source;
  for (const SignalName& name : signal.from)
    source += fmt::format("{}{}{}{}", source.empty() ? "" : ", ", name.topic,
                          name.topic.empty() || name.field.empty() ? "" : ":", name.field);
  return source;
}

}  // namespace

/// A mapped signal while records are read.
struct SignalStream::Channel {
  MappedSignal signal;
  std::vector<double> fields;
  std::vector<bool> is_fresh;
  std::vector<Stamp> stamps;  ///< by field
  bool counts_turns = false;  ///< of a derivative: the angle has been beyond a turn
  double last = no_value;     ///< of a derivative: the value before
  double sigma = no_value;    ///< stated in the last record
  Stamp last_stamp = no_stamp, newest = no_stamp;
  SignalCount count;
};

/// The fields that are read out of one topic by one clock.
struct SignalStream::Reading {
  int topic = 0;
  std::string clock;
  FieldRequest request;
  std::unique_ptr<FieldReader> reader;
  std::vector<double> values;
  struct Use {
    std::size_t channel, field, slot;
  };
  std::vector<Use> uses;
  struct Check {
    std::size_t channel, slot;
    SignalCondition condition;
  };
  std::vector<Check> checks;
  /// How accurate a record says that it is, and the slot of what is 0 where that means nothing.
  struct Accuracy {
    std::size_t channel, slot;
    std::optional<std::size_t> kind;
  };
  std::vector<Accuracy> accuracies;
  double least_lateness = std::numeric_limits<double>::infinity();

  /// Where the value of a field will be; asks for it if nobody has.
  std::size_t slot_of(const std::string& field) {
    std::vector<std::string>& fields = request.fields;
    const auto known = std::find(fields.begin(), fields.end(), field);
    const auto slot = static_cast<std::size_t>(known - fields.begin());
    if (known == fields.end()) fields.push_back(field);
    return slot;
  }
  /// Whether all that a channel asks of a record holds.
  bool counts_for(std::size_t channel) const noexcept {
    return std::ranges::all_of(checks, [&](const Check& check) {
      return check.channel != channel || check.condition.holds(values[check.slot]);
    });
  }
};

SignalStream::SignalStream(const Log& log, const SignalMap& map)
    : outputs_(static_cast<std::size_t>(map.outputs())),
      inputs_(static_cast<std::size_t>(map.inputs())),
      wanted_(log.topics().size()) {
  if (map.origin()) plane_.emplace(*map.origin());
  for (MappedSignal& signal : map.resolved(log)) add(log, std::move(signal));
  for (Reading& reading : readings_) {
    reading.reader = log.reader(reading.topic, reading.request);
    reading.values.resize(reading.request.fields.size());
    wanted_[static_cast<std::size_t>(reading.topic)] = true;
  }
}

SignalStream::~SignalStream() = default;

void SignalStream::add(const Log& log, MappedSignal signal) {
  Channel channel;
  const int topic = log.topic(signal.from.front().topic);
  const std::string& type = log.topics()[static_cast<std::size_t>(topic)].type;
  const std::vector<SignalName> fields = fields_of(signal, type);
  for (std::size_t i = 0; i < fields.size(); ++i) {
    Reading& reading = reading_of(log.topic(fields[i].topic), signal.options.clock);
    reading.uses.push_back({channels_.size(), i, reading.slot_of(fields[i].field)});
  }
  for (const SignalCondition& condition : signal.conditions) {
    Reading& reading = reading_of(log.topic(condition.of.topic), signal.options.clock);
    reading.checks.push_back({channels_.size(), reading.slot_of(condition.of.field), condition});
  }
  note_accuracy(log, signal, type);
  channel.fields.assign(fields.size(), no_value);
  channel.is_fresh.assign(fields.size(), false);
  channel.stamps.assign(fields.size(), no_stamp);
  channel.count = {signal.variable.name, source_of(signal), signal.is_output};
  channel.signal = std::move(signal);
  channels_.push_back(std::move(channel));
}

void SignalStream::note_accuracy(const Log& log, const MappedSignal& signal, const std::string& type) {
  if (!signal.accuracy) return;
  Reading& reading = reading_of(log.topic(signal.accuracy->of.topic), signal.options.clock);
  Reading::Accuracy accuracy{channels_.size(), reading.slot_of(signal.accuracy->of.field), {}};
  if (const std::string kind = kind_of_accuracy(signal, type); !kind.empty()) accuracy.kind = reading.slot_of(kind);
  reading.accuracies.push_back(accuracy);
}

SignalStream::Reading& SignalStream::reading_of(int topic, const std::string& clock) {
  for (Reading& reading : readings_)
    if (reading.topic == topic && reading.clock == clock) return reading;
  Reading& reading = readings_.emplace_back();
  reading.topic = topic;
  reading.clock = reading.request.clock = clock;
  return reading;
}

std::span<const SignalRow> SignalStream::take(const Record& record) {
  rows_.clear();
  for (Reading& reading : readings_)
    if (reading.topic == record.topic) read(record, reading);
  return rows_;
}

void SignalStream::begin_anew() {
  for (Channel& channel : channels_) {
    channel.is_fresh.assign(channel.is_fresh.size(), false);
    channel.last = no_value;
    channel.last_stamp = channel.newest = no_stamp;
  }
}

void SignalStream::read(const Record& record, Reading& reading) {
  const Stamp stamp = reading.reader->read(record, reading.values.data());
  if (stamp == no_stamp) return;
  const Stamp arrival = record.received == no_stamp ? stamp : record.received;
  reading.least_lateness = std::min(reading.least_lateness, seconds_between(stamp, arrival));
  completed_.clear();
  for (const Reading::Accuracy& each : reading.accuracies) {
    Channel& channel = channels_[each.channel];
    const bool means_nothing = each.kind && reading.values[*each.kind] == 0.0;
    channel.sigma = means_nothing ? no_value : stated_sigma(channel.signal, reading.values[each.slot]);
  }
  for (const Reading::Use& use : reading.uses) {
    Channel& channel = channels_[use.channel];
    if (!reading.counts_for(use.channel)) {
      if (use.field == 0) {
        ++channel.count.left_out;
        ++left_out_;
      }
      continue;
    }
    // Wheels may come one by one, each in a message of its own: what a message lacks is waited for.
    if (waits_for_all(channel.signal.options.form) && std::isnan(reading.values[use.slot])) continue;
    if (channel.signal.options.form == SignalForm::direction && !belongs(channel, stamp)) continue;
    channel.fields[use.field] = reading.values[use.slot];
    channel.is_fresh[use.field] = true;
    channel.stamps[use.field] = stamp;
    channel.newest = std::max(channel.newest, stamp);
    if (std::find(channel.is_fresh.begin(), channel.is_fresh.end(), false) == channel.is_fresh.end())
      complete(channel, channel.newest);
  }
  for (auto& [key, row] : completed_) rows_.push_back(std::move(row));
}

/// Forgets parts that are older than a new one; false if the new one is older than they are.
bool SignalStream::belongs(Channel& channel, Stamp stamp) {
  bool is_behind = false;
  for (std::size_t i = 0; i < channel.fields.size(); ++i) {
    if (!channel.is_fresh[i]) continue;
    const double ahead = seconds_between(channel.stamps[i], stamp);
    if (ahead > same_time) channel.is_fresh[i] = false;
    is_behind = is_behind || ahead < -same_time;
  }
  return !is_behind;
}

/// All that makes up a signal has come.
void SignalStream::complete(Channel& channel, Stamp stamp) {
  channel.is_fresh.assign(channel.is_fresh.size(), false);
  channel.newest = no_stamp;
  const double value = value_of(channel.signal, channel.fields, plane_);
  if (std::isnan(value)) {
    ++channel.count.missing;
    ++missing_;
    return;
  }
  const Stamp measured = stamp - static_cast<Stamp>(std::llround(channel.signal.options.delay * 1e9));
  if (!channel.signal.options.derivative) return put(channel, measured, value);
  const double duration = channel.last_stamp == no_stamp ? 0.0 : seconds_between(channel.last_stamp, measured);
  if (duration > 0.0) {
    const double rate = change_since_last(channel, value) / duration + channel.signal.options.offset;
    if (channel.signal.is_output) {  // the mean since the last record
      put(channel, channel.last_stamp + (measured - channel.last_stamp) / 2, rate);
    } else {  // it was so since the last record, and is taken to stay so
      put(channel, channel.last_stamp, rate);
      put(channel, measured, rate);
    }
  }
  if (channel.last_stamp != no_stamp && duration <= 0.0) return;
  channel.last = value;
  channel.last_stamp = measured;
}

/// What begins anew has gone the shorter way. An angle begins anew after a turn, unless it has been beyond one.
double SignalStream::change_since_last(Channel& channel, double value) {
  const MappedSignal& signal = channel.signal;
  const double change = value - channel.last;
  const bool is_told = signal.options.wraps.has_value();
  if (!is_told && std::max(std::abs(value), std::abs(channel.last)) > turn_counted * signal.period)
    channel.counts_turns = true;
  if (!(signal.period > 0.0) || (!is_told && channel.counts_turns)) return change;
  return change - signal.period * std::round(change / signal.period);
}

void SignalStream::put(Channel& channel, Stamp stamp, double value) {
  ++channel.count.values;
  const bool is_output = channel.signal.is_output;
  SignalRow& row = completed_[{!is_output, stamp}];
  const auto index = static_cast<std::size_t>(channel.signal.index);
  if (row.values.empty()) row = {is_output, stamp, std::vector<double>(is_output ? outputs_ : inputs_, no_value), {}};
  row.values[index] = value;
  if (std::isnan(channel.sigma)) return;
  ++channel.count.stated;
  channel.count.least_sigma = std::min(channel.count.least_sigma, channel.sigma);
  channel.count.most_sigma = std::max(channel.count.most_sigma, channel.sigma);
  row.sigmas.resize(outputs_, no_value);
  row.sigmas[index] = channel.sigma;
}

std::vector<SignalCount> SignalStream::counts() const {
  std::vector<SignalCount> counts;
  for (const Channel& channel : channels_) counts.push_back(channel.count);
  return counts;
}

std::optional<GeodeticPoint> SignalStream::origin() const {
  return plane_ ? std::optional(plane_->origin()) : std::nullopt;
}

std::vector<SignalStream::Lateness> SignalStream::lateness() const {
  std::vector<Lateness> lateness;
  for (const Reading& reading : readings_) lateness.push_back({reading.topic, reading.least_lateness});
  return lateness;
}

}  // namespace rhec::logs
