#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/core/model/model.hpp"
#include "rhec/core/qp/iterate.hpp"

namespace rhec {

/// Where the variables of a model lie in the stages of a horizon, and which intervals share a value (docs/method.md,
/// section 4).
///
/// A lifted (blocked) variable is one whose value is part of the stage state, so that consecutive intervals (a block)
/// can share it: every parameter, then every blocked input, in this order. With x the model's state and c the lifted
/// variables,
///
///     stage state    s_i = [x_i; c_i]                  c_i: values on interval i - 1 (at node 0: on interval 0)
///     stage control  w_i = [free inputs; values of the lifted variables whose block starts at interval i]
///
/// A lifted variable whose block does not start keeps its value, c_{i+1} = c_i; one whose block starts takes that of
/// its control. Interval i uses c_{i+1} or, with a ramp, the line from c_i to c_{i+1}. So unblocked, structured and
/// full-horizon blocking differ only in the number of controls of a stage.
///
/// The constructor allocates for the widest structure. After a change, `finish` must be called.
class RHEC_EXPORT HorizonStructure {
 public:
  struct Setup {
    int max_intervals = 0;
    std::vector<int> blocked_inputs;      ///< inputs that are lifted variables
    bool parameters_are_decided = false;  ///< blocks of parameters may start within the horizon,
    std::vector<int> one_block;           ///< except for these parameters
    int limits = 0;                       ///< rows of a stage, at most
  };
  /// Throws Error if the horizon has no interval.
  HorizonStructure(const Model& model, const Setup& setup);

  void set_intervals(int intervals) noexcept;
  void set_block_start(int interval, int lifted, bool starts) noexcept;
  void set_ramp(int lifted, bool is_ramp) noexcept;
  /// Whether nothing has changed since `finish`; counts are valid only then.
  bool is_finished() const noexcept { return is_finished_; }
  /// Counts the controls of every interval. False if nothing has changed since the last call.
  bool finish() noexcept;

  const Capacity& capacity() const noexcept { return capacity_; }
  int intervals() const noexcept { return intervals_; }
  /// Length of a row [s; w] in memory.
  int stride() const noexcept { return stride_; }
  int vehicle_states() const noexcept { return nx_; }
  int inputs() const noexcept { return nu_; }
  int parameters() const noexcept { return np_; }
  int lifted_count() const noexcept { return lifted_; }
  int free_input_count() const noexcept { return static_cast<int>(free_inputs_.size()); }
  int control_count(int interval) const noexcept { return control_counts_[interval]; }
  const int* control_counts() const noexcept { return control_counts_.data(); }
  /// No input is lifted, so that a row begins like the model's [x; p; u].
  bool is_direct() const noexcept { return free_input_count() == nu_; }

  bool starts_block(int interval, int lifted) const noexcept { return starts_[interval * lifted_ + lifted] != 0; }
  /// For all lifted variables at an interval: 1 if a block starts, otherwise 0.
  const std::uint8_t* block_starts(int interval) const noexcept { return starts_.data() + at(interval); }
  /// Whether a block starts anywhere within the horizon.
  bool any_start() const noexcept { return any_start_; }
  /// Whether a lifted variable ramps to the value of a new block.
  bool is_ramp(int lifted) const noexcept { return ramp_[lifted] != 0; }
  bool any_ramp() const noexcept { return any_ramp_; }
  /// Index in w_i of a lifted variable whose block starts at interval i, or -1.
  int control_of_lifted(int interval, int lifted) const noexcept { return controls_of_lifted(interval)[lifted]; }
  const int* controls_of_lifted(int interval) const noexcept { return control_index_.data() + at(interval); }
  /// The index of an input among the lifted variables, or -1 if it is free on every interval.
  int lifted_of_input(int input) const noexcept { return lifted_of_input_[input]; }
  /// Index of an input in w_i, or -1 if the stage state holds its value.
  int control_of_input(int interval, int input) const noexcept;
  /// Index of an input in the row [s_i; w_i].
  int column_of_input(int interval, int input) const noexcept;

  // Values that interval i of an iterate uses.
  void inputs_on(const Iterate& iterate, int interval, double* u) const noexcept;
  /// With a ramp, the value at the end of the interval, which is the block's.
  void parameters_on(const Iterate& iterate, int interval, double* p) const noexcept;
  /// Writes inputs (N x n_u) and parameters (N x n_p) per interval into controls and lifted variables; a block takes
  /// the row of its first interval.
  void set_decisions(Iterate& iterate, const double* inputs, const double* parameters) const noexcept;
  /// Overwrites the lifted variables of node `interval` + 1 with the values of the interval.
  void carry_lifted(int interval, Iterate& iterate) const noexcept;

 private:
  std::ptrdiff_t at(int interval) const noexcept { return static_cast<std::ptrdiff_t>(interval) * lifted_; }

  int nx_, nu_, np_, lifted_, stride_ = 0, intervals_ = 0;
  Capacity capacity_;
  bool any_ramp_ = false, any_start_ = false;
  bool is_finished_ = false;  ///< nothing has changed since `finish`
  std::vector<int> lifted_of_input_, free_inputs_;
  std::vector<std::uint8_t> starts_, ramp_;
  std::vector<int> control_index_, control_counts_;
};

}  // namespace rhec
