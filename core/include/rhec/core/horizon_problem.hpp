#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "rhec/core/blocking.hpp"
#include "rhec/core/model.hpp"
#include "rhec/core/ocp.hpp"

namespace rhec {

struct CostView;
struct MeasurementView;
struct Recollection;

/// Row `i` of rows of equal width.
template <class Vector>
auto row(Vector& v, int i, int width) noexcept {
  return v.data() + static_cast<std::ptrdiff_t>(i) * width;
}

/// What the two kinds of problem share: a model over a horizon, with channels (parameters or blocked inputs) whose
/// values are carried from stage to stage.
///
/// Stage state s_i = [x_i; c_i], c_i the carried channels' values on interval i-1 (at node 0: on interval 0). Stage
/// control w_i = [free inputs; values of the channels whose block starts at interval i]. A channel that does not start
/// keeps its value: c_{i+1} = c_i; one that starts takes its control's. Where the model sees a channel, it sees
/// c_{i+1}, or, with Transition::ramp, the line from c_i to c_{i+1}.
class RHEC_EXPORT HorizonProblem : public Ocp {
 public:
  const Model& model() const noexcept { return *model_; }
  std::shared_ptr<const Model> shared_model() const noexcept { return model_; }
  int substeps() const noexcept { return substeps_; }

  Capacity capacity() const noexcept override { return capacity_; }
  int intervals() const noexcept override { return intervals_; }
  int state_count(int) const noexcept override { return capacity_.states; }
  int control_count(int interval) const noexcept override { return control_counts_[interval]; }
  const double* state_lower(int node) const noexcept override { return row(lower_, node, stride_); }
  const double* state_upper(int node) const noexcept override { return row(upper_, node, stride_); }
  const double* control_lower(int i) const noexcept override { return row(lower_, i, stride_) + capacity_.states; }
  const double* control_upper(int i) const noexcept override { return row(upper_, i, stride_) + capacity_.states; }
  bool has_second_derivatives() const noexcept override { return model_->has_second_derivatives(); }
  std::size_t scratch_size() const noexcept override;
  void mark_dynamics(int interval, std::uint8_t* state_flags, std::uint8_t* control_flags) const noexcept override;
  void remember_in(StageQp& qp) const override;
  bool is_made_at(const Iterate& point, const StageQp& qp) const noexcept override;

  double evaluate_stages(const Iterate& point, double* defects, double* stage_costs,
                         std::span<double> scratch) const noexcept override;
  void simulate_interval(int interval, Iterate& point, std::span<double> scratch) const noexcept override;
  /// The same as `simulate_interval`; with the derivatives, which are kept, so that `prepare` at such a point need not
  /// ask the model again.
  void foresee_interval(int interval, Iterate& point) noexcept;
  double linearise(StageRange range, const Iterate& point, Hessian hessian, StageQp& qp,
                   std::span<double> scratch) const noexcept override;
  void prepare(const Iterate& point, Hessian hessian, StageQp& qp, std::span<double> scratch) const noexcept override;
  void refresh(const Iterate& point, StageQp& qp, std::span<double> scratch) const noexcept override;

  /// Length of an interval [s].
  double duration(int interval) const noexcept { return durations_[interval]; }
  void set_duration(int interval, double seconds) noexcept { durations_[interval] = seconds; }

  /// True where a block of carried channel `channel` starts at an interval.
  bool begins(int interval, int channel) const noexcept { return begins_[interval * channels_ + channel] != 0; }
  /// A block of a carried channel starts somewhere within the horizon.
  bool any_start() const noexcept { return any_start_; }
  int channel_count() const noexcept { return channels_; }
  /// Index in w_i of a channel that starts at interval i, or -1.
  int control_of_channel(int interval, int channel) const noexcept {
    return control_index_[interval * channels_ + channel];
  }
  /// True where a carried channel's blocks are reached by a ramp.
  bool is_ramp(int channel) const noexcept { return ramp_[channel] != 0; }

  // The point in the vehicle's terms: what interval i uses.
  const double* vehicle_state(const Iterate& point, int node) const noexcept { return point.state(node); }
  void inputs_on(const Iterate& point, int interval, double* u) const noexcept;
  /// With a ramp, the value at the interval's end, which is the block's.
  void parameters_on(const Iterate& point, int interval, double* p) const noexcept;
  /// Writes inputs (N x n_u) and parameters (N x n_p) per interval into a point's controls and carried states; where
  /// intervals share a block, the row of the block's first interval counts.
  void set_decisions(Iterate& point, const double* inputs, const double* parameters) const noexcept;

 protected:
  struct Shape {
    int max_intervals = 0;
    int substeps = 1;
    std::vector<int> blocked_inputs;  ///< inputs that are carried channels
    bool decides_parameters = false;  ///< blocks of parameters may start within the horizon,
    std::vector<int> one_block = {};  ///< but for those of these
  };
  HorizonProblem(std::shared_ptr<const Model> model, const Shape& shape);

  int nx() const noexcept { return nx_; }
  int nu() const noexcept { return nu_; }
  int np() const noexcept { return np_; }
  int stride() const noexcept { return stride_; }

  void set_intervals(int intervals) noexcept {
    is_finished_ &= intervals_ == intervals;
    intervals_ = intervals;
  }
  void set_begins(int interval, int channel, bool begins) noexcept {
    std::uint8_t& before = begins_[interval * channels_ + channel];
    is_finished_ &= (before != 0) == begins;
    before = begins;
  }
  void set_ramp(int channel, bool ramp) noexcept;
  /// Counts the controls of every interval; call it after the structure may have changed. False where it has not.
  bool finish_structure() noexcept;
  /// Carried channel of an input, or -1 where it is free on every interval.
  int channel_of_input(int input) const noexcept { return input_channel_[input]; }
  int control_of_input(int interval, int input) const noexcept;

  /// Bounds of z = [s; w] at every stage, as the rows of StageQp.
  double* lower_row(int stage) noexcept { return row(lower_, stage, stride_); }
  double* upper_row(int stage) noexcept { return row(upper_, stage, stride_); }
  /// Where the kernels of costs write to: all of a program, or (after the fact) its matrices or vectors alone.
  enum class Parts { all, matrices, vectors };
  CostView cost_view(Parts parts, Hessian hessian, StageQp& qp) const noexcept;
  CostView cost_view(double* H, double* h, bool bends) const noexcept;
  /// Removes all bounds.
  void clear_bounds() noexcept;
  /// Where an input is found in z of an interval: free, or that of its channel.
  int column_of_input(int interval, int input) const noexcept;
  /// No input is carried: z begins as the vehicle's [x; p; u].
  bool is_direct() const noexcept { return static_cast<int>(free_inputs_.size()) == nu_; }

  // The cost, which makes the kind.
  virtual double cost(const Iterate& point, double* stage_costs, std::span<double> scratch) const noexcept = 0;
  /// Overwrites h, and H but for the curvature of the dynamics; returns the sum of the stages' costs where vectors are
  /// wanted.
  virtual double add_cost(StageRange range, const Iterate& point, Hessian hessian, Parts parts, StageQp& qp,
                          std::span<double> scratch) const noexcept = 0;
  virtual std::size_t cost_scratch_size() const noexcept = 0;
  /// Whether bounds are data that may come between `prepare` and `refresh`.
  virtual bool has_late_bounds() const noexcept = 0;
  /// What was remembered in a program that has memory for this model; null where it has not. What another problem left
  /// there is forgotten.
  Recollection* recollection_in(StageQp& qp) const noexcept;
  const Recollection* recollection_in(const StageQp& qp) const noexcept;

 private:
  void gather(const Iterate& point, StageRange range, double* x, double* u, double* p, double* p_end) const noexcept;
  void gather_rows(const Iterate& point, StageRange range, double* rows) const noexcept;
  void fill_stages(StageRange range, const Iterate& point, Hessian hessian, StageQp& qp,
                   std::span<double> scratch) const noexcept;
  bool is_of_structure(const StageQp& qp, const Recollection& known) const noexcept;
  bool has_structure(const StageQp& qp, const Recollection& known) const noexcept;
  void remember(const Iterate& point, int first, const StageQp& qp, Recollection& known) const noexcept;
  bool move_along(const Iterate& point, Hessian hessian, StageQp& qp, Recollection& known,
                  std::span<double> scratch) const noexcept;
  void fill_sizes(StageRange range, StageQp& qp) const noexcept;
  /// What is special about a call of `linearise_dynamics`.
  struct Dynamics {
    Hessian hessian = Hessian::gauss_newton;
    bool has_channel_rows = false;  ///< F has those of carried channels already
    Recollection* ahead = nullptr;  ///< the point is this one's, and one more interval is wanted
  };
  void linearise_dynamics(StageRange steps, const Iterate& point, const Dynamics& how, StageQp& qp,
                          std::span<double> scratch) const noexcept;
  void complete_dynamics(StageRange steps, const Iterate& point, bool has_channel_rows, StageQp& qp) const noexcept;
  void look_ahead(Recollection& known) const noexcept;
  bool has_foreseen(int interval, const Iterate& point, double* row) const noexcept;
  void take_foreseen(int interval, const Iterate& point, StageQp& qp) const noexcept;
  void carry_channels(int interval, Iterate& point) const noexcept;
  void place_started_channels(int interval, Hessian hessian, StageQp& qp) const noexcept;
  void scatter(int interval, const double* jacobian, const double* hessian, StageQp& qp) const noexcept;
  void fill_bounds(const Iterate& point, StageRange range, StageQp& qp) const noexcept;

  std::shared_ptr<const Model> model_;
  /// Of this problem and its copies alone: all that was set up once, such as weights, is the same in them.
  std::shared_ptr<const char> identity_ = std::make_shared<const char>();
  Capacity capacity_;
  int nx_, nu_, np_, channels_, substeps_, stride_ = 0, row_ = 0, intervals_ = 0;
  bool any_ramp_ = false;
  bool any_start_ = false;    ///< of a channel, on any interval
  bool is_finished_ = false;  ///< nothing of the structure has changed since `finish_structure`
  AlignedDoubles lower_, upper_;
  std::vector<int> input_channel_, free_inputs_;
  std::vector<double> durations_;
  std::vector<std::uint8_t> begins_, ramp_;
  std::vector<int> control_index_, control_counts_;
  /// One interval that the model was asked about.
  struct Foreseen {
    double duration = 0.0;                      ///< 0: none
    AlignedDoubles z, next, jacobian, scratch;  ///< rows as Model::integrate_rows has them
  };
  Foreseen foreseen_;
};

}  // namespace rhec
