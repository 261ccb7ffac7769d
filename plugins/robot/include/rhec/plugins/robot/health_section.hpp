#pragma once

#include <memory>

#include "rhec/core/config/options.hpp"
#include "rhec/core/estimation/estimator.hpp"
#include "rhec/core/estimation/sensor_watch.hpp"
#include "rhec/plugins/robot/estimator_makers.hpp"

namespace rhec {

/// The keys of `estimator.health`: how stamps, inputs and measurements are judged.
struct RHEC_EXPORT HealthOptions {
  bool watch = true, offsets = SensorWatch::Setup{}.offsets, whiteness = SensorWatch::Setup{}.whiteness;
  double gate = SensorWatch::Setup{}.gate;
  int proof = SensorWatch::Setup{}.proof;
  double inputs_hold = Estimator::Timeline{}.input_hold;
  double lost_position = SensorWatch::Setup{}.lost_position, lost_heading = SensorWatch::Setup{}.lost_heading;
  static const OptionTable<HealthOptions>& table();
};

/// The judge that these options ask for, of what an estimator of these parts gets; null: none.
RHEC_EXPORT std::unique_ptr<SensorWatch> make_watch(const HealthOptions& options, const EstimatorParts& parts);

}  // namespace rhec
