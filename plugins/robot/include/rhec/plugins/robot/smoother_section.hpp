#pragma once

#include <memory>

#include "rhec/core/config/options.hpp"
#include "rhec/core/estimation/full_information.hpp"
#include "rhec/plugins/robot/estimator_makers.hpp"
#include "rhec/plugins/robot/option_section.hpp"
#include "rhec/plugins/robot/robot_context.hpp"

namespace rhec {

/// The keys of the section `smoother`.
struct RHEC_EXPORT SmootherOptions {
  double deadline = 60.0;  ///< of the solver [s]
  Settings blocking, robust, solver;
  static const OptionTable<SmootherOptions>& table();
};

/// The section `smoother`: the estimator's problem over a whole log. Everything else is taken from `estimator`.
class RHEC_EXPORT SmootherSection {
 public:
  SmootherSection(std::shared_ptr<const RobotContext> context, const Settings& section);
  static OptionSection documentation();

  const SmootherOptions& options() const noexcept { return options_; }
  FullInformationEstimation make(const EstimatorParts& estimator) const;

 private:
  std::shared_ptr<const RobotContext> context_;
  SmootherOptions options_;
};

}  // namespace rhec
