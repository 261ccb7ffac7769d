#include "rhec/plugins/robot/smoother_section.hpp"

#include <chrono>
#include <utility>

#include "rhec/core/estimation/full_information.hpp"
#include "rhec/core/estimation/prior_smoothing.hpp"
#include "rhec/plugins/robot/plugin_option.hpp"
#include "rhec/plugins/robot/robust_losses.hpp"

namespace rhec {
namespace {

constexpr PluginOption<Solver> smoothing_solver{.otherwise = "sparse_sqp"};

std::vector<OptionRow> priors_rows() {
  std::vector<OptionRow> rows = PriorsSection::rows();
  rows.front().default_value = "as in `estimator.priors`";
  rows.front().meaning =
      "as there. If any is given here, parameters follow priors even where the estimator has blocks; without it, where "
      "neither `smoother.blocking` nor `blocking` is given";
  return rows;
}

}  // namespace

const OptionTable<SmootherOptions>& SmootherOptions::table() {
  using S = SmootherOptions;
  static const auto rows =
      OptionTable<S>()
          .number("deadline", &S::deadline,
                  "the solver stops after so long, with the best that it has; .inf: never [s]",
                  or_infinite(greater_than(0.0)))
          .map("blocking", &S::blocking, {BlockingSection::row("as in `blocking`")})
          .map("priors", &S::priors, priors_rows())
          .integer(
              "laws", &S::laws,
              "with priors: the most probable combinations of them, given the whole log, at most so many, are each "
              "solved for, and the estimate is their mixture",
              between(1, most_bank_members))
          .map("robust", &S::robust, robust_rows("as in `estimator`"))
          .map("solver", &S::solver, {smoothing_solver.row()});
  return rows;
}

SmootherSection::SmootherSection(std::shared_ptr<const RobotContext> context, const Settings& section)
    : context_(std::move(context)), options_(SmootherOptions::table().parse(section, "smoother")) {
  // Reports mistakes now.
  robust_losses(options_.robust, context_->about, "smoother");
  if (!options_.blocking.is_null() && BlockingSection(context_, options_.blocking).blocks_noise())
    throw options_.blocking.error(
        "found blocks of process noise; a smoother estimates it on each interval: expected parameters alone");
  [[maybe_unused]] const PriorsSection checked(context_, options_.priors);
  if (!options_.blocking.is_null() && !options_.priors.is_null())
    throw options_.priors.error(
        "a smoother has either blocks or priors; take out 'smoother.blocking', or 'smoother.priors'");
}

OptionSection SmootherSection::documentation() {
  return {"smoother",
          "How a whole log is estimated at once. What is not here is as in `estimator`; its own estimates are the "
          "start.",
          SmootherOptions::table().schema()};
}

Clock::time_point SmootherSection::deadline() const {
  // A longer time is no limit, and would overflow the clock's type.
  constexpr double no_limit = 1e9;
  if (!(options_.deadline < no_limit)) return Clock::time_point::max();
  return Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(options_.deadline));
}

bool SmootherSection::follows_priors(const EstimatorParts& estimator) const {
  if (!options_.priors.is_null()) return true;
  return options_.blocking.is_null() && !estimator.blocking.is_given();
}

std::unique_ptr<Smoother> SmootherSection::make(const EstimatorParts& estimator) const {
  EstimatorParts parts = estimator;
  if (!options_.robust.is_null()) parts.robust = robust_losses(options_.robust, context_->about, "smoother");
  std::shared_ptr<Solver> solver = smoothing_solver.make(context_->host, options_.solver);
  if (follows_priors(parts)) {
    if (!options_.priors.is_null()) parts.priors = PriorsSection(context_, options_.priors);
    return std::make_unique<PriorSmoothing>(parts.context->model, std::move(solver),
                                            PriorSmoothing::Setup{.filters = parts.filters(),
                                                                  .priors = parts.priors.given(),
                                                                  .problem = parts.problem(),
                                                                  .most_laws = options_.laws});
  }
  FullInformationEstimation::Setup setup;
  setup.problem = parts.problem();  // its horizon is set from the log later
  setup.blockings =
      options_.blocking.is_null() ? parts.blocking.make() : BlockingSection(context_, options_.blocking).make();
  setup.walks = parts.walks;
  setup.initial_mean = parts.initial_mean;
  setup.initial_covariance = parts.initial_covariance;
  return std::make_unique<FullInformationEstimation>(parts.context->model, std::move(solver), std::move(setup));
}

}  // namespace rhec
