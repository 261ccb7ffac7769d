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

/// A sensor has at most so many outputs; further ones that are like them make another one.
inline constexpr int most_sensor_outputs = 6;

/// The sensors of a model: outputs of one unit and one stated variance, like the coordinates of a position, are one;
/// those of several devices (`Variable::device`), such as two receivers, are not.
/// `output_variances`: n_y.
RHEC_EXPORT std::vector<Sensor> sensors_of(const ModelDescription& about, const std::vector<double>& output_variances);

}  // namespace rhec
