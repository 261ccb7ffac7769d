#include "rhec/plugins/robot/health_section.hpp"

#include <cmath>

#include "rhec/plugins/robot/bounds_section.hpp"
#include "rhec/plugins/robot/sensors.hpp"

namespace rhec {

const OptionTable<HealthOptions>& HealthOptions::table() {
  using H = HealthOptions;
  static const auto rows =
      OptionTable<H>()
          .flag("watch", &H::watch,
                "whether stamps, inputs and measurements are judged before they are used; false: all are trusted")
          .flag(
              "offsets", &H::offsets,
              "whether angles, speeds and the like that are off by little for long are found, and what they are off by "
              "taken out of what is measured")
          .flag("whiteness", &H::whiteness,
                "whether the covariance that is given out is larger where innovations are correlated, as by errors "
                "that last and what a model does not have")
          .number("gate", &H::gate, "a measurement that is less probable than so many standard deviations is not used",
                  or_infinite(greater_than(0.0)))
          .integer("proof", &H::proof, "samples that a sensor must have jumped for before the estimate follows it",
                   between(2, 10000))
          .number("inputs_hold", &H::inputs_hold,
                  "time that inputs hold for at least where no others follow, as commands do that are told only when "
                  "they change [s]; else they hold until the next ones are missed",
                  or_infinite(at_least(0.0)))
          .number("lost_position", &H::lost_position,
                  "standard deviation of the position above which the vehicle is lost [m]",
                  or_infinite(greater_than(0.0)))
          .number("lost_heading", &H::lost_heading,
                  "standard deviation of the heading above which the vehicle is lost [rad]",
                  or_infinite(greater_than(0.0)));
  return rows;
}

std::unique_ptr<SensorWatch> make_watch(const HealthOptions& options, const EstimatorParts& parts) {
  if (!options.watch) return nullptr;
  const RobotContext& context = *parts.context;
  SensorWatch::Setup setup;
  setup.noise = parts.filter_noise();
  for (const ParameterWalk& walk : parts.walks) setup.walk.push_back(walk.process_noise);
  const Eigen::Index nx = context.model->state_count(), np = context.model->parameter_count();
  for (Eigen::Index j = 0; j < np; ++j)
    setup.parameter_sigmas.push_back(std::sqrt(parts.initial_covariance(nx + j, nx + j)));
  setup.initial_mean = parts.initial_mean;
  setup.initial_covariance = parts.initial_covariance;
  setup.has_ramps = senses_motion(*context.model);
  setup.step = context.step;
  setup.substeps = parts.substeps;
  setup.offsets = options.offsets;
  setup.whiteness = options.whiteness;
  setup.gate = options.gate;
  setup.proof = options.proof;
  setup.lost_position = options.lost_position;
  setup.lost_heading = options.lost_heading;
  return std::make_unique<SensorWatch>(context.model, setup);
}

}  // namespace rhec
