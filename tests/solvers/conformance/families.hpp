#pragma once

// The problems that every solver is held against, as data: families of random problems of any model.

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "rhec/core/horizon/horizon_problem.hpp"
#include "support/limited_ocp.hpp"

namespace rhec::conformance {

/// A problem, and where a solver starts.
struct Problem {
  std::unique_ptr<HorizonProblem> ocp;
  Iterate guess;
  std::unique_ptr<testing::LimitedOcp> limited;  ///< the problem with limits, where it has some

  /// What solvers get.
  const Ocp& posed() const noexcept { return limited ? static_cast<const Ocp&>(*limited) : *ocp; }
};

struct Family {
  enum class Answer {
    solved,     ///< a point within the tolerance
    infeasible  ///< no point satisfies the constraints: the solver says so and leaves the point as it was
  };

  std::string name;     ///< begins with rhe_ or rhc_
  std::string meaning;  ///< one phrase
  int problems = 3;     ///< how many are made, with seeds 1, 2, ...
  Answer answer = Answer::solved;
  /// Solvers may end in different optima, each of which is right; otherwise their objectives have to agree.
  bool several_optima = false;
  std::function<Problem(std::shared_ptr<const Model>, unsigned seed)> make;
  std::function<bool(const Model&)> applies = [](const Model&) { return true; };
};

/// How many problems of a family are made: its own number, or RHEC_CONFORMANCE_PROBLEMS of the environment where that
/// is more.
int problem_count(const Family& family);

const std::vector<Family>& families();
/// Those with limits (limited_families.cpp), which `families` includes.
std::vector<Family> limited_families();
/// Throws std::out_of_range where there is none.
const Family& family(const std::string& name);

/// Models for which the families are made: those that are found, and `models_of_the_suite`.
std::vector<std::string> model_names();
/// "integrator": one state, no parameter. "wide_chain": 40 states, wider than small dense linear algebra is made for.
const std::vector<std::string>& models_of_the_suite();
std::shared_ptr<const Model> make_model(const std::string& name);
/// The families that make sense for a model. The wide one gets few: it is there for its size alone.
bool applies(const Family& family, const std::string& model_name, const Model& model);

/// Restricts a problem so that no point is feasible, or not, on the smallest model that can show it: x' = u.
std::unique_ptr<HorizonProblem> integrator_in_a_box(double lower_input, double upper_input);

}  // namespace rhec::conformance
