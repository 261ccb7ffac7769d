#pragma once

#include <cstddef>
#include <vector>

#include "rhec/core/base/export.hpp"

namespace rhec {

/// What was measured on one interval, from a node to the next. It only refers to the numbers.
struct MeasuredInterval {
  double duration = 0.0;           ///< [s]
  const double* inputs = nullptr;  ///< n_u: their means over the interval, NaN where missing
  /// Measurements between the two nodes: their times from the start of the interval, ascending, above 0 and below the
  /// duration [s]; their outputs, one row of n_y each, NaN where missing.
  int between = 0;
  const double* times = nullptr;
  const double* outputs = nullptr;
};

/// Keeps the measurements between two nodes, at most as many as it was made for. Only its constructor allocates.
class RHEC_EXPORT BetweenNodes {
 public:
  BetweenNodes(int outputs, int most) : width_(outputs), times_(most), outputs_(times_.size() * outputs) {}

  int most() const noexcept { return static_cast<int>(times_.size()); }
  int count() const noexcept { return count_; }
  int width() const noexcept { return width_; }
  void clear() noexcept { count_ = 0; }
  /// Copies them; those beyond what there is room for are left out.
  void assign(const MeasuredInterval& interval) noexcept;
  void assign(const BetweenNodes& from) noexcept;
  /// Adds one behind the others, with all outputs missing, and returns its outputs; null if there is no room.
  double* add(double time) noexcept;

  double time(int i) const noexcept { return times_[i]; }
  const double* outputs(int i) const noexcept { return outputs_.data() + static_cast<std::ptrdiff_t>(i) * width_; }
  double* outputs(int i) noexcept { return outputs_.data() + static_cast<std::ptrdiff_t>(i) * width_; }
  /// Over an interval of this duration and these inputs.
  MeasuredInterval over(double duration, const double* inputs) const noexcept {
    return {duration, inputs, count_, times_.data(), outputs_.data()};
  }

 private:
  int width_, count_ = 0;
  std::vector<double> times_, outputs_;
};

}  // namespace rhec
