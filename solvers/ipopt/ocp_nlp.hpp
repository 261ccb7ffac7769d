#pragma once

#include <span>
#include <vector>

#include <IpTNLP.hpp>
#include <IpTaggedObject.hpp>

#include "limit_variables.hpp"
#include "rhec/core/ocp/ocp.hpp"
#include "rhec/core/ocp/solver.hpp"
#include "rhec/core/ocp/sparse_nlp.hpp"
#include "rhec/core/qp/kkt.hpp"

namespace Ipopt {
class OrigIpoptNLP;
class TNLPAdapter;
}  // namespace Ipopt

namespace rhec::ipopt {

enum class Curvature { exact, gauss_newton, limited_memory };

/// Multipliers of constraints and bounds, with the signs of Iterate's.
struct Multipliers {
  std::vector<double> of_constraints, of_bounds;
};
/// An iterate of Ipopt, unscaled.
struct PrimalDual {
  std::vector<double> z;
  Multipliers multipliers;
  Ipopt::TaggedObject::Tag tag = 0;  ///< Ipopt's identifier of the iterate; 0: none
};

/// Observes Ipopt's iterates.
class Spectator {
 public:
  virtual ~Spectator() = default;
  /// Called at the start of iteration `iteration`; returning false stops Ipopt. `iterate` is null in the restoration
  /// phase, whose iterates are no candidates for the solution.
  virtual bool see(int iteration, const PrimalDual* iterate) noexcept = 0;
  /// Called with Ipopt's final iterate.
  virtual void see_last(const PrimalDual& iterate) noexcept = 0;
};

/// An Ocp as the sparse NLP that Ipopt solves, with limits as equations (LimitVariables). Every iterate is evaluated
/// only once: objective and constraints together, then, in one pass over the stages, the gradient, the Jacobian, the
/// Hessian for the iterate's multipliers and the KKT residual.
class OcpNlp final : public Ipopt::TNLP {
 public:
  /// A long horizon is evaluated in pieces of so many stages, the stage after the piece included, which fit the
  /// processor's cache. The core's `assess` uses the same pieces, so its sums are the same.
  static constexpr int window = 16;

  OcpNlp(const Ocp& ocp, Curvature curvature);

  /// Takes on a problem of the capacity given at construction, with its current structure and data.
  void take(const Ocp& ocp);
  /// Forgets the problem and all evaluations.
  void release() noexcept { ocp_ = nullptr; }

  int variables() const noexcept { return nlp_.variables() + limits_.count(); }
  int constraints() const noexcept { return nlp_.constraints(); }
  bool has_empty_bounds() const noexcept;

  /// Sets Ipopt's starting point. If `barrier` is above zero the iterate's multipliers are used too: the distance from
  /// each bound and its multiplier are increased, as little as possible, until their product is at least `barrier`.
  void set_start(const Iterate& iterate, double barrier) noexcept;
  /// States and controls of a point z, which are all that it writes.
  void write(const std::vector<double>& z, Iterate& iterate) const noexcept {
    nlp_.write(*ocp_, z.data(), nullptr, nullptr, iterate);
  }
  /// Takes effect with the next run.
  void set_curvature(Curvature curvature) noexcept;
  /// The spectator must outlive the solve.
  void set_spectator(Spectator* spectator) noexcept { spectator_ = spectator; }

  /// The KKT residual of an iterate, with states and controls clipped to their bounds. Ipopt does not see fixed
  /// variables: their multipliers are computed from stationarity.
  KktResidual residual_at(const PrimalDual& iterate) noexcept;
  // For the iterate whose residual was computed last:
  /// Swaps it with an iterate of the same capacity. Once only.
  void exchange_assessed(Iterate& iterate) noexcept;
  /// Sum of |bound multiplier| x distance from the bound: the barrier's remaining contribution to the objective.
  double complementarity_gap() const noexcept;
  /// Sum of |multiplier| x |violation| of the constraints: to first order, how far it takes the objective.
  double violation_gap() noexcept;
  /// With the costs of slacks.
  double objective() const noexcept { return linear_objective_; }
  /// Time spent in Ipopt's calls of this object since construction [us].
  double microseconds() const noexcept { return microseconds_; }

  // Ipopt::TNLP. Arrays are Ipopt's.
  bool get_nlp_info(Ipopt::Index& n, Ipopt::Index& m, Ipopt::Index& jacobian_entries, Ipopt::Index& hessian_entries,
                    IndexStyleEnum& index_style) override;
  bool get_bounds_info(Ipopt::Index n, double* lower, double* upper, Ipopt::Index m, double* constraint_lower,
                       double* constraint_upper) override;
  bool get_starting_point(Ipopt::Index n, bool init_z, double* z, bool init_bounds, double* lower_multipliers,
                          double* upper_multipliers, Ipopt::Index m, bool init_multipliers,
                          double* multipliers) override;
  bool eval_f(Ipopt::Index n, const double* z, bool new_z, double& objective) override;
  bool eval_grad_f(Ipopt::Index n, const double* z, bool new_z, double* gradient) override;
  bool eval_g(Ipopt::Index n, const double* z, bool new_z, Ipopt::Index m, double* constraints) override;
  bool eval_jac_g(Ipopt::Index n, const double* z, bool new_z, Ipopt::Index m, Ipopt::Index entries, Ipopt::Index* rows,
                  Ipopt::Index* columns, double* values) override;
  bool eval_h(Ipopt::Index n, const double* z, bool new_z, double objective_factor, Ipopt::Index m,
              const double* multipliers, bool new_multipliers, Ipopt::Index entries, Ipopt::Index* rows,
              Ipopt::Index* columns, double* values) override;
  void finalize_solution(Ipopt::SolverReturn status, Ipopt::Index n, const double* z, const double* lower_multipliers,
                         const double* upper_multipliers, Ipopt::Index m, const double* constraints,
                         const double* multipliers, double objective, const Ipopt::IpoptData* data,
                         Ipopt::IpoptCalculatedQuantities* quantities) override;
  bool intermediate_callback(Ipopt::AlgorithmMode mode, Ipopt::Index iteration, double objective, double infeasibility,
                             double dual_infeasibility, double barrier, double step, double regularisation,
                             double dual_length, double primal_length, Ipopt::Index trials,
                             const Ipopt::IpoptData* data, Ipopt::IpoptCalculatedQuantities* quantities) override;

 private:
  /// Adds its lifetime to a sum.
  class Timer {
   public:
    explicit Timer(double& microseconds) noexcept : microseconds_(&microseconds) {}
    ~Timer() { *microseconds_ += microseconds_since(start_); }
    Timer(const Timer&) = delete;
    Timer& operator=(const Timer&) = delete;

   private:
    double* microseconds_;
    Clock::time_point start_ = Clock::now();
  };
  /// A point at which something was evaluated.
  struct Place {
    std::vector<double> z;
    unsigned visit = 0;  ///< the last of Ipopt's visits to this point
    bool is_known = false, is_sound = false;
    /// Whether it is the point `at`. If Ipopt says that the point is unchanged, nothing is compared.
    bool is_at(const double* at, unsigned now) noexcept;
    void move_to(const double* at, unsigned now) noexcept;
  };
  void visit(bool is_new) noexcept { visit_ += is_new; }
  bool evaluate_at(const double* z, unsigned visit) noexcept;
  bool linearise_at(const double* z, unsigned visit);
  void linearise_all(const PrimalDual& iterate, bool has_multipliers) noexcept;
  void evaluate_limits(const Iterate& iterate, double* c) noexcept;
  void write_hessian(const double* z, const double* multipliers, double factor, double* values) noexcept;
  template <class Take>
  double linearise(const double* z, const double* multipliers, const double* bound_multipliers, Hessian hessian,
                   const Take& take) noexcept;
  void set_fixed_multipliers(StageRange piece) noexcept;
  bool has_judged(const PrimalDual& iterate) const noexcept;
  void forget_seen() noexcept;
  void read_iterate();

  const Ocp* ocp_ = nullptr;
  Curvature curvature_;
  Spectator* spectator_ = nullptr;
  SparseNlp nlp_;
  LimitVariables limits_;
  std::vector<double> limit_values_;  ///< of all stages, by Ocp::evaluate_limits
  std::vector<double> lower_, upper_;
  std::vector<int> bounded_;  ///< variables that have a bound
  PrimalDual start_;
  std::vector<double> start_lower_, start_upper_;  ///< bound multipliers with Ipopt's signs: nonnegative
  /// Ipopt's objects that hold its iterates; valid from the first iterate it reports to the end of the run.
  struct {
    const Ipopt::IpoptData* data = nullptr;
    Ipopt::OrigIpoptNLP* scaled = nullptr;
    Ipopt::TNLPAdapter* adapter = nullptr;
  } iterates_;
  PrimalDual seen_;                              ///< the last one read
  std::vector<double> seen_lower_, seen_upper_;  ///< always zero where there is no bound

  static constexpr unsigned elsewhere = 0;
  unsigned visit_ = 1;
  std::vector<double> scratch_;
  // At `evaluated_`.
  Place evaluated_;
  Iterate trial_;
  std::vector<double> defects_, constraints_;
  double objective_ = 0.0;
  // At `linearised_`.
  Place linearised_;
  const PrimalDual* linear_iterate_ = nullptr;  ///< whose multipliers were used
  Ipopt::TaggedObject::Tag linear_tag_ = 0;     ///< its tag, if it is at this point
  StageQp pieces_;                              ///< window of the current pass; only the vectors are kept
  Iterate linear_;  ///< the iterate; its multipliers are valid while its residual is computed
  std::vector<double> gradient_, jacobian_, hessian_;
  KktResidual linear_kkt_;
  double linear_objective_ = 0.0;
  bool is_assessed_ = false;
  bool is_linear_exact_ = false;  ///< the Hessian is exact, for these multipliers

  bool starts_with_multipliers_ = false, any_fixed_ = false;
  std::vector<double> weighted_, clipped_, hessian_part_;
  double microseconds_ = 0.0;
};

}  // namespace rhec::ipopt
