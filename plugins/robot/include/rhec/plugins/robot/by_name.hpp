#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "rhec/core/config/option_values.hpp"
#include "rhec/core/model/model.hpp"

namespace rhec {

/// A standard deviation, or 0, if the range has it. Between the least and the largest of them lies what doubles tell
/// apart: problems whose weights differ by more are solved to no digit.
struct RHEC_EXPORT SigmaValue {
  static constexpr double least = 1e-9, most = 1e9;
  Range range;
  double read(const Settings& from, const OptionContext& context) const;
  std::string type() const { return NumberValue{range}.type(); }
  std::string constraint() const { return NumberValue{range}.constraint(); }
};

/// [lower, upper] as written in a configuration; null stands for no bound.
struct RHEC_EXPORT BoundsValue {
  static constexpr double farthest = 1e9;  ///< what is farther off is no bound of a vehicle's
  std::pair<double, double> read(const Settings& from, const OptionContext& context) const;
  std::string type() const { return "list of 2 numbers"; }
  std::string constraint() const { return "lower <= upper; null for none"; }
};

/// The default of a variable that is not named, as text and as a value.
template <class Item>
struct DefaultByName {
  std::string text;
  std::function<Item(const ModelDescription& about, const Variable& variable, std::size_t index)> value;
};
/// The same number for all.
RHEC_EXPORT DefaultByName<double> constant_default(double number);
/// A fraction of the variable's typical magnitude.
RHEC_EXPORT DefaultByName<double> scaled_default(double share);

/// A configuration map from names of a model's variables to values of one type, e.g. `process_noise: {kappa: 0.03}`:
/// which variables it may name, the defaults of the others, and the documentation of both.
template <class Value>
class ByName {
 public:
  using Item = decltype(std::declval<const Value&>().read(std::declval<const Settings&>(), OptionContext{}));

  /// Variables that the map may name.
  struct Kind {
    std::string
        placeholder;  ///< "PARAMETER": stands for the names in the documentation; consecutive kinds may share one
    std::vector<Variable> ModelDescription::*variables;
    DefaultByName<Item> otherwise;
    std::string meaning;
  };

  /// `owner` says whose values they are, for error messages.
  ByName(std::string owner, Value value, std::vector<Kind> kinds)
      : owner_(std::move(owner)), value_(std::move(value)), kinds_(std::move(kinds)) {}

  /// The values of a model's variables, one kind after the other. Throws Error for unknown names, with the nearest
  /// known one, and for values that cannot be read. Names in `passed_over` may stand there, and count for nothing.
  std::vector<Item> read(const Settings& map, const ModelDescription& about,
                         const std::vector<std::string>& passed_over = {}) const {
    std::vector<std::string> known;
    for (const Kind& kind : kinds_)
      for (const Variable& variable : about.*kind.variables) known.push_back(variable.name);
    std::vector<std::string> allowed = known;
    allowed.insert(allowed.end(), passed_over.begin(), passed_over.end());
    check_keys(map, allowed, owner_);
    std::vector<Item> items;
    items.reserve(known.size());
    for (const Kind& kind : kinds_) {
      const std::vector<Variable>& variables = about.*kind.variables;
      for (std::size_t j = 0; j < variables.size(); ++j) {
        const Settings* given = map.find(variables[j].name);
        items.push_back(given ? value_.read(*given, OptionContext{owner_, variables[j].unit})
                              : kind.otherwise.value(about, variables[j], j));
      }
    }
    return items;
  }

  /// One row per placeholder.
  std::vector<OptionRow> rows() const {
    std::vector<OptionRow> rows;
    for (const Kind& kind : kinds_)
      if (rows.empty() || rows.back().name != kind.placeholder)
        rows.push_back({kind.placeholder, value_.type(), kind.otherwise.text, value_.constraint(), kind.meaning});
    return rows;
  }

 private:
  std::string owner_;
  Value value_;
  std::vector<Kind> kinds_;
};

using NumbersByName = ByName<NumberValue>;
using SigmasByName = ByName<SigmaValue>;

}  // namespace rhec
