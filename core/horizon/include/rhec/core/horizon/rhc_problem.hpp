#pragma once

#include <cstddef>
#include <memory>
#include <string_view>
#include <vector>

#include "rhec/core/horizon/horizon_problem.hpp"

namespace rhec {

struct CostView;

/// Receding horizon control over N intervals (docs/method.md, section 3; Wallace et al., eq. 4), with given x_0 and
/// parameters p:
///
///     minimise  sum_{i=0}^{N-1} || x_i - xref_i ||^2_Vx + || u_i - uref_i ||^2_Vu  +  || x_N - xref_N ||^2_VN
///     subject to the dynamics, bounds on the states of nodes 1 .. N and on the inputs.
///
/// Terms add limits and further costs; their data are set node by node (HorizonProblem::terms).
///
/// p is embedded like the initial state: it is part of the given initial stage state, so that both may arrive after the
/// problem has been linearised. Inputs may be blocked. Data are set in place, without allocation; call `finish` after
/// changing the structure, the initial state, or the bounds.
class RHEC_EXPORT RhcProblem final : public HorizonProblem {
 public:
  /// An input that is the rate at which a state changes, c_{i+1} = c_i + dt_i v_i (InputRateModel).
  struct Rate {
    int input, state;
    bool operator==(const Rate&) const = default;
  };
  struct Setup {
    int max_intervals = 15;
    int substeps = 1;
    std::vector<double> state_weights;             ///< n_x, diagonal of Vx
    std::vector<double> input_weights;             ///< n_u, diagonal of Vu
    std::vector<double> terminal_weights;          ///< n_x, diagonal of VN
    std::vector<double> state_lower, state_upper;  ///< n_x; empty: the model's own bounds
    std::vector<double> input_lower, input_upper;  ///< n_u; empty: the model's own bounds
    std::vector<int> blocked_inputs;               ///< inputs that are blocked
    std::vector<Rate> rates = {};                  ///< inputs that are rates; beyond the horizon they are 0
    std::vector<NamedTerm> terms = {};             ///< limits and further costs
  };
  RhcProblem(std::shared_ptr<const Model> model, Setup setup);

  const Setup& setup() const noexcept { return setup_; }

  double* given_state() noexcept { return initial_.data(); }              ///< x_0, n_x
  double* given_parameters() noexcept { return initial_.data() + nx(); }  ///< p, n_p
  double* state_reference(int node) noexcept { return reference_.data() + at(node); }
  double* input_reference(int interval) noexcept { return reference_.data() + at(interval) + capacity().states; }
  const double* state_reference(int node) const noexcept { return reference_.data() + at(node); }
  const double* input_reference(int interval) const noexcept {
    return reference_.data() + at(interval) + capacity().states;
  }
  /// Bounds of an input, per interval; initially those of the set-up.
  double& input_lower(int interval, int input) noexcept { return input_lower_[interval * nu() + input]; }
  double& input_upper(int interval, int input) noexcept { return input_upper_[interval * nu() + input]; }
  double input_lower(int interval, int input) const noexcept { return input_lower_[interval * nu() + input]; }
  double input_upper(int interval, int input) const noexcept { return input_upper_[interval * nu() + input]; }

  /// Bounds of a state, at nodes 1 .. N.
  void set_state_bounds(int state, double lower, double upper) noexcept;

  void set_intervals(int intervals) noexcept { changing_structure().set_intervals(intervals); }
  /// Marks where the blocks of a blocked input start; begins[0] counts as 1.
  void set_blocks(int input, const std::uint8_t* begins) noexcept;
  /// Copies data and structure of a problem with the same model and set-up, without allocation.
  void take_data(const RhcProblem& from) noexcept;
  /// Ends a change. A state bound that no admissible input can satisfy from the given initial state (the estimate may
  /// violate it) is relaxed, node by node, to the nearest value within reach. Returns the number of relaxed bounds.
  int finish(std::span<double> scratch) noexcept;

  std::string_view kind() const noexcept override { return "rhc"; }
  const double* initial_state() const noexcept override { return initial_.data(); }
  const double* inputs_behind() const noexcept override { return behind_.empty() ? nullptr : behind_.data(); }

 private:
  RhcProblem(std::shared_ptr<const Model> model, Setup setup, std::shared_ptr<const TermFunctions> terms);

  std::ptrdiff_t at(int stage) const noexcept { return static_cast<std::ptrdiff_t>(stage) * stride(); }

  double cost(const Iterate& iterate, double* stage_costs, std::span<double> scratch) const noexcept override;
  double write_cost(StageRange range, const Iterate& iterate, Hessian hessian, CostParts parts, StageQp& qp,
                    std::span<double> scratch) const noexcept override;
  std::size_t cost_scratch_size() const noexcept override;
  bool has_late_bounds() const noexcept override { return true; }
  bool has_constant_cost_hessian() const noexcept override { return true; }
  double write_tracking(StageRange range, const Iterate& iterate, const CostView& view) const noexcept;
  void check_rates();
  void write_state_bounds() noexcept;
  void write_input_bounds() noexcept;
  int relax_unreachable_bounds(std::span<double> scratch) noexcept;

  Setup setup_;
  std::vector<double> initial_, input_lower_, input_upper_;
  std::vector<double> behind_;         ///< n_u: 0 for rates, otherwise NaN; empty if there are no rates
  int moved_bounds_ = 0;               ///< state bounds relaxed by the last `finish`
  bool has_new_state_bounds_ = false;  ///< since the last `finish`
  AlignedDoubles reference_;           ///< one row [x; p; u] per stage
  AlignedDoubles stage_weights_, terminal_weights_, periods_,
      inverse_periods_;  ///< rows [x; p; u]; the period of angles and its inverse, else 0
};

}  // namespace rhec
