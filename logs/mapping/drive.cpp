#include "rhec/logs/mapping/drive.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "rhec/core/base/error.hpp"

namespace rhec::logs {
namespace {

constexpr double nothing = std::numeric_limits<double>::quiet_NaN();
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
  bool has_sigmas = false;
};

class DriveReader {
 public:
  DriveReader(const Log& log, const SignalMap& map) : log_(log), stream_(log, map) {
    drive_.outputs = map.outputs();
    drive_.inputs = map.inputs();
  }

  Drive read() {
    std::optional<Damage> undecoded;
    drive_.damage = log_.read(stream_.wanted(), [&](const Record& record) {
      try {
        take(record);
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
  void take(const Record& record) {
    for (const SignalRow& row : stream_.take(record)) {
      const Stamp arrival = record.received == no_stamp ? row.stamp : record.received;
      raw_.push_back({arrival, row.stamp, row.is_output, drive_.values.size(), !row.sigmas.empty()});
      for (const std::vector<double>* each : {&row.values, &row.sigmas})
        drive_.values.insert(drive_.values.end(), each->begin(), each->end());
    }
  }

  void finish() {
    drive_.signals = stream_.counts();
    for (const SignalCount& each : drive_.signals)
      if (each.values == 0)
        throw Error(fmt::format("{}: {} has no value for {}{}; `rhec log {}` lists what there is", log_.name(),
                                each.source, each.variable, drive_.damage ? ": " + drive_.damage->what : std::string(),
                                log_.name()));
    forget_useless_arrivals();
    const double shift = useless_arrivals_ ? 0.0 : shift_of_arrivals();
    Stamp first = raw_.front().stamp;
    for (const RawEvent& each : raw_) first = std::min(first, each.stamp);
    drive_.start = std::abs(seconds_between(0, first)) < since_1970 ? 0 : first;
    for (const RawEvent& each : raw_)
      drive_.events.push_back({seconds_between(drive_.start, each.arrival) - shift,
                               seconds_between(drive_.start, each.stamp), each.is_output, each.values,
                               each.has_sigmas});
    std::stable_sort(drive_.events.begin(), drive_.events.end(),
                     [](const DriveEvent& a, const DriveEvent& b) { return a.arrival < b.arrival; });
    join_inputs();
    drive_.origin = stream_.origin();
  }

  /// Where all records were received at one time, as those of converters that leave it out, nobody has said when.
  void forget_useless_arrivals() {
    const auto is_of_first = [&](const RawEvent& each) { return each.arrival == raw_.front().arrival; };
    const auto has_stamp_of_first = [&](const RawEvent& each) { return each.stamp == raw_.front().stamp; };
    useless_arrivals_ = std::ranges::all_of(raw_, is_of_first) && !std::ranges::all_of(raw_, has_stamp_of_first);
    if (useless_arrivals_)
      for (RawEvent& each : raw_) each.arrival = each.stamp;
  }

  double shift_of_arrivals() const {
    double least = std::numeric_limits<double>::infinity(), most = -least;
    int quick = 0, slow = 0;
    for (const SignalStream::Lateness& each : stream_.lateness()) {
      if (!std::isfinite(each.least)) continue;
      if (each.least < least) quick = each.topic;
      if (each.least > most) slow = each.topic;
      least = std::min(least, each.least);
      most = std::max(most, each.least);
    }
    if (most - least > longest_way)
      throw Error(fmt::format(
          "{}: the clocks of {} and {} differ by {:.6g} s; expected stamps of one clock; `clock: received` at these "
          "signals takes the time at which they were recorded",
          log_.name(), log_.topics()[static_cast<std::size_t>(quick)].name,
          log_.topics()[static_cast<std::size_t>(slow)].name, most - least));
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
    double first = nothing, last = nothing;
    std::int64_t count = 0;
    for (const DriveEvent& event : drive_.events) {
      if (event.is_output || std::isnan(drive_.values[event.values + input])) continue;
      if (count++ == 0) first = event.time;
      last = event.time;
    }
    return count > 1 ? (last - first) / static_cast<double>(count - 1) : 0.0;
  }

  const Log& log_;
  SignalStream stream_;
  Drive drive_;
  std::vector<RawEvent> raw_;
  bool useless_arrivals_ = false;
};

}  // namespace

Stamp Drive::stamp_of(double time) const noexcept { return start + static_cast<Stamp>(std::llround(time * 1e9)); }

Drive read_drive(const Log& log, const SignalMap& map) { return DriveReader(log, map).read(); }

}  // namespace rhec::logs
