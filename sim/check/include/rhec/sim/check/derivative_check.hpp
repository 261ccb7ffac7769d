#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/core/model/model.hpp"

/// A model's derivatives and its integration against what they are said to be, by values alone.
namespace rhec::sim {

/// The values that a variable is tried with: its bounds; where it has none, so many of its scales to either side of 0
/// (of the other bound, where that is further away), and of an angle a whole turn at least.
RHEC_EXPORT std::pair<double, double> range_of(const Variable& variable, double scales);

/// A range of stages, as the rows of Model::Intervals; `parameters_end` is for a ramp.
struct StagePoints {
  int count = 0;
  std::vector<double> states, inputs, parameters, parameters_end, durations;
};

/// Random stages, each value 2 % or more of its range away from its bounds. Every third stage has no input and every
/// fifth no state (0, or as near to it as that lets). Durations are 0.05 s to 0.25 s.
RHEC_EXPORT StagePoints random_stages(const ModelDescription& within, int count, std::uint64_t seed);

/// The largest error found. It is in units of the variables' scales, relative to the entry itself where that is above
/// the result's largest one (at most 1, at least 0.001).
struct WorstEntry {
  double error = 0.0;
  std::string where;      ///< "d next x_pos / d u1"; empty where nothing was compared
  double given = 0.0;     ///< by the model
  double expected = 0.0;  ///< by differences, or by Runge-Kutta steps
};

struct DerivativeErrors {
  WorstEntry first, second;                ///< of F
  WorstEntry output_first, output_second;  ///< of h
  int compared = 0;
  int skipped = 0;  ///< entries that are not finite, or have no finite difference
};

/// First and second derivatives of F and h against differences of five points (of values and of first derivatives; of
/// several distances the one that agrees best). `within` is the model's description, with the scales to use; second
/// derivatives are left out where the model has none.
RHEC_EXPORT DerivativeErrors derivative_errors(const Model& model, const ModelDescription& within,
                                               const StagePoints& stages, bool ramp, int substeps);

/// F against classical Runge-Kutta steps of `rates`, relative to the larger of the value and the state's scale.
RHEC_EXPORT WorstEntry integration_error(const Model& model, const ModelDescription& within, const StagePoints& stages,
                                         bool ramp, int substeps);

}  // namespace rhec::sim
