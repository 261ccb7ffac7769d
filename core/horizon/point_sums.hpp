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
/// a measurement costs the products of its n parts alone, whatever the number of variables. With W = L D L' these are n
/// rows L'G with the weights D and the pulls L^-1 v. The points are those of Chebyshev of the first kind, so that the
/// polynomial is close to the best of its degree (Berrut and Trefethen 2004, eq. 5.3).
class PointSums {
 public:
  static constexpr int most_points = 9;

  /// Shares of an interval at which so many points lie, increasing, none at its ends.
  static std::vector<double> shares(int points);
  /// The parts of points at these shares, at another share: a row of padded(most_points), 0 behind them.
  static void write_parts(const double* shares, int points, double share, double* parts) noexcept;

  /// L and D of an output's W.
  class Factors {
   public:
    static constexpr std::ptrdiff_t size = (most_points + 1) * padded(most_points);
    explicit Factors(double* memory) noexcept : memory_(memory) {}
    double* pivots() const noexcept { return memory_; }
    double* row(int point) const noexcept { return memory_ + (point + 1) * padded(most_points); }

   private:
    double* memory_;
  };

  PointSums() = default;
  /// Of `outputs` outputs, whose gradients have rows of `width`, a multiple of eight; `memory` has `size` entries.
  PointSums(int points, int outputs, int width, double* memory) noexcept;
  static std::size_t size(int outputs, int width) noexcept;

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
  /// W = L D L' of an output. Fewer measurements than points leave pivots that are zero but for rounding; they and
  /// their columns are then zero.
  void factor(int output, Factors factors) const noexcept;

  struct Rows {
    const double *rows, *weights, *pulls;  ///< `points` rows of `width`; weights may be null
  };
  /// The rows of an output, whose gradient at point k is `gradients + k * step`: for H and h with the factors of its W,
  /// and for h alone without. Valid until the next call.
  Rows rows(int output, const double* gradients, std::ptrdiff_t step, const Factors* factors) noexcept;

 private:
  static constexpr std::ptrdiff_t row = padded(most_points);
  static constexpr int block = 4;  ///< rows are gone through in blocks, for the processor's lanes

  int points_ = 0, outputs_ = 0, width_ = 0;
  double *said_ = nullptr, *weights_ = nullptr, *pulls_ = nullptr;  ///< by output: at the points; W; v
  double *rows_ = nullptr, *reduced_ = nullptr;
};

}  // namespace rhec
