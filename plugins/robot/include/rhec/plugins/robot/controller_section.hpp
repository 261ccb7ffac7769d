#pragma once

#include <memory>
#include <string>
#include <vector>

#include "rhec/core/config/options.hpp"
#include "rhec/core/control/controller.hpp"
#include "rhec/plugins/robot/hooks.hpp"
#include "rhec/plugins/robot/integration.hpp"
#include "rhec/plugins/robot/option_section.hpp"
#include "rhec/plugins/robot/plugin_option.hpp"
#include "rhec/plugins/robot/robot_context.hpp"

namespace rhec {

/// The keys of `controller.health`: how fast the vehicle is while an estimate's health is not `ok`.
struct RHEC_EXPORT PaceOptions {
  double degraded = Controller::Setup::Pace{}.degraded, lost = Controller::Setup::Pace{}.lost;
  double heading = Controller::Setup::Pace{}.heading;
  double seconds = Controller::Setup::Pace{}.seconds;
  static const OptionTable<PaceOptions>& table();
};

/// The keys of the section `controller`.
struct RHEC_EXPORT ControllerOptions {
  int horizon = RhcProblem::Setup{}.max_intervals;
  Integrator integrator = Integrator::runge_kutta;
  std::optional<int> substeps = {};  ///< none: chosen for the model
  ReferenceSpeed reference_speed = Controller::Setup{}.reference_speed;
  double least_speed_factor = Controller::Setup{}.least_speed_factor;
  double speed_bound_factor = Controller::Setup{}.speed_bound_factor;
  double speed_bound_offset = Controller::Setup{}.speed_bound_offset;
  bool turn_around = Controller::Setup{}.turns_around;
  PaceOptions health;
  Settings weights, rate_bounds, terms, blocking, solver;
  static const OptionTable<ControllerOptions>& table();
};

/// The section `controller`: how the path is followed.
class RHEC_EXPORT ControllerSection {
 public:
  ControllerSection(std::shared_ptr<const RobotContext> context, const Settings& section);
  static OptionSection documentation();

  const ControllerOptions& options() const noexcept { return options_; }
  PluginChoice solver_choice() const;
  /// Weights and blocking are read only here, since they may not fit the vehicle of a robot that only estimates.
  std::unique_ptr<Controller> make(const Path& path, const RobotHooks& hooks = {},
                                   std::shared_ptr<const SlipAhead> ahead = nullptr) const;
  /// What is likely not meant, e.g. a term that does nothing.
  std::vector<std::string> notes() const;

 private:
  void add_problem(Controller::Setup& setup, int intervals) const;
  void add_blockings(Controller::Setup& setup, int intervals) const;
  const std::vector<Settings>& terms() const;
  TermFunctions functions_of(const Settings& item) const;
  void add_terms(Controller::Setup& setup) const;

  std::shared_ptr<const RobotContext> context_;
  Settings section_;  ///< as written, for error messages
  ControllerOptions options_;
};

}  // namespace rhec
