#pragma once

#include <memory>
#include <vector>

#include "rhec/core/estimation/estimate.hpp"
#include "rhec/core/estimation/sensor.hpp"
#include "rhec/core/model/model.hpp"

namespace rhec::python {

/// An estimate that stays as it is when its estimator goes on.
struct EstimateObject {
  Estimate value;
  std::vector<Innovation> innovations;  ///< `value.innovations` are these
  double microseconds = 0.0;            ///< that the estimator took
  std::shared_ptr<const ModelDescription> about;
  std::shared_ptr<const std::vector<Sensor>> sensors, inputs;

  EstimateObject() = default;
  EstimateObject(const EstimateObject&) = delete;
  EstimateObject& operator=(const EstimateObject&) = delete;

  /// Whether an estimate can be put into the place of this one: arrays that Python has of it stay where they are.
  bool has_room_for(const Estimate& other) const {
    return value.state.size() == other.state.size() && value.parameters.size() == other.parameters.size() &&
           value.covariance.size() == other.covariance.size();
  }
  void take(const Estimate& other) {
    innovations.assign(other.innovations.begin(), other.innovations.end());
    value = other;
    value.innovations = innovations;
  }
};

}  // namespace rhec::python
