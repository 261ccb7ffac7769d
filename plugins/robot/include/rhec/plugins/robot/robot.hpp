#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "rhec/core/config/options.hpp"
#include "rhec/core/control/controller.hpp"
#include "rhec/core/estimation/estimator.hpp"
#include "rhec/core/estimation/full_information.hpp"
#include "rhec/core/horizon/rhe_problem.hpp"
#include "rhec/plugins/host/host.hpp"

namespace rhec {

/// What of a configuration file a robot needs; each is a section of its own, described in docs/configuration.md.
struct RobotOptions {
  double step = 0.2;  ///< dt: longest interval of the estimator, interval of the controller [s]
  Settings model, noise, bounds, blocking, estimator, controller, smoother;

  RHEC_EXPORT static const OptionTable<RobotOptions>& table();
  /// The same rows for a struct that has more keys beside them.
  template <class Derived>
  static OptionTable<Derived>& add_to(OptionTable<Derived>& rows) {
    return rows
        .number("step", &Derived::step, "longest interval of the estimator, interval of the controller [s]",
                greater_than(0.0))
        .subtree("model", &Derived::model, "the vehicle: name and options of a model plugin")
        .subtree("noise", &Derived::noise, "standard deviations: outputs and inputs, by the variable's name")
        .subtree("bounds", &Derived::bounds,
                 "[lower, upper] by the variable's name; the model's own where none is given")
        .subtree("blocking", &Derived::blocking, "by parameter: name and options of a blocking plugin")
        .subtree("estimator", &Derived::estimator, "how state and parameters are estimated")
        .subtree("controller", &Derived::controller, "how the path is followed")
        .subtree("smoother", &Derived::smoother, "how a whole log is estimated at once; see 'rhec smooth'");
  }
};

/// The section `estimator`.
struct EstimatorOptions {
  enum class Name { rhe, ekf, truth };
  Name name = Name::rhe;
  int horizon = 15;
  int substeps = 1;
  Settings arrival, forgetting, restart_sigma, block_sigma, initial, robust, solver;
  int heading_starts = 1;
  static const OptionTable<EstimatorOptions>& table();
};

/// The section `controller`.
struct ControllerOptions {
  int horizon = 15;
  int substeps = 1;
  ReferenceSpeed reference_speed = ReferenceSpeed::ground;
  double least_speed_factor = 0.3;
  double speed_bound_factor = 2.5, speed_bound_offset = 1.0;
  Settings weights, blocking, solver;
  static const OptionTable<ControllerOptions>& table();
};

/// The section `smoother`: the estimator's problem over a whole log. What is not here is as in `estimator`.
struct SmootherOptions {
  Settings blocking, robust, solver;
  double deadline = 60.0;  ///< of the solver [s]
  static const OptionTable<SmootherOptions>& table();
};

/// A section of a configuration file with its keys, for people. A name in capitals stands for each variable of its
/// kind.
struct OptionSection {
  std::string name;
  std::string meaning;
  std::vector<OptionRow> rows;
};
/// The sections of RobotOptions: model, noise, bounds, blocking, estimator, controller, smoother.
RHEC_EXPORT std::vector<OptionSection> robot_sections();

/// Numbers that a map gives by the names of variables; `defaults` for those that it does not name. Throws Error for
/// unknown names (with the nearest) and for values that are outside `range`, or infinite where they may not be.
RHEC_EXPORT std::vector<double> numbers_by_name(const Settings& map, const std::vector<Variable>& variables,
                                                std::vector<double> defaults, const Range& range,
                                                const std::string& owner, bool may_be_infinite = false);
/// [lower, upper] as it is written in a configuration; null stands for no bound. Throws Error.
RHEC_EXPORT std::pair<double, double> bounds_in(const Settings& pair);
/// Throws Error unless every key of a map (or null) is known; the nearest known one is suggested.
RHEC_EXPORT void require_known_keys(const Settings& map, const std::vector<std::string>& known,
                                    const std::string& owner);

/// Standard deviations of measured variables where a configuration gives none: a share of their typical magnitudes.
RHEC_EXPORT std::vector<double> default_sigmas(const std::vector<Variable>& variables);

/// A plugin as a configuration names it.
struct PluginChoice {
  std::string name;
  Settings options;  ///< a map, without the name
};

/// Makes models, estimators and controllers from configuration, with plugins by name.
class RHEC_EXPORT Robot {
 public:
  /// Throws Error, naming file, line and key, for whatever is wrong in any section.
  Robot(const Host& host, const RobotOptions& options);
  /// From a file that has just the keys of RobotOptions.
  static Robot from_file(const Host& host, const std::string& yaml_file);

  const std::shared_ptr<const Model>& model() const noexcept { return model_; }
  PluginChoice model_choice() const;
  PluginChoice solver_choice(std::string_view kind) const;  ///< of the estimator (rhe) or the controller (rhc)
  PluginChoice blocking_choice(int parameter) const;
  double step() const noexcept { return options_.step; }
  const EstimatorOptions& estimator_options() const noexcept { return estimator_; }
  const SmootherOptions& smoother_options() const noexcept { return smoother_; }
  const std::vector<double>& output_sigmas() const noexcept { return output_sigmas_; }
  const std::vector<double>& input_sigmas() const noexcept { return input_sigmas_; }
  /// What the model says of itself, with the bounds of this configuration.
  ModelDescription bounded_description() const;
  /// Of the section `blocking`, by parameter.
  std::vector<std::shared_ptr<const Blocking>> make_blockings() const;

  /// Is given the solver of each estimator (rhe) and controller (rhc) made from now on, and returns the one to use in
  /// its place, never null: to watch what it is asked, say. Goes round what wraps them already; copies of the robot
  /// have it too.
  using SolverWrap = std::function<std::shared_ptr<Solver>(std::string_view, std::shared_ptr<Solver>)>;
  void wrap_solvers(SolverWrap wrap);

  /// The estimator of the section `estimator`; the initial state, where given, takes the place of that section's.
  std::unique_ptr<Estimator> make_estimator(const std::optional<Eigen::VectorXd>& initial_state = {}) const;
  std::unique_ptr<Controller> make_controller(const Path& path) const;
  /// What estimates a whole log at once (sections `smoother` and `estimator`).
  FullInformationEstimation make_smoother(const std::optional<Eigen::VectorXd>& initial_state = {}) const;

  /// Is given the method of each estimator made from now on, and returns the one to use in its place, never null: a
  /// NodeRecorder, say. Copies of the robot have it too.
  using MethodWrap = std::function<std::unique_ptr<EstimationMethod>(std::unique_ptr<EstimationMethod>)>;
  void wrap_methods(MethodWrap wrap) { method_wrap_ = std::move(wrap); }

 private:
  void read_initial(const std::optional<Eigen::VectorXd>& initial_state, Eigen::VectorXd& mean,
                    Eigen::MatrixXd& covariance) const;
  void read_bounds();
  void check_estimator() const;
  std::unique_ptr<EstimationMethod> make_receding_horizon(const Eigen::VectorXd& mean,
                                                          const Eigen::MatrixXd& covariance) const;
  std::vector<RobustLoss> read_robust(const Settings& section, const std::string& owner) const;
  std::shared_ptr<Solver> make_solver(std::string_view kind) const;
  FullInformationEstimation::Setup estimation_setup(int horizon, const Settings& blocking) const;

  Host host_;
  RobotOptions options_;
  EstimatorOptions estimator_;
  ControllerOptions controller_;
  std::shared_ptr<const Model> model_;
  SmootherOptions smoother_;
  SolverWrap wrap_;
  MethodWrap method_wrap_;
  std::vector<double> output_sigmas_, input_sigmas_;
  std::vector<double> state_lower_, state_upper_, input_lower_, input_upper_, parameter_lower_, parameter_upper_;
};

}  // namespace rhec
