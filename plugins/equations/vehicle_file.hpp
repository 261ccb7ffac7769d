#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "rhec/core/config/option_values.hpp"
#include "rhec/core/config/settings.hpp"
#include "rhec/core/model/model.hpp"
#include "statements.hpp"

namespace rhec::equations {

/// A number that the file declares and a configuration may set.
struct Option {
  std::string name;
  std::vector<Item> otherwise;  ///< default, a term of numbers; empty if there is none
  Range range;
  std::string unit, meaning;

  std::string described() const;  ///< "distance of the axles [m]"
};

/// A bound of a variable: a term of numbers and options; empty for none.
struct Bounds {
  std::vector<Item> lower, upper;
};

/// A vehicle's equations, as they are written: docs/equations.md describes it. Its constructors throw Error with the
/// place of the first mistake that can be told without values.
class VehicleFile {
 public:
  explicit VehicleFile(const std::filesystem::path& file);
  /// The same in a part of another file, e.g. of a scenario.
  explicit VehicleFile(const Settings& section);

  const std::string& name() const { return file_; }
  /// All but the bounds, which depend on options.
  const ModelDescription& description() const { return description_; }
  /// The bounds of states, inputs and parameters, one after the other.
  const std::vector<Bounds>& bounds() const { return bounds_; }
  const std::vector<Option>& options() const { return options_; }
  const std::vector<Statement>& equations() const { return equations_; }
  const std::vector<Statement>& straight_motion() const { return straight_motion_; }
  /// The text of the equations, as it is written.
  const std::string& equations_text() const { return settings_.find("equations")->text(); }
  bool has_straight_motion() const { return settings_.find("straight_motion") != nullptr; }
  /// The place of a variable, e.g. "states", "delta".
  Place place(std::string_view section, const std::string& variable) const;

 private:
  void read();
  void read_options();
  void read_variables(const char* section, std::vector<Variable>& variables);
  void read_variable(std::string_view section, Variable& variable, const Settings& about, int index);
  void read_role(std::string_view section, const Settings& role, int index);
  void check_name(const Settings& at, const std::string& name);
  std::vector<Item> term_of(const Settings& scalar) const;
  SourceText text_of(const Settings& scalar) const;
  std::vector<Statement> statements_of(const char* section) const;

  std::string file_, text_;
  std::vector<std::string_view> lines_;
  Settings settings_;
  ModelDescription description_;
  std::vector<Bounds> bounds_;
  std::vector<Option> options_;
  std::vector<Statement> equations_, straight_motion_;
  std::vector<std::string> names_;  ///< taken by variables and options
};

}  // namespace rhec::equations
