#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "rhec/core/base/error.hpp"
#include "rhec/core/config/settings.hpp"
#include "rhec/sim/files/json.hpp"

namespace rhec::sim {

/// Message about a key of a line, or about the line if there is no key.
std::string at_key(const std::string& where, std::string_view key, std::string_view what);

/// "did you mean 'x'?", or a list of the known names.
std::string did_you_mean(std::string_view word, const std::vector<std::string>& known);

/// A value of a line, with its key. Accessors throw Error, naming file, line and key, if the value has another kind.
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
  /// Rows of equal width; null for missing values if that is allowed.
  Rows rows(std::size_t count, std::string_view what, bool may_miss) const;

  const Json& map() const;
  LineValue operator[](const std::string& key) const;
  bool has(const std::string& key) const { return map().contains(key); }
  /// Throws Error for any other key.
  void allow(const std::vector<std::string>& known) const;
  /// The same, with the keys that later versions added, by version.
  void allow(std::vector<std::string> known, const std::map<int, std::vector<std::string>>& added, int version) const;
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
