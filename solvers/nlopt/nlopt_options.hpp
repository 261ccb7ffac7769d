#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <nlopt.h>

#include "rhec/core/config/options.hpp"

namespace rhec::nlopt {

/// What an algorithm of NLopt can take.
struct Traits {
  bool gradients = false;        ///< asks for derivatives
  bool inequalities = false;     ///< takes inequality constraints
  bool equalities = false;       ///< takes equality constraints
  bool bounds = true;            ///< takes bounds of variables
  bool finite_bounds = false;    ///< needs all of them finite
  bool local_optimiser = false;  ///< hands sub-problems to `local_algorithm`
  bool from_start = true;        ///< begins at the start; a restart from its last iterate makes sense
  int fewest_variables = 1;
};
Traits traits_of(nlopt_algorithm algorithm);
/// Without the prefix: "LD_SLSQP".
std::string name_of(nlopt_algorithm algorithm);
/// The algorithms that this build of NLopt has, by name.
const std::vector<std::pair<std::string, nlopt_algorithm>>& algorithms();
/// "LD_MMA, LD_SLSQP, ...": those that take constraints of the kinds asked for.
std::string names_of_those_with(bool inequalities, bool equalities);

/// In which variables NLopt sees the problem.
enum class Scaling {
  automatic,  ///< full for LD_SLSQP, diagonal for all others
  none,
  diagonal,  ///< divided by the square roots of the condensed Hessian's diagonal
  full       ///< by its Cholesky factor; bounds of variables become general linear constraints
};

struct NloptOptions {
  nlopt_algorithm algorithm = NLOPT_LD_SLSQP;
  nlopt_algorithm local_algorithm = NLOPT_LD_SLSQP;
  double tolerance = 1e-8;
  int max_iterations = 1000;
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

/// Whether derivatives are asked for; of AUGLAG and MLSL, whether their local algorithm does.
bool uses_gradients(nlopt_algorithm algorithm, const NloptOptions& options);

/// The native parameters as NLopt takes them. Throws Error where one is no number or would make NLopt print.
std::vector<std::pair<std::string, double>> native_parameters(const Settings& native);

}  // namespace rhec::nlopt
