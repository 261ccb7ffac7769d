#pragma once

#include <functional>
#include <initializer_list>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "rhec/core/config/option_values.hpp"

// What OptionTable (rhec/core/config/options.hpp) does without knowing its struct: compiled once, and not for every
// table.

namespace rhec {

/// Reads and shows a variable that is given by its address.
class RHEC_EXPORT OptionKind {
 public:
  OptionKind() = default;
  OptionKind(const OptionKind&) = delete;
  OptionKind& operator=(const OptionKind&) = delete;
  virtual ~OptionKind();
  virtual void read(void* variable, const Settings& from, const OptionContext& context) const = 0;
  /// Appends rows for the option `name`, with the value of the variable as the default one.
  virtual void describe(const void* variable, const std::string& name, const std::string& meaning,
                        std::vector<OptionRow>& rows) const = 0;
};

/// A kind of value (rhec/core/config/option_values.hpp) of a variable of type Target.
template <class Value, class Target>
class KindOf final : public OptionKind {
 public:
  explicit KindOf(Value value) : value_(std::move(value)) {}
  void read(void* variable, const Settings& from, const OptionContext& context) const override {
    *static_cast<Target*>(variable) = value_.read(from, context);
  }
  void describe(const void* variable, const std::string& name, const std::string& meaning,
                std::vector<OptionRow>& rows) const override {
    const Target& given = *static_cast<const Target*>(variable);
    rows.push_back({name, value_.type(), value_.print(given), value_.constraint(), meaning});
  }

 private:
  Value value_;
};

/// KindOf<Value, Target> of the usual variables, compiled once: of double, int, bool, std::string, Settings, and of
/// optional values and lists of these.
template <class Value>
std::shared_ptr<const OptionKind> usual_kind(Value value) = delete;
template <>
RHEC_EXPORT std::shared_ptr<const OptionKind> usual_kind(NumberValue value);
template <>
RHEC_EXPORT std::shared_ptr<const OptionKind> usual_kind(IntegerValue value);
template <>
RHEC_EXPORT std::shared_ptr<const OptionKind> usual_kind(FlagValue value);
template <>
RHEC_EXPORT std::shared_ptr<const OptionKind> usual_kind(TextValue value);
template <>
RHEC_EXPORT std::shared_ptr<const OptionKind> usual_kind(SubtreeValue value);
template <>
RHEC_EXPORT std::shared_ptr<const OptionKind> usual_kind(OptionalValue<NumberValue> value);
template <>
RHEC_EXPORT std::shared_ptr<const OptionKind> usual_kind(OptionalValue<IntegerValue> value);
template <>
RHEC_EXPORT std::shared_ptr<const OptionKind> usual_kind(AutomaticValue<IntegerValue> value);
template <>
RHEC_EXPORT std::shared_ptr<const OptionKind> usual_kind(ListValue<NumberValue> value);
template <>
RHEC_EXPORT std::shared_ptr<const OptionKind> usual_kind(ListValue<IntegerValue> value);
template <>
RHEC_EXPORT std::shared_ptr<const OptionKind> usual_kind(ListValue<TextValue> value);

/// One of several names, of a variable that is read and written as a number by these functions.
RHEC_EXPORT std::shared_ptr<const OptionKind> choice_kind(std::vector<std::pair<std::string, long long>> choices,
                                                          long long (*get)(const void* variable),
                                                          void (*set)(void* variable, long long number));
/// Settings that are passed on as they are, of which `details` are known: rows "name.detail", or "name" if a detail has
/// no name.
RHEC_EXPORT std::shared_ptr<const OptionKind> map_kind(std::vector<OptionRow> details);

/// The options of a struct that is given by its address.
class RHEC_EXPORT OptionEntries {
 public:
  OptionEntries();
  OptionEntries(const OptionEntries&);
  OptionEntries(OptionEntries&&) noexcept;
  OptionEntries& operator=(const OptionEntries&);
  OptionEntries& operator=(OptionEntries&&) noexcept;
  ~OptionEntries();

  /// `variable_of` returns the address of the option's variable. Throws Error if there is an option of that name.
  void add(std::string name, std::string meaning, std::function<void*(void* object)> variable_of,
           std::shared_ptr<const OptionKind> kind);
  void add_renamed(std::string old_name, std::string new_name);
  void read(void* object, const Settings& from, std::string_view context,
            std::initializer_list<std::string_view> skip = {}) const;
  void describe(const void* object, const std::string& prefix, std::vector<OptionRow>& rows) const;

 private:
  struct Entry {
    std::string meaning;
    std::function<void*(void*)> variable_of;
    std::shared_ptr<const OptionKind> kind;
  };
  std::vector<std::string> names_;
  std::vector<std::pair<std::string, std::string>> renamed_;  ///< old and new names
  std::vector<Entry> entries_;
};

/// A struct with options of its own: rows "name.option".
RHEC_EXPORT std::shared_ptr<const OptionKind> group_kind(OptionEntries entries);

}  // namespace rhec
