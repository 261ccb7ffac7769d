#pragma once

#include <memory>
#include <string>

#include "rhec/core/config/option_values.hpp"
#include "rhec/core/config/settings.hpp"
#include "rhec/plugins/host/host.hpp"

namespace rhec {

/// A plugin, as named in a configuration.
struct PluginChoice {
  std::string name;
  Settings options;  ///< a map, without the name
};

/// A part of a configuration that names a plugin: a map of `name` and the plugin's options, or just the name. Product
/// is Model, Blocking, Solver, Prior or Term.
template <class Product>
struct RHEC_EXPORT PluginOption {
  const char* otherwise;  ///< the plugin if none is named

  /// Throws Error as the host does, with the section's place if the plugin finds its options inconsistent.
  std::shared_ptr<Product> make(const Host& host, const Settings& section) const;
  PluginChoice choice(const Settings& section) const;
  /// For the documentation, named "name".
  OptionRow row(std::string meaning = "its options stand beside the name") const;
};

}  // namespace rhec
