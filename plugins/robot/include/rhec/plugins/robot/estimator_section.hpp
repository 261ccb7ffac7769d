#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "rhec/core/config/options.hpp"
#include "rhec/core/estimation/estimator.hpp"
#include "rhec/plugins/robot/estimator_makers.hpp"
#include "rhec/plugins/robot/health_section.hpp"
#include "rhec/plugins/robot/hooks.hpp"
#include "rhec/plugins/robot/integration.hpp"

namespace rhec {

/// Which covariance an estimate by blocks has.
enum class BlockCovariance { bank, blocks };

/// The keys of the section `estimator`.
struct RHEC_EXPORT EstimatorOptions {
  std::string name = "rhe";
  int horizon = RheProblem::Setup{}.max_intervals;
  Integrator integrator = Integrator::runge_kutta;
  std::optional<int> substeps = {};  ///< none: chosen for the model
  int most_between = 64;
  int heading_starts = RecedingHorizonEstimation::Setup{}.heading_starts;
  BlockCovariance covariance = BlockCovariance::bank;
  HealthOptions health;
  Settings delays, arrival, process_noise, restart_sigma, block_sigma, priors, bank, memory, initial, robust, solver;
  static OptionTable<EstimatorOptions> table(const EstimatorMakers& makers);
};

/// The section `estimator`: how state and parameters are estimated.
class RHEC_EXPORT EstimatorSection {
 public:
  /// Also checks keys that the chosen estimator does not use: otherwise a mistake there would show up only with another
  /// estimator.
  EstimatorSection(std::shared_ptr<const RobotContext> context, BlockingSection blocking, const Settings& section,
                   EstimatorMakers makers = {});
  static OptionSection documentation(const EstimatorMakers& makers = {});

  const EstimatorOptions& options() const noexcept { return options_; }
  PluginChoice solver_choice() const;
  /// The model, as the estimator integrates it.
  const std::shared_ptr<const Model>& model() const noexcept { return parts_.context->model; }
  /// Integration steps of an interval, as given or as the model needs them.
  int substeps() const noexcept { return parts_.substeps; }
  /// The priors of a parameter as written, e.g. "auto" or "walk, matern".
  std::string priors_text(int parameter) const { return parts_.priors.text(parameter); }
  /// What it remembers of places.
  const MemorySection& memory() const noexcept { return parts_.memory; }
  /// Replaces the makers.
  void use(EstimatorMakers makers) { makers_ = std::move(makers); }

  /// `initial_state`, if given, replaces the defaults of the states that the section says nothing of; NaN where it says
  /// nothing either.
  EstimatorParts parts(const std::optional<Eigen::VectorXd>& initial_state = {}) const;
  std::unique_ptr<Estimator> make(const std::optional<Eigen::VectorXd>& initial_state = {},
                                  const RobotHooks& hooks = {}) const;

 private:
  std::unique_ptr<SensorWatch> make_watch_for(const EstimatorMaker& maker, const EstimatorParts& parts) const;
  void require_memory_for(const EstimatorMaker& maker) const;
  void add_states(const std::vector<double>& sigmas);

  EstimatorMakers makers_;
  EstimatorOptions options_;
  EstimatorParts parts_;
  std::vector<double> delays_;  ///< by output
};

}  // namespace rhec
