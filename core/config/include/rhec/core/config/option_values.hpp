#pragma once

#include <cstddef>
#include <initializer_list>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "rhec/core/config/settings.hpp"

/// The kinds of option values that rhec/core/config/options.hpp combines. Each reads itself from Settings, prints
/// itself, and describes its type and constraint in words.
namespace rhec {

/// One option, as shown to users.
struct OptionRow {
  std::string name;           ///< with the names of its groups: "line_search.steps"
  std::string type;           ///< "number", "integer", "flag", "text", "choice", "list of numbers", "map", ...
  std::string default_value;  ///< as written in a configuration
  std::string constraint;     ///< "at least 1"; empty if all values are allowed
  std::string meaning;        ///< short description, with the unit
};

/// The allowed values of a number. Beside what a range says, a number is 0 or has a magnitude from `least_magnitude` to
/// `most_magnitude`, so that its square and that of its inverse are numbers, with room for what multiplies them.
struct RHEC_EXPORT Range {
  static constexpr double least_magnitude = 1e-100, most_magnitude = 1e100;
  double lower = -std::numeric_limits<double>::infinity();
  double upper = std::numeric_limits<double>::infinity();
  bool lower_is_open = false;    ///< `lower` itself is not allowed
  bool may_be_infinite = false;  ///< .inf and -.inf mean something

  bool contains(double value) const noexcept {
    return (lower_is_open ? value > lower : value >= lower) && value <= upper;
  }
  std::string text() const;  ///< "greater than 0"; empty if every number is allowed
};
constexpr Range any() { return {}; }
constexpr Range at_least(double lower) { return {.lower = lower}; }
constexpr Range greater_than(double lower) { return {.lower = lower, .lower_is_open = true}; }
constexpr Range between(double lower, double upper) { return {.lower = lower, .upper = upper}; }
/// The same range, with infinity where nothing bounds it: "no limit".
constexpr Range or_infinite(Range range) {
  range.may_be_infinite = true;
  return range;
}

/// The candidate that `word` was most likely meant to be (fewest letters inserted, dropped, changed or swapped); empty
/// if none is close.
RHEC_EXPORT std::string nearest(std::string_view word, const std::vector<std::string>& candidates);

/// Which option is read and what it means: the end of every error message.
struct OptionContext {
  std::string_view owner;
  std::string_view meaning;
};

/// An error at `at` of the kind "found 'five', expected an integer, at least 1 (size of ...)".
RHEC_EXPORT Error wrong_option(const Settings& at, const std::string& type, const std::string& constraint,
                               const OptionContext& context);
/// Throws Error unless `from` is a map (or null) whose keys are all in `known` or `skip`.
RHEC_EXPORT void check_keys(const Settings& from, const std::vector<std::string>& known, std::string_view owner,
                            std::initializer_list<std::string_view> skip = {});
/// Throws Error if `from` has a key that is called otherwise now. `renamed` has old and new names.
RHEC_EXPORT void check_old_names(const Settings& from, const std::vector<std::pair<std::string, std::string>>& renamed,
                                 std::string_view owner);
/// Throws Error if a table gets the same name twice.
RHEC_EXPORT void check_new_name(const std::string& name, const std::vector<std::string>& known);

struct RHEC_EXPORT NumberValue {
  Range range;
  double read(const Settings& from, const OptionContext& context) const;
  std::string print(double value) const;
  std::string type() const { return "number"; }
  std::string constraint() const { return range.text(); }
};

struct RHEC_EXPORT IntegerValue {
  Range range;
  int read(const Settings& from, const OptionContext& context) const;
  std::string print(int value) const { return std::to_string(value); }
  std::string type() const { return "integer"; }
  std::string constraint() const { return range.text(); }
};

struct RHEC_EXPORT FlagValue {
  bool read(const Settings& from, const OptionContext& context) const;
  std::string print(bool value) const { return value ? "true" : "false"; }
  std::string type() const { return "flag"; }
  std::string constraint() const { return "true or false"; }
};

struct RHEC_EXPORT TextValue {
  std::string read(const Settings& from, const OptionContext& context) const;
  std::string print(const std::string& value) const { return value; }
  std::string type() const { return "text"; }
  std::string constraint() const { return {}; }
};

struct RHEC_EXPORT SubtreeValue {
  Settings read(const Settings& from, const OptionContext&) const { return from; }
  std::string print(const Settings&) const { return "{}"; }
  std::string type() const { return "map"; }
  std::string constraint() const { return "passed through as it is"; }
};

/// The index in `names` of the value at `from`. Otherwise throws Error with the names and the nearest one.
RHEC_EXPORT std::size_t read_choice(const Settings& from, const std::vector<std::string>& names,
                                    const OptionContext& context);
/// "one of step, ramp"
RHEC_EXPORT std::string one_of(const std::vector<std::string>& names);

template <class Enum>
struct ChoiceValue {
  std::vector<std::pair<std::string, Enum>> choices;
  Enum read(const Settings& from, const OptionContext& context) const {
    return choices[read_choice(from, names(), context)].second;
  }
  std::string print(Enum value) const {
    for (const auto& [name, meant] : choices) {
      if (meant == value) return name;
    }
    return {};
  }
  std::string type() const { return "choice"; }
  std::string constraint() const { return one_of(names()); }

 private:
  std::vector<std::string> names() const {
    std::vector<std::string> all;
    for (const auto& choice : choices) all.push_back(choice.first);
    return all;
  }
};

template <class Value>
struct OptionalValue {
  Value value;
  using Result = decltype(value.read(std::declval<const Settings&>(), std::declval<const OptionContext&>()));
  std::optional<Result> read(const Settings& from, const OptionContext& context) const {
    if (from.is_null() || from.text() == "none") return std::nullopt;
    return value.read(from, context);
  }
  std::string print(const std::optional<Result>& given) const { return given ? value.print(*given) : "none"; }
  std::string type() const { return value.type() + " or none"; }
  std::string constraint() const { return value.constraint(); }
};

/// A value, or `auto`: chosen by the program.
template <class Value>
struct AutomaticValue {
  Value value;
  using Result = decltype(value.read(std::declval<const Settings&>(), std::declval<const OptionContext&>()));
  std::optional<Result> read(const Settings& from, const OptionContext& context) const {
    if (from.text() == "auto") return std::nullopt;
    try {
      return value.read(from, context);
    } catch (const Error&) {
      throw wrong_option(from, type(), constraint(), context);
    }
  }
  std::string print(const std::optional<Result>& given) const { return given ? value.print(*given) : "auto"; }
  std::string type() const { return value.type() + " or auto"; }
  std::string constraint() const { return value.constraint(); }
};

template <class Value>
struct ListValue {
  Value value;
  using Result = decltype(value.read(std::declval<const Settings&>(), std::declval<const OptionContext&>()));
  std::vector<Result> read(const Settings& from, const OptionContext& context) const {
    if (from.kind() != Settings::Kind::list) throw wrong_option(from, type(), constraint(), context);
    std::vector<Result> values;
    for (const Settings& item : from.items()) values.push_back(value.read(item, context));
    return values;
  }
  std::string print(const std::vector<Result>& values) const {
    std::string text;
    for (const Result& each : values) text += (text.empty() ? "" : ", ") + value.print(each);
    return "[" + text + "]";
  }
  std::string type() const { return "list of " + value.type() + "s"; }
  std::string constraint() const { return value.constraint().empty() ? std::string() : "each " + value.constraint(); }
};

}  // namespace rhec
