// What the tests of a robot's sections share: settings with places, the context of a vehicle, and the text of an error.
#pragma once

#include <memory>
#include <string>

#include "rhec/core/base/error.hpp"
#include "rhec/plugins/robot/bounds_section.hpp"
#include "rhec/plugins/robot/model_section.hpp"
#include "rhec/plugins/robot/option_section.hpp"
#include "rhec/plugins/robot/robot_context.hpp"
#include "rhec/plugins/yaml/yaml.hpp"

namespace rhec {

inline const Host& host() {
  static const Host found;
  return found;
}

/// The first line of the text is line 1 of robot.yaml.
inline Settings settings(const std::string& text) { return parse_yaml(text, "robot.yaml"); }

/// Of a bicycle with slip: states x_pos, y_pos, beta, delta; inputs u1, u2; parameters kappa, mu; outputs x_gps, y_gps,
/// delta.
inline std::shared_ptr<const RobotContext> context_with(const std::string& bounds = {}) {
  const auto model = ModelSection(host(), {}).model();
  return std::make_shared<const RobotContext>(
      RobotContext{host(), 0.2, model, BoundsSection(settings(bounds), model->description()).bounded(),
                   NoiseSection({}, model->description())});
}

/// The default that a section's documentation shows of a key.
inline std::string documented_default(const OptionSection& section, const std::string& key) {
  for (const OptionRow& row : section.rows)
    if (row.name == key) return row.default_value;
  return "(no such key)";
}

}  // namespace rhec
