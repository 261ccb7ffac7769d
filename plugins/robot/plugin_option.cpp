#include "rhec/plugins/robot/plugin_option.hpp"

#include <algorithm>
#include <filesystem>
#include <string_view>
#include <system_error>
#include <type_traits>
#include <utility>

#include <fmt/format.h>

#include "rhec/core/base/error.hpp"
#include "rhec/core/horizon/blocking.hpp"
#include "rhec/core/model/model.hpp"
#include "rhec/core/ocp/solver.hpp"
#include "rhec/core/prior/prior.hpp"
#include "rhec/core/term/term.hpp"
#include "rhec/plugins/equations/equations.hpp"

namespace rhec {
namespace {

/// How the host makes a product, and the product's name.
template <class Product>
struct Maker;
template <>
struct Maker<Model> {
  static constexpr auto make = &Host::make_model;
  static constexpr const char* word = "a model plugin";
};
template <>
struct Maker<Blocking> {
  static constexpr auto make = &Host::make_blocking;
  static constexpr const char* word = "a blocking plugin";
};
template <>
struct Maker<Solver> {
  static constexpr auto make = &Host::make_solver;
  static constexpr const char* word = "a solver plugin";
};

template <>
struct Maker<Prior> {
  static constexpr auto make = &Host::make_prior;
  static constexpr const char* word = "a prior plugin";
};

template <>
struct Maker<Term> {
  static constexpr auto make = &Host::make_term;
  static constexpr const char* word = "a term plugin";
};

/// The name of a model or a term whose equations stand in the configuration, among its options.
constexpr const char* inline_equations = "equations";

/// The file with a vehicle's equations that a section names. If it is named in a file, it is relative to that file.
std::string equations_file(const Settings& named) {
  const std::filesystem::path given(named.as_text());
  if (!is_equations_file(given.string()))
    throw named.mismatch("a file with a vehicle's equations, whose name ends in .yaml");
  const bool in_a_file = named.origin().line > 0;
  const std::filesystem::path file =
      in_a_file ? std::filesystem::path(named.origin().file).parent_path() / given : given;
  std::error_code problem;
  if (!std::filesystem::is_regular_file(file, problem))
    throw named.error(fmt::format("found '{}', expected a file with a vehicle's equations; there is no {}",
                                  given.string(), file.string()));
  return file.string();
}

template <class Product>
std::string name_in(const Settings& section, const char* otherwise) {
  if (section.is_null()) return otherwise;
  if (section.kind() == Settings::Kind::scalar) return section.text();
  if (section.kind() != Settings::Kind::map)
    throw section.mismatch("the name of a plugin, or a map with the key 'name' and the plugin's options");
  const Settings* name = section.find("name");
  if constexpr (std::is_same_v<Product, Term>) {
    const Settings* equations = section.find("equations");
    if (equations && name) throw equations->error("found equations and a plugin's name; expected one of the keys");
    if (equations && equations->kind() != Settings::Kind::map)
      throw equations->mismatch("a map of limits and costs (docs/terms.md)");
    if (equations) return inline_equations;
  }
  if constexpr (std::is_same_v<Product, Model>) {
    const Settings* equations = section.find("equations");
    if (equations && name)
      throw equations->error("found a file with equations and a plugin's name; expected one of the keys");
    if (equations && equations->kind() == Settings::Kind::map) return inline_equations;
    if (equations) return equations_file(*equations);
  }
  return name ? name->as_text() : otherwise;
}

/// True if a message begins with a place inside this part of the settings.
bool names_place_of(const Settings& settings, std::string_view message) {
  const std::string& file = settings.origin().file;
  if (!file.empty() && message.starts_with(file + ":")) return true;
  const auto in_item = [&](const Settings& item) { return names_place_of(item, message); };
  const auto in_member = [&](const auto& member) { return names_place_of(member.second, message); };
  return std::any_of(settings.items().begin(), settings.items().end(), in_item) ||
         std::any_of(settings.members().begin(), settings.members().end(), in_member);
}

}  // namespace

template <class Product>
std::shared_ptr<Product> PluginOption<Product>::make(const Host& host, const Settings& section) const {
  try {
    const bool is_name = section.kind() == Settings::Kind::scalar;
    return (host.*Maker<Product>::make)(name_in<Product>(section, otherwise),
                                        is_name ? Settings::map(section.origin()) : section);
  } catch (const Error& mistake) {
    // A plugin that finds its options inconsistent does not know where they are written.
    if (section.is_null() || names_place_of(section, mistake.what())) throw;
    throw section.error(mistake.what());
  }
}

template <class Product>
PluginChoice PluginOption<Product>::choice(const Settings& section) const {
  PluginChoice choice{name_in<Product>(section, otherwise), Settings::map(section.origin())};
  for (const auto& [key, value] : section.members())
    if (key != "name" && !(std::is_same_v<Product, Model> && key == "equations" && choice.name != inline_equations))
      choice.options.add(key, value);
  return choice;
}

template <class Product>
OptionRow PluginOption<Product>::row(std::string meaning) const {
  return {"name", TextValue{}.type(), otherwise, Maker<Product>::word, std::move(meaning)};
}

template struct PluginOption<Model>;
template struct PluginOption<Blocking>;
template struct PluginOption<Solver>;
template struct PluginOption<Prior>;
template struct PluginOption<Term>;

}  // namespace rhec
