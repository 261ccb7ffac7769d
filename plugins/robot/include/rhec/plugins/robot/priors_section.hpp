#pragma once

#include <memory>
#include <vector>

#include "rhec/core/prior/standard_bank.hpp"
#include "rhec/plugins/robot/option_section.hpp"
#include "rhec/plugins/robot/plugin_option.hpp"
#include "rhec/plugins/robot/robot_context.hpp"

namespace rhec {

/// `estimator.priors`: for each parameter how it varies along the way. A prior, a list of priors that are weighed
/// against each other, or `auto`.
class RHEC_EXPORT PriorsSection {
 public:
  PriorsSection(std::shared_ptr<const RobotContext> context, const Settings& section);
  static std::vector<OptionRow> rows();

  /// By parameter the priors given; none where that is left open.
  std::vector<PriorCombination> given() const;
  /// The members of a bank: all combinations.
  std::vector<PriorCombination> combinations() const;
  /// Whether any parameter's prior is given, and not `auto`.
  bool is_given() const;
  const Settings& section() const noexcept { return section_; }
  /// Names of a parameter's priors, e.g. "auto" or "walk, matern".
  std::string text(int parameter) const;

 private:
  std::shared_ptr<const RobotContext> context_;
  Settings section_;
};

}  // namespace rhec
