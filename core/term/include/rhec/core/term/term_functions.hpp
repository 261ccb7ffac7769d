#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/core/config/settings.hpp"
#include "rhec/core/formula/tape.hpp"
#include "rhec/core/model/model.hpp"
#include "rhec/core/term/term.hpp"
#include "rhec/core/term/term_writer.hpp"

namespace rhec {

/// A term, what messages call it, and with which options a plugin of that name makes it again (a map, for files).
struct NamedTerm {
  std::string name;
  std::shared_ptr<const Term> term;
  Settings options = {};
};

/// The formulas of some terms over the stages of a model, with exact first and second derivatives, by the interpreter
/// of core/formula. Const and thread-safe; allocates in its constructor only.
///
/// Arguments of a stage are a row  [x; p; u; duration; data of the interval; data of the terms].  Its limits stand in
/// the order
///
///     those of x and p alone,  those that also need the duration or data of the interval,  those of inputs
///
/// since the last node has the first group only, and a given initial state leaves nothing but the last one to decide.
class RHEC_EXPORT TermFunctions {
 public:
  enum class Stage {
    first,  ///< whose state is given
    middle,
    last  ///< without inputs
  };
  struct Entry {
    int row, column;
  };
  /// An entry of a Jacobian or Hessian that is not zero by structure.
  /// Rows are limits, then residuals, those that the stage has.
  struct Rows {
    int first_limit = 0, limits = 0;  ///< consecutive, of the order above
    std::vector<int> residuals;       ///< indices
    std::vector<Entry> slopes;        ///< columns of [x; p; u]
    std::vector<Entry> bends;         ///< row >= column, both of [x; p; u]
    Tape values, jacobians, hessians;
    int count() const noexcept { return limits + static_cast<int>(residuals.size()); }
  };

  /// Throws Error if a term refuses the vehicle, or depends on nothing that can be decided.
  TermFunctions(const Model& model, std::vector<NamedTerm> terms);

  const std::vector<NamedTerm>& terms() const noexcept { return terms_; }
  const Rows& rows(Stage stage) const noexcept { return rows_[static_cast<std::size_t>(stage)]; }
  int limit_count() const noexcept { return static_cast<int>(linear_.size()); }
  /// Of all limits, in their order.
  const double* linear() const noexcept { return linear_.data(); }
  const double* quadratic() const noexcept { return quadratic_.data(); }
  const std::vector<std::string>& limit_names() const noexcept { return limit_names_; }
  const std::vector<Loss>& losses() const noexcept { return losses_; }
  /// Numbers of limits and data of a term, and where its data begin.
  int data_of(std::size_t term) const noexcept {
    const std::size_t next = term + 1;
    return (next < first_data_.size() ? first_data_[next] : data_count_) - first_data_[term];
  }
  int limits_of(std::size_t term) const noexcept { return static_cast<int>(places_[term].size()); }
  int first_data_of(std::size_t term) const noexcept { return first_data_[term]; }
  /// The place in the order of limits of a term's own limit.
  int place_of(std::size_t term, int limit) const noexcept { return places_[term][static_cast<std::size_t>(limit)]; }
  int data_count() const noexcept { return data_count_; }
  int most_obstacles() const noexcept { return most_obstacles_; }
  bool has_residuals() const noexcept { return !losses_.empty(); }

  /// Numbers of arguments of a stage, and the length of their row.
  int argument_count() const noexcept { return argument_count_; }
  int argument_row() const noexcept;

  /// For `count` stages of a kind whose arguments are consecutive rows: values (count x rows), and, unless null, slopes
  /// (count x slopes).
  void evaluate(Stage stage, int count, const double* arguments, double* values, double* slopes,
                double* scratch) const noexcept;
  /// Where limits of consecutive stages are written: the value of row r of stage i to values[i values_step + r], and,
  /// unless `slopes` is null, its derivative by entry c of [x; p; u] to slopes[i slopes_step + r row_length + c].
  /// Derivatives that are zero by structure are not written.
  struct LimitPlaces {
    double* values;
    std::ptrdiff_t values_step;
    double* slopes = nullptr;
    std::ptrdiff_t slopes_step = 0, row_length = 0;
  };
  /// The limits alone.
  void evaluate_limits(Stage stage, int count, const double* arguments, const LimitPlaces& places,
                       double* scratch) const noexcept;
  /// The Hessian of sum_r weights_r row_r: bends (count x bends).
  void curve(Stage stage, int count, const double* arguments, const double* weights, double* bends,
             double* scratch) const noexcept;
  /// Doubles of scratch of these two.
  std::size_t scratch_size() const noexcept;

 private:
  template <class Use>
  void run(const Tape& tape, int count, const double* arguments, double* registers, const Use& use) const noexcept;

  std::vector<NamedTerm> terms_;
  std::vector<Rows> rows_;
  std::vector<double> linear_, quadratic_;
  std::vector<std::string> limit_names_;
  std::vector<Loss> losses_;
  std::vector<std::vector<int>> places_;  ///< by term and limit
  std::vector<int> first_data_;
  int data_count_ = 0, argument_count_ = 0, most_obstacles_ = 0;
  const TapeKernels* kernels_;
};

}  // namespace rhec
