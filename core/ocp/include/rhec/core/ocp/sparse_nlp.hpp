#pragma once

#include <cstdint>
#include <vector>

#include "rhec/core/ocp/ocp.hpp"

namespace rhec {

/// An Ocp as one sparse NLP, for solvers without stage structure (docs/method.md, section 7):
///
///     minimise f(z)  subject to  row_lower <= c(z) <= row_upper,  lower <= z <= upper
///
/// z = [s_0; w_0; s_1; w_1; ...; s_N], without s_0 if it is given; rows of c are, stage after stage, the defects
/// F_i(s_i, w_i) - s_{i+1}, which have to be zero, and the limits g_i(s_i, w_i), of which some may be soft. Slacks of
/// soft rows are no part of z. With L = f + multipliers' c + bound_multipliers' z, the multipliers are the costates of
/// nodes 1 .. N and those of the limits; they and the bound multipliers have the signs of those of an Iterate.
///
/// Patterns hold for every iterate of one structure; values are scattered from the Ocp's own linearisation (StageQp),
/// so that nothing is evaluated twice. Matrices are stored by compressed columns with sorted rows.
class RHEC_EXPORT SparseNlp {
 public:
  struct Pattern {
    int rows = 0, columns = 0;
    std::vector<int> starts;       ///< columns + 1
    std::vector<int> row_indices;  ///< starts.back()
    int entries() const noexcept { return starts.empty() ? 0 : starts.back(); }
  };

  /// Takes over the Ocp's present structure. True if it has changed, so that whatever was derived from the patterns
  /// (orderings, symbolic factors) must be renewed.
  bool take_structure(const Ocp& ocp);
  /// Identifies a structure: equal signatures mean equal patterns.
  const std::vector<std::int32_t>& signature() const noexcept { return signature_; }

  int variables() const noexcept { return hessian_.columns; }
  int constraints() const noexcept { return jacobian_.rows; }
  const Pattern& jacobian() const noexcept { return jacobian_; }
  /// The lower triangle: a full block for each stage [s_i; w_i], and nothing outside of these blocks.
  const Pattern& hessian() const noexcept { return hessian_; }
  /// Where in z the states of a node begin; -1 if they are given.
  int state_start(int node) const noexcept { return state_starts_[node]; }
  /// Where in c the limits of a stage begin, which follow the defects of its interval; as many as `limit_count`.
  int limit_start(int stage) const noexcept { return limit_starts_[stage]; }
  int limit_count(int stage) const noexcept { return limit_counts_[stage]; }

  // Conversion between iterates and vectors. Multipliers and bound multipliers may be null.
  void read(const Ocp& ocp, const Iterate& iterate, double* z, double* multipliers,
            double* bound_multipliers) const noexcept;
  /// For all stages or those of a range: states, controls and multipliers. A given s_0 is also written. costate_0 is
  /// unchanged: it follows from stationarity in s_0 (`set_costate_0`).
  void write(const Ocp& ocp, StageRange range, const double* z, const double* multipliers,
             const double* bound_multipliers, Iterate& iterate) const noexcept;
  void write(const Ocp& ocp, const double* z, const double* multipliers, const double* bound_multipliers,
             Iterate& iterate) const noexcept {
    write(ocp, all_stages(ocp), z, multipliers, bound_multipliers, iterate);
  }
  /// The costate of a given initial state, from a linearisation at the iterate; zero if the initial state is free.
  static void set_costate_0(const StageQp& linearisation, Iterate& iterate) noexcept;

  /// Bounds of z; infinite if there is none.
  void bounds(const Ocp& ocp, double* lower, double* upper) const noexcept;
  /// Bounds of c, zeros for the defects, and the weights of the slacks of its rows: infinite and zero for hard ones,
  /// such as all defects.
  void row_bounds(const Ocp& ocp, double* lower, double* upper, double* linear, double* quadratic) const noexcept;
  /// c from the defects that Ocp::evaluate gives (rows of the capacity's states), and from the values that
  /// Ocp::evaluate_limits gives, which may be null where there are none.
  void constraints(const Ocp& ocp, const double* defects, const double* limits, double* c) const noexcept;
  /// The values of limits in c, which are no part of a linearisation.
  void limits(const Ocp& ocp, const double* values, double* c) const noexcept;

  // Values at the iterate of a linearisation, written for all stages or those of a range to their places in the whole
  // vectors. Of the constraints, these are the defects alone. The Hessian is that of the Lagrangian if the
  // linearisation was made with Hessian::exact and the iterate's multipliers.
  void constraints(const StageQp& linearisation, StageRange range, double* c) const noexcept;
  void gradient(const StageQp& linearisation, StageRange range, double* g) const noexcept;
  void jacobian(const StageQp& linearisation, StageRange range, double* values) const noexcept;
  void hessian(const StageQp& linearisation, StageRange range, double* values) const noexcept;
  void constraints(const StageQp& linearisation, double* c) const noexcept {
    constraints(linearisation, {0, linearisation.intervals()}, c);
  }
  void gradient(const StageQp& linearisation, double* g) const noexcept {
    gradient(linearisation, {0, linearisation.intervals()}, g);
  }
  void jacobian(const StageQp& linearisation, double* values) const noexcept {
    jacobian(linearisation, {0, linearisation.intervals()}, values);
  }
  void hessian(const StageQp& linearisation, double* values) const noexcept {
    hessian(linearisation, {0, linearisation.intervals()}, values);
  }

 private:
  std::vector<std::int32_t> signature_, next_signature_;
  std::vector<int> words_;                                 ///< where each interval begins in the signature
  std::vector<std::uint8_t> state_flags_, control_flags_;  ///< of the interval being marked
  std::vector<std::uint8_t> limit_state_flags_, limit_control_flags_;
  std::vector<int> state_starts_, control_starts_, constraint_starts_, state_counts_, control_counts_;
  std::vector<int> limit_starts_, limit_counts_;
  Pattern jacobian_, hessian_;
  /// Where the entries of each stage, which are contiguous, come from. Equal stages share a list.
  struct Sources {
    std::vector<int> offsets;  ///< in the stage's AB or H; if negative, ~offset in its G
    std::vector<int> firsts;   ///< per stage, in `offsets`
    std::vector<int> starts;   ///< per stage, the first of its entries; then the end of the last stage's
    void clear() noexcept;
    void end_stage();
    void repeat_stage();
    void gather(const double* rows, int stage, double* values) const noexcept;
    void gather(const double* rows, const double* limits, int stage, double* values) const noexcept;
  };
  Sources jacobian_sources_, hessian_sources_;

  bool is_like_before(int stage) const noexcept;
};

}  // namespace rhec
