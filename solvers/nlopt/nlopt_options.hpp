#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <nlopt.h>

#include "rhec/core/config/options.hpp"

namespace rhec::nlopt {

/// What an algorithm of NLopt supports and requires.
struct Traits {
  bool gradients = false;        ///< uses derivatives
  bool inequalities = false;     ///< supports inequality constraints
  bool equalities = false;       ///< supports equality constraints
  bool bounds = true;            ///< supports bounds of variables
  bool finite_bounds = false;    ///< requires finite bounds on all variables
  bool local_optimiser = false;  ///< solves subproblems with `local_algorithm`
  bool from_start = true;        ///< starts at the given point, so a restart from its last iterate makes sense
  int fewest_variables = 1;
};
Traits traits_of(nlopt_algorithm algorithm);
/// Its name without the prefix, e.g. "LD_SLSQP".
std::string name_of(nlopt_algorithm algorithm);
/// The algorithms in this build of NLopt, by name.
const std::vector<std::pair<std::string, nlopt_algorithm>>& algorithms();
/// The algorithms that support the given kinds of constraints: "LD_MMA, LD_SLSQP, ...".
std::string names_of_those_with(bool inequalities, bool equalities);

/// How the variables that NLopt sees are scaled.
enum class Scaling {
  automatic,  ///< full for LD_SLSQP, diagonal for the others
  none,
  diagonal,  ///< divided by the square roots of the condensed Hessian's diagonal
  full       ///< by the Hessian's Cholesky factor; bounds of variables become general linear constraints
};

struct NloptOptions {
  nlopt_algorithm algorithm = NLOPT_LD_SLSQP;
  nlopt_algorithm local_algorithm = NLOPT_LD_SLSQP;
  double tolerance = 1e-8;
  int max_iterations = 2000;
  int restarts = 50;
  std::optional<int> iterations_per_run;
  bool polish = true;
  Scaling scaling = Scaling::automatic;
  int max_variables = 600;
  double ftol_rel = 1e-6;
  double ftol_abs = 0.0;
  double xtol_rel = 0.0;
  double xtol_abs = 0.0;
  int maxeval = 0;
  std::optional<double> initial_step;
  int population = 0;
  int vector_storage = 0;
  int seed = 1;
  Settings native;

  static const OptionTable<NloptOptions>& table();
};

/// Whether the algorithm uses derivatives; for AUGLAG and MLSL, whether their local algorithm does.
bool uses_gradients(nlopt_algorithm algorithm, const NloptOptions& options);

/// The native parameters in NLopt's form. Throws Error if one is not a number or would make NLopt print.
std::vector<std::pair<std::string, double>> native_parameters(const Settings& native);

}  // namespace rhec::nlopt
