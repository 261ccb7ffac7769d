#pragma once

#include <cstddef>
#include <span>

#include "rhec/core/horizon/horizon_structure.hpp"
#include "rhec/core/model/model.hpp"
#include "rhec/core/ocp/ocp.hpp"
#include "rhec/core/qp/stage_qp.hpp"

namespace rhec {

/// The dynamics of stages from the intervals of a model: F_i(s_i, w_i), and AB and b of a stage QP. It only refers to
/// its parts, and is made anew for each use.
struct IntervalDynamics {
  const Model& model;
  const HorizonStructure& structure;
  const double* durations;  ///< of all intervals [s]
  const double* data;       ///< of all intervals, n_d each
  int substeps;

  /// Length of a row [x; p; u (; p at the end)] as the model takes it.
  static int row_length(const HorizonStructure& structure) noexcept;
  /// Doubles of scratch for a call over this many intervals.
  static std::size_t scratch_size(const Model& model, const HorizonStructure& structure,
                                  std::size_t intervals) noexcept;

  /// F_i(s_i, w_i) - s_{i+1} of all intervals, as rows of the capacity's states.
  void write_defects(const Iterate& iterate, double* defects, double* scratch) const noexcept;
  /// Overwrites the state of the node after an interval.
  void simulate(int interval, Iterate& iterate, double* scratch) const noexcept;

  /// Numbers of states and controls of the stages of a range, and whether the initial state is given.
  void write_sizes(StageRange range, bool initial_state_is_given, StageQp& qp) const noexcept;

  /// One more interval, for a range that reaches the end of the horizon.
  struct Extension {
    const double *rows, *costates;  ///< of all stages and the one behind
    const double *durations, *data;
    double* curvature;  ///< Hessian of the interval behind
  };
  struct Options {
    Hessian hessian = Hessian::gauss_newton;
    bool has_lifted_rows = false;          ///< AB already has the rows of lifted variables
    const Extension* extension = nullptr;  ///< null: none
  };
  /// AB and b of the intervals of a range; with Hessian::exact also H, which becomes the curvature of the dynamics.
  void linearise(StageRange range, const Iterate& iterate, const Options& options, StageQp& qp,
                 double* scratch) const noexcept;
  /// Completes what the model does not provide: the rows of lifted variables, and s_{i+1} in b.
  void complete(StageRange range, const Iterate& iterate, bool has_lifted_rows, StageQp& qp) const noexcept;
  /// Moves the model's derivatives with respect to parameters to the controls that start their blocks.
  void place_starts(int interval, Hessian hessian, StageQp& qp) const noexcept;
  /// z = [x; p; u (; p at the end)] of each interval of a range.
  void gather_rows(const Iterate& iterate, StageRange range, double* rows) const noexcept;

  /// The stage variable of an interval that entry z of the model's [x; p; u (; p at the end)] is.
  int column_of(int interval, int z) const noexcept;

 private:
  const double* data_of(int interval) const noexcept {
    return data + static_cast<std::ptrdiff_t>(interval) * model.data_count();
  }
  void gather(const Iterate& iterate, StageRange range, double* x, double* u, double* p, double* p_end) const noexcept;
  void scatter(int interval, const double* jacobian, const double* hessian, StageQp& qp) const noexcept;
};

}  // namespace rhec
