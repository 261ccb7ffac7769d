#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "rhec/core/riccati.hpp"
#include "rhec/core/solver.hpp"

namespace rhec::gn_rti {

/// Solves a strictly convex StageQp with all its bounds, exactly, by a dual active-set method (Goldfarb & Idnani 1983,
/// "A numerically stable dual method for solving strictly convex quadratic programs").
///
/// What pulls the wrong way in the claimed active set is dropped, until all multipliers have their sign. From there the
/// most violated bound is added, one at a time, by a step that keeps the signs: it drops the bound whose multiplier
/// comes to zero first. The dual objective grows with each step, so that this ends.
///
/// A change of the set costs no factorisation, in general. Claimed bounds of controls are held inside the Riccati
/// factorisation, at no cost. Every other active bound is a multiplier in the gradient: with the responses W of the
/// minimiser to the gradients A of these bounds, the multipliers solve the small dense system S = -A'W, whose Cholesky
/// factor grows and shrinks with the set. Only where a held bound is dropped is the program factorised anew.
class DualActiveSet {
 public:
  enum class Outcome {
    solved,
    not_convex,   ///< without its state bounds the program has no minimiser: it has to be convexified first
    no_solution,  ///< the bounds contradict each other, as far as can be seen here
    too_much,     ///< more changes than are provided for, or rounding: another method has to do it
    out_of_time
  };
  /// At most so many active bounds beside the held ones, and so many changes of the set.
  static constexpr int max_columns = 32, max_changes = 96;

  DualActiveSet() = default;
  explicit DualActiveSet(const Capacity& capacity);

  /// What needs the program's matrices only: the factorisation with the claimed set (null: none), and the responses.
  void prepare(const StageQp& qp, Riccati& riccati, const ActiveSet* claimed) noexcept;
  /// After `prepare`, with the program's vectors as they are now. Where solved, the set goes to `active` and the
  /// minimiser, its costates and multipliers to `step`. The deadline is looked at before every change of the set.
  Outcome solve(const StageQp& qp, Riccati& riccati, ActiveSet& active, Iterate& step,
                Clock::time_point deadline) noexcept;
  /// After `solve`: has the factorisation give its policy too (Riccati::feedback), which a solution may come without.
  void complete_policy(const StageQp& qp, Riccati& riccati) noexcept;
  /// Since the last `prepare`.
  int factorisations() const noexcept { return factorisations_; }

 private:
  enum class Hold : std::uint8_t { free, held, column };
  enum class Found { nothing, values, step };
  /// A variable with a bound.
  struct Bounded {
    Riccati::Entry entry;
    std::ptrdiff_t at;  ///< in the rows of all stages
    bool is_control, is_equality;
    Hold hold;
    std::int8_t side;  ///< of the active bound
    double lower, upper;
    double least, most;  ///< the bounds with their tolerance
    int slot;            ///< where its responses are, or none
    double bound() const noexcept { return side < 0 ? lower : upper; }
    /// Positive outside the bounds and their tolerance.
    double violation(double value) const noexcept { return std::max(least - value, value - most); }
    void set_bounds(double new_lower, double new_upper) noexcept;
  };
  static constexpr int none = -1, slots = max_columns + 2 * Riccati::Responses::size;

  void collect(const StageQp& qp, const ActiveSet* claimed) noexcept;
  bool take_bounds(const StageQp& qp) noexcept;
  void factor(const StageQp& qp, Riccati& riccati) noexcept;
  bool refactor(const StageQp& qp, Riccati& riccati) noexcept;
  bool find_responses(const StageQp& qp, Riccati& riccati, const int* which, int count, bool with_minimiser) noexcept;
  bool find_responses_of_columns(const StageQp& qp, Riccati& riccati, int first) noexcept;
  bool find_responses_of_next(const StageQp& qp, Riccati& riccati, int entering) noexcept;
  const double* responses(int which) const noexcept {
    return responses_.data() + static_cast<std::ptrdiff_t>(bounded_[which].slot) * width_;
  }
  double* factor_row(int k) noexcept { return factor_.data() + static_cast<std::ptrdiff_t>(k) * max_columns; }
  const double* factor_row(int k) const noexcept {
    return factor_.data() + static_cast<std::ptrdiff_t>(k) * max_columns;
  }
  int column_count() const noexcept { return static_cast<int>(columns_.size()); }

  double eliminate(int entering, int count, double* row) const noexcept;
  void back_substitute(double* right_hand_side) const noexcept;
  bool factor_columns(int first, bool may_leave_out) noexcept;
  void drop_column(int k) noexcept;

  bool begin_with_columns(const StageQp& qp, Riccati& riccati) noexcept;
  bool combine_batch(const StageQp& qp, Riccati& riccati, Iterate& step) noexcept;
  bool solve_with_multipliers(const StageQp& qp, Riccati& riccati, Iterate& step) noexcept;
  double largest_miss() const noexcept;
  void return_to_bounds() noexcept;
  bool drop_wrong_columns() noexcept;
  bool release_wrong_held() noexcept;
  bool drop_wrong() noexcept;
  int most_violated() const noexcept;
  int count_violated() const noexcept;
  bool add_controls_together(const StageQp& qp, Riccati& riccati, int worst) noexcept;
  void append_column(int which, double square, double multiplier) noexcept;
  Outcome add(const StageQp& qp, Riccati& riccati, int entering, Clock::time_point deadline) noexcept;
  Found find_values(const StageQp& qp, Riccati& riccati, Iterate& step) noexcept;
  void write(ActiveSet& active, Iterate& step) const noexcept;

  int factorisations_ = 0, changes_ = 0;
  std::ptrdiff_t width_ = 0;  ///< of a slot: as many bounds as there can be
  bool is_convex_ = false, is_collected_ = false, has_policy_ = false;
  double pull_tolerance_ = 0.0;
  ActiveSet held_, claimed_;
  std::vector<Bounded> bounded_;
  // By bounded variable. The value of a held one is its multiplier: that is what changes of it.
  std::vector<double> value_, direction_;
  std::vector<double> responses_;  ///< slots: the change of all values with a gradient of one
  std::vector<int> owner_;         ///< of each slot, or none
  std::vector<int> columns_;       ///< active bounds that are not held, in the order of the factor
  std::vector<double> multipliers_, factor_;
  std::vector<double> h_;  ///< the program's gradient with the multipliers of the columns
  Riccati::Responses batch_;
  std::array<int, Riccati::Responses::size - 1> of_batch_;  ///< whose responses `batch_` has beside the minimiser
  int in_batch_ = 0;                                        ///< how many of them; 0: it is without the minimiser
  Iterate policy_step_;
};

}  // namespace rhec::gn_rti
