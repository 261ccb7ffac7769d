#include "rhec/core/estimation/sensor.hpp"

#include <algorithm>

namespace rhec {

std::vector<Sensor> sensors_of(const ModelDescription& about, const std::vector<double>& output_variances) {
  std::vector<Sensor> sensors;
  for (int j = 0; j < static_cast<int>(about.outputs.size()); ++j) {
    // One device measures nothing twice.
    const auto measures_it = [&](int other) {
      return !about.outputs[j].meaning.empty() && about.outputs[other].meaning == about.outputs[j].meaning;
    };
    const auto has_output = [&](const Sensor& sensor) {
      const int first = sensor.outputs.front();
      if (std::ranges::any_of(sensor.outputs, measures_it)) return false;
      return about.outputs[first].unit == about.outputs[j].unit && output_variances[first] == output_variances[j] &&
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
