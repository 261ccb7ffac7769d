#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/core/model/model.hpp"

/// Checks a model's derivatives and its integration numerically, using only evaluated values.
namespace rhec::sim {

/// The test range of a variable: its bounds. A missing bound is replaced by `scales` times its scale on that side of 0
/// (of the other bound, if that is further away); an angle gets at least a full turn.
RHEC_EXPORT std::pair<double, double> range_of(const Variable& variable, double scales);

/// A range of stages, as the rows of Model::Intervals; `parameters_end` is for a ramp.
struct StagePoints {
  int count = 0;
  std::vector<double> states, inputs, parameters, parameters_end, durations;
};

/// Random stages, each value 2 % or more of its range away from its bounds. Every third stage has no input and every
/// fifth no state (0, or as close to 0 as that range allows). Durations are 0.05 s to 0.25 s.
RHEC_EXPORT StagePoints random_stages(const ModelDescription& within, int count, std::uint64_t seed);

/// The largest error found, in units of the variables' scales, relative to the entry itself if that exceeds the
/// result's largest one (at most 1, at least 0.001).
struct WorstEntry {
  double error = 0.0;
  std::string where;      ///< "d next x_pos / d u1"; empty if nothing was compared
  double given = 0.0;     ///< the model's value
  double expected = 0.0;  ///< from finite differences or Runge-Kutta steps
};

struct DerivativeErrors {
  WorstEntry first, second;                ///< of F
  WorstEntry output_first, output_second;  ///< of h
  int compared = 0;
  int skipped = 0;  ///< entries that are not finite or whose difference is not finite
};

/// Compares first and second derivatives of F and h with five-point differences of values and of first derivatives,
/// taking the step size that agrees best. `within` is the model's description with the scales to use. Skips second
/// derivatives if the model has none.
RHEC_EXPORT DerivativeErrors derivative_errors(const Model& model, const ModelDescription& within,
                                               const StagePoints& stages, bool ramp, int substeps);

/// Compares F with classical Runge-Kutta steps of `rates`; errors are relative to the larger of the value and the
/// state's scale.
RHEC_EXPORT WorstEntry integration_error(const Model& model, const ModelDescription& within, const StagePoints& stages,
                                         bool ramp, int substeps);

}  // namespace rhec::sim
