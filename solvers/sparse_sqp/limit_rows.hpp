#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace rhec::sparse_sqp {

/// The rows of a SparseQp that are limits instead of equations,
///
///     lower - sigma <= (J d + c)_r <= upper + sigma,   sigma >= 0,   at the cost  linear sigma + 1/2 quadratic
///     sigma^2,
///
/// and which of them are active. An infinite linear weight forbids the slack. A row is
///
/// - off between its sides: its multiplier is zero,
/// - at a side (or at both, which are one): an equation, with a multiplier of at most the linear weight,
/// - beyond a side, with a slack: its multiplier is the price at the margin, linear + quadratic sigma. That is an
///   equation too, with 1 / quadratic in the place of a regularisation, or a known multiplier if quadratic is zero.
class LimitRows {
 public:
  struct Data {
    std::span<const int> rows;  ///< rows of J that are limits; the others are equations
    // By row of J.
    const double* lower = nullptr;
    const double* upper = nullptr;
    const double* linear = nullptr;
    const double* quadratic = nullptr;
  };
  enum class State : std::int8_t { off, lower, upper, both, below, above };

  /// Throws std::bad_alloc.
  void take_structure(int rows);

  /// The active set that multipliers tell of; `describe` writes multipliers that tell of the present one.
  void guess(const Data& limits, const double* multipliers);
  void describe(const Data& limits, double* multipliers) const;
  void set(int row, State state) noexcept { states_[row] = state; }
  State state(int row) const noexcept { return states_[row]; }

  /// The rows' part of the matrix: rows that are no equations now, and the lower right diagonal.
  void write_matrix(const Data& limits, std::uint8_t* off, double* dual) const noexcept;
  /// Whether a row has a known multiplier, and which.
  bool is_known(const Data& limits, int row) const noexcept;
  double known_multiplier(const Data& limits, int row) const noexcept;
  /// What is left of a row's equation, where its value is J d + c.
  double unmet(const Data& limits, int row, double value, double multiplier) const noexcept;

  struct Change {
    int added = 0, released = 0;
  };
  /// Corrects the active set by what values and multipliers show.
  Change update(const Data& limits, const double* values, const double* multipliers, double value_tolerance,
                double multiplier_tolerance);
  /// Removes from multipliers what has the wrong sign.
  void clip(const Data& limits, double* multipliers) const noexcept;

 private:
  std::vector<State> states_;
};

}  // namespace rhec::sparse_sqp
