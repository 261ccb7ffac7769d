#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/core/config/settings.hpp"
#include "rhec/sim/files/json_error.hpp"

namespace rhec::sim {

/// A JSON value: null, boolean, number, string, array or object. Objects keep the order of their members.
class RHEC_EXPORT Json {
 public:
  enum class Kind : std::uint8_t { null, boolean, integer, number, text, array, object };
  using Member = std::pair<std::string, Json>;

  Json() noexcept {}
  Json(std::nullptr_t) noexcept {}
  template <std::same_as<bool> T>
  Json(T value) noexcept : value_(value) {}
  template <std::integral T>
  requires(!std::same_as<T, bool>) Json(T value)
  noexcept : Json(from_integer(value)) {}
  Json(double value) noexcept : value_(value) {}
  Json(std::string value) : value_(std::make_unique<std::string>(std::move(value))) {}
  Json(std::string_view value) : Json(std::string(value)) {}
  Json(const char* value) : Json(std::string(value)) {}
  /// An array of the values.
  template <class T>
  Json(const std::vector<T>& values) : Json(array()) {
    reserve(values.size());
    for (const auto& value : values) push_back(Json(value));
  }
  /// An object with these members.
  template <class T>
  Json(const std::map<std::string, T>& members) : Json(object()) {
    for (const auto& [key, value] : members) (*this)[key] = Json(value);
  }
  /// An object if every value is a two-element array that starts with a string: {{"x", 1}, {"y", 2}}. Otherwise an
  /// array.
  Json(std::initializer_list<Json> values);
  Json(const Json& other);
  Json(Json&& other) noexcept;
  Json& operator=(Json other) noexcept;
  ~Json();

  static Json array();
  static Json object();

  /// Throws JsonParseError. The last value of a repeated key wins, unless repeated keys are refused.
  enum class RepeatedKeys { last_counts, refused };
  static Json parse(std::string_view text, RepeatedKeys repeated = RepeatedKeys::last_counts);
  /// Empty if the text is not valid JSON.
  static std::optional<Json> parse_if_valid(std::string_view text);
  /// Serialises on one line, or with `indent` spaces per level. Invalid UTF-8 becomes the replacement character, a
  /// non-finite number null. Numbers round-trip to the same bits.
  std::string dump(int indent = -1) const;

  Kind kind() const noexcept { return static_cast<Kind>(value_.index()); }
  /// "null", "boolean", "number", "string", "array" or "object".
  const char* kind_name() const noexcept;
  bool is_null() const noexcept { return kind() == Kind::null; }
  bool is_boolean() const noexcept { return kind() == Kind::boolean; }
  bool is_integer() const noexcept { return kind() == Kind::integer; }
  bool is_number() const noexcept { return kind() == Kind::integer || kind() == Kind::number; }
  bool is_string() const noexcept { return kind() == Kind::text; }
  bool is_array() const noexcept { return kind() == Kind::array; }
  bool is_object() const noexcept { return kind() == Kind::object; }

  // These throw JsonError for a value of another kind.
  bool as_flag() const;
  std::int64_t as_integer() const;  ///< truncates decimals
  double as_number() const;
  const std::string& as_text() const;
  template <class T>
  T get() const {
    if constexpr (std::same_as<T, bool>) {
      return as_flag();
    } else if constexpr (std::integral<T>) {
      return static_cast<T>(as_integer());
    } else if constexpr (std::floating_point<T>) {
      return static_cast<T>(as_number());
    } else if constexpr (std::same_as<T, Json>) {
      return *this;
    } else if constexpr (std::same_as<T, std::string>) {
      return as_text();
    } else {
      T values;  // a vector
      for (const Json& value : *this) values.push_back(value.get<typename T::value_type>());
      return values;
    }
  }

  // For arrays and objects. Null counts as empty; for other values these throw JsonError.
  std::size_t size() const;
  bool empty() const { return size() == 0; }
  void reserve(std::size_t count);
  void push_back(Json value);
  Json& emplace_back();
  const Json* begin() const;
  const Json* end() const;
  Json* begin();
  Json* end();
  const Json& front() const { return at(0); }
  const Json& back() const { return at(size() - 1); }
  Json& back() { return const_cast<Json&>(std::as_const(*this).back()); }
  template <std::integral Index>
  const Json& at(Index index) const {
    return element(static_cast<std::size_t>(index));
  }
  template <std::integral Index>
  const Json& operator[](Index index) const {
    return element(static_cast<std::size_t>(index));
  }
  template <std::integral Index>
  Json& operator[](Index index) {
    return const_cast<Json&>(element(static_cast<std::size_t>(index)));
  }

  const std::vector<Member>& items() const;
  const Json* find(std::string_view key) const;  ///< null if there is none
  bool contains(std::string_view key) const { return find(key) != nullptr; }
  const Json& at(std::string_view key) const;
  const Json& operator[](std::string_view key) const { return at(key); }
  /// Creates the member if there is none.
  Json& operator[](std::string_view key);
  /// The member, or the given value if there is none.
  template <class T>
  T value(std::string_view key, const T& otherwise) const {
    const Json* found = find(key);
    return found ? found->get<T>() : otherwise;
  }
  std::string value(std::string_view key, const char* otherwise) const { return value(key, std::string(otherwise)); }
  void erase(std::string_view key);
  /// Copies all members of another object.
  void update(const Json& other);

  /// Numbers are compared by value, members in their order.
  RHEC_EXPORT friend bool operator==(const Json& a, const Json& b);

 private:
  using Array = std::vector<Json>;
  using Object = std::vector<Member>;
  // In the order of Kind.
  using Value = std::variant<std::monostate, bool, std::int64_t, double, std::unique_ptr<std::string>,
                             std::unique_ptr<Array>, std::unique_ptr<Object>>;
  template <class T>
  static Json from_integer(T value) noexcept {
    Json json;
    if (std::in_range<std::int64_t>(value)) {
      json.value_ = static_cast<std::int64_t>(value);
    } else {
      json.value_ = static_cast<double>(value);
    }
    return json;
  }
  const Json& element(std::size_t index) const;
  [[noreturn]] void refuse(const char* expected) const;

  template <class T>
  const T& held() const noexcept {
    return **std::get_if<std::unique_ptr<T>>(&value_);
  }
  template <class T>
  T& held() noexcept {
    return **std::get_if<std::unique_ptr<T>>(&value_);
  }

  Value value_;
};

/// Settings as JSON; text that reads as a number or boolean becomes one.
RHEC_EXPORT Json json_of(const Settings& settings);
/// The same as text, which is also valid YAML.
RHEC_EXPORT std::string json_text(const Settings& settings);

/// Appends a quoted JSON string.
RHEC_EXPORT void append_quoted(std::string_view value, std::string& text);

}  // namespace rhec::sim
