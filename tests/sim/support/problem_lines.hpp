#pragma once

#include <memory>
#include <span>
#include <string>

#include <gmock/gmock.h>

#include "rhec/core/model/formula_model.hpp"
#include "rhec/sim/problems/problem_file.hpp"
#include "support/error_of.hpp"

// Lines of problem files about a small model, and what is said of those that are wrong.
namespace rhec::sim {

/// A cart whose speed is the input times a grip.
template <class Scalar>
struct Cart {
  static constexpr int state_count = 2, input_count = 2, parameter_count = 1, output_count = 1;
  void dynamics(const Scalar* x, const Scalar* u, const Scalar* p, Scalar* dxdt) const {
    dxdt[0] = u[0] * p[0];
    dxdt[1] = u[1] - x[1];
  }
  void outputs(const Scalar* x, Scalar* y) const { y[0] = x[0]; }
};

inline std::shared_ptr<const Model> cart() {
  ModelDescription about;
  about.name = "cart";
  about.states = {{"pos", "m", ""}, {"lean", "rad", "", -1.0, 1.0}};
  about.inputs = {{"speed", "m/s", "", -1.0, 1.0}, {"push", "rad/s", ""}};
  about.parameters = {{"grip", "1", "", 0.0, 1.0}};
  about.outputs = {{"gps", "m", ""}};
  return std::make_shared<FormulaModel<Cart>>(Cart<double>{}, about);
}

inline const std::string rhe_line = R"({"id": "run/rhe/sb/7", "problem": "rhe", "model": {"name": "cart", "mass": 2.5},
 "horizon": {"intervals": 3, "dt": 0.1, "integrator": "rk4", "substeps": 2},
 "arrival": {"state": [1, 0.5], "parameters": [0.75], "information": [[4, 0, 0], [0, 3, 0.5], [0, 0.5, 2]]},
 "outputs": [[1.5], [null], [1.75], [2]], "inputs": [[2, 0.25], [null, 0.5], [9, null]],
 "weights": {"outputs": [100], "inputs": [10, 20]},
 "bounds": {"speed": [null, 3], "grip": [0, 0.9]}, "block_starts": {"grip": [0, 2]}})";

inline const std::string rhc_line = R"({"id": "run/rhc/8", "problem": "rhc", "model": {"name": "cart"},
 "horizon": {"intervals": 2, "dt": 0.1, "integrator": "rk4", "substeps": 1},
 "initial_state": [1, 0.5], "parameters": [0.5],
 "reference": {"pos": [1, 2, 3], "speed": [4, 5]}, "weights": {"stage": {"pos": 1, "speed": 5}, "terminal": {"pos": 10}},
 "bounds": {"speed": [0, 4.5]}, "block_starts": {"push": [0]}})";

// All that version 2 adds.
inline const std::string rhe_line_2 = R"({"version": 2, "id": "run/rhe/7", "problem": "rhe", "model": {"name": "cart"},
 "horizon": {"intervals": 3, "dt": [0.1, 0.2, 0.3], "integrator": "rk4", "substeps": 2},
 "arrival": {"state": [1, 0.5], "parameters": [0.75], "information": [[4, 0, 0], [0, 3, 0.5], [0, 0.5, 2]]},
 "outputs": [[1.5], [null], [1.75], [2]], "inputs": [[2, 0.25], [null, 0.5], [9, null]],
 "weights": {"outputs": [100], "inputs": [10, 20]}, "robust": [{"outputs": ["gps"], "delta": 3}],
 "bounds": {"speed": [null, 3]}, "block_starts": {"grip": [0, 2]}, "transition": {"grip": "ramp"},
 "neighbour_variance": {"grip": [0.5, null]},
 "guess": {"states": [[1, 2, 3], [4, 5, 6], [7, 8, 9], [-0.0, 11, 12]], "controls": [[1, 2, 3], [4, 5], [6, 7, 8]],
  "costates": [[0, 0, 0], [1, 1, 1], [2, 2, 2], [3, 3, 3]]},
 "origin": {"run": "figure8", "status": "infeasible"}})";

inline const std::string rhc_line_2 = R"({"version": 2, "id": "run/rhc/8", "problem": "rhc", "model": {"name": "cart"},
 "horizon": {"intervals": 2, "dt": 0.1, "integrator": "rk4", "substeps": 1},
 "initial_state": [1, 0.5], "parameters": [0.5], "reference": {}, "weights": {"stage": {}, "terminal": {}},
 "bounds": {"speed": [[0, null], 4.5], "push": [-1, 1]}})";

// What version 3 adds: the rate of an input.
inline const std::string rhc_line_3 = R"({"version": 3, "id": "run/rhc/8", "problem": "rhc", "model": {"name": "cart"},
 "horizon": {"intervals": 2, "dt": 0.1, "integrator": "rk4", "substeps": 1}, "rates": ["push"],
 "initial_state": [1, 0.5, 0.25], "parameters": [0.5],
 "reference": {"pos": [1, 2, 3], "speed": [4, 5], "push": [0.25, 0, 0], "push_rate": [0, 0]},
 "weights": {"stage": {"pos": 1, "speed": 5, "push": 2, "push_rate": 0.5}, "terminal": {"pos": 10, "push": 2}},
 "bounds": {"speed": [0, 4.5], "push": [-1, 1], "push_rate": [-3, 3]}})";

inline std::string replaced(std::string text, const std::string& old, const std::string& with) {
  const std::size_t at = text.find(old);
  EXPECT_NE(at, std::string::npos) << old;
  return text.replace(at, old.size(), with);
}

/// What reading, and building, says of a line with one thing changed.
inline std::string mistake(const std::string& line, const std::string& old, const std::string& with) {
  return error_of([&] { build(read_problem(replaced(line, old, with), "set.jsonl", 3), cart()); });
}

/// One thing that is changed in a line, and what is said of it.
struct Mistake {
  const std::string &line, old, with, key, what;
};

inline void expect_told(std::span<const Mistake> mistakes) {
  using namespace ::testing;
  for (const Mistake& each : mistakes) {
    const std::string place = each.key.empty() ? "set.jsonl:3: " : "set.jsonl:3: " + each.key + ": ";
    EXPECT_THAT(mistake(each.line, each.old, each.with), AllOf(StartsWith(place), HasSubstr(each.what))) << each.with;
  }
}

}  // namespace rhec::sim
