#pragma once

#include <memory>

#include "rhec/core/config/options.hpp"
#include "rhec/core/estimation/smoother.hpp"
#include "rhec/plugins/robot/estimator_makers.hpp"
#include "rhec/plugins/robot/option_section.hpp"
#include "rhec/plugins/robot/robot_context.hpp"

namespace rhec {

/// The keys of the section `smoother`.
struct RHEC_EXPORT SmootherOptions {
  double deadline = 600.0;  ///< of the solver [s]
  int laws = 8;             ///< of priors: at most so many are solved for and mixed
  Settings blocking, priors, robust, solver;
  static const OptionTable<SmootherOptions>& table();
};

/// The section `smoother`: the estimator's problem over a whole log, with blocks or with priors. Everything else is
/// taken from `estimator`.
class RHEC_EXPORT SmootherSection {
 public:
  SmootherSection(std::shared_ptr<const RobotContext> context, const Settings& section);
  static OptionSection documentation();

  const SmootherOptions& options() const noexcept { return options_; }
  /// When a smoother that begins now has to stop.
  Clock::time_point deadline() const;
  /// With the blocks or the priors of this section; else with those of the estimator.
  std::unique_ptr<Smoother> make(const EstimatorParts& estimator) const;

 private:
  bool follows_priors(const EstimatorParts& estimator) const;

  std::shared_ptr<const RobotContext> context_;
  SmootherOptions options_;
};

}  // namespace rhec
