#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rhec/plugins/robot/blocking_section.hpp"
#include "rhec/plugins/robot/controller_section.hpp"
#include "rhec/plugins/robot/estimator_section.hpp"
#include "rhec/plugins/robot/hooks.hpp"
#include "rhec/plugins/robot/model_section.hpp"
#include "rhec/plugins/robot/robot_context.hpp"
#include "rhec/plugins/robot/smoother_section.hpp"

namespace rhec {

/// The part of a configuration file that a robot needs; docs/configuration.md describes each section.
struct RobotOptions {
  double step = Estimator::Timeline{}.longest_interval;  ///< dt [s]
  Settings model, noise, bounds, blocking, estimator, controller, smoother;
  Settings signals;  ///< read by who reads a log, or listens to a robot: rhec/logs/mapping/signal_map.hpp
  Settings ros;      ///< read by `rhec ros`

  RHEC_EXPORT static const OptionTable<RobotOptions>& table();
  /// Adds the same rows to the table of a struct that has further keys.
  template <class Derived>
  static OptionTable<Derived>& add_to(OptionTable<Derived>& rows) {
    return rows
        .number("step", &Derived::step, "interval of the estimator's nodes, and of the controller [s]",
                between(1e-5, 1e5))
        .subtree("model", &Derived::model, "the vehicle: name and options of a model plugin")
        .subtree("noise", &Derived::noise, "standard deviations: outputs and inputs, by the variable's name")
        .subtree("bounds", &Derived::bounds,
                 "[lower, upper] by the variable's name; the model's own where none is given")
        .subtree("blocking", &Derived::blocking, "by parameter: name and options of a blocking plugin")
        .subtree("estimator", &Derived::estimator, "how state and parameters are estimated")
        .subtree("controller", &Derived::controller, "how the path is followed")
        .subtree("smoother", &Derived::smoother, "how a whole log is estimated at once; see 'rhec smooth'")
        .subtree("signals", &Derived::signals,
                 "which signals of a log, or of a robot, are the model's outputs and inputs")
        .subtree("ros", &Derived::ros, "how a live node takes part in ROS 2; see 'rhec ros'");
  }
};

/// The sections of RobotOptions: model, noise, bounds, blocking, estimator, controller, smoother.
RHEC_EXPORT std::vector<OptionSection> robot_sections(const EstimatorMakers& estimators = {});

/// Makes models, estimators and controllers from configuration, with plugins by name.
class RHEC_EXPORT Robot {
 public:
  /// Throws Error, with file, line and key, for any mistake in any section.
  Robot(const Host& host, const RobotOptions& options, EstimatorMakers estimators = {});
  /// From a file with only the keys of RobotOptions.
  static Robot from_file(const Host& host, const std::string& yaml_file);

  const std::shared_ptr<const Model>& model() const noexcept { return context_->model; }
  PluginChoice model_choice() const { return model_.choice(); }
  /// Of the estimator (rhe) or the controller (rhc).
  PluginChoice solver_choice(std::string_view kind) const;
  PluginChoice blocking_choice(int parameter) const { return blocking_.choice(parameter); }
  double step() const noexcept { return context_->step; }
  /// For the calls of a sample that begins now, in a loop that has to keep pace with a vehicle: one step from now.
  /// Nothing has a deadline of itself, so that the results of simulations do not depend on the computer's load.
  Clock::time_point deadline() const {
    return Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(step()));
  }
  const EstimatorOptions& estimator_options() const noexcept { return estimator_.options(); }
  /// The model as the estimator integrates it: `model()`, or an ImplicitModel of it.
  const std::shared_ptr<const Model>& estimator_model() const noexcept { return estimator_.model(); }
  /// Steps in which the estimator integrates an interval.
  int substeps() const noexcept { return estimator_.substeps(); }
  const SmootherOptions& smoother_options() const noexcept { return smoother_.options(); }
  const std::vector<double>& output_sigmas() const noexcept { return context_->noise.output_sigmas; }
  const std::vector<double>& input_sigmas() const noexcept { return context_->noise.input_sigmas; }
  /// The model's description, with the bounds of this configuration.
  const ModelDescription& bounded_description() const noexcept { return context_->about; }
  /// The same with the biases and scale errors of `noise.biases` and `noise.scales` as states behind the vehicle's: an
  /// estimate's state begins with these.
  const ModelDescription& estimated_description() const noexcept { return estimated_; }
  const std::vector<SensorError>& output_biases() const noexcept { return context_->noise.biases; }
  const std::vector<SensorError>& output_scales() const noexcept { return context_->noise.scales; }
  /// Whether the section `blocking` gives any; else a window's parameters follow the priors of `estimator.priors`.
  bool has_blockings() const noexcept { return blocking_.is_given(); }
  /// The priors of a parameter as written, e.g. "auto".
  std::string priors_text(int parameter) const { return estimator_.priors_text(parameter); }
  /// What one should know of this configuration though it can be used: keys that count for nothing, numbers that look
  /// like a wrong unit. A sentence each.
  std::vector<std::string> notes() const;
  /// What its estimators remember of places.
  const MemorySection& memory() const noexcept { return estimator_.memory(); }
  /// Of the section `blocking`, by parameter.
  std::vector<std::shared_ptr<const Blocking>> make_blockings() const { return blocking_.make(); }

  /// Replaces the estimators passed to the constructor, e.g. to add one that needs objects created later.
  void use_estimators(EstimatorMakers estimators);
  /// Applies to everything made from now on, outside of the hooks added before. Copies of the robot keep the hooks.
  void add_hooks(std::shared_ptr<const RobotHooks> hooks);

  /// The estimator of the section `estimator`. `initial_state`, if given, is used of the states that the section says
  /// nothing of (NaN: not known either). A heading that nobody has said anything of may be any, and is searched.
  std::unique_ptr<Estimator> make_estimator(const std::optional<Eigen::VectorXd>& initial_state = {}) const;
  /// `ahead`: Estimator::slip_ahead, for a controller that plans with the slip of a map.
  std::unique_ptr<Controller> make_controller(const Path& path, std::shared_ptr<const SlipAhead> ahead = nullptr) const;
  /// When a smoother that begins now has to stop (`smoother.deadline`).
  Clock::time_point smoothing_deadline() const { return smoother_.deadline(); }
  /// Estimates a whole log at once (sections `smoother` and `estimator`).
  std::unique_ptr<Smoother> make_smoother(const std::optional<Eigen::VectorXd>& initial_state = {}) const;

 private:
  ModelSection model_;
  std::shared_ptr<const RobotContext> context_;
  ModelDescription estimated_;
  BlockingSection blocking_;
  EstimatorSection estimator_;
  ControllerSection controller_;
  SmootherSection smoother_;
  RobotHookChain hooks_;
};

}  // namespace rhec
