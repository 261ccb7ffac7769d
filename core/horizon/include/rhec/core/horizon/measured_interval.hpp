#pragma once

#include <cstddef>
#include <vector>

#include "rhec/core/base/export.hpp"

namespace rhec {

/// Outputs that were measured at one time. It only refers to the numbers.
struct Measured {
  // NOLINTNEXTLINE(google-explicit-constructor): outputs of usual accuracy are all that most have
  Measured(const double* outputs = nullptr, const double* information = nullptr) noexcept
      : values(outputs), weights(information) {}

  explicit operator bool() const noexcept { return values != nullptr; }
  double operator[](std::ptrdiff_t output) const noexcept { return values[output]; }
  double weight(std::ptrdiff_t output) const noexcept { return weights ? weights[output] : 1.0; }

  const double* values;  ///< n_y, NaN where missing
  /// n_y, positive: how much information each has, relative to one with the noise that its output is configured with,
  /// (sigma / sigma of this measurement)^2. Null: 1.
  const double* weights;
};

/// What was measured on one interval, from a node to the next. It only refers to the numbers.
struct MeasuredInterval {
  double duration = 0.0;           ///< [s]
  const double* inputs = nullptr;  ///< n_u: their means over the interval, NaN where missing
  /// Measurements between the two nodes: their times from the start of the interval, ascending, above 0 and below the
  /// duration [s]; their outputs, one row of n_y each, NaN where missing.
  int between = 0;
  const double* times = nullptr;
  const double* outputs = nullptr;
  const double* weights = nullptr;  ///< of these outputs as in Measured, rows of n_y; null: all 1
  /// The parameters jump at its end: what they were before says nothing of what they are behind it.
  bool ends_with_jump = false;

  /// Measurement number k between the nodes, of n_y outputs.
  Measured measured(int k, std::ptrdiff_t output_count) const noexcept {
    return {outputs + k * output_count, weights ? weights + k * output_count : nullptr};
  }
};

/// Keeps outputs that were measured at one time. Only its constructor allocates.
class RHEC_EXPORT MeasuredOutputs {
 public:
  MeasuredOutputs() = default;
  explicit MeasuredOutputs(int outputs);

  void clear() noexcept;
  void assign(Measured from) noexcept {
    clear();
    add(from);
  }
  /// Takes those that are not missing in place of what it has.
  void add(Measured from) noexcept;
  /// Leaves out those that are not missing in y (n_y).
  void remove(const double* y) noexcept;
  /// Until the next change.
  Measured measured() const noexcept { return {values_.data(), has_weights_ ? weights_.data() : nullptr}; }
  double* values() noexcept { return values_.data(); }
  double operator[](std::ptrdiff_t output) const noexcept { return values_[output]; }
  std::size_t size() const noexcept { return values_.size(); }

 private:
  bool has_weights_ = false;
  std::vector<double> values_, weights_;
};

/// Keeps the measurements between two nodes, at most as many as it was made for. Only its constructor allocates.
class RHEC_EXPORT BetweenNodes {
 public:
  BetweenNodes(int outputs, int most)
      : width_(outputs), times_(most), outputs_(times_.size() * outputs), weights_(outputs_.size(), 1.0) {}

  int most() const noexcept { return static_cast<int>(times_.size()); }
  int count() const noexcept { return count_; }
  int width() const noexcept { return width_; }
  void clear() noexcept {
    count_ = 0;
    has_weights_ = false;
  }
  /// Copies them; those beyond what there is room for are left out.
  void assign(const MeasuredInterval& interval) noexcept;
  void assign(const BetweenNodes& from) noexcept;
  /// Adds one behind the others, with all outputs missing, and returns its outputs; null if there is no room.
  double* add(double time) noexcept;
  /// Of measurement i: takes those outputs that are not missing in place of what it has.
  void add_outputs(int i, Measured from) noexcept;

  double time(int i) const noexcept { return times_[i]; }
  const double* outputs(int i) const noexcept { return outputs_.data() + static_cast<std::ptrdiff_t>(i) * width_; }
  double* outputs(int i) noexcept { return outputs_.data() + static_cast<std::ptrdiff_t>(i) * width_; }
  /// Whether some measurement has weights of its own.
  bool has_weights() const noexcept { return has_weights_; }
  const double* weights(int i) const noexcept {
    return has_weights_ ? weights_.data() + static_cast<std::ptrdiff_t>(i) * width_ : nullptr;
  }
  Measured measured(int i) const noexcept { return {outputs(i), weights(i)}; }
  /// Over an interval of this duration and these inputs.
  MeasuredInterval over(double duration, const double* inputs, bool ends_with_jump = false) const noexcept {
    return {duration, inputs, count_, times_.data(), outputs_.data(), weights(0), ends_with_jump};
  }

 private:
  int width_, count_ = 0;
  double* weigh(int i) noexcept;

  bool has_weights_ = false;  ///< else `weights_` are not used
  std::vector<double> times_, outputs_, weights_;
};

}  // namespace rhec
