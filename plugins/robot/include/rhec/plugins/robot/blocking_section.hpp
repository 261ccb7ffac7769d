#pragma once

#include <memory>
#include <string>
#include <vector>

#include "rhec/core/horizon/blocking.hpp"
#include "rhec/plugins/robot/option_section.hpp"
#include "rhec/plugins/robot/plugin_option.hpp"
#include "rhec/plugins/robot/robot_context.hpp"

namespace rhec {

/// The section `blocking`, or that of the smoother: by parameter, the blocking that says which intervals of a horizon
/// share one value.
class RHEC_EXPORT BlockingSection {
 public:
  BlockingSection(std::shared_ptr<const RobotContext> context, const Settings& section);
  static OptionSection documentation();
  /// The row of a parameter; `otherwise` takes the place of the default plugin's name.
  static OptionRow row(const std::string& otherwise = {});

  /// One a parameter.
  std::vector<std::shared_ptr<const Blocking>> make() const;
  /// Throws Error where one of them cannot take the horizon, which `key` sets.
  std::vector<std::shared_ptr<const Blocking>> make_for(int horizon, const std::string& key) const;
  PluginChoice choice(int parameter) const;

 private:
  const Settings& section_of(std::size_t parameter) const;

  std::shared_ptr<const RobotContext> context_;
  Settings section_;
};

}  // namespace rhec
