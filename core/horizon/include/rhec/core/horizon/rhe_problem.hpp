#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "rhec/core/horizon/blocking.hpp"
#include "rhec/core/horizon/horizon_problem.hpp"
#include "rhec/core/horizon/measured_interval.hpp"
#include "rhec/core/horizon/rhe_problem_setup.hpp"

namespace rhec {

class BetweenCache;
class OutputCache;
class PartsOfIntervals;
struct CostView;

/// Receding horizon estimation over N intervals (docs/method.md, section 2; Wallace et al., eq. 2):
///
///     minimise  || [chi_0; rho_first] - [xbar; pbar] ||^2_P            arrival cost
///             + sum over nodes      || h(chi_i) - y_i ||^2_Ry          missing outputs (NaN) are skipped
///             + sum between nodes   || h(F(chi_i, nu_i, rho_i; tau)) - y ||^2_Ry    Ry: times weights of y (Measured)
///             + sum over intervals  || nu_i - u_meas_i ||^2_Ru
///             + sum over block starts (rho_b - rho_a)^2 / variance     where neighbouring blocks are linked
///             + sum over blocks       weight rho_b^2                   where their values are expected to be 0
///     subject to the dynamics, bounds on states at every node, on inputs, and on every parameter block.
///
/// Data are set in place, without allocation. After a change of the structure (the number of intervals or the block
/// starts), `finish` must be called.
class RHEC_EXPORT RheProblem final : public HorizonProblem {
 public:
  using Setup = RheProblemSetup;
  RheProblem(std::shared_ptr<const Model> model, Setup setup);

  const Setup& setup() const noexcept { return setup_; }

  /// Arrival cost: mean and information matrix of [x; p] at node 0.
  Eigen::VectorXd arrival_mean;         ///< n_x + n_p
  Eigen::MatrixXd arrival_information;  ///< symmetric positive semidefinite

  /// y at a node, with its weights.
  void set_output(int node, Measured measured) noexcept;
  Measured measured(int node) const noexcept;
  /// y at a node (n_y) and measured u on an interval (n_u), NaN where missing.
  double* output(int node) noexcept { return outputs_.data() + at_output(node); }
  double* measured_input(int interval) noexcept { return measured_inputs_.data() + at_input(interval); }
  const double* output(int node) const noexcept { return outputs_.data() + at_output(node); }
  const double* measured_input(int interval) const noexcept { return measured_inputs_.data() + at_input(interval); }
  /// Measurements within an interval, at times of their own.
  BetweenNodes& between(int interval) noexcept { return between_[interval]; }
  const BetweenNodes& between(int interval) const noexcept { return between_[interval]; }
  /// Weight of an output from now on.
  void set_output_weight(int output, double weight) noexcept;
  void set_intervals(int intervals) noexcept { changing_structure().set_intervals(intervals); }
  /// Marks where a parameter's blocks start. `begins` has one entry per interval. The first interval uses the value of
  /// node 0, so begins[0] matters only for a ramp that starts there. Ignored for a parameter that was set up as one
  /// block.
  void set_blocks(int parameter, const std::uint8_t* begins, Transition transition) noexcept;
  /// Links the block that starts at an interval to the previous one; infinite variance: not linked.
  void link(int interval, int parameter, double variance) noexcept;
  double link_variance(int interval, int parameter) const noexcept;
  /// Weight of the squared value of the block that starts at an interval; at interval 0, of the horizon's first block,
  /// which has no control of its own. For process noise that is constant over a block (StateNoiseModel).
  void set_block_weight(int interval, int parameter, double weight) noexcept;
  double block_weight(int interval, int parameter) const noexcept;
  void finish() noexcept;
  /// Copies data, output weights and structure of a problem with the same model and otherwise the same set-up, without
  /// allocation.
  void take_data(const RheProblem& from) noexcept;
  /// Moves durations, known data, outputs and measured inputs one interval towards the start of the horizon; the last
  /// ones stay until they are overwritten.
  void drop_first_interval() noexcept;

  /// Weights in (0, 1] that the robust losses give to the outputs at an iterate: d loss / d s.
  void robust_weights(const Iterate& iterate, int node, double* weights, std::span<double> scratch) const noexcept;

  /// Of the measurements between the nodes of an interval: the products of these weights and of those that they were
  /// measured with; `weights` has a row of n_y for each. And, if not
  /// null, rows of the residual h - y and its gradient by the model's [x; p; u (; p at the end)], for each output.
  void linearise_between(int interval, const Iterate& iterate, double* weights, double* rows,
                         std::span<double> scratch) const noexcept;

  std::string_view kind() const noexcept override { return "rhe"; }
  bool has_small_residuals() const noexcept override { return true; }
  const double* known_inputs(int interval) const noexcept override { return measured_input(interval); }
  std::unique_ptr<Linearisation> make_linearisation() const override;
  const double* initial_state() const noexcept override { return nullptr; }

 private:
  friend class RheLinearisation;

  std::ptrdiff_t at_output(int node) const noexcept { return static_cast<std::ptrdiff_t>(node) * output_row_; }
  std::ptrdiff_t at_input(int interval) const noexcept {
    return static_cast<std::ptrdiff_t>(interval) * stride() + capacity().states;
  }

  double cost(const Iterate& iterate, double* stage_costs, std::span<double> scratch) const noexcept override;
  double write_cost(StageRange range, const Iterate& iterate, Hessian hessian, CostParts parts, StageQp& qp,
                    std::span<double> scratch) const noexcept override {
    return write_cost(range, iterate, hessian, parts, qp, nullptr, nullptr, scratch);
  }
  /// The same with caches of outputs, at nodes and between them, which are read and completed; null: none.
  double write_cost(StageRange range, const Iterate& iterate, Hessian hessian, CostParts parts, StageQp& qp,
                    OutputCache* known, BetweenCache* known_between, std::span<double> scratch) const noexcept;
  std::size_t cost_scratch_size() const noexcept override;

  void residual(const double* measured, const double* predicted, double* difference) const noexcept;
  double losses(const double* difference, const double* output_weights, double* weight,
                double* curvature) const noexcept;
  const double* weights_at(int node) const noexcept;
  const double* weights_between(int interval, int place, double* room) const noexcept;
  struct Observed {
    const double *outputs, *jacobians;  ///< rows of the nodes of a range
  };
  Observed observe(StageRange range, const Iterate& iterate, OutputCache* known, double* outputs, double* jacobians,
                   double* room) const noexcept;
  double write_measurements(StageRange range, const Iterate& iterate, Hessian hessian, const CostView& view,
                            OutputCache* known, std::span<double> scratch) const noexcept;
  double write_general_measurements(StageRange range, const Iterate& iterate, Hessian hessian, const CostView& view,
                                    const double* predicted, const double* jacobians, double* memory) const noexcept;
  struct BetweenBatch;
  struct OfPoints;
  struct ModelRows;
  bool has_between() const noexcept;
  bool has_many(int interval) const noexcept;
  std::size_t between_scratch_size() const noexcept;
  double add_between(StageRange range, const Iterate& iterate, Hessian hessian, const CostView* view,
                     double* stage_costs, double* memory) const noexcept;
  std::vector<double> points_of_interval() const;
  template <class Flush>
  void gather_interval(int interval, const Iterate& iterate, BetweenBatch& batch, const Flush& flush) const noexcept;
  void gather_entry(int interval, int place, bool is_point, double share, const Iterate& iterate,
                    BetweenBatch& batch) const noexcept;
  void write_part(int interval, double share, const Iterate& iterate, const BetweenBatch& batch, double* z,
                  double* data) const noexcept;
  void turn_ramp(const BetweenBatch& batch, double share, double* J, double* H) const noexcept;
  void evaluate_batch(BetweenBatch& batch, bool with_gradients) const noexcept;
  double add_batch(BetweenBatch& batch, Hessian hessian, const CostView* view, double* stage_costs) const noexcept;
  void write_parts(int interval, int place, double* parts) const noexcept;
  double add_points(BetweenBatch& batch, int interval, const OfPoints& points, const CostView* view) const noexcept;
  double sum_up(BetweenBatch& batch, int interval, const OfPoints& points, const CostView* view) const noexcept;
  double sum_up_known(BetweenBatch& batch, int interval, const OfPoints& points) const noexcept;
  ModelRows in_order_of_stage(BetweenBatch& batch, int interval, const ModelRows& rows, int count) const noexcept;
  void add_rows(BetweenBatch& batch, int interval, const double* rows, int count, const double* weights,
                const double* pulls, const CostView& view) const noexcept;
  void add_curvature_of_dynamics(BetweenBatch& batch, const CostView& view) const noexcept;
  void add_curvature_between(BetweenBatch& batch, int i, const CostView& view) const noexcept;
  void add_curvature_of_losses(BetweenBatch& batch, const CostView& view) const noexcept;
  double weigh(BetweenBatch& batch, int interval, int place, const double* predicted, double* weights, double* pulls,
               double* curvatures) const noexcept;
  std::ptrdiff_t between_key_size() const noexcept;
  std::ptrdiff_t between_said_size() const noexcept;
  std::ptrdiff_t between_kept_size() const noexcept;
  double add_known_between(StageRange range, const Iterate& iterate, const CostView& view, BetweenCache& known,
                           double* memory) const noexcept;
  double* H_of(const CostView& view, int stage) const noexcept;
  double* h_of(const CostView& view, int stage) const noexcept;
  double inputs(int interval, const Iterate& iterate, double* H, double* h) const noexcept;
  double links(int interval, const Iterate& iterate, double* H, double* h) const noexcept;
  void weigh_nodes() noexcept;
  void write_bounds(int stage) noexcept;
  double arrival_term(const Iterate& iterate, double* q) const noexcept;
  double first_block_weight(int parameter) const noexcept;

  Setup setup_;
  int ny_, output_row_;
  const PartsOfIntervals* parts_;  ///< the model, if its data depend on where an interval ends
  int bounded_intervals_ = -1;     ///< for which bounds were written
  std::vector<std::uint8_t> has_block_bounds_, is_one_block_;  ///< per stage; per parameter
  std::vector<int> robust_group_;                              ///< per output, or -1
  AlignedDoubles lower_pattern_, upper_pattern_;               ///< bounds of [x; p; u] at every stage
  std::vector<BetweenNodes> between_;                          ///< by interval
  std::vector<double> between_points_;                         ///< shares of an interval (PointSums)
  AlignedDoubles outputs_;                                     ///< one row per node, NaN where nothing was measured
  AlignedDoubles output_weights_, output_periods_, output_inverse_periods_;  ///< rows; the period of angles, else 0
  bool has_weights_ = false, has_block_weights_ = false;  ///< some measurement at a node, or block, has one of its own
  AlignedDoubles weights_, node_weights_;  ///< one row per node: these, and their products with `output_weights_`
  AlignedDoubles measured_inputs_, input_weights_;  ///< rows as in Iterate; NaN and 0 outside of the inputs
  std::vector<double> link_information_, block_weights_;
};

}  // namespace rhec
