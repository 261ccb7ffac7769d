#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "rhec/core/base/error.hpp"
#include "rhec/core/config/settings.hpp"
#include "rhec/sim/files/json.hpp"

namespace rhec::sim {

/// What is wrong at a key of a line, or with the line where there is no key.
std::string at_key(const std::string& where, std::string_view key, std::string_view what);

/// "did you mean 'x'?", or the names there are.
std::string did_you_mean(std::string_view word, const std::vector<std::string>& known);

/// A value of a line that knows its key. What asks for a value of another kind than it is throws Error, naming file,
/// line and key.
class LineValue {
 public:
  using Rows = std::vector<std::vector<double>>;

  LineValue(const Json& value, std::string key, const std::string& where)
      : value_(&value), key_(std::move(key)), where_(&where) {}

  Error error(std::string_view what) const { return Error(at_key(*where_, key_, what)); }
  Error mismatch(std::string_view expected) const;

  bool is_null() const noexcept { return value_->is_null(); }
  bool is_list() const noexcept { return value_->is_array(); }
  double number() const;
  double number_or(double for_null) const { return is_null() ? for_null : number(); }
  /// NaN for null.
  double number_or_missing() const;
  int integer(int at_least) const;
  std::string text() const;
  Settings settings() const;

  std::vector<LineValue> items(std::string_view expected) const;
  std::vector<double> numbers() const;
  /// Rows of any width.
  Rows ragged(std::size_t count, std::string_view what) const;
  /// Rows of one width each, null for missing where that is allowed.
  Rows rows(std::size_t count, std::string_view what, bool may_miss) const;

  const Json& map() const;
  LineValue operator[](const std::string& key) const;
  bool has(const std::string& key) const { return map().contains(key); }
  /// Throws Error for another key than these.
  void allow(const std::vector<std::string>& known) const;
  /// The same, with the keys that came with version 2.
  void allow(std::vector<std::string> known, const std::vector<std::string>& since_2, int version) const;
  template <class Each>
  void for_each(const Each& each) const {
    for (const auto& [key, value] : map().items()) each(key, LineValue(value, child(key), *where_));
  }

 private:
  std::string child(const std::string& key) const { return key_.empty() ? key : key_ + "." + key; }
  std::string found() const;
  Origin origin() const;

  const Json* value_;
  std::string key_;
  const std::string* where_;
};

}  // namespace rhec::sim
