#include "rhec/plugins/robot/smoother_section.hpp"

#include <utility>

#include "rhec/plugins/robot/plugin_option.hpp"
#include "rhec/plugins/robot/robust_losses.hpp"

namespace rhec {
namespace {

constexpr PluginOption<Solver> smoothing_solver{.otherwise = "sparse_sqp"};

}  // namespace

const OptionTable<SmootherOptions>& SmootherOptions::table() {
  using S = SmootherOptions;
  static const auto rows =
      OptionTable<S>()
          .number("deadline", &S::deadline,
                  "the solver stops after so long, with the best that it has; .inf: never [s]", greater_than(0.0))
          .map("blocking", &S::blocking, {BlockingSection::row("as in `blocking`")})
          .map("robust", &S::robust, robust_rows("as in `estimator`"))
          .map("solver", &S::solver, {smoothing_solver.row()});
  return rows;
}

SmootherSection::SmootherSection(std::shared_ptr<const RobotContext> context, const Settings& section)
    : context_(std::move(context)), options_(SmootherOptions::table().parse(section, "smoother")) {
  robust_losses(options_.robust, context_->about, "smoother");  // reports mistakes now
}

OptionSection SmootherSection::documentation() {
  return {"smoother",
          "How a whole log is estimated at once. What is not here is as in `estimator`; its own estimates are the "
          "start.",
          SmootherOptions::table().schema()};
}

FullInformationEstimation SmootherSection::make(const EstimatorParts& estimator) const {
  FullInformationEstimation::Setup setup;
  setup.problem = estimator.problem();  // its horizon is set from the log later
  if (!options_.robust.is_null()) setup.problem.robust = robust_losses(options_.robust, context_->about, "smoother");
  setup.blockings =
      options_.blocking.is_null() ? estimator.blocking.make() : BlockingSection(context_, options_.blocking).make();
  setup.walks = estimator.walks;
  setup.initial_mean = estimator.initial_mean;
  setup.initial_covariance = estimator.initial_covariance;
  return {context_->model, smoothing_solver.make(context_->host, options_.solver), std::move(setup)};
}

}  // namespace rhec
