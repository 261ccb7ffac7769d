#pragma once

#include <cstdint>
#include <cstring>
#include <vector>

#include "rhec/core/qp/stage_qp.hpp"

namespace rhec {

struct RiccatiKernels;
struct RiccatiView;

/// Which bounds and limits of a StageQp are active, i.e. hold as equalities: -1 the lower one, +1 the upper, 0 none. A
/// soft limit that is violated has -2 or +2.
class RHEC_EXPORT ActiveSet {
 public:
  ActiveSet() = default;
  explicit ActiveSet(const Capacity& capacity);

  std::int8_t* state(int node) noexcept { return row(node); }
  std::int8_t* control(int interval) noexcept { return row(interval) + capacity_.states; }
  const std::int8_t* state(int node) const noexcept { return row(node); }
  const std::int8_t* control(int interval) const noexcept { return row(interval) + capacity_.states; }
  std::int8_t* limit(int stage) noexcept { return limits_.data() + static_cast<std::ptrdiff_t>(stage) * limit_row_; }
  const std::int8_t* limit(int stage) const noexcept {
    return limits_.data() + static_cast<std::ptrdiff_t>(stage) * limit_row_;
  }
  /// States and controls of a stage, in columns as in a row of StageQp.
  std::int8_t* row(int stage) noexcept { return sides_.data() + static_cast<std::ptrdiff_t>(stage) * row_; }
  const std::int8_t* row(int stage) const noexcept { return sides_.data() + static_cast<std::ptrdiff_t>(stage) * row_; }
  /// Whether no bound is active, whatever limits are.
  bool is_empty() const noexcept;
  void clear() noexcept;
  /// Calls function(stage, column, side) for every active bound, stage by stage, with columns as in a row.
  template <class Function>
  void for_each(const Function& function) const {
    // Rows are padded to multiples of eight, and most entries are free.
    constexpr int eight = sizeof(std::uint64_t);
    for (int k = 0; k < static_cast<int>(sides_.size()); k += eight) {
      std::uint64_t any = 0;
      std::memcpy(&any, sides_.data() + k, sizeof any);
      for (int j = 0; any != 0 && j < eight; ++j)
        if (const std::int8_t side = sides_[k + j]; side != 0) function(k / row_, k % row_ + j, side);
    }
  }
  bool operator==(const ActiveSet& other) const noexcept { return sides_ == other.sides_ && limits_ == other.limits_; }

 private:
  Capacity capacity_;
  int row_ = 0, limit_row_ = 0;
  std::vector<std::int8_t> sides_, limits_;
};

/// Solves a StageQp in which the bounds of an active set hold as equalities, and all others and the limits are ignored,
/// by a backward Riccati recursion (docs/method.md, section 7): with the value function V_{i+1}(s) = 1/2 s'Ps + p's
/// subject to C s = d,
///
///     G = R + B'PB,  L = S + B'PA,  g = r + B'(Pb + p)
///     w = -G^-1 (L s + g),   P_i = Q + A'PA - L'G^-1 L,   p_i = q + A'(Pb + p) - L'G^-1 g
///
/// on the null space of the active rows. An active bound of a control fixes it. An active state bound C s_{i+1} = d
/// becomes C B w = d - C b - C A s, which is solved for as many controls as it has pivots; the remaining rows pass on
/// to node i. The cost is linear in the horizon. If a reduced G is not positive definite it is convexified (its
/// negative eigenvalues are reflected), which changes R in the free directions only; the reduced Hessian is then
/// positive definite.
///
/// `factor` needs the matrices and the active set, `solve` also the vectors, so that `factor` can run in advance.
class RHEC_EXPORT Riccati {
 public:
  enum class Outcome {
    done,
    inconsistent  ///< the active bounds contradict each other
  };
  Riccati() = default;
  explicit Riccati(const Capacity& capacity);

  /// `diagonal`, if not null, is added to the diagonals of H (barrier terms): one row of the QP's stride per stage.
  void factor(const StageQp& qp, const ActiveSet& active, const double* diagonal) noexcept;
  void factor(const StageQp& qp, const ActiveSet& active) noexcept { factor(qp, active, nullptr); }
  /// Without active bounds of states. False, and nothing to solve with, if a stage would have to be convexified.
  bool factor_if_convex(const StageQp& qp, const ActiveSet& active) noexcept;
  /// `factor` without active bounds and `write_convexified`, in little more time than a convex QP takes; false if it
  /// fails.
  bool convexify(StageQp& qp, const ActiveSet& no_bounds) noexcept;
  /// Only what `covariances` needs; a `solve` that follows factorises again.
  void factor_for_covariances(const StageQp& qp, const ActiveSet& active) noexcept;
  bool was_convexified() const noexcept { return convexified_; }
  /// After a `factor` without active bounds: writes the convexified R into the QP. Its reduced Hessian is then positive
  /// definite for every active set.
  void write_convexified(StageQp& qp) noexcept;

  /// The minimiser as a step, with costates and the multipliers of the active bounds. Vectors may have changed since
  /// `factor`; `h` replaces the QP's gradients (null: it does not).
  Outcome solve(const StageQp& qp, const ActiveSet& active, Iterate& step, const double* h) noexcept;
  Outcome solve(const StageQp& qp, const ActiveSet& active, Iterate& step) noexcept {
    return solve(qp, active, step, nullptr);
  }

  /// Sensitivities of the minimiser to gradients of one entry, or one row of a stage, each: with h = e_k and all other
  /// vectors of the QP zero, the values z of all stages, and in place of fixed controls their multipliers. Interleaved:
  /// entry c of the row of stage i is at values[(i * stride + c) * size + (number of the gradient)]. Behind them there
  /// is room for the values of all limits, which the caller may fill. With limits there are no costates.
  struct Sensitivities {
    static constexpr int size = 8;
    AlignedDoubles values, costates;
    std::vector<int> control_counts;  ///< of the QP that they belong to
    int intervals = -1;
    Sensitivities() = default;
    explicit Sensitivities(const Capacity& capacity);
  };
  struct Entry {
    int stage = 0, place = 0;
    const double* row = nullptr;  ///< the gradient, in place of e_k
  };
  /// For at most Sensitivities::size gradients. False if the last factorisation has active state bounds or was
  /// convexified: sensitivities are not available then.
  bool find_sensitivities(const StageQp& qp, const ActiveSet& active, const Entry* gradients, int count,
                          Sensitivities& sensitivities) noexcept;
  /// Adds the weighted sensitivities (Sensitivities::size weights) to a minimiser that `solve` has found: the result is
  /// that of `solve` with these gradients, except for `feedback`.
  void combine(const StageQp& qp, const ActiveSet& active, const Sensitivities& sensitivities, const double* weights,
               Iterate& step) noexcept;
  /// sums += weighted sum of the values of the sensitivities, over the first `places` entries of all rows.
  void add_values(const Sensitivities& sensitivities, const double* weights, int places, double* sums) const noexcept;
  /// The control of stage i by the policy of the last `solve` for any stage-state step: w = T v(s) + Y s + y0.
  void feedback(const StageQp& qp, int i, const double* state_step, double* control_step) noexcept;
  /// Marginal covariances of all states from the last factorisation, for an objective that is twice a negative
  /// log-likelihood, as in RHE (docs/method.md, section 2: no factor 1/2). The n_s x n_s block of node i goes to
  /// covariance + i * n_s^2, if not null; the last node's to `last`.
  void covariances(const StageQp& qp, double* covariance, double* last) noexcept;
  /// The last node's alone, as a Kalman filter finds it, without a factorisation: of an H whose controls are coupled to
  /// nothing, and whose first node is known. False, and nothing written, for others.
  bool filter_covariance(const StageQp& qp, double* last) noexcept;

  /// The largest number of controls, and of states, of one stage.
  static constexpr int max_width = 64;
  /// A reduced Hessian with a pivot below this fraction of its diagonal entry counts as not positive definite.
  static constexpr double definite_tolerance = 1e-11;

 private:
  /// How a special stage was reduced. A free initial state is such a stage too, with s_0 in place of w.
  struct Reduction {
    int free = 0;       ///< remaining free directions
    int rows = 0;       ///< rows of C reduced here
    int pivots = 0;     ///< rows solved for a control
    int left = 0;       ///< rows passed on
    bool plain = true;  ///< no fixed controls and no rows: T is the identity
    bool overflow = false;
  };
  /// Pointers to the data of one special stage; see the members.
  struct Special {
    double *G, *L, *factor, *K, *T, *Y, *C, *eliminator;
    int *pivot_row, *pivot_column, *left_row;
  };
  Special special(int i) noexcept;
  RiccatiView view_of(const StageQp& qp, const std::int8_t* sides) noexcept;
  double* P(int node) noexcept { return P_.data() + static_cast<std::ptrdiff_t>(node) * ns_ * stride_; }
  double* p(int node) noexcept { return p_.data() + static_cast<std::ptrdiff_t>(node) * stride_; }

  RiccatiView begin_factor(const StageQp& qp, const ActiveSet& active, const double* diagonal) noexcept;
  void factor_stages(const StageQp& qp, const ActiveSet& active, const double* diagonal) noexcept;
  void factor_node_0(const StageQp& qp, const ActiveSet& active) noexcept;
  void write_change(const double* reduced, const double* factor, int i, StageQp& qp) const noexcept;
  void factor_special(const StageQp& qp, const ActiveSet& active, const RiccatiView& view, int i) noexcept;
  void factor_initial(const StageQp& qp, const ActiveSet& active) noexcept;
  int count_active(const StageQp& qp, const ActiveSet& active, int node) const noexcept;
  void write_active_rows(const StageQp& qp, const ActiveSet& active, int node) noexcept;
  void write_active_bounds(const StageQp& qp, const ActiveSet& active, int node) noexcept;
  void eliminate(double* D, double* E, int rows, int width, const bool* fixed, Reduction& reduction,
                 Special& v) noexcept;
  void null_space(const double* D, const double* E, int width, const bool* fixed, const Reduction& reduction,
                  Special& v) noexcept;
  void factor_reduced(double* reduced, int n, double tolerance, double* factor) noexcept;
  bool transform_rows(const double* right_hand_side, const Reduction& reduction, const Special& v, double* transformed,
                      double scale) const noexcept;
  bool solve_special_backward(const StageQp& qp, const ActiveSet& active, const double* h, int i) noexcept;
  bool solve_initial(const StageQp& qp, const ActiveSet& active, Iterate& step) noexcept;
  void solve_special_forward(const StageQp& qp, const ActiveSet& active, Iterate& step, int i) noexcept;
  void add_special_controls(int i, int states, int controls, double* covariance) noexcept;
  void write_bound_multipliers(const StageQp& qp, const ActiveSet& active, Iterate& step, int node) noexcept;

  Capacity capacity_;
  int ns_ = 0, nw_ = 0, stride_ = 0, width_ = 0, max_rows_ = 0;
  bool convexified_ = false, for_steps_ = true;
  bool has_initial_inverse_ = false;  ///< of P at node 0; otherwise node 0 was factorised as a special stage
  const RiccatiKernels* kernels_ = nullptr;
  AlignedDoubles P_, U_, V_, closed_, columns_, inverse_, drift_, g_, p_;  // see RiccatiView
  AlignedDoubles initial_inverse_;
  std::vector<int> state_counts_, control_counts_;
  std::vector<std::uint8_t> is_special_, fixes_control_, has_gradient_;  // N stages
  std::vector<Reduction> reductions_;                                    // N stages, then node 0
  std::vector<double> G_, L_, factor_;  // of special stages: full G and L; Cholesky factor of the reduced G
  std::vector<double> K_, T_, Y_;       // v = -K s - k, w = T v + Y s + y0
  std::vector<double> C_, eliminator_;  // rows at each node; row operations of the elimination at each stage
  std::vector<int> pivot_row_, pivot_column_, left_row_;
  std::vector<double> d_, special_g_, y0_, k_, row_multipliers_, work_;
};

}  // namespace rhec
