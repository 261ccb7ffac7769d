#pragma once

#include <memory>

#include "rhec/core/model/model.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/robot/noise_section.hpp"

namespace rhec {

/// The contents of the sections `model`, `bounds` and `noise`, which all other sections need.
struct RobotContext {
  Host host;
  double step;  ///< longest interval of the estimator, interval of the controller [s]
  std::shared_ptr<const Model> model;
  ModelDescription about;  ///< the model's description, with the bounds of the configuration
  NoiseSection noise;
};

}  // namespace rhec
