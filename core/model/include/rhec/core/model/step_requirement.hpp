#pragma once

#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/core/model/model.hpp"

namespace rhec {

/// State, input and parameter of a model, in its units.
struct OperatingPoint {
  std::vector<double> state, inputs, parameters;
};

/// What a model's integration needs to follow it over an interval in equal steps: the classical Runge-Kutta method, or
/// that of an ImplicitModel.
///
/// A mode with eigenvalue lambda of df/dx is multiplied in each step of length d by R(d lambda), with
/// R(z) = 1 + z + z^2/2 + z^3/6 + z^4/24, instead of exp(d lambda). A mode that decays, or neither decays nor grows,
/// must not grow: |R| <= 1 (Hairer and Wanner, Solving Ordinary Differential Equations II, section IV.2). A step that
/// is stable can still be inexact; so over the interval R^m must be exp(m d lambda) to `mode_tolerance`, and the next
/// state that of twice as many steps to `state_tolerance` of each state's typical magnitude.
///
/// Implicit steps have R(z) = (1 + 2z/5 + z^2/20) / (1 - 3z/5 + 3z^2/20 - z^3/60), and are stable whatever their
/// length. Of a mode that the exact motion leaves less than `mode_over` of, they may leave `mode_left`.
struct RHEC_EXPORT StepRequirement {
  static constexpr double mode_tolerance = 0.01;
  static constexpr double mode_over = 0.05, mode_left = 0.1;
  static constexpr double state_tolerance = 1e-3;
  static constexpr int most_substeps = 1000;  ///< more are not tried

  int stable_substeps = 1;  ///< fewest that are stable; 0: over 1000
  int mode_substeps = 1;    ///< fewest that are stable and follow the modes; 0: over 1000
  int substeps = 1;         ///< fewest that follow the motion as well; 0: over 1000
  double time_constant = std::numeric_limits<double>::infinity();  ///< 1 / |lambda| of the mode that needs most [s]
  int state = -1;  ///< that takes the greatest part in this mode; without one that of the largest error
};

/// The requirement of the point that needs most. Points where the model's values or derivatives are not finite ask for
/// nothing. Derivatives are those of F over a duration that is short against the model's rates. `duration` > 0 [s].
RHEC_EXPORT StepRequirement step_requirement(const Model& model, std::span<const OperatingPoint> points,
                                             double duration);

/// Points that a vehicle is likely to pass: straight ahead at a ground speed [m/s] (none: at which the speed input has
/// its typical magnitude), at a fifth and twice of it, and standing, without slip and with `parameters`; then with each
/// other input, and each state that has bounds, moved both ways by a typical magnitude within its bounds. `about` is
/// the model's description with the bounds that hold.
RHEC_EXPORT std::vector<OperatingPoint> operating_points(const Model& model, const ModelDescription& about,
                                                         std::span<const double> parameters,
                                                         std::optional<double> ground_speed = {});

/// How inexact an interval's steps are, seen from one place: the difference of the next state from that of twice as
/// many steps, in typical magnitudes of the states. Of implicit steps it is what is left of that difference after
/// another interval like this one (dF/dx of it): an error in what settles within an interval does not last. Allocates
/// when it is made only.
class RHEC_EXPORT StepError {
 public:
  explicit StepError(const Model& model);
  /// Infinite if one of the two next states is not finite. `worst_state` gets the one that differs most.
  double operator()(const double* state, const double* inputs, const double* parameters, double duration, int substeps,
                    int* worst_state = nullptr) noexcept;

 private:
  const Model* model_;
  std::vector<double> coarse_, fine_, data_;
  std::vector<double> jacobian_, errors_;  ///< empty with explicit steps
};

}  // namespace rhec
