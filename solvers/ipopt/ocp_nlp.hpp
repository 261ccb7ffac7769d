#pragma once

#include <span>
#include <vector>

#include <IpTNLP.hpp>
#include <IpTaggedObject.hpp>

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

/// What belongs to constraints and bounds, with the signs of Iterate's.
struct Multipliers {
  std::vector<double> of_constraints, of_bounds;
};
/// An iterate of Ipopt in the problem's own units.
struct PrimalDual {
  std::vector<double> z;
  Multipliers multipliers;
  Ipopt::TaggedObject::Tag tag = 0;  ///< Ipopt's number for it; 0: it has none
};

/// Is shown the iterates of Ipopt.
class Spectator {
 public:
  virtual ~Spectator() = default;
  /// Iteration `iteration` begins; false stops Ipopt. Null: an iterate of the restoration phase, which is no candidate
  /// for a solution.
  virtual bool see(int iteration, const PrimalDual* iterate) noexcept = 0;
  /// Where Ipopt ended.
  virtual void see_last(const PrimalDual& iterate) noexcept = 0;
};

/// An Ocp as the sparse nonlinear program that Ipopt solves. Every iterate is evaluated once, whoever asks: objective
/// and constraints together; then, in one passage through the stages, gradient, Jacobian, the Hessian for the iterate's
/// multipliers and the KKT residual.
class OcpNlp final : public Ipopt::TNLP {
 public:
  /// Of a long horizon, as many stages as a processor's cache has room for, the one behind a piece among them: pieces
  /// are those of the core's `assess`, and so are their sums.
  static constexpr int window = 16;

  OcpNlp(const Ocp& ocp, Curvature curvature);

  /// Takes over a problem of the capacity at construction, with its present structure and data.
  void take(const Ocp& ocp);
  /// Forgets the problem that was taken, and all that was evaluated.
  void release() noexcept { ocp_ = nullptr; }

  int variables() const noexcept { return nlp_.variables(); }
  int constraints() const noexcept { return nlp_.constraints(); }
  bool has_empty_bounds() const noexcept;

  /// Where Ipopt starts. With a barrier parameter above zero the iterate's multipliers count too: each variable and the
  /// multiplier of its bound are moved until their product is that parameter or more, as little as that takes.
  void set_start(const Iterate& iterate, double barrier) noexcept;
  /// From the next run on.
  void set_curvature(Curvature curvature) noexcept;
  /// For the length of a solve.
  void set_spectator(Spectator* spectator) noexcept { spectator_ = spectator; }

  /// Judges an iterate, with its states and controls clipped to their bounds. Multipliers of variables that have one
  /// value only follow from stationarity: Ipopt does not see such variables.
  KktResidual residual_at(const PrimalDual& iterate) noexcept;
  // Of the iterate whose residual was computed last:
  /// Gives it away, once, and gets an iterate of the same capacity for it.
  void exchange_judged(Iterate& iterate) noexcept;
  /// Sum of |bound multiplier| x distance from the bound: what the barrier still adds to the objective.
  double complementarity_gap() const noexcept;
  double objective() const noexcept { return linear_objective_; }
  /// The time that Ipopt's calls of this object have taken since it was made [us].
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
  /// Adds the time that it exists.
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
  /// Where something was evaluated.
  struct Place {
    std::vector<double> z;
    unsigned visit = 0;  ///< of Ipopt's, in which it was last asked for
    bool is_known = false, is_sound = false;
    /// Whether it is here, at `at`; what Ipopt says to be the same iterate need not be compared.
    bool is_at(const double* at, unsigned now) noexcept;
    void move_to(const double* at, unsigned now) noexcept;
  };
  void visit(bool is_new) noexcept { visit_ += is_new; }
  bool evaluate_at(const double* z, unsigned visit) noexcept;
  bool linearise_at(const double* z, unsigned visit);
  void linearise_all(const PrimalDual& iterate, bool has_multipliers) noexcept;
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
  std::vector<double> lower_, upper_;
  std::vector<int> bounded_;  ///< variables that have a bound
  PrimalDual start_;
  std::vector<double> start_lower_, start_upper_;  ///< multipliers of bounds as Ipopt has them, none of them negative
  /// Where Ipopt has its iterates, from the first that it shows to its end.
  struct {
    const Ipopt::IpoptData* data = nullptr;
    Ipopt::OrigIpoptNLP* scaled = nullptr;
    Ipopt::TNLPAdapter* adapter = nullptr;
  } iterates_;
  PrimalDual seen_;                              ///< one of them
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
  const PrimalDual* linear_iterate_ = nullptr;  ///< whose multipliers were taken
  Ipopt::TaggedObject::Tag linear_tag_ = 0;     ///< its number, where it is at this place itself
  StageQp pieces_;                              ///< of the passage under way; only the vectors are kept
  Iterate linear_;  ///< the iterate; with its multipliers as long as its residual is computed
  std::vector<double> gradient_, jacobian_, hessian_;
  KktResidual linear_kkt_;
  double linear_objective_ = 0.0;
  bool is_judged_ = false;
  bool is_linear_exact_ = false;  ///< the Hessian is that for these multipliers

  bool starts_with_multipliers_ = false, any_fixed_ = false;
  std::vector<double> weighted_, clipped_, hessian_part_;
  double microseconds_ = 0.0;
};

}  // namespace rhec::ipopt
