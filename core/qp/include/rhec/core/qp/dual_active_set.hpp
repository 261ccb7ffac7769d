#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "rhec/core/base/clock.hpp"
#include "rhec/core/qp/riccati.hpp"

namespace rhec {

/// Solves a strictly convex StageQp exactly with all its bounds and limits, by a dual active-set method (Goldfarb &
/// Idnani 1983; docs/method.md, section 7).
///
/// Bounds whose multipliers have the wrong sign are dropped from the claimed active set (warm start) until all signs
/// are right. Then the most violated bound is added, one at a time, by a step that keeps the signs: it drops the bound
/// whose multiplier reaches zero first. The dual objective grows with each step, so the method terminates.
///
/// In general a change of the active set needs no factorisation. Claimed bounds of controls are held inside the Riccati
/// factorisation, at no cost. Every other active bound adds its multiplier to the gradient: with the sensitivities W of
/// the minimiser to the gradients A of these bounds, the multipliers solve the small dense system S = -A'W, whose
/// Cholesky factor grows and shrinks with the set. Only dropping a held bound needs a new factorisation. Sensitivities
/// are computed in batches, together with those of bounds that are likely to follow; for a claimed set already in
/// `prepare`.
///
/// An active limit adds its row of the stage QP's G, times its multiplier, to the gradient. The multiplier of a soft
/// limit stops at the slack's linear weight. From there on the limit is violated: with a quadratic weight it remains a
/// column, with the reciprocal weight on the diagonal of S (`relaxed`), without one its multiplier is constant
/// (`saturated`).
///
/// A variable is identified by its place in the rows of all stages, as in an Iterate; limits follow behind them.
class RHEC_EXPORT DualActiveSet {
 public:
  enum class Outcome {
    solved,
    not_convex,   ///< without state bounds the QP has no minimiser; it must be convexified first
    no_solution,  ///< the bounds contradict each other, as far as this method can tell
    too_much,     ///< too many changes of the active set, or rounding errors; use another method
    out_of_time
  };
  /// Largest number of active bounds besides the held ones, and of changes of the active set. With limits there are
  /// more of both, and a soft one takes up to three changes until it is violated; the interior-point method takes as
  /// long as some hundred.
  static constexpr int max_columns = 32, max_columns_with_limits = 96, max_changes = 96, max_changes_with_limits = 288;

  DualActiveSet() = default;
  explicit DualActiveSet(const Capacity& capacity);

  /// Work that needs only the QP's matrices: factorises with the claimed active set (null: none) and finds
  /// sensitivities. If `is_factored`, the recursion has factorised the QP without active bounds already.
  void prepare(const StageQp& qp, Riccati& riccati, const ActiveSet* claimed, bool is_factored = false) noexcept;
  /// After `prepare`, with the QP's present vectors. If solved, writes the active set to `active` and the minimiser,
  /// its costates and multipliers to `step`. Checks the deadline before every change of the active set.
  Outcome solve(const StageQp& qp, Riccati& riccati, ActiveSet& active, Iterate& step,
                Clock::time_point deadline) noexcept;
  /// With limits: whether the last digits of costates matter less than another solution of the equations.
  void set_cheap(bool cheap) noexcept { is_cheap_ = cheap; }
  /// Forgets what was learnt from earlier solves.
  void reset() noexcept { rows_change_ = false; }
  /// After `solve`: also computes the policy (Riccati::feedback), which `solve` may omit.
  void complete_policy(const StageQp& qp, Riccati& riccati) noexcept;
  /// Number since the last `prepare`.
  int factorisations() const noexcept { return factorisations_; }
  /// Whether the QP of the last `prepare` is convex only with all claimed bounds of controls held.
  bool needs_all_held() const noexcept { return needs_all_held_; }

 private:
  enum class Hold : std::uint8_t { free, held, column, saturated };
  enum class Found { nothing, values, step, solution };
  static constexpr int none = -1, batch_size = Riccati::Sensitivities::size;
  /// Enough for all columns and for the bounds that are likely to follow.
  static constexpr int most_batches = max_columns_with_limits / batch_size + 1;
  struct Batch {
    Riccati::Sensitivities sensitivities;
    std::array<int, batch_size> of{};  ///< places
    int count = 0;
  };
  struct Violations {
    int worst = none, count = 0;
  };
  using Weights = std::array<std::array<double, batch_size>, most_batches>;

  void take_claims(const StageQp& qp, const ActiveSet& claimed) noexcept;
  bool take_bounds(const StageQp& qp) noexcept;
  void factor(const StageQp& qp, Riccati& riccati) noexcept;
  void forget_factorisation() noexcept;
  void loosen_claims(const StageQp& qp, const ActiveSet& claimed, bool all) noexcept;
  void hold_claims(int first) noexcept;
  bool refactor(const StageQp& qp, Riccati& riccati) noexcept;
  void let_go(int place) noexcept;
  bool is_limit(int place) const noexcept { return place >= places_; }
  bool is_control(int place) const noexcept { return place % stride_ >= states_ && !is_limit(place); }
  int limit_place(int stage, int row) const noexcept { return places_ + stage * limit_row_ + row; }
  double linear(int place) const noexcept { return linear_[place - places_]; }
  double softness(int place) const noexcept { return softness_[place - places_]; }
  bool is_soft(int place) const noexcept;
  /// The value that a column must have: the bound, beyond it where the limit is violated.
  double target(int place, double multiplier) const noexcept {
    const double edge = bound(place);
    return has_limits_ && relaxed_[place] != 0 ? edge + (multiplier - side_[place] * linear(place)) * softness(place)
                                               : edge;
  }
  double bound(int place) const noexcept { return (side_[place] < 0 ? lower_ : upper_)[place]; }
  bool is_equality_bound(int place) const noexcept;

  bool find_sensitivities(const StageQp& qp, Riccati& riccati, const int* places, int count) noexcept;
  bool is_needed(int batch, const int* places, int count) const noexcept;
  void forget(int batch) noexcept;
  bool find_sensitivities_of_columns(const StageQp& qp, Riccati& riccati, bool and_violated) noexcept;
  bool find_sensitivities_of_next(const StageQp& qp, Riccati& riccati, const int* first, int count,
                                  double least) noexcept;
  /// Sensitivity of the variable at one place to the gradient of another, which must have sensitivities.
  double sensitivity(int of, int at) const noexcept {
    const auto number = static_cast<unsigned>(number_[of]);
    return sensitivities_at(number / batch_size, at)[number % batch_size];
  }
  const double* sensitivities_at(int batch, int place) const noexcept {
    return batches_[batch].sensitivities.values.data() + static_cast<std::ptrdiff_t>(place) * batch_size;
  }
  double& weight_of(int place, Weights& weights) const noexcept {
    const auto number = static_cast<unsigned>(number_[place]);
    return weights[number / batch_size][number % batch_size];
  }
  void add_sensitivities(const Riccati& riccati, const Weights& weights, std::vector<double>& sums) const noexcept;
  double* factor_row(int k) noexcept { return factor_.data() + std::ptrdiff_t{most_columns_} * k; }
  const double* factor_row(int k) const noexcept { return factor_.data() + std::ptrdiff_t{most_columns_} * k; }
  int column_count() const noexcept { return static_cast<int>(columns_.size()); }

  double eliminate(int entering, int count, double* row) const noexcept;
  void back_substitute(double* right_hand_side) const noexcept;
  bool factor_columns(int first, bool may_leave_out) noexcept;
  void drop_column(int k) noexcept;

  bool combine(const StageQp& qp, Riccati& riccati, Iterate& step) noexcept;
  bool solve_with_multipliers(const StageQp& qp, Riccati& riccati, Iterate& step) noexcept;
  double largest_miss() const noexcept;
  void return_to_bounds() noexcept;
  void write_pending(const Riccati& riccati) noexcept;
  void release_column(int column, Weights& weights) noexcept;
  double excess_of(int place, double multiplier) const noexcept;
  void drop_wrong_columns(const Riccati& riccati) noexcept;
  bool release_wrong_held() noexcept;
  bool drop_wrong(const Riccati& riccati) noexcept;
  Violations find_violations() noexcept;
  bool add_controls_together(const StageQp& qp, Riccati& riccati, int worst) noexcept;
  int list_with_next(int first, int* places) const noexcept;
  bool return_to_base(const Iterate& step) noexcept;
  void write_values(Iterate& step) const noexcept;
  void append_column(int place, double square, double multiplier) noexcept;
  Outcome add(const StageQp& qp, Riccati& riccati, int entering, Clock::time_point deadline) noexcept;
  Found find_values(const StageQp& qp, Riccati& riccati, bool may_combine, Iterate& step) noexcept;
  void write(const StageQp& qp, ActiveSet& active, Iterate& step) const noexcept;

  // dual_limits.cpp
  const double* row_of(const StageQp& qp, int place) const noexcept {
    return qp.G((place - places_) / limit_row_) + static_cast<std::ptrdiff_t>((place - places_) % limit_row_) * stride_;
  }
  void take_limit_claims(const StageQp& qp, const ActiveSet& claimed) noexcept;
  bool take_limits(const StageQp& qp) noexcept;
  void saturate(int place) noexcept;
  void add_limit_gradients(const StageQp& qp) noexcept;
  void keep_rows(const StageQp& qp) noexcept;
  void compare_rows(const StageQp& qp) noexcept;
  bool find_limit_values(const StageQp& qp, const Iterate& step) noexcept;
  void find_limit_sensitivities(const StageQp& qp, double* values) const noexcept;
  bool pass_end(int column, bool grows) noexcept;
  bool correct_soft_column(int k, Weights& weights) noexcept;
  void write_limits(const StageQp& qp, ActiveSet& active, Iterate& step) const noexcept;

  int factorisations_ = 0, changes_ = 0, states_ = 0, stride_ = 0, limit_row_ = 0;
  int most_columns_ = 0, batch_count_ = 0, most_changes_ = 0;
  int places_ = 0, all_places_ = 0;  ///< number of places that the QP uses: of variables, and of limits too
  bool has_limits_ = false, needs_all_held_ = false, is_convex_ = false;
  bool has_bounds_ = false, has_policy_ = false, has_base_ = false;
  double pull_tolerance_ = 0.0, miss_ = 0.0;
  const double *lower_ = nullptr, *upper_ = nullptr;  ///< of the QP that is being solved
  ActiveSet held_, claimed_;
  // By place. For a held variable, the value is its multiplier, since this is what changes.
  std::vector<double> value_, violation_, largest_;  ///< the last: of each eight violations
  std::vector<double> least_, most_;  ///< the bounds widened by their tolerance; infinite for variables not free
  std::vector<Hold> hold_;
  std::vector<std::int8_t> side_;  ///< of the active bound
  std::vector<int> number_;        ///< index among the sensitivities, or none
  std::vector<int> held_places_, saturated_;
  // With limits only.
  AlignedDoubles own_lower_, own_upper_, rows_;                        ///< the last: G at the last `prepare`
  bool rows_change_ = false, has_pending_ = false, is_cheap_ = false;  ///< `solve` found another G; see `pending_`
  std::vector<double> linear_, softness_;  ///< by limit: weight of the slack, reciprocal quadratic weight (or 0)
  std::vector<std::uint8_t> relaxed_;
  std::vector<Batch> batches_;
  /// Active bounds that are not held, in the order of the Cholesky factor, and those with which the step was found.
  std::vector<int> columns_, base_places_;
  std::vector<double> multipliers_, base_multipliers_, factor_;
  Weights pending_{};      ///< changes of multipliers that the values do not have yet
  std::vector<double> h_;  ///< the QP's gradient plus the multipliers of the columns
  Iterate policy_step_;
};

}  // namespace rhec
