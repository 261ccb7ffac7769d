#pragma once

#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/core/horizon/measured_interval.hpp"

namespace rhec {

/// Many measurements of one output within an interval, as four that say the same: a sensor's rate does not decide what
/// an interval costs. As long as the output is a polynomial of degree 3 in time, the least-squares polynomial through
/// the measurements holds all that they say of it. Its values at the nodes of Gauss' quadrature for the sum over the
/// times of measurement are uncorrelated, and each has the weight w of its node: the variance R / w (Golub and Welsch
/// 1969; the products of two of Lagrange's polynomials of degree 3 have the degree 6, and four nodes are exact up to
/// 7). Allocates in its constructor only.
class RHEC_EXPORT ReadingSummary {
 public:
  ReadingSummary() = default;
  /// Of these outputs, not angles, among `output_count`; for intervals with `most` measurements between their nodes. An
  /// interval is cut into `pieces` of equal duration, each with polynomials of its own.
  ReadingSummary(std::vector<int> outputs, int output_count, int most, int pieces);

  /// Measurements of an output in a piece from which on they are summarised, and what they become.
  static constexpr int least = 5, nodes = 4;

  /// The interval with its measurements summarised; it refers to numbers of this object, until the next call.
  MeasuredInterval operator()(const MeasuredInterval& interval) noexcept;
  /// Measurements that there can be afterwards.
  int most() const noexcept { return static_cast<int>(times_.size()); }
  /// How many measurements of usual accuracy each output of the summarised interval stands for, rows of n_y in the
  /// order of its times: sums of the weights of those that were measured.
  const double* weights() const noexcept { return weights_.data(); }

 private:
  bool summarise(const MeasuredInterval& interval, int output, int taken) noexcept;
  void add(double time, int output, double value, double weight) noexcept;

  std::vector<int> outputs_;
  int width_ = 0, pieces_ = 1, count_ = 0;
  std::vector<double> times_, values_, weights_;  ///< of the summarised interval
  std::vector<int> present_;                      ///< measurements of one output in one piece
  std::vector<double> polynomials_;               ///< `nodes` rows: at those
};

}  // namespace rhec
