#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "rhec/core/base/error.hpp"
#include "rhec/core/base/export.hpp"

namespace rhec::logs {

/// A time in nanoseconds since the epoch of the log's clock: an integer, since a double of seconds since 1970 resolves
/// 2e-7 s only.
using Stamp = std::int64_t;
inline constexpr Stamp no_stamp = std::numeric_limits<Stamp>::min();
/// b - a [s]; does not overflow, whatever a file says.
inline double seconds_between(Stamp a, Stamp b) noexcept {
  return static_cast<double>((static_cast<long double>(b) - static_cast<long double>(a)) / 1e9L);
}

/// Records of one kind: messages of a topic, or the lines of a table.
struct Topic {
  std::string name;         ///< "/odom"; empty: a table
  std::string type;         ///< "nav_msgs/msg/Odometry"; "table"
  std::int64_t count = -1;  ///< records, where the file says so; else -1
};

/// A record as it lies in the file. Valid during the call that hands it out.
struct Record {
  int topic = 0;
  Stamp received = 0;      ///< when it was recorded; `no_stamp` where nobody says so
  std::int64_t place = 0;  ///< byte offset, number of the record, or line: for messages to the user
  int form = 0;            ///< of the topic's definitions, the one that it is written by
  std::span<const std::byte> bytes;
};

/// A record that cannot be read; the text says what was found and expected, and not where.
class RHEC_EXPORT RecordError : public Error {
 public:
  using Error::Error;
};

/// What to read out of the records of a topic.
struct FieldRequest {
  std::vector<std::string> fields;
  /// What gives the stamp: empty: the record's own (a header's stamp, the column `time`), and when it was received
  /// where it has none; "received": when it was received; else the name of a field that counts seconds.
  std::string clock = {};
};
inline constexpr const char* received_clock = "received";

/// Reads the fields of a request out of records.
class RHEC_EXPORT FieldReader {
 public:
  virtual ~FieldReader() = default;
  /// Writes one number for each field, NaN where the record has none: an array that is too short, a name that is not
  /// there, an empty cell. Returns when this was measured. Throws RecordError for a record that is broken.
  virtual Stamp read(const Record& record, double* values) = 0;
};

/// Where and why reading had to end before the end of the file; what came before it is good.
struct Damage {
  std::string what;  ///< file, place, what was found and expected, and what to do
};

/// A log: records of topics, in the order of the file. Reading takes memory for one record (or one compressed block of
/// them), however large the file is. Constructing and reading throw Error, with file and place, for what no part of the
/// file can be used without.
class RHEC_EXPORT Log {
 public:
  virtual ~Log() = default;
  const std::string& name() const noexcept { return name_; }
  const std::vector<Topic>& topics() const noexcept { return topics_; }
  /// Index of a topic by name. Throws Error that suggests the nearest name.
  int topic(std::string_view name) const;

  /// Throws Error for a field that the topic does not have, with the nearest name.
  virtual std::unique_ptr<FieldReader> reader(int topic, const FieldRequest& request) const = 0;
  /// Names of the numbers in a record, as `reader` takes them; of very many, the first. Throws RecordError.
  virtual std::vector<std::string> fields_of(const Record& record) const = 0;

  /// The unit that a field is in, by its name in units.hpp, where the log says so: the head of a column; else empty.
  virtual std::string unit_of(int topic, std::string_view field) const;

  /// Hands out the records of topics that are `wanted` (by index), until `take` returns false.
  using Take = std::function<bool(const Record& record)>;
  virtual std::optional<Damage> read(const std::vector<bool>& wanted, const Take& take) const = 0;

  /// Damage at a record that could not be decoded.
  virtual Damage damage_at(const Record& record, const RecordError& error) const = 0;

 protected:
  explicit Log(std::string name) : name_(std::move(name)) {}
  std::vector<Topic> topics_;

 private:
  std::string name_;
};

/// A signal by name: "/odom:twist.twist.linear.x", "/fix" (a topic as a whole), or "speed" (a column).
struct SignalName {
  std::string topic, field;
};
RHEC_EXPORT SignalName parse_signal_name(std::string_view text);

/// "; did you mean 'x'?", or what there is if nothing is near.
RHEC_EXPORT std::string suggestion_for(std::string_view name, const std::vector<std::string>& known);
/// A text of a file, shortened and printable, in quotes.
RHEC_EXPORT std::string in_quotes(std::string_view text);

}  // namespace rhec::logs
