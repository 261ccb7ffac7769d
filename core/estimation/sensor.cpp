#include "rhec/core/estimation/sensor.hpp"

#include <algorithm>

namespace rhec {

std::vector<Sensor> sensors_of(const ModelDescription& about, const std::vector<double>& output_variances) {
  std::vector<Sensor> sensors;
  for (int j = 0; j < static_cast<int>(about.outputs.size()); ++j) {
    const auto has_output = [&](const Sensor& sensor) {
      const int first = sensor.outputs.front();
      return about.outputs[first].unit == about.outputs[j].unit &&
             about.outputs[first].device == about.outputs[j].device && output_variances[first] == output_variances[j] &&
             sensor.outputs.size() < most_sensor_outputs;
    };
    const auto found = std::find_if(sensors.begin(), sensors.end(), has_output);
    if (found == sensors.end()) {
      sensors.push_back({about.outputs[j].name, {j}, about.outputs[j].unit});
      continue;
    }
    found->name += " and " + about.outputs[j].name;
    found->outputs.push_back(j);
  }
  return sensors;
}

}  // namespace rhec
