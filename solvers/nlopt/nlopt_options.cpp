#include "nlopt_options.hpp"

#include <string_view>

namespace rhec::nlopt {

Traits traits_of(nlopt_algorithm algorithm) {
  Traits traits;
  const std::string name = name_of(algorithm);
  const auto begins = [&](std::string_view with) { return name.compare(0, with.size(), with) == 0; };
  const auto holds = [&](std::string_view part) { return name.find(part) != std::string::npos; };
  const bool global = begins("G");
  const bool augmented = holds("AUGLAG");
  traits.local_optimiser = augmented || holds("MLSL");
  traits.gradients = begins("LD") || begins("GD");
  traits.finite_bounds = global;
  traits.from_start = !global;
  switch (algorithm) {
    case NLOPT_LD_MMA:
    case NLOPT_LD_CCSAQ:
    case NLOPT_GN_ORIG_DIRECT:
    case NLOPT_GN_ORIG_DIRECT_L:
    case NLOPT_GN_AGS:
      traits.inequalities = true;
      break;
    case NLOPT_LD_SLSQP:
    case NLOPT_LN_COBYLA:
    case NLOPT_GN_ISRES:
      traits.inequalities = traits.equalities = true;
      break;
    case NLOPT_LN_NEWUOA:
      traits.bounds = false;
      traits.fewest_variables = 2;
      break;
    case NLOPT_LN_NEWUOA_BOUND:
    case NLOPT_LN_BOBYQA:
      traits.fewest_variables = 2;
      break;
    default:
      traits.inequalities = traits.equalities = augmented;
      break;
  }
  return traits;
}

std::string name_of(nlopt_algorithm algorithm) {
  const char* name = nlopt_algorithm_to_string(algorithm);
  return name ? name : "";
}

const std::vector<std::pair<std::string, nlopt_algorithm>>& algorithms() {
  static const auto all = [] {
    std::vector<std::pair<std::string, nlopt_algorithm>> found;
    for (int number = 0; number < NLOPT_NUM_ALGORITHMS; ++number) {
      const auto algorithm = static_cast<nlopt_algorithm>(number);
      const std::string_view about = nlopt_algorithm_name(algorithm);
      if (about.find("NOT COMPILED") == std::string_view::npos) found.emplace_back(name_of(algorithm), algorithm);
    }
    return found;
  }();
  return all;
}

std::string names_of_those_with(bool inequalities, bool equalities) {
  std::string names;
  for (const auto& [name, algorithm] : algorithms()) {
    const Traits traits = traits_of(algorithm);
    if ((inequalities && !traits.inequalities) || (equalities && !traits.equalities)) continue;
    names += (names.empty() ? "" : ", ") + name;
  }
  return names;
}

const OptionTable<NloptOptions>& NloptOptions::table() {
  static const auto options =
      OptionTable<NloptOptions>()
          .choice("algorithm", &NloptOptions::algorithm, algorithms(), "NLopt's algorithm, by its own name")
          .choice("local_algorithm", &NloptOptions::local_algorithm, algorithms(),
                  "what AUGLAG and MLSL hand their sub-problems to")
          .number("tolerance", &NloptOptions::tolerance, "KKT residual at which the solution is accepted",
                  greater_than(0.0))
          .integer("max_iterations", &NloptOptions::max_iterations,
                   "limit of points from which steps are taken (of all simulations, where the algorithm takes no "
                   "gradients), all restarts together",
                   between(1, 100000000))
          .integer("restarts", &NloptOptions::restarts,
                   "how often a local algorithm starts again from its last point, scaled anew and a hundred times "
                   "stricter, while that brings progress",
                   between(0, 1000))
          .optional_integer("iterations_per_run", &NloptOptions::iterations_per_run,
                            "linearisations after which an algorithm with full scaling starts again, scaled anew; 0: "
                            "no limit; none: 15, or 3 where there are more than 100 variables",
                            at_least(0.0))
          .flag(
              "polish", &NloptOptions::polish,
              "finish each run by Newton steps on the condensed problem with the active bounds; these are not NLopt's")
          .choice("scaling", &NloptOptions::scaling,
                  {{"auto", Scaling::automatic},
                   {"none", Scaling::none},
                   {"diagonal", Scaling::diagonal},
                   {"full", Scaling::full}},
                  "variables that NLopt sees, by the condensed Hessian at the start of a run: diagonal: by its "
                  "diagonal; full: by its Cholesky factor, bounds then being general constraints; auto: full for "
                  "LD_SLSQP, else diagonal")
          .integer("max_variables", &NloptOptions::max_variables,
                   "most decision variables that are taken: the condensed problem is dense", between(1, 100000))
          .number("ftol_rel", &NloptOptions::ftol_rel,
                  "relative change of the objective that ends the first run; 0: off", at_least(0.0))
          .number("ftol_abs", &NloptOptions::ftol_abs, "the same, absolute; 0: off", at_least(0.0))
          .number("xtol_rel", &NloptOptions::xtol_rel,
                  "relative change of the scaled variables that ends a run; 0: off", at_least(0.0))
          .number("xtol_abs", &NloptOptions::xtol_abs, "the same, absolute; 0: off", at_least(0.0))
          .integer("maxeval", &NloptOptions::maxeval, "evaluations that end a run; 0: no limit", at_least(0.0))
          .optional_number("initial_step", &NloptOptions::initial_step,
                           "first step of algorithms without gradients, in the scaled variables", greater_than(0.0))
          .integer("population", &NloptOptions::population,
                   "size of the population of stochastic algorithms; 0: NLopt's own choice", at_least(0.0))
          .integer("vector_storage", &NloptOptions::vector_storage,
                   "vectors that limited-memory algorithms keep; 0: NLopt's own choice", at_least(0.0))
          .integer("seed", &NloptOptions::seed,
                   "of stochastic algorithms; NLopt's generator belongs to the thread and is seeded at every run",
                   at_least(0.0))
          .subtree("native", &NloptOptions::native,
                   "parameters of single algorithms by NLopt's own names, e.g. inner_maxeval of LD_MMA");
  return options;
}

bool uses_gradients(nlopt_algorithm algorithm, const NloptOptions& options) {
  const Traits traits = traits_of(algorithm);
  return traits.local_optimiser ? traits_of(options.local_algorithm).gradients : traits.gradients;
}

std::vector<std::pair<std::string, double>> native_parameters(const Settings& native) {
  if (!native.is_null() && native.kind() != Settings::Kind::map) throw native.mismatch("a map of names and numbers");
  std::vector<std::pair<std::string, double>> parameters;
  for (const auto& [name, value] : native.members()) {
    if (name == "verbosity") throw value.error("a solver of rhec prints nothing; leave 'verbosity' out");
    parameters.emplace_back(name, value.as_number());
  }
  return parameters;
}

}  // namespace rhec::nlopt
