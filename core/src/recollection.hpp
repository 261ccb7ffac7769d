#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "rhec/core/aligned.hpp"
#include "rhec/core/model.hpp"
#include "rhec/core/stage_qp.hpp"

namespace rhec {

/// What a HorizonProblem keeps in a StageQp of how F and b there were made, and of what the model's sensors said: from
/// one sample to the next most rows of the point are those of before, a stage earlier.
struct Recollection {
  std::shared_ptr<const Model> model;  ///< that was asked; others are not remembered
  std::shared_ptr<const char> of;      ///< whose problem's
  unsigned changes = 0;                ///< of the program, when it was made
  int substeps = 1;
  int intervals = -1;  ///< of the linearisation; -1: nothing is remembered
  /// The one interval more that a controller will see next: after its rows in F, b and `ahead`, at `rows` too.
  bool looks_ahead = false;
  bool has_curvature = false;        ///< H is that of all costs and of the dynamics, at `costates`
  AlignedDoubles rows, costates;     ///< of the point
  AlignedDoubles ahead;              ///< curvature of the interval that is looked at ahead
  std::vector<double> durations;     ///< of the intervals
  std::vector<std::uint8_t> begins;  ///< of each interval's channels
  std::ptrdiff_t output_size = 0, output_jacobian_size = 0;  ///< of a node; 0 where outputs are not asked for
  AlignedDoubles outputs, output_jacobians;                  ///< twice the nodes, of which node 0 is number `first`
  int first = 0;
  std::vector<std::uint8_t> observed;  ///< nodes whose outputs are those at `rows`
  std::vector<std::uint8_t> is_clean;  ///< stages where all of H that measurements do not write to is zero
  /// Of nodes: 2 where the whole row was found again, 1 where the state was; of intervals, the same of their costates.
  std::vector<std::uint8_t> same, same_costate;

  double* outputs_of(int node) noexcept { return outputs.data() + (first + node) * output_size; }
  double* output_jacobians_of(int node) noexcept {
    return output_jacobians.data() + (first + node) * output_jacobian_size;
  }
  void forget() noexcept;
  /// What is kept of nodes that are now `steps` earlier: of outputs, as far as the states are the same.
  void move_outputs(int steps) noexcept;
};

}  // namespace rhec
