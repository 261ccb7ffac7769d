#pragma once

#include <string>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/core/model/model.hpp"

namespace rhec {

/// Outputs that one device measures, and that are judged together.
struct Sensor {
  std::string name;          ///< of its outputs, e.g. "x_gps and y_gps"
  std::vector<int> outputs;  ///< indices of the model's outputs, in their order
  std::string unit = {};     ///< of these
};

/// A sensor has at most so many outputs: the coordinates of a position.
inline constexpr int most_sensor_outputs = 3;

/// The sensors of a model. Outputs are one where they are the coordinates of a place or of a velocity: of one unit,
/// one stated variance and one device (`Variable::device`), and either named alike but for an x, a y and a z, or two
/// in the unit of the position of which one is the next. Any other output is a sensor of its own: two receivers, or a
/// steering angle and an articulation, can fail one without the other. `output_variances`: n_y.
RHEC_EXPORT std::vector<Sensor> sensors_of(const ModelDescription& about, const std::vector<double>& output_variances);

}  // namespace rhec
