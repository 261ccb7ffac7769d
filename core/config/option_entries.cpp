#include "rhec/core/config/option_entries.hpp"

namespace rhec {
namespace {

template <class Target, class Value>
std::shared_ptr<const OptionKind> kind_of(Value value) {
  return std::make_shared<const KindOf<Value, Target>>(std::move(value));
}

class ChoiceKind final : public OptionKind {
 public:
  using Number = long long;
  ChoiceKind(std::vector<std::pair<std::string, Number>> choices, Number (*get)(const void*),
             void (*set)(void*, Number))
      : choices_{std::move(choices)}, get_(get), set_(set) {}
  void read(void* variable, const Settings& from, const OptionContext& context) const override {
    set_(variable, choices_.read(from, context));
  }
  void describe(const void* variable, const std::string& name, const std::string& meaning,
                std::vector<OptionRow>& rows) const override {
    rows.push_back({name, choices_.type(), choices_.print(get_(variable)), choices_.constraint(), meaning});
  }

 private:
  ChoiceValue<Number> choices_;
  Number (*get_)(const void*);
  void (*set_)(void*, Number);
};

class MapKind final : public OptionKind {
 public:
  explicit MapKind(std::vector<OptionRow> details) : details_(std::move(details)) {}
  void read(void* variable, const Settings& from, const OptionContext& /*context*/) const override {
    *static_cast<Settings*>(variable) = from;
  }
  void describe(const void* /*variable*/, const std::string& name, const std::string& /*meaning*/,
                std::vector<OptionRow>& rows) const override {
    for (const OptionRow& detail : details_) {
      rows.push_back(detail);
      rows.back().name = detail.name.empty() ? name : name + "." + detail.name;
    }
  }

 private:
  std::vector<OptionRow> details_;
};

class GroupKind final : public OptionKind {
 public:
  explicit GroupKind(OptionEntries entries) : entries_(std::move(entries)) {}
  void read(void* variable, const Settings& from, const OptionContext& context) const override {
    entries_.read(variable, from, context.owner);
  }
  void describe(const void* variable, const std::string& name, const std::string& /*meaning*/,
                std::vector<OptionRow>& rows) const override {
    entries_.describe(variable, name + ".", rows);
  }

 private:
  OptionEntries entries_;
};

}  // namespace

OptionKind::~OptionKind() = default;

template <>
std::shared_ptr<const OptionKind> usual_kind(NumberValue value) {
  return kind_of<double>(value);
}
template <>
std::shared_ptr<const OptionKind> usual_kind(IntegerValue value) {
  return kind_of<int>(value);
}
template <>
std::shared_ptr<const OptionKind> usual_kind(FlagValue value) {
  return kind_of<bool>(value);
}
template <>
std::shared_ptr<const OptionKind> usual_kind(TextValue value) {
  return kind_of<std::string>(value);
}
template <>
std::shared_ptr<const OptionKind> usual_kind(SubtreeValue value) {
  return kind_of<Settings>(value);
}
template <>
std::shared_ptr<const OptionKind> usual_kind(OptionalValue<NumberValue> value) {
  return kind_of<std::optional<double>>(value);
}
template <>
std::shared_ptr<const OptionKind> usual_kind(OptionalValue<IntegerValue> value) {
  return kind_of<std::optional<int>>(value);
}
template <>
std::shared_ptr<const OptionKind> usual_kind(AutomaticValue<IntegerValue> value) {
  return kind_of<std::optional<int>>(value);
}
template <>
std::shared_ptr<const OptionKind> usual_kind(ListValue<NumberValue> value) {
  return kind_of<std::vector<double>>(value);
}
template <>
std::shared_ptr<const OptionKind> usual_kind(ListValue<IntegerValue> value) {
  return kind_of<std::vector<int>>(value);
}
template <>
std::shared_ptr<const OptionKind> usual_kind(ListValue<TextValue> value) {
  return kind_of<std::vector<std::string>>(value);
}

std::shared_ptr<const OptionKind> choice_kind(std::vector<std::pair<std::string, long long>> choices,
                                              long long (*get)(const void* variable),
                                              void (*set)(void* variable, long long number)) {
  return std::make_shared<const ChoiceKind>(std::move(choices), get, set);
}

std::shared_ptr<const OptionKind> map_kind(std::vector<OptionRow> details) {
  return std::make_shared<const MapKind>(std::move(details));
}

std::shared_ptr<const OptionKind> group_kind(OptionEntries entries) {
  return std::make_shared<const GroupKind>(std::move(entries));
}

OptionEntries::OptionEntries() = default;
OptionEntries::OptionEntries(const OptionEntries&) = default;
OptionEntries::OptionEntries(OptionEntries&&) noexcept = default;
OptionEntries& OptionEntries::operator=(const OptionEntries&) = default;
OptionEntries& OptionEntries::operator=(OptionEntries&&) noexcept = default;
OptionEntries::~OptionEntries() = default;

void OptionEntries::add(std::string name, std::string meaning, std::function<void*(void* object)> variable_of,
                        std::shared_ptr<const OptionKind> kind) {
  check_new_name(name, names_);
  names_.push_back(std::move(name));
  entries_.push_back({std::move(meaning), std::move(variable_of), std::move(kind)});
}

void OptionEntries::add_renamed(std::string old_name, std::string new_name) {
  renamed_.emplace_back(std::move(old_name), std::move(new_name));
}

void OptionEntries::read(void* object, const Settings& from, std::string_view context,
                         std::initializer_list<std::string_view> skip) const {
  check_old_names(from, renamed_, context);
  check_keys(from, names_, context, skip);
  for (std::size_t k = 0; k < entries_.size(); ++k) {
    const Entry& option = entries_[k];
    if (const Settings* value = from.find(names_[k]))
      option.kind->read(option.variable_of(object), *value, OptionContext{context, option.meaning});
  }
}

void OptionEntries::describe(const void* object, const std::string& prefix, std::vector<OptionRow>& rows) const {
  // Its variables are read alone.
  void* const read_only = const_cast<void*>(object);
  for (std::size_t k = 0; k < entries_.size(); ++k)
    entries_[k].kind->describe(entries_[k].variable_of(read_only), prefix + names_[k], entries_[k].meaning, rows);
}

}  // namespace rhec
