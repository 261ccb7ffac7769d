#pragma once

#include <cstddef>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "rhec/core/horizon/horizon_structure.hpp"
#include "rhec/core/qp/stage_qp.hpp"
#include "rhec/core/term/term_functions.hpp"

namespace rhec {

/// Terms over a horizon: their data at every node, and their rows and costs as functions of [s; w]. Empty by default.
/// Evaluation is const and thread-safe with the caller's scratch; only the constructor allocates.
class RHEC_EXPORT HorizonTerms {
 public:
  /// The horizon that terms are on.
  struct Horizon {
    const HorizonStructure& structure;
    const double* durations;
    const double* data;  ///< of the intervals, `data_count` numbers each
    int data_count;
    bool is_given;  ///< the initial state
  };

  HorizonTerms() = default;
  HorizonTerms(std::shared_ptr<const TermFunctions> functions, const Model& model, int max_intervals);

  /// Null: there are none.
  const TermFunctions* functions() const noexcept { return functions_.get(); }
  bool has_limits() const noexcept { return limits_ > 0; }
  bool has_residuals() const noexcept { return functions_ && functions_->has_residuals(); }
  /// What hard limits cost by the unit that they are violated by, in place of infinity. Infinity makes them hard again.
  void set_price(double price) noexcept;
  double price() const noexcept { return price_; }  ///< infinity also where no limit is hard
  bool is_hard(int limit) const noexcept;           ///< as it was stated
  const double* linear() const noexcept { return linear_.data(); }

  /// Lets the terms write the data and bounds of a node.
  void place(int node, const TermPlace& place) noexcept;
  // Data and bounds of a node as rows, in the order of TermFunctions.
  double* data(int node) noexcept { return data_.data() + at(node, data_row_); }
  double* lower(int node) noexcept { return lower_.data() + at(node, limits_); }
  double* upper(int node) noexcept { return upper_.data() + at(node, limits_); }
  const double* data(int node) const noexcept { return data_.data() + at(node, data_row_); }
  const double* lower(int node) const noexcept { return lower_.data() + at(node, limits_); }
  const double* upper(int node) const noexcept { return upper_.data() + at(node, limits_); }
  /// Takes data, bounds and the price of hard limits.
  void take_data(const HorizonTerms& from) noexcept;

  /// The rows of a node of a horizon of `intervals`; null if it has none.
  const TermFunctions::Rows* rows(int node, int intervals, bool is_given) const noexcept;

  std::size_t scratch_size(const HorizonStructure& structure) const noexcept;
  /// g at all nodes, rows of capacity().limit_row().
  void evaluate_limits(const Horizon& horizon, const Iterate& iterate, double* values, double* scratch) const noexcept;
  void mark_limits(const Horizon& horizon, int node, std::uint8_t* state_flags,
                   std::uint8_t* control_flags) const noexcept;
  /// Which parts of limits to write.
  enum class LimitParts {
    all,
    values  ///< all but G, which keeps what it had
  };
  /// The limits of a range of stages of a QP.
  void write_limits(const Horizon& horizon, StageRange range, const Iterate& iterate, LimitParts parts, StageQp& qp,
                    double* scratch) const noexcept;
  /// The limits of stages of which nothing is known yet: none of them can be violated.
  void write_open_limits(const Horizon& horizon, StageRange range, StageQp& qp) const noexcept;
  /// Whether any limit has a multiplier.
  bool any_pulls(const HorizonStructure& structure, const Iterate& iterate) const noexcept;
  /// The cost of residuals; adds those of single stages to `stage_costs`, if not null.
  double cost(const Horizon& horizon, const Iterate& iterate, double* stage_costs, double* scratch) const noexcept;
  /// Which parts of a QP to add to.
  struct Parts {
    bool vectors = true, matrices = true;
    bool exact = false;  ///< second derivatives of residuals and of limits, with the iterate's multipliers
  };
  /// Adds the costs of residuals, and the curvature of limits, to h and H. Returns the costs.
  double add_cost(const Horizon& horizon, StageRange range, const Iterate& iterate, Parts parts, StageQp& qp,
                  double* scratch) const noexcept;

 private:
  static std::ptrdiff_t at(int node, int row) noexcept { return static_cast<std::ptrdiff_t>(node) * row; }
  template <class Use>
  void for_each_kind(const Horizon& horizon, StageRange range, const Use& use) const noexcept;
  void gather(const Horizon& horizon, StageRange range, const Iterate& iterate, double* arguments) const noexcept;
  bool has_fixed_columns(const HorizonStructure& structure) const noexcept;
  int column(const HorizonStructure& structure, int node, int argument) const noexcept;
  void write_limit_counts(const Horizon& horizon, StageRange range, StageQp& qp) const noexcept;
  void complete_limits(const TermFunctions::Rows& rows, StageRange stages, StageQp& qp) const noexcept;
  void write_moved_slopes(const Horizon& horizon, TermFunctions::Stage stage, StageRange stages,
                          const double* arguments, StageQp& qp, double* scratch) const noexcept;

  double price_ = std::numeric_limits<double>::infinity();
  std::vector<double> linear_;  ///< weights of slacks; of hard limits infinity, or their price
  std::shared_ptr<const TermFunctions> functions_;
  int nx_ = 0, np_ = 0, nu_ = 0, limits_ = 0, data_row_ = 0;
  std::size_t most_rows_ = 0, most_slopes_ = 0, most_bends_ = 0;
  std::vector<double> data_, lower_, upper_;
  std::vector<double> own_lower_, own_upper_;  ///< of one term, in its own order
};

}  // namespace rhec
