// The only translation unit that uses the JSON library.
#include "rhec/sim/files/json.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>

#include <fmt/format.h>

namespace rhec::sim {
namespace {

using Foreign = nlohmann::ordered_json;

/// Builds a value from the parser's events.
class Builder {
 public:
  explicit Builder(Json::RepeatedKeys repeated) : repeated_(repeated) {}

  bool null() { return put(Json()); }
  bool boolean(bool value) { return put(Json(value)); }
  bool number_integer(std::int64_t value) { return put(Json(value)); }
  bool number_unsigned(std::uint64_t value) { return put(Json(value)); }
  bool number_float(double value, const std::string&) { return put(Json(value)); }
  bool string(std::string& value) { return put(Json(std::move(value))); }
  bool binary(const Foreign::binary_t&) { return false; }  // does not occur in text
  bool start_array(std::size_t) { return open(Json::array()); }
  bool start_object(std::size_t) { return open(Json::object()); }
  bool end_array() { return close(); }
  bool end_object() { return close(); }
  bool key(std::string& name) {
    Json& object = *open_.back();
    if (repeated_ == Json::RepeatedKeys::refused && object.contains(name))
      throw JsonParseError(JsonParseError::Cause::repeated_key, 0, name);
    member_ = &object[name];
    return true;
  }
  bool parse_error(std::size_t byte, const std::string&, const Foreign::exception& error) {
    const bool is_syntax = dynamic_cast<const Foreign::parse_error*>(&error) != nullptr;
    mistake_.emplace(is_syntax ? JsonParseError::Cause::syntax : JsonParseError::Cause::large_number, byte, "");
    return false;
  }

  std::optional<JsonParseError> mistake_;
  Json whole_;

 private:
  Json& place_for(Json value) {
    if (open_.empty()) return whole_ = std::move(value);
    if (open_.back()->is_object()) return *member_ = std::move(value);
    return open_.back()->emplace_back() = std::move(value);
  }
  bool put(Json value) {
    place_for(std::move(value));
    return true;
  }
  // An array or object does not grow while a nested one is open, so the pointers stay valid.
  bool open(Json empty) {
    // Values are copied, compared and destroyed by recursion.
    if (open_.size() == JsonParseError::most_levels) {
      mistake_.emplace(JsonParseError::Cause::nesting, 0, "");
      return false;
    }
    open_.push_back(&place_for(std::move(empty)));
    return true;
  }
  bool close() {
    open_.pop_back();
    return true;
  }

  Json::RepeatedKeys repeated_;
  std::vector<Json*> open_;
  Json* member_ = nullptr;
};

Foreign foreign(const Json& json) {
  switch (json.kind()) {
    case Json::Kind::null:
      return nullptr;
    case Json::Kind::boolean:
      return json.as_flag();
    case Json::Kind::integer:
      return json.as_integer();
    case Json::Kind::number:
      return json.as_number();
    case Json::Kind::text:
      return json.as_text();
    case Json::Kind::array: {
      Foreign::array_t values;
      values.reserve(json.size());
      for (const Json& value : json) values.push_back(foreign(value));
      return values;
    }
    case Json::Kind::object:
      break;
  }
  Foreign::object_t members;
  members.reserve(json.size());
  for (const auto& [key, value] : json.items()) members.push_back({key, foreign(value)});
  return members;
}

}  // namespace

JsonError::~JsonError() = default;

JsonParseError::JsonParseError(Cause the_cause, std::size_t at, std::string the_key)
    : JsonError(the_cause == Cause::syntax         ? fmt::format("no JSON after {} bytes", at)
                : the_cause == Cause::large_number ? fmt::format("a number after {} bytes is too large", at)
                : the_cause == Cause::nesting
                    ? fmt::format("more than {} arrays and objects within each other", most_levels)
                    : fmt::format("the key '{}' is repeated", the_key)),
      cause(the_cause),
      byte(at),
      key(std::move(the_key)) {}
JsonParseError::~JsonParseError() = default;

Json::Json(std::initializer_list<Json> values) {
  const bool is_object = std::all_of(values.begin(), values.end(), [](const Json& value) {
    return value.is_array() && value.size() == 2 && value[0].is_string();
  });
  *this = is_object ? object() : array();
  reserve(values.size());
  for (const Json& value : values) {
    if (is_object) {
      (*this)[value[0].as_text()] = value[1];
    } else {
      push_back(value);
    }
  }
}

Json::Json(const Json& other) {
  switch (other.kind()) {
    case Kind::null:
      break;
    case Kind::boolean:
      value_ = std::get<bool>(other.value_);
      break;
    case Kind::integer:
      value_ = std::get<std::int64_t>(other.value_);
      break;
    case Kind::number:
      value_ = std::get<double>(other.value_);
      break;
    case Kind::text:
      value_ = std::make_unique<std::string>(other.held<std::string>());
      break;
    case Kind::array:
      value_ = std::make_unique<Array>(other.held<Array>());
      break;
    case Kind::object:
      value_ = std::make_unique<Object>(other.held<Object>());
      break;
  }
}

Json::Json(Json&& other) noexcept : value_(std::exchange(other.value_, Value())) {}
Json& Json::operator=(Json other) noexcept {
  value_.swap(other.value_);
  return *this;
}
Json::~Json() = default;

Json Json::array() {
  Json json;
  json.value_ = std::make_unique<Array>();
  return json;
}

Json Json::object() {
  Json json;
  json.value_ = std::make_unique<Object>();
  return json;
}

Json Json::parse(std::string_view text, RepeatedKeys repeated) {
  Builder builder(repeated);
  if (!Foreign::sax_parse(text, &builder) && builder.mistake_) throw JsonParseError(*builder.mistake_);
  return std::move(builder.whole_);
}

std::optional<Json> Json::parse_if_valid(std::string_view text) {
  Builder builder(RepeatedKeys::last_counts);
  if (!Foreign::sax_parse(text, &builder)) return std::nullopt;
  return std::move(builder.whole_);
}

std::string Json::dump(int indent) const {
  return foreign(*this).dump(indent, ' ', false, Foreign::error_handler_t::replace);
}

const char* Json::kind_name() const noexcept {
  switch (kind()) {
    case Kind::null:
      return "null";
    case Kind::boolean:
      return "boolean";
    case Kind::integer:
    case Kind::number:
      return "number";
    case Kind::text:
      return "string";
    case Kind::array:
      return "array";
    case Kind::object:
      return "object";
  }
  return "";
}

void Json::refuse(const char* expected) const {
  throw JsonError(fmt::format("found {}, expected {}", kind_name(), expected));
}

bool Json::as_flag() const {
  if (kind() != Kind::boolean) refuse("boolean");
  return std::get<bool>(value_);
}

std::int64_t Json::as_integer() const {
  if (kind() == Kind::number) return static_cast<std::int64_t>(std::get<double>(value_));
  if (kind() != Kind::integer) refuse("number");
  return std::get<std::int64_t>(value_);
}

double Json::as_number() const {
  if (kind() == Kind::integer) return static_cast<double>(std::get<std::int64_t>(value_));
  if (kind() != Kind::number) refuse("number");
  return std::get<double>(value_);
}

const std::string& Json::as_text() const {
  if (kind() != Kind::text) refuse("string");
  return held<std::string>();
}

std::size_t Json::size() const {
  if (kind() == Kind::array) return held<Array>().size();
  if (kind() == Kind::object) return held<Object>().size();
  if (kind() != Kind::null) refuse("array or object");
  return 0;
}

void Json::reserve(std::size_t count) {
  if (kind() == Kind::array) held<Array>().reserve(count);
  if (kind() == Kind::object) held<Object>().reserve(count);
}

void Json::push_back(Json value) { emplace_back() = std::move(value); }

Json& Json::emplace_back() {
  if (kind() == Kind::null) *this = array();
  if (kind() != Kind::array) refuse("array");
  return held<Array>().emplace_back();
}

const Json* Json::begin() const {
  if (kind() == Kind::null) return nullptr;
  if (kind() != Kind::array) refuse("array");
  return held<Array>().data();
}
const Json* Json::end() const { return begin() + size(); }
Json* Json::begin() { return const_cast<Json*>(std::as_const(*this).begin()); }
Json* Json::end() { return const_cast<Json*>(std::as_const(*this).end()); }

const Json& Json::element(std::size_t index) const {
  if (kind() != Kind::array) refuse("array");
  if (index >= size()) throw JsonError(fmt::format("there is no element {} in an array of {}", index, size()));
  return (held<Array>())[index];
}

const std::vector<Json::Member>& Json::items() const {
  static const Object none;
  if (kind() == Kind::null) return none;
  if (kind() != Kind::object) refuse("object");
  return held<Object>();
}

const Json* Json::find(std::string_view key) const {
  for (const Member& member : items())
    if (member.first == key) return &member.second;
  return nullptr;
}

const Json& Json::at(std::string_view key) const {
  if (const Json* found = find(key)) return *found;
  throw JsonError(fmt::format("there is no '{}'", key));
}

Json& Json::operator[](std::string_view key) {
  if (const Json* found = find(key)) return const_cast<Json&>(*found);
  if (kind() == Kind::null) *this = object();
  return held<Object>().emplace_back(key, Json()).second;
}

void Json::erase(std::string_view key) {
  if (contains(key)) std::erase_if(held<Object>(), [&](const Member& member) { return member.first == key; });
}

void Json::update(const Json& other) {
  for (const auto& [key, value] : other.items()) (*this)[key] = value;
}

bool operator==(const Json& a, const Json& b) {
  if (a.is_integer() && b.is_integer()) return a.as_integer() == b.as_integer();
  if (a.is_number() && b.is_number()) return a.as_number() == b.as_number();
  if (a.kind() != b.kind()) return false;
  switch (a.kind()) {
    case Json::Kind::boolean:
      return a.as_flag() == b.as_flag();
    case Json::Kind::text:
      return a.held<std::string>() == b.held<std::string>();
    case Json::Kind::array:
      return a.held<Json::Array>() == b.held<Json::Array>();
    case Json::Kind::object:
      return a.held<Json::Object>() == b.held<Json::Object>();
    default:
      return true;
  }
}

Json json_of(const Settings& settings) {
  switch (settings.kind()) {
    case Settings::Kind::null:
      return nullptr;
    case Settings::Kind::scalar: {
      const std::optional<Json> literal = Json::parse_if_valid(settings.text());
      if (literal && (literal->is_number() || literal->is_boolean())) return *literal;
      return settings.text();
    }
    case Settings::Kind::list: {
      Json list = Json::array();
      for (const Settings& item : settings.items()) list.push_back(json_of(item));
      return list;
    }
    case Settings::Kind::map:
      break;
  }
  Json object = Json::object();
  for (const auto& [key, value] : settings.members()) object[key] = json_of(value);
  return object;
}

std::string json_text(const Settings& settings) { return json_of(settings).dump(); }

void append_quoted(std::string_view value, std::string& text) {
  const bool is_plain =
      std::all_of(value.begin(), value.end(), [](char c) { return c >= ' ' && c <= '~' && c != '"' && c != '\\'; });
  if (is_plain) {
    text.append(1, '"').append(value).append(1, '"');
  } else {
    text += Json(value).dump();
  }
}

}  // namespace rhec::sim
