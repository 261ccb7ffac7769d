#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "rhec/core/base/aligned.hpp"
#include "rhec/core/horizon/horizon_structure.hpp"
#include "rhec/core/horizon/horizon_terms.hpp"
#include "rhec/core/model/model.hpp"
#include "rhec/core/ocp/ocp.hpp"

namespace rhec {

/// A model over a horizon: the structure, dynamics and bounds common to all kinds of problems.
///
/// Stages are those of HorizonStructure; interval i leads from s_i to s_{i+1} by integrating the model over
/// `duration(i)` in `substeps` Runge-Kutta steps. A kind of problem is defined by its cost: a derived class implements
/// `cost` and `write_cost`. Terms add limits, and further costs. RheProblem and RhcProblem are such classes; others can
/// be written outside of rhec with this header alone.
///
/// Data are set in place, without allocation. A problem can be copied, but not assigned or moved, since solvers and
/// linearisations that were set up with it keep a reference.
class RHEC_EXPORT HorizonProblem : public Ocp {
 public:
  HorizonProblem& operator=(const HorizonProblem&) = delete;

  /// The kind of problem, as named in files and reports: "rhe", "rhc", ...
  virtual std::string_view kind() const noexcept = 0;
  const Model& model() const noexcept { return *model_; }
  std::shared_ptr<const Model> shared_model() const noexcept { return model_; }
  int substeps() const noexcept { return substeps_; }
  const HorizonStructure& structure() const noexcept { return structure_; }

  /// Length of an interval [s].
  double duration(int interval) const noexcept { return durations_[interval]; }
  void set_duration(int interval, double seconds) noexcept { durations_[interval] = seconds; }
  /// The known data of an interval, Model::data_count entries.
  double* interval_data(int interval) noexcept { return data_.data() + at_data(interval); }
  const double* interval_data(int interval) const noexcept { return data_.data() + at_data(interval); }
  /// The known inputs of an interval (n_u, NaN where unknown), for an initial guess; null if none is known.
  virtual const double* known_inputs(int /*interval*/) const noexcept { return nullptr; }
  /// The terms of the problem, and their data and bounds at every node.
  HorizonTerms& terms() noexcept { return terms_; }
  const HorizonTerms& terms() const noexcept { return terms_; }
  /// The inputs that a guess goes on with behind the end of a plan (n_u, NaN for the last ones); null: the last ones.
  virtual const double* inputs_behind() const noexcept { return nullptr; }

  Capacity capacity() const noexcept override { return structure_.capacity(); }
  int intervals() const noexcept override { return structure_.intervals(); }
  int state_count(int) const noexcept override { return structure_.capacity().states; }
  int control_count(int interval) const noexcept override { return structure_.control_count(interval); }
  const double* state_lower(int node) const noexcept override { return at(lower_, node); }
  const double* state_upper(int node) const noexcept override { return at(upper_, node); }
  const double* control_lower(int i) const noexcept override { return at(lower_, i) + structure_.capacity().states; }
  const double* control_upper(int i) const noexcept override { return at(upper_, i) + structure_.capacity().states; }
  int limit_count(int stage) const noexcept override;
  const double* limit_lower(int stage) const noexcept override { return terms_.lower(stage) + first_limit(stage); }
  const double* limit_upper(int stage) const noexcept override { return terms_.upper(stage) + first_limit(stage); }
  const double* limit_linear(int stage) const noexcept override;
  const double* limit_quadratic(int stage) const noexcept override;
  /// Whether a limit was stated as hard, also where it has a price (HorizonTerms::set_price).
  bool is_hard_limit(int stage, int limit) const noexcept { return terms_.is_hard(first_limit(stage) + limit); }
  void evaluate_limits(const Iterate& iterate, double* values, std::span<double> scratch) const noexcept override;
  void mark_limits(int stage, std::uint8_t* state_flags, std::uint8_t* control_flags) const noexcept override;
  bool has_second_derivatives() const noexcept override { return model_->has_second_derivatives(); }
  /// From the operations of the model (Model::operations) and of a Riccati recursion.
  StepOperations step_operations() const noexcept override;
  std::size_t scratch_size() const noexcept override;
  void mark_dynamics(int interval, std::uint8_t* state_flags, std::uint8_t* control_flags) const noexcept override;
  double evaluate_stages(const Iterate& iterate, double* defects, double* stage_costs,
                         std::span<double> scratch) const noexcept override;
  void simulate_interval(int interval, Iterate& iterate, std::span<double> scratch) const noexcept override;
  double linearise(StageRange range, const Iterate& iterate, Hessian hessian, StageQp& qp,
                   std::span<double> scratch) const noexcept override;
  void refresh(const Iterate& iterate, StageQp& qp, std::span<double> scratch) const noexcept override;
  /// A linearisation cache: it evaluates only what has changed since the last iterate, even if that has moved along by
  /// some intervals.
  std::unique_ptr<Linearisation> make_linearisation() const override;

  /// As `simulate_interval`, for a new interval at the end of a horizon that has moved on. Keeps the derivatives for
  /// the next `Linearisation::prepare`.
  void simulate_new_interval(int interval, Iterate& iterate, std::span<double> scratch) noexcept;

 protected:
  struct Setup {
    HorizonStructure::Setup structure;
    int substeps = 1;
    std::shared_ptr<const TermFunctions> terms = nullptr;  ///< with as many limits as the structure
  };
  /// Throws Error if a number of the set-up is out of range.
  HorizonProblem(std::shared_ptr<const Model> model, const Setup& setup);
  HorizonProblem(const HorizonProblem&) = default;

  int nx() const noexcept { return structure_.vehicle_states(); }
  int nu() const noexcept { return structure_.inputs(); }
  int np() const noexcept { return structure_.parameters(); }
  int stride() const noexcept { return structure_.stride(); }
  HorizonStructure& changing_structure() noexcept { return structure_; }
  /// Copies structure, durations, known data, bounds and data of terms of a problem of the same capacity.
  void take_horizon(const HorizonProblem& from) noexcept;

  /// Bounds of z = [s; w] at every stage, as rows of `stride()` entries. Initially there are none.
  double* lower_row(int stage) noexcept { return at(lower_, stage); }
  double* upper_row(int stage) noexcept { return at(upper_, stage); }
  void clear_bounds() noexcept;

  /// Which part of a cost `write_cost` is to write: H and h, H alone, or h alone.
  enum class CostParts { all, matrices, vectors };

  /// The sum of the stage costs; adds those of single stages to `stage_costs` (N + 1), if not null.
  virtual double cost(const Iterate& iterate, double* stage_costs, std::span<double> scratch) const noexcept = 0;
  /// Writes the cost of a range of stages into h (gradient) and H (Hessian) of a QP at an iterate, overwriting what was
  /// there. With Hessian::exact, H already holds the curvature of the dynamics, to which that of the cost is added.
  /// Returns the costs of these stages, if vectors are wanted.
  virtual double write_cost(StageRange range, const Iterate& iterate, Hessian hessian, CostParts parts, StageQp& qp,
                            std::span<double> scratch) const noexcept = 0;
  /// Scratch that these two need, behind the scratch of the dynamics.
  virtual std::size_t cost_scratch_size() const noexcept { return 0; }
  /// Zeros what `write_cost` is about to write, for a cost that adds term by term.
  void clear_cost(StageRange range, Hessian hessian, CostParts parts, StageQp& qp) const noexcept;

  /// Whether bounds are data that may change between `Linearisation::prepare` and `refresh`.
  virtual bool has_late_bounds() const noexcept { return false; }
  /// Whether the cost's Hessian depends on no data, so that a linearisation cache may keep it for known intervals.
  virtual bool has_constant_cost_hessian() const noexcept { return false; }

 private:
  friend class HorizonLinearisation;

  double* at(AlignedDoubles& rows, int i) const noexcept {
    return rows.data() + static_cast<std::ptrdiff_t>(i) * structure_.stride();
  }
  const double* at(const AlignedDoubles& rows, int i) const noexcept {
    return rows.data() + static_cast<std::ptrdiff_t>(i) * structure_.stride();
  }
  std::ptrdiff_t at_data(int interval) const noexcept { return interval * data_count_; }
  bool keeps_curvature() const noexcept;
  /// Bounds, the initial step, and limits.
  void write_bounds(const Iterate& iterate, StageRange range, StageQp& qp, std::span<double> scratch) const noexcept;
  void write_own_bounds(const Iterate& iterate, StageRange range, StageQp& qp) const noexcept;
  void write_limits(const Iterate& iterate, StageRange range, HorizonTerms::LimitParts parts, StageQp& qp,
                    std::span<double> scratch) const noexcept;
  /// `write_cost`, with what terms add.
  double write_costs(StageRange range, const Iterate& iterate, Hessian hessian, CostParts parts, StageQp& qp,
                     std::span<double> scratch) const noexcept;
  double add_terms(StageRange range, const Iterate& iterate, Hessian hessian, CostParts parts, StageQp& qp,
                   std::span<double> scratch) const noexcept;
  HorizonTerms::Horizon horizon_of_terms() const noexcept;
  int first_limit(int stage) const noexcept;

  std::shared_ptr<const Model> model_;
  HorizonStructure structure_;
  int substeps_;
  HorizonTerms terms_;
  AlignedDoubles lower_, upper_;
  std::ptrdiff_t data_count_;  ///< of an interval
  std::vector<double> durations_, data_;
  /// The interval that `simulate_new_interval` has simulated, with its derivatives.
  struct SimulatedInterval {
    double duration = 0.0;                      ///< 0: none
    AlignedDoubles z, next, jacobian, scratch;  ///< rows as in Model::integrate_rows
  };
  SimulatedInterval simulated_;
};

}  // namespace rhec
