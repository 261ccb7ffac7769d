#pragma once

#include <memory>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/core/formula/tape.hpp"
#include "rhec/core/model/model.hpp"
#include "rhec/core/model/vehicle_graph.hpp"

namespace rhec {

class Reserve;

/// The outputs of motion: those that depend on the input or on parameters, as a gyro's rate of turn does. Indices among
/// the outputs, ascending; none for a model that has no graph.
RHEC_EXPORT std::vector<int> outputs_of_motion(const VehicleGraph& vehicle);
RHEC_EXPORT std::vector<int> outputs_of_motion(const Model& model);

/// The outputs of motion y = h(x, u, p) of a vehicle, and their derivatives. `Model::observe` knows the state alone,
/// and gives 0 for them. What a sensor has at a node is the limit from the left: h of the node's state, and of the
/// input and the parameter of the interval that ends there.
///
/// They are interpreted, so that the outputs of the state cost what they cost without them. All calls are const and
/// thread-safe, and neither allocate nor throw.
class RHEC_EXPORT MotionOutputs {
 public:
  /// Throws Error if the model has outputs of motion and a state, input or parameter count other than its graph's.
  explicit MotionOutputs(const Model& model);

  /// Which outputs of the model these are.
  const std::vector<int>& which() const noexcept { return which_; }
  int count() const noexcept { return static_cast<int>(which_.size()); }

  /// One request, dense, with z = [x; u; p]. A null result pointer means 'not requested'.
  struct Points {
    int count = 0;
    const double* states = nullptr;       ///< count x n_x
    const double* inputs = nullptr;       ///< count x n_u
    const double* parameters = nullptr;   ///< count x n_p
    double* outputs = nullptr;            ///< count x n_m
    double* jacobians = nullptr;          ///< count x (n_m x n_z), column-major
    const double* multipliers = nullptr;  ///< count x n_m; needed with `hessians`
    double* hessians = nullptr;           ///< count x (n_z x n_z): sum_j multipliers_j d2h_j/dz2
  };
  void evaluate(const Points& request) const noexcept;

 private:
  void evaluate(const Points& request, double* registers) const noexcept;

  std::vector<int> which_;
  int nx_ = 0, nu_ = 0, np_ = 0;
  Tape jacobian_, hessian_;  ///< of [h; dh/dz] and of d2h/dz2
  const TapeKernels* kernels_;
  std::shared_ptr<Reserve> reserve_;  ///< null where registers fit on the stack
};

/// Throws Error, with the name of an output of motion, if the model has one: `user` is made for outputs of the state.
RHEC_EXPORT void refuse_outputs_of_motion(const Model& model, const char* user);

}  // namespace rhec
