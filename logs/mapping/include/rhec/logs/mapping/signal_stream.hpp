#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "rhec/logs/mapping/signal_map.hpp"

namespace rhec::logs {

/// What was read of one variable.
struct SignalCount {
  std::string variable, source;
  bool is_output = false;
  std::int64_t values = 0, missing = 0;
  std::int64_t left_out = 0;  ///< by a condition (`when`)
  std::int64_t stated = 0;    ///< values of whose accuracy their records say something
  double least_sigma = std::numeric_limits<double>::infinity(), most_sigma = 0.0;  ///< that they state
};

/// Outputs or inputs that were measured together.
struct SignalRow {
  bool is_output = false;
  Stamp stamp = no_stamp;
  std::vector<double> values;  ///< n_y or n_u, NaN where missing
  std::vector<double> sigmas;  ///< n_y, stated standard deviations of outputs, NaN: none; empty: of none
};

/// Outputs and inputs out of records, one record after the other, as a map says.
class RHEC_EXPORT SignalStream {
 public:
  /// `log` says which topics there are, and how their records are read; it must outlive the stream. Throws Error for a
  /// signal that it does not have.
  SignalStream(const Log& log, const SignalMap& map);
  ~SignalStream();
  SignalStream(const SignalStream&) = delete;
  SignalStream& operator=(const SignalStream&) = delete;

  /// By topic of the log: whether it is read.
  const std::vector<bool>& wanted() const noexcept { return wanted_; }
  /// The rows that a record completes, outputs first; valid until the next call. Throws RecordError for one that is
  /// broken.
  std::span<const SignalRow> take(const Record& record);
  /// Forgets what parts of signals, and derivatives, have in hand: the next records belong to another time. Counts and
  /// the local plane stay.
  void begin_anew();

  /// By signal.
  std::vector<SignalCount> counts() const;
  /// Values that were missing in records, of all signals.
  std::int64_t missing() const noexcept { return missing_; }
  /// Values that a condition left out, of all signals.
  std::int64_t left_out() const noexcept { return left_out_; }
  /// Of the local plane: as configured, or the first good fix; none: there was none.
  std::optional<GeodeticPoint> origin() const;
  /// By topic and clock, the least time from a stamp to its arrival [s]; infinite where nothing came.
  struct Lateness {
    int topic = 0;
    double least = 0.0;
  };
  std::vector<Lateness> lateness() const;

 private:
  struct Channel;
  struct Reading;
  void add(const Log& log, MappedSignal signal);
  Reading& reading_of(int topic, const std::string& clock);
  void read(const Record& record, Reading& reading);
  void complete(Channel& channel, Stamp stamp);
  static bool belongs(Channel& channel, Stamp stamp);
  static double change_since_last(Channel& channel, double value);
  void put(Channel& channel, Stamp stamp, double value);
  void note_accuracy(const Log& log, const MappedSignal& signal, const std::string& type);

  std::size_t outputs_, inputs_;
  std::vector<Channel> channels_;
  std::vector<Reading> readings_;
  std::vector<bool> wanted_;
  std::int64_t missing_ = 0, left_out_ = 0;
  std::optional<LocalPlane> plane_;
  std::map<std::pair<bool, Stamp>, SignalRow> completed_;  ///< of the reading at hand: by kind and stamp
  std::vector<SignalRow> rows_;
};

}  // namespace rhec::logs
