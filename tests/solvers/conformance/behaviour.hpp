#pragma once

// Every solver on every model, for tests of how solvers behave.

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <ostream>
#include <string>
#include <vector>

#include "assessment.hpp"
#include "families.hpp"
#include "found.hpp"

namespace rhec::conformance {

struct Pair {
  std::string solver, model;
};

inline std::ostream& operator<<(std::ostream& out, const Pair& of) { return out << of.solver << " on " << of.model; }

inline std::vector<Pair> all_pairs() {
  std::vector<Pair> pairs;
  for (const std::string& solver : host().names(PluginKind::solver)) {
    for (const std::string& model : host().names(PluginKind::model)) pairs.push_back({solver, model});
    pairs.push_back({solver, "integrator"});
  }
  return pairs;
}

class Behaviour : public ::testing::TestWithParam<Pair> {
 protected:
  std::shared_ptr<Solver> make(const Settings& options = {}) const { return make_solver(GetParam().solver, options); }

  Problem problem(const std::string& name, unsigned seed = 1) const { return family(name).make(model_, seed); }

  Assessment solve(Solver& solver, const Problem& of) const {
    return solve_and_assess(solver, of.posed(), of.guess, tolerance_);
  }

  /// The same with a solver that was busy with another problem.
  Assessment set_up_and_solve(Solver& solver, const Problem& of) const {
    solver.setup(of.posed());
    return solve(solver, of);
  }

  /// What a new instance makes of a problem.
  Assessment by_new_instance(const Problem& of) const {
    const auto solver = make();
    solver->setup(of.posed());
    return solve(*solver, of);
  }

  void expect_solved(const Assessment& assessed, const std::string& when) const {
    EXPECT_EQ(assessed.report.status, Status::solved) << when << ": " << name_of(assessed.report.status);
    EXPECT_LE(assessed.kkt.largest(), tolerance_) << when;
    for (const std::string& complaint : assessed.complaints) ADD_FAILURE() << when << ": " << complaint;
  }

  /// Solved as a new instance solves it.
  void expect_right(Solver& solver, const Problem& of, const std::string& when) const {
    const Assessment assessed = set_up_and_solve(solver, of), fresh = by_new_instance(of);
    expect_solved(assessed, when);
    EXPECT_NEAR(assessed.objective, fresh.objective, 1e-7 * (1e-3 + std::abs(fresh.objective))) << when;
  }

  bool applies(const std::string& name) const {
    return conformance::applies(family(name), GetParam().model, *model_) &&
           make()->why_not(problem(name).posed()).empty();
  }

  std::shared_ptr<const Model> model_ = make_model(GetParam().model);
  double tolerance_ = tolerance_of(GetParam().solver);
};

}  // namespace rhec::conformance
