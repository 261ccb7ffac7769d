#include "rhec/plugins/robot/estimator_makers.hpp"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include "rhec/core/base/error.hpp"
#include "rhec/core/estimation/banked_covariance.hpp"
#include "rhec/core/estimation/filter_estimation.hpp"
#include "rhec/core/estimation/prior_horizon_estimation.hpp"
#include "rhec/plugins/robot/bounds_section.hpp"
#include "rhec/plugins/robot/sensors.hpp"

namespace rhec {
namespace {

std::vector<double> variances_of(const std::vector<double>& sigmas) {
  std::vector<double> variances;
  variances.reserve(sigmas.size());
  for (const double sigma : sigmas) variances.push_back(sigma * sigma);
  return variances;
}

/// The bank, with its memory of places.
BankEstimation::Setup remembering_filters(const EstimatorParts& parts) {
  BankEstimation::Setup setup = parts.filters();
  if (parts.memory.is_given()) setup.place = parts.memory.setup(parts.make_map());
  return setup;
}

void refuse_memory(const EstimatorParts& parts, std::string_view owner) {
  if (parts.memory.is_given())
    throw parts.memory.section().error(fmt::format(
        "{} remember no places; expected estimator.name: bank, or rhe without a section 'blocking'", owner));
}

std::unique_ptr<EstimationMethod> make_receding_horizon(const EstimatorParts& parts) {
  if (!parts.blocking.is_given())
    return std::make_unique<PriorHorizonEstimation>(
        parts.context->model, parts.make_solver(),
        PriorHorizonEstimation::Setup{.filters = remembering_filters(parts), .problem = parts.problem()});
  if (parts.priors.is_given())
    throw parts.priors.section().error(
        "a window has either blocks or priors; take out the section 'blocking', or estimator.priors");
  refuse_memory(parts, "blocks");
  RecedingHorizonEstimation::Setup setup;
  setup.problem = parts.problem();
  setup.arrival = parts.arrival;
  setup.blockings = parts.blocking.make_for(parts.horizon, "estimator.horizon");
  setup.noises = parts.blocking.make_noises_for(parts.horizon, "estimator.horizon");
  setup.walks = parts.walks;
  setup.initial_mean = parts.initial_mean;
  setup.initial_covariance = parts.initial_covariance;
  setup.heading_starts = parts.heading_starts;
  auto blocks =
      std::make_unique<RecedingHorizonEstimation>(parts.context->model, parts.make_solver(), std::move(setup));
  if (!parts.has_bank_beside_blocks) return blocks;
  return std::make_unique<BankedCovariance>(std::move(blocks), parts.filters(), parts.context->model);
}

std::unique_ptr<EstimationMethod> make_kalman_filter(const EstimatorParts& parts) {
  refuse_memory(parts, "ekf's random walks");
  const RobotContext& context = *parts.context;
  FilterEstimation::Setup setup;
  setup.noise = parts.filter_noise();
  for (const ParameterWalk& walk : parts.walks) setup.walk.push_back(walk.process_noise);
  setup.has_ramps = senses_motion(*context.model);
  setup.initial_mean = parts.initial_mean;
  setup.initial_covariance = parts.initial_covariance;
  setup.substeps = parts.substeps;
  setup.heading_starts = parts.heading_starts;
  setup.most_between = parts.most_between;
  setup.remembered_nodes = parts.remembered_nodes();
  return std::make_unique<FilterEstimation>(context.model, std::move(setup));
}

std::unique_ptr<EstimationMethod> make_bank(const EstimatorParts& parts) {
  return std::make_unique<BankEstimation>(parts.context->model, remembering_filters(parts));
}

}  // namespace

const OptionTable<BankOptions>& BankOptions::table() {
  static const auto rows =
      OptionTable<BankOptions>().number("memory", &BankOptions::memory,
                                        "ground after which another combination of priors may hold: over each metre, "
                                        "1 / memory of all probability is dealt out anew [m]",
                                        greater_than(0.0));
  return rows;
}

RheProblem::Setup EstimatorParts::problem() const {
  RheProblem::Setup setup;
  setup.max_intervals = horizon;
  setup.substeps = substeps;
  setup.most_between = most_between;
  for (const double sigma : context->noise.output_sigmas) setup.output_weights.push_back(1.0 / (sigma * sigma));
  for (const double sigma : context->noise.input_sigmas) setup.input_weights.push_back(1.0 / (sigma * sigma));
  setup.robust = robust;
  setup.state_lower = lower_bounds_of(context->about.states);
  setup.state_upper = upper_bounds_of(context->about.states);
  setup.parameter_lower = lower_bounds_of(context->about.parameters);
  setup.parameter_upper = upper_bounds_of(context->about.parameters);
  return setup;
}

KalmanFilter::Noise EstimatorParts::filter_noise() const {
  return {.output_variances = variances_of(context->noise.output_sigmas),
          .input_variances = variances_of(context->noise.input_sigmas),
          .parameter_lower = lower_bounds_of(context->about.parameters),
          .parameter_upper = upper_bounds_of(context->about.parameters),
          .motion_outputs = sensed_motion(*context->model),
          .scaled_outputs = scaled_outputs(*context->model)};
}

BankEstimation::Setup EstimatorParts::filters() const {
  BankEstimation::Setup setup;
  setup.bank.members = priors.combinations();
  setup.bank.output_variances = variances_of(context->noise.output_sigmas);
  setup.bank.input_variances = variances_of(context->noise.input_sigmas);
  setup.bank.substeps = substeps;
  setup.bank.memory = bank.memory;
  setup.bank.robust = robust;
  setup.bank.motion_outputs = sensed_motion(*context->model);
  setup.bank.scaled_outputs = scaled_outputs(*context->model);
  setup.bank.adapts_noise = context->noise.adapt;
  setup.bank.initial_parameters = initial_parameters;
  setup.parameter_lower = lower_bounds_of(context->about.parameters);
  setup.parameter_upper = upper_bounds_of(context->about.parameters);
  const int nx = context->model->state_count();
  setup.initial_state = initial_mean.head(nx);
  setup.initial_covariance = initial_covariance.topLeftCorner(nx, nx);
  setup.heading_starts = heading_starts;
  setup.bank.most_between = most_between;
  setup.remembered_nodes = remembered_nodes();
  return setup;
}

EstimatorMakers::EstimatorMakers()
    : all_({{"rhe", "receding horizon", make_receding_horizon},
            {"ekf", "extended Kalman filter", make_kalman_filter},
            {"bank", "Kalman filters with different priors of the parameters, mixed by their likelihood", make_bank}}) {
}

EstimatorMakers& EstimatorMakers::add(EstimatorMaker maker) {
  for (const EstimatorMaker& other : all_)
    if (other.name == maker.name)
      throw Error(fmt::format("there is an estimator '{}' already; give each a name of its own", maker.name));
  all_.push_back(std::move(maker));
  return *this;
}

const EstimatorMaker& EstimatorMakers::named(std::string_view name) const {
  const auto found = std::find_if(all_.begin(), all_.end(), [&](const auto& maker) { return maker.name == name; });
  if (found != all_.end()) return *found;
  std::vector<std::string> names;
  for (const EstimatorMaker& maker : all_) names.push_back(maker.name);
  throw Error(fmt::format("there is no estimator '{}'; expected {}", name, one_of(names)));
}

}  // namespace rhec
