#pragma once

#include <concepts>
#include <functional>
#include <initializer_list>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "rhec/core/config/option_entries.hpp"
#include "rhec/core/config/option_values.hpp"

namespace rhec {

/// The options of a struct T: a name, a member (or a function that returns it), a meaning and the allowed values for
/// each. The table reads T from Settings and documents itself; the defaults are those of a default-constructed T.
///
///     struct StructuredOptions {
///       int size = 5;
///       Transition transition = Transition::step;
///       static const OptionTable<StructuredOptions>& table() {
///         static const auto options = OptionTable<StructuredOptions>()
///             .integer("size", &StructuredOptions::size, "block length [intervals]", at_least(1))
///             .choice("transition", &StructuredOptions::transition,
///                     {{"step", Transition::step}, {"ramp", Transition::ramp}}, "how a parameter changes block");
///         return options;
///       }
///     };
template <class T>
class OptionTable {
 public:
  template <std::invocable<T&> Member>
  OptionTable& number(std::string name, Member member, std::string meaning, Range range = any()) {
    return leaf(std::move(name), member, NumberValue{range}, std::move(meaning));
  }
  template <std::invocable<T&> Member>
  OptionTable& integer(std::string name, Member member, std::string meaning, Range range = any()) {
    return leaf(std::move(name), member, IntegerValue{range}, std::move(meaning));
  }
  template <std::invocable<T&> Member>
  OptionTable& flag(std::string name, Member member, std::string meaning) {
    return leaf(std::move(name), member, FlagValue{}, std::move(meaning));
  }
  OptionTable& text(std::string name, std::string T::*member, std::string meaning) {
    return leaf(std::move(name), member, TextValue{}, std::move(meaning));
  }
  template <class Enum>
  OptionTable& choice(std::string name, Enum T::*member,
                      std::vector<std::pair<std::string, std::type_identity_t<Enum>>> choices, std::string meaning) {
    if constexpr (!std::is_enum_v<Enum>) {
      return leaf(std::move(name), member, ChoiceValue<Enum>{std::move(choices)}, std::move(meaning));
    } else {
      std::vector<std::pair<std::string, long long>> numbered;
      numbered.reserve(choices.size());
      for (auto& [called, value] : choices) numbered.emplace_back(std::move(called), static_cast<long long>(value));
      return entry(
          std::move(name), member,
          choice_kind(
              std::move(numbered), [](const void* of) { return static_cast<long long>(*static_cast<const Enum*>(of)); },
              [](void* of, long long number) { *static_cast<Enum*>(of) = static_cast<Enum>(number); }),
          std::move(meaning));
    }
  }
  /// `none` or an empty value means 'no value'.
  OptionTable& optional_number(std::string name, std::optional<double> T::*member, std::string meaning,
                               Range range = any()) {
    return leaf(std::move(name), member, OptionalValue<NumberValue>{{range}}, std::move(meaning));
  }
  OptionTable& optional_integer(std::string name, std::optional<int> T::*member, std::string meaning,
                                Range range = any()) {
    return leaf(std::move(name), member, OptionalValue<IntegerValue>{{range}}, std::move(meaning));
  }
  /// `auto` means 'no value': the program chooses one.
  OptionTable& automatic_integer(std::string name, std::optional<int> T::*member, std::string meaning,
                                 Range range = any()) {
    return leaf(std::move(name), member, AutomaticValue<IntegerValue>{{range}}, std::move(meaning));
  }
  OptionTable& numbers(std::string name, std::vector<double> T::*member, std::string meaning, Range each = any()) {
    return leaf(std::move(name), member, ListValue<NumberValue>{{each}}, std::move(meaning));
  }
  OptionTable& integers(std::string name, std::vector<int> T::*member, std::string meaning, Range each = any()) {
    return leaf(std::move(name), member, ListValue<IntegerValue>{{each}}, std::move(meaning));
  }
  OptionTable& names(std::string name, std::vector<std::string> T::*member, std::string meaning) {
    return leaf(std::move(name), member, ListValue<TextValue>{}, std::move(meaning));
  }
  /// A subtree that is passed on as it is, e.g. the native options of a backend.
  OptionTable& subtree(std::string name, Settings T::*member, std::string meaning) {
    return leaf(std::move(name), member, SubtreeValue{}, std::move(meaning));
  }
  /// The same for a subtree with a known structure: `details` are its rows, named "name.detail", or "name" if a detail
  /// has no name.
  OptionTable& map(std::string name, Settings T::*member, std::vector<OptionRow> details) {
    return entry(std::move(name), member, map_kind(std::move(details)), {});
  }
  /// A nested struct with its own table; its options become rows "name.option".
  template <class Group>
  OptionTable& group(std::string name, Group T::*member, OptionTable<Group> table) {
    return entry(std::move(name), member, group_kind(std::move(table.entries_)), {});
  }

  /// An option that had another name once. The old name is refused with an error that gives the new one.
  OptionTable& renamed(std::string old_name, std::string new_name) {
    entries_.add_renamed(std::move(old_name), std::move(new_name));
    return *this;
  }

  /// The options in `from` (a map, or null for all defaults). `context` names their owner, e.g. "blocking
  /// 'structured'"; keys in `skip` (e.g. the "name" that selects the plugin) are ignored. Throws Error with the place,
  /// the key path, what was found and what was expected; for an unknown key it suggests the nearest known one.
  T parse(const Settings& from, std::string_view context, std::initializer_list<std::string_view> skip = {}) const {
    T result{};
    parse_into(result, from, context, skip);
    return result;
  }

  /// The same, starting from the values in `into`.
  void parse_into(T& into, const Settings& from, std::string_view context,
                  std::initializer_list<std::string_view> skip = {}) const {
    entries_.read(&into, from, context, skip);
  }

  /// One row per option, in the order of the table.
  std::vector<OptionRow> schema() const {
    std::vector<OptionRow> rows;
    describe(T{}, "", rows);
    return rows;
  }

  /// Appends the rows, with the default values in `defaults`.
  void describe(const T& defaults, const std::string& prefix, std::vector<OptionRow>& rows) const {
    entries_.describe(&defaults, prefix, rows);
  }

 private:
  template <class>
  friend class OptionTable;

  template <class Member, class Value>
  OptionTable& leaf(std::string name, Member member, Value value, std::string meaning) {
    using Target = std::remove_cvref_t<std::invoke_result_t<const Member&, T&>>;
    using Result = decltype(value.read(std::declval<const Settings&>(), std::declval<const OptionContext&>()));
    std::shared_ptr<const OptionKind> kind;
    if constexpr (std::is_same_v<Target, Result> && requires { usual_kind(value); })
      kind = usual_kind(std::move(value));
    else
      kind = std::make_shared<const KindOf<Value, Target>>(std::move(value));
    return entry(std::move(name), member, std::move(kind), std::move(meaning));
  }

  template <class Member>
  OptionTable& entry(std::string name, Member member, std::shared_ptr<const OptionKind> kind, std::string meaning) {
    entries_.add(
        std::move(name), std::move(meaning),
        [member](void* object) -> void* { return std::addressof(std::invoke(member, *static_cast<T*>(object))); },
        std::move(kind));
    return *this;
  }

  OptionEntries entries_;
};

}  // namespace rhec
