#include "line_value.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "rhec/core/config/option_values.hpp"

namespace rhec::sim {

std::string at_key(const std::string& where, std::string_view key, std::string_view what) {
  return key.empty() ? fmt::format("{}: {}", where, what) : fmt::format("{}: {}: {}", where, key, what);
}

std::string did_you_mean(std::string_view word, const std::vector<std::string>& known) {
  const std::string near = nearest(word, known);
  return near.empty() ? fmt::format("expected one of {}", fmt::join(known, ", "))
                      : fmt::format("did you mean '{}'?", near);
}

Error LineValue::mismatch(std::string_view expected) const {
  return error(fmt::format("found {}, expected {}", found(), expected));
}

double LineValue::number() const {
  if (!value_->is_number()) throw mismatch("a number");
  return value_->as_number();
}

double LineValue::number_or_missing() const {
  if (is_null()) return std::numeric_limits<double>::quiet_NaN();
  if (!value_->is_number()) throw mismatch("a number, or null for a missing one");
  return value_->as_number();
}

int LineValue::integer(int at_least) const {
  if (value_->is_integer()) {
    const std::int64_t number = value_->as_integer();
    if (number >= at_least && number <= std::numeric_limits<int>::max()) return static_cast<int>(number);
  }
  throw mismatch(fmt::format("an integer, at least {}", at_least));
}

std::string LineValue::text() const {
  if (!value_->is_string()) throw mismatch("a text");
  return value_->as_text();
}

Settings LineValue::settings() const {
  const Origin origin = this->origin();
  if (value_->is_null()) return Settings::null(origin);
  if (value_->is_object()) {
    Settings all = Settings::map(origin);
    for_each([&](const std::string& key, const LineValue& value) { all.add(key, value.settings()); });
    return all;
  }
  if (value_->is_array()) {
    Settings all = Settings::list(origin);
    for (const LineValue& item : items("a list")) all.append(item.settings());
    return all;
  }
  return Settings::scalar(value_->is_string() ? text() : value_->dump(), origin);
}

std::vector<LineValue> LineValue::items(std::string_view expected) const {
  if (!value_->is_array()) throw mismatch(expected);
  std::vector<LineValue> all;
  all.reserve(value_->size());
  for (std::size_t i = 0; i < value_->size(); ++i)
    all.emplace_back((*value_)[i], fmt::format("{}[{}]", key_, i), *where_);
  return all;
}

std::vector<double> LineValue::numbers() const {
  std::vector<double> all;
  for (const LineValue& item : items("a list of numbers")) all.push_back(item.number());
  return all;
}

LineValue::Rows LineValue::ragged(std::size_t count, std::string_view what) const {
  Rows all;
  for (const LineValue& row : items("a list of rows")) all.push_back(row.numbers());
  if (all.size() != count) throw error(fmt::format("{} rows, expected {}: {}", all.size(), count, what));
  return all;
}

LineValue::Rows LineValue::rows(std::size_t count, std::string_view what, bool may_miss) const {
  Rows all;
  for (const LineValue& row : items("a list of rows")) {
    std::vector<double> numbers;
    for (const LineValue& item : row.items("a row of numbers"))
      numbers.push_back(may_miss ? item.number_or_missing() : item.number());
    if (!all.empty() && numbers.size() != all.front().size())
      throw row.error(fmt::format("{} numbers, expected {} as in the first row", numbers.size(), all.front().size()));
    all.push_back(std::move(numbers));
  }
  if (all.size() != count) throw error(fmt::format("{} rows, expected {}: {}", all.size(), count, what));
  return all;
}

const Json& LineValue::map() const {
  if (!value_->is_object()) throw mismatch("a map");
  return *value_;
}

LineValue LineValue::operator[](const std::string& key) const {
  const Json* found = map().find(key);
  if (!found) throw Error(at_key(*where_, child(key), "missing; every number a solver needs is on the line"));
  return {*found, child(key), *where_};
}

void LineValue::allow(const std::vector<std::string>& known) const {
  for (const auto& [key, value] : map().items())
    if (std::find(known.begin(), known.end(), key) == known.end())
      throw Error(at_key(*where_, child(key), "unknown key; " + did_you_mean(key, known)));
}

void LineValue::allow(std::vector<std::string> known, const std::map<int, std::vector<std::string>>& added,
                      int version) const {
  for (const auto& [since, keys] : added) {
    for (const std::string& key : keys)
      if (version < since && has(key))
        throw Error(at_key(*where_, child(key),
                           fmt::format("is a key of version {0}; add \"version\": {0} to the line", since)));
    known.insert(known.end(), keys.begin(), keys.end());
  }
  allow(known);
}

std::string LineValue::found() const {
  if (value_->is_object()) return "a map";
  if (value_->is_array()) return fmt::format("a list of {}", value_->size());
  return value_->dump();
}

Origin LineValue::origin() const {
  const std::size_t colon = where_->rfind(':');
  return {where_->substr(0, colon), std::stoi(where_->substr(colon + 1))};
}

}  // namespace rhec::sim
