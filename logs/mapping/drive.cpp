#include "rhec/logs/mapping/drive.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "rhec/core/base/angle.hpp"
#include "rhec/core/base/error.hpp"
#include "signal_value.hpp"

namespace rhec::logs {
namespace {

constexpr double missing = std::numeric_limits<double>::quiet_NaN();
// Messages that take longer than this from stamp to arrival were stamped by another clock [s]; and so were those that
// arrive before they were measured.
constexpr double longest_way = 10.0, smallest_lead = 1e-3;
// Stamps above this count from 1970 [s].
constexpr double since_1970 = 1e8;
// An input holds until its next value, but no longer than this, or five of its usual intervals [s].
constexpr double least_hold = 1.0, usual_intervals = 5.0;

/// A row before it is known how the clocks compare.
struct RawEvent {
  Stamp arrival = no_stamp, stamp = no_stamp;
  bool is_output = false;
  std::size_t values = 0;
};

bool waits_for_all(SignalForm form) { return form == SignalForm::mean || form == SignalForm::turn; }

/// A mapped signal while a log is read.
struct Channel {
  MappedSignal signal;
  std::vector<double> fields;
  std::vector<bool> is_fresh;
  double last = missing;  ///< of a derivative: the value before
  Stamp last_stamp = no_stamp, newest = no_stamp;
  SignalCount count;
};

/// The fields that are read out of one topic by one clock.
struct Plan {
  int topic = 0;
  std::string clock;
  FieldRequest request;
  std::unique_ptr<FieldReader> reader;
  std::vector<double> values;
  struct Use {
    std::size_t channel, field, slot;
  };
  std::vector<Use> uses;
  double least_lateness = std::numeric_limits<double>::infinity();
};

class DriveReader {
 public:
  DriveReader(const Log& log, const SignalMap& map) : log_(log) {
    drive_.outputs = map.outputs();
    drive_.inputs = map.inputs();
    if (map.origin()) plane_.emplace(*map.origin());
    for (MappedSignal& signal : map.resolved(log)) add(std::move(signal));
    for (Plan& plan : plans_) {
      plan.reader = log.reader(plan.topic, plan.request);
      plan.values.resize(plan.request.fields.size());
    }
  }

  Drive read() {
    std::vector<bool> wanted(log_.topics().size());
    for (const Plan& plan : plans_) wanted[static_cast<std::size_t>(plan.topic)] = true;
    std::optional<Damage> undecoded;
    drive_.damage = log_.read(wanted, [&](const Record& record) {
      try {
        for (Plan& plan : plans_)
          if (plan.topic == record.topic) take(record, plan);
      } catch (const RecordError& error) {
        undecoded = log_.damage_at(record, error);
        return false;
      }
      return true;
    });
    if (undecoded) drive_.damage = std::move(undecoded);
    finish();
    return std::move(drive_);
  }

 private:
  void add(MappedSignal signal) {
    Channel channel;
    const int topic = log_.topic(signal.from.front().topic);
    const std::string& type = log_.topics()[static_cast<std::size_t>(topic)].type;
    const std::vector<SignalName> fields = fields_of(signal, type);
    for (std::size_t i = 0; i < fields.size(); ++i) {
      Plan& plan = plan_of(log_.topic(fields[i].topic), signal.options.clock);
      std::vector<std::string>& requested = plan.request.fields;
      const auto known = std::find(requested.begin(), requested.end(), fields[i].field);
      plan.uses.push_back({channels_.size(), i, static_cast<std::size_t>(known - requested.begin())});
      if (known == requested.end()) requested.push_back(fields[i].field);
    }
    channel.fields.assign(fields.size(), missing);
    channel.is_fresh.assign(fields.size(), false);
    std::string source;
    for (const SignalName& name : signal.from)
      source += fmt::format("{}{}{}{}", source.empty() ? "" : ", ", name.topic,
                            name.topic.empty() || name.field.empty() ? "" : ":", name.field);
    channel.count = {signal.variable.name, std::move(source), signal.is_output};
    channel.signal = std::move(signal);
    channels_.push_back(std::move(channel));
  }

  Plan& plan_of(int topic, const std::string& clock) {
    for (Plan& plan : plans_)
      if (plan.topic == topic && plan.clock == clock) return plan;
    Plan& plan = plans_.emplace_back();
    plan.topic = topic;
    plan.clock = plan.request.clock = clock;
    return plan;
  }

  void take(const Record& record, Plan& plan) {
    const Stamp stamp = plan.reader->read(record, plan.values.data());
    if (stamp == no_stamp) return;
    const Stamp arrival = record.received == no_stamp ? stamp : record.received;
    plan.least_lateness = std::min(plan.least_lateness, seconds_between(stamp, arrival));
    rows_.clear();
    for (const Plan::Use& use : plan.uses) {
      Channel& channel = channels_[use.channel];
      // Wheels may come one by one, each in a message of its own: what a message lacks is waited for.
      if (waits_for_all(channel.signal.options.form) && std::isnan(plan.values[use.slot])) continue;
      channel.fields[use.field] = plan.values[use.slot];
      channel.is_fresh[use.field] = true;
      channel.newest = std::max(channel.newest, stamp);
      if (std::find(channel.is_fresh.begin(), channel.is_fresh.end(), false) == channel.is_fresh.end())
        complete(channel, channel.newest, arrival);
    }
    for (const auto& [key, row] : rows_) raw_.push_back(row);
  }

  /// All that makes up a signal has come.
  void complete(Channel& channel, Stamp stamp, Stamp arrival) {
    channel.is_fresh.assign(channel.is_fresh.size(), false);
    channel.newest = no_stamp;
    const double value = value_of(channel.signal, channel.fields, plane_);
    if (std::isnan(value)) {
      ++channel.count.missing;
      return;
    }
    const Stamp measured = stamp - static_cast<Stamp>(std::llround(channel.signal.options.delay * 1e9));
    if (!channel.signal.options.derivative) return put(channel, measured, arrival, value);
    const double duration = channel.last_stamp == no_stamp ? 0.0 : seconds_between(channel.last_stamp, measured);
    if (duration > 0.0) {
      const double change = channel.signal.is_angle ? angle_difference(value, channel.last) : value - channel.last;
      const double rate = change / duration + channel.signal.options.offset;
      // It was so since the last record, and is taken to stay so.
      put(channel, channel.last_stamp, arrival, rate);
      put(channel, measured, arrival, rate);
    }
    if (channel.last_stamp != no_stamp && duration <= 0.0) return;
    channel.last = value;
    channel.last_stamp = measured;
  }

  void put(Channel& channel, Stamp stamp, Stamp arrival, double value) {
    ++channel.count.values;
    const bool is_output = channel.signal.is_output;
    const auto [at, is_new] = rows_.try_emplace({!is_output, stamp});
    if (is_new) {
      at->second = {arrival, stamp, is_output, drive_.values.size()};
      const int size = is_output ? drive_.outputs : drive_.inputs;
      drive_.values.resize(drive_.values.size() + static_cast<std::size_t>(size), missing);
    }
    drive_.values[at->second.values + static_cast<std::size_t>(channel.signal.index)] = value;
  }

  void finish() {
    for (Channel& channel : channels_) drive_.signals.push_back(channel.count);
    for (const SignalCount& each : drive_.signals)
      if (each.values == 0)
        throw Error(fmt::format("{}: {} has no value for {}{}; `rhec log {}` lists what there is", log_.name(),
                                each.source, each.variable, drive_.damage ? ": " + drive_.damage->what : std::string(),
                                log_.name()));
    const double shift = shift_of_arrivals();
    Stamp first = raw_.front().stamp;
    for (const RawEvent& each : raw_) first = std::min(first, each.stamp);
    drive_.start = std::abs(seconds_between(0, first)) < since_1970 ? 0 : first;
    for (const RawEvent& each : raw_)
      drive_.events.push_back({seconds_between(drive_.start, each.arrival) - shift,
                               seconds_between(drive_.start, each.stamp), each.is_output, each.values});
    std::stable_sort(drive_.events.begin(), drive_.events.end(),
                     [](const DriveEvent& a, const DriveEvent& b) { return a.arrival < b.arrival; });
    join_inputs();
    if (plane_) drive_.origin = plane_->origin();
  }

  double shift_of_arrivals() const {
    double least = std::numeric_limits<double>::infinity(), most = -least;
    const Plan *quick = nullptr, *slow = nullptr;
    for (const Plan& plan : plans_) {
      if (!std::isfinite(plan.least_lateness)) continue;
      if (plan.least_lateness < least) quick = &plan;
      if (plan.least_lateness > most) slow = &plan;
      least = std::min(least, plan.least_lateness);
      most = std::max(most, plan.least_lateness);
    }
    if (most - least > longest_way)
      throw Error(fmt::format(
          "{}: the clocks of {} and {} differ by {:.6g} s; expected stamps of one clock; `clock: received` at these "
          "signals takes the time at which they were recorded",
          log_.name(), log_.topics()[static_cast<std::size_t>(quick->topic)].name,
          log_.topics()[static_cast<std::size_t>(slow->topic)].name, most - least));
    return least < -smallest_lead || least > longest_way ? least : 0.0;
  }

  /// Rows of inputs have all of them: those that another message has said hold on.
  void join_inputs() {
    const auto inputs = static_cast<std::size_t>(drive_.inputs);
    struct Known {
      double time, value;
    };
    std::vector<std::vector<Known>> known(inputs);
    std::vector<double> holds(inputs, least_hold);
    for (std::size_t j = 0; j < inputs; ++j) holds[j] = std::max(least_hold, usual_intervals * usual_interval(j));
    for (const DriveEvent& event : drive_.events) {
      if (event.is_output) continue;
      double* const row = drive_.values.data() + event.values;
      for (std::size_t j = 0; j < inputs; ++j) {
        std::vector<Known>& before = known[j];
        auto at = before.end();
        while (at != before.begin() && std::prev(at)->time > event.time) --at;
        if (!std::isnan(row[j])) {
          before.insert(at, {event.time, row[j]});
        } else if (at != before.begin() && event.time - std::prev(at)->time <= holds[j]) {
          row[j] = std::prev(at)->value;
        }
      }
    }
  }

  double usual_interval(std::size_t input) const {
    double first = missing, last = missing;
    std::int64_t count = 0;
    for (const DriveEvent& event : drive_.events) {
      if (event.is_output || std::isnan(drive_.values[event.values + input])) continue;
      if (count++ == 0) first = event.time;
      last = event.time;
    }
    return count > 1 ? (last - first) / static_cast<double>(count - 1) : 0.0;
  }

  const Log& log_;
  Drive drive_;
  std::vector<Channel> channels_;
  std::vector<Plan> plans_;
  std::optional<LocalPlane> plane_;
  std::vector<RawEvent> raw_;
  std::map<std::pair<bool, Stamp>, RawEvent> rows_;  ///< of the record at hand: outputs, then inputs, by stamp
};

}  // namespace

Stamp Drive::stamp_of(double time) const noexcept { return start + static_cast<Stamp>(std::llround(time * 1e9)); }

Drive read_drive(const Log& log, const SignalMap& map) { return DriveReader(log, map).read(); }

}  // namespace rhec::logs
