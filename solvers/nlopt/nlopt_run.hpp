#pragma once

#include <vector>

#include "condensed.hpp"
#include "nlopt_options.hpp"
#include "rhec/core/ocp/solver.hpp"

namespace rhec::nlopt {

/// The variables y that NLopt sees: x = centre + factor y, with a diagonal or triangular factor.
struct Transformation {
  Eigen::VectorXd centre;
  Eigen::VectorXd diagonal;  ///< used if `full` is empty
  Eigen::MatrixXd full;      ///< upper triangular
  bool is_full() const noexcept { return full.size() > 0; }
  Eigen::VectorXd x_of(const Eigen::VectorXd& y) const;
  /// factor' g: the gradient with respect to y.
  Eigen::VectorXd pulled_back(const Eigen::VectorXd& g) const;
};

/// One call of nlopt_optimize on a condensed problem.
class Run {
 public:
  enum class Goal {
    objective,
    violation  ///< the sum of squared violations of the rows, subject to the bounds of variables only
  };
  enum class Outcome {
    ended,  ///< by NLopt's own criteria, or limited by rounding
    deadline,
    iteration_limit,
    failed  ///< NLopt refused or gave up; `x` is still the best iterate found
  };
  struct Limits {
    Clock::time_point deadline;
    long iterations = 0;      ///< limit, as counted by `iterations`
    long quota = 0;           ///< iterations after which this run ends normally; 0: no quota
    double strictness = 1.0;  ///< factor on the tolerances
  };
  Run(CondensedProblem& problem, const NloptOptions& options, nlopt_algorithm algorithm, Goal goal,
      const Transformation& transformation, const Limits& limits);

  Outcome optimise();
  /// The best iterate found: the feasible one of the lowest objective, or else the least infeasible one.
  const Eigen::VectorXd& x() const noexcept { return best_x_; }
  /// The last iterate that was counted as an iteration, feasible or not.
  const Eigen::VectorXd& last_x() const noexcept { return last_counted_; }
  /// Whether NLopt stopped because rounding, or linearised constraints without a solution, left it no step.
  bool gave_up() const noexcept { return gave_up_; }
  /// Number of points at which NLopt asked for derivatives, or for values if it never asks for derivatives.
  long iterations() const noexcept { return iterations_; }

 private:
  /// A bound as a constraint of NLopt: value <= 0, or value = 0.
  struct Constraint {
    bool is_row = false;
    int index = 0;
    double sign = 0.0, bound = 0.0;  ///< sign (value - bound) <= 0
  };
  static double objective_of(unsigned n, const double* y, double* gradient, void* run) noexcept;
  static void inequalities_of(unsigned m, double* values, unsigned n, const double* y, double* gradient,
                              void* run) noexcept;
  static void equalities_of(unsigned m, double* values, unsigned n, const double* y, double* gradient,
                            void* run) noexcept;
  bool go_to(const double* y, bool with_gradient);
  double evaluate(const double* y, double* gradient);
  void evaluate(const std::vector<Constraint>& constraints, const double* y, double* values, double* gradient);
  double value_of(const Constraint& c) const noexcept;
  double goal_value() const noexcept;
  void remember();
  void stop(Outcome why) noexcept;
  bool may_count(const Eigen::VectorXd& x, bool with_gradient);
  double allowed_violation() const noexcept;
  void configure(nlopt_opt optimiser, bool is_local) const;
  void list_constraints();

  CondensedProblem& problem_;
  const NloptOptions& options_;
  nlopt_algorithm algorithm_;
  Traits traits_;
  Goal goal_;
  const Transformation& transformation_;
  Limits limits_;
  bool uses_gradients_;
  long iterations_ = 0;
  int returns_ = 0;  ///< evaluations repeated at the iterate counted last
  nlopt_opt optimiser_ = nullptr;
  Outcome outcome_ = Outcome::ended;
  bool gave_up_ = false;
  bool was_stopped_ = false;
  std::vector<Constraint> inequalities_, equalities_;
  double violation_weight_ = 1.0;
  Eigen::VectorXd last_counted_, best_x_;
  double best_value_ = 0.0, best_violation_ = 0.0;
};

}  // namespace rhec::nlopt
