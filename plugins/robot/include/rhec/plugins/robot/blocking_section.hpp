#pragma once

#include <memory>
#include <string>
#include <vector>

#include "rhec/core/estimation/receding_horizon_estimation.hpp"
#include "rhec/core/horizon/blocking.hpp"
#include "rhec/plugins/robot/option_section.hpp"
#include "rhec/plugins/robot/plugin_option.hpp"
#include "rhec/plugins/robot/robot_context.hpp"

namespace rhec {

/// The section `blocking`, or that of the smoother: for each parameter, the blocking, i.e. which intervals of a horizon
/// share one value; and for the process noise of states that have some, under the name STATE_noise.
class RHEC_EXPORT BlockingSection {
 public:
  BlockingSection(std::shared_ptr<const RobotContext> context, const Settings& section);
  static OptionSection documentation();
  /// The row of a parameter; `otherwise`, if not empty, replaces the default plugin's name.
  static OptionRow row(const std::string& otherwise = {});
  /// The row of a state's process noise.
  static OptionRow noise_row();

  /// Whether any parameter's blocking is given.
  bool is_given() const noexcept { return !section_.members().empty(); }
  /// One per parameter.
  std::vector<std::shared_ptr<const Blocking>> make() const;
  /// Throws Error if one of them does not support this horizon; `key` is the key that sets it.
  std::vector<std::shared_ptr<const Blocking>> make_for(int horizon, const std::string& key) const;
  /// The noises that are named; throws as `make_for`.
  std::vector<RecedingHorizonEstimation::Setup::BlockedNoise> make_noises_for(int horizon,
                                                                              const std::string& key) const;
  bool blocks_noise() const;
  PluginChoice choice(int parameter) const;

 private:
  const Settings& section_of(std::size_t parameter) const;
  const Settings* section_of_noise(std::size_t state) const;

  std::shared_ptr<const RobotContext> context_;
  Settings section_;
};

}  // namespace rhec
