#pragma once

// Many measurements of an interval as few rows.

#include <cstddef>
#include <vector>

#include "rhec/core/base/padded.hpp"

namespace rhec {

/// What an output is at a time within an interval is a polynomial through its values at n points of the interval: with
/// the parts l_k(t) of the points, which are 1 at one of them and 0 at the others,
///
///     y(t) = sum_k l_k(t) y_k,      dy/dz (t) = sum_k l_k(t) G_k.
///
/// So measurements at t_m with weights w_m and pulls q_m add to H and h
///
///     sum_m w_m dy/dz' dy/dz = G' W G,   W = sum_m w_m l l',      sum_m q_m dy/dz = G' v,   v = sum_m q_m l:
///
/// a measurement costs the products of its n parts alone, whatever the number of variables. The points are those of
/// Chebyshev of the first kind, so that the polynomial is close to the best of its degree (Berrut and Trefethen 2004,
/// eq. 5.3).
class PointSums {
 public:
  static constexpr int most_points = 9;
  static constexpr std::ptrdiff_t row = padded(most_points);

  /// Shares of an interval at which so many points lie, increasing, none at its ends.
  static std::vector<double> shares(int points);
  /// The parts of points at these shares, at another share: a row, 0 behind them.
  static void write_parts(const double* shares, int points, double share, double* parts) noexcept;

  /// The sums of an output's costs. Of quadratic ones, with weights and pulls that are derivatives of the cost, what
  /// the model said at the points when they were formed is kept with them. Where it says other things, ds away from
  /// these, the same measurements have
  ///
  ///     v = v_0 + W ds,      cost = cost_0 + v_0' ds + ds' W ds / 2:
  ///
  /// none need be looked at again.
  class Kept {
   public:
    static constexpr std::ptrdiff_t size = (most_points + 2) * row + 8;
    explicit Kept(double* memory) noexcept : memory_(memory) {}
    double* weights() const noexcept { return memory_; }  ///< W, by rows
    double* said() const noexcept { return memory_ + most_points * row; }
    double* pulls() const noexcept { return said() + row; }
    double& cost() const noexcept { return pulls()[row]; }
    double& largest() const noexcept { return pulls()[row + 1]; }  ///< of the residuals, absolute

   private:
    double* memory_;
  };

  PointSums() = default;
  /// Of `outputs` outputs; `memory` has `size` entries.
  PointSums(int points, int outputs, double* memory) noexcept;
  static std::size_t size(int outputs) noexcept;

  /// Begins with what the model says of the outputs at the points, `step` entries from one point to the next.
  void begin(const double* outputs, std::ptrdiff_t step) noexcept;
  /// What it says of each output at a measurement with these parts.
  void predict(const double* parts, double* outputs) const noexcept;
  /// Adds a measurement by its parts, and by the pulls of its outputs; 0: not measured.
  void add_pulls(const double* parts, const double* pulls) noexcept;
  /// v of an output, one entry for each point.
  const double* pulls(int output) const noexcept { return pulls_ + output * row; }

  void begin_weights() noexcept;
  /// Adds a measurement by its parts, and by the weights of its outputs; 0: not measured.
  void add_weights(const double* parts, const double* weights) noexcept;
  void keep_weights(int output, Kept kept) const noexcept;
  /// Keeps the sums of costs that are quadratic, with their cost and the largest residual.
  void keep(int output, double cost, double largest, Kept kept) const noexcept;
  /// After `begin`: the cost and the pulls of an output from kept sums. False, and nothing is changed, where these do
  /// not tell: an angle's residual could pass half its period (0: not an angle), or the cost is so much less than when
  /// they were formed that rounding matters.
  bool revise(int output, Kept kept, double period, double& cost) noexcept;

 private:
  static constexpr int block = 4;  ///< rows are gone through in blocks, for the processor's lanes

  int points_ = 0, outputs_ = 0;
  double *said_ = nullptr, *weights_ = nullptr, *pulls_ = nullptr;  ///< by output: at the points; W; v
};

}  // namespace rhec
