#pragma once

#include <vector>

#include <IpTNLP.hpp>

#include "ocp_nlp.hpp"

namespace rhec::ipopt {

/// The elastic form of an NLP, whose constraints can always be met: how far from feasible is the NLP itself?
///
///     minimise 1/2 |r|^2 + small |z - z_start|^2  subject to  c(z) - r = 0,  z within its bounds
///
/// with the exact Hessian, or that of r alone where the NLP's curvature is not the exact one. All rows of c have an r,
/// defects too: states may have bounds that no simulation meets. A point that is stationary for the violation, and
/// whose violation is not zero, tells that no point nearby meets all constraints. The final point is stationary but for
/// the pull of the start; from there the next solve has less of it.
class ViolationNlp final : public Ipopt::TNLP {
 public:
  /// Begins at the NLP's starting point. The NLP must outlive the solve. The spectator is asked whether to go on, and
  /// gets no iterates.
  ViolationNlp(OcpNlp& of, Spectator& spectator);

  int iterations() const noexcept { return iterations_; }
  // Of the final point:
  const std::vector<double>& point() const noexcept { return point_; }
  /// max |c|; infinite where no point was found.
  double largest() const noexcept { return largest_; }
  /// The gradient of 1/2 |c|^2 as far as bounds let the point follow it, relative to |c|: small where stationary.
  double slope() const noexcept { return slope_; }

  // Ipopt::TNLP. Arrays are Ipopt's.
  bool get_nlp_info(Ipopt::Index& n, Ipopt::Index& m, Ipopt::Index& jacobian_entries, Ipopt::Index& hessian_entries,
                    IndexStyleEnum& index_style) override;
  bool get_bounds_info(Ipopt::Index n, double* lower, double* upper, Ipopt::Index m, double* constraint_lower,
                       double* constraint_upper) override;
  bool get_starting_point(Ipopt::Index n, bool init_x, double* x, bool init_bounds, double* lower_multipliers,
                          double* upper_multipliers, Ipopt::Index m, bool init_multipliers,
                          double* multipliers) override;
  bool eval_f(Ipopt::Index n, const double* x, bool new_x, double& objective) override;
  bool eval_grad_f(Ipopt::Index n, const double* x, bool new_x, double* gradient) override;
  bool eval_g(Ipopt::Index n, const double* x, bool new_x, Ipopt::Index m, double* constraints) override;
  bool eval_jac_g(Ipopt::Index n, const double* x, bool new_x, Ipopt::Index m, Ipopt::Index entries, Ipopt::Index* rows,
                  Ipopt::Index* columns, double* values) override;
  bool eval_h(Ipopt::Index n, const double* x, bool new_x, double objective_factor, Ipopt::Index m,
              const double* multipliers, bool new_multipliers, Ipopt::Index entries, Ipopt::Index* rows,
              Ipopt::Index* columns, double* values) override;
  void finalize_solution(Ipopt::SolverReturn status, Ipopt::Index n, const double* x, const double* lower_multipliers,
                         const double* upper_multipliers, Ipopt::Index m, const double* constraints,
                         const double* multipliers, double objective, const Ipopt::IpoptData* data,
                         Ipopt::IpoptCalculatedQuantities* quantities) override;
  bool intermediate_callback(Ipopt::AlgorithmMode mode, Ipopt::Index iteration, double objective, double infeasibility,
                             double dual_infeasibility, double barrier, double step, double regularisation,
                             double dual_length, double primal_length, Ipopt::Index trials,
                             const Ipopt::IpoptData* data, Ipopt::IpoptCalculatedQuantities* quantities) override;

 private:
  void judge();
  bool evaluate();

  OcpNlp& of_;
  Spectator& spectator_;
  int variables_ = 0, constraints_ = 0;                   ///< of the NLP
  int jacobian_entries_ = 0, hessian_entries_ = 0;        ///< of the NLP
  std::vector<double> start_, point_, lower_, upper_;     ///< of z
  std::vector<double> violations_, jacobian_, gradient_;  ///< c, its Jacobian and the gradient at the final point
  std::vector<int> jacobian_rows_, jacobian_columns_;
  double largest_, slope_;
  int iterations_ = 0;
};

}  // namespace rhec::ipopt
