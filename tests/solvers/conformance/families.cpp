#include "families.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <iterator>
#include <stdexcept>
#include <utility>

#include "found.hpp"
#include "making.hpp"
#include "rhec/core/model/formula_model.hpp"
#include "support/test_models.hpp"

namespace rhec::conformance {
namespace {

using testing::Integrator;

bool has_parameters(const Model& model) { return model.parameter_count() > 0; }

// --- models of the suite --------------------------------------------------------------------------------------------

/// Carts in a row, each drawn by the one before; the first one is pushed. The rate at which they follow is unknown.
template <class Scalar>
struct WideChain {
  static constexpr int state_count = 40, input_count = 1, parameter_count = 1, output_count = 40;
  void dynamics(const Scalar* x, const Scalar* u, const Scalar* p, Scalar* dxdt) const {
    dxdt[0] = u[0] - p[0] * x[0];
    for (int j = 1; j < state_count; ++j) dxdt[j] = p[0] * (x[j - 1] - x[j]);
  }
  void outputs(const Scalar* x, Scalar* y) const {
    for (int j = 0; j < output_count; ++j) y[j] = x[j];
  }
};

ModelDescription about_integrator() {
  ModelDescription about;
  about.name = "integrator";
  about.states = {{.name = "x", .unit = "m", .meaning = "position"}};
  about.inputs = {{.name = "u", .unit = "m/s", .meaning = "speed"}};
  about.outputs = {{.name = "y", .unit = "m", .meaning = "position"}};
  return about;
}

ModelDescription about_wide_chain() {
  ModelDescription about;
  about.name = "wide_chain";
  for (int j = 0; j < WideChain<double>::state_count; ++j) {
    const std::string number = std::to_string(j);
    about.states.push_back({.name = "x" + number, .unit = "m", .meaning = "place of cart " + number});
    about.outputs.push_back({.name = "y" + number, .unit = "m", .meaning = "place of cart " + number});
  }
  about.inputs = {{.name = "u", .unit = "m/s", .meaning = "push"}};
  about.parameters = {{.name = "rate", .unit = "1/s", .meaning = "of following", .lower = 0.0, .upper = 2.0}};
  return about;
}

std::vector<Family> make_families() {
  std::vector<Family> all;
  const auto add = [&](std::string name, std::string meaning, Make make) -> Family& {
    Family f;
    f.name = std::move(name);
    f.meaning = std::move(meaning);
    f.make = std::move(make);
    all.push_back(std::move(f));
    return all.back();
  };

  // Estimation: block structures.
  add("rhe_full_horizon", "one value of each parameter, and room for no more",
      [](const ModelPointer& model, unsigned seed) {
        const RheSpec spec = rhe([&](RheSpec& s) {
          s.adjust = [&](RheProblem::Setup& setup, const Drive&) {
            for (int j = 0; j < model->parameter_count(); ++j) setup.one_block.push_back(j);
          };
        });
        return random(spec)(model, seed);
      })
      .problems = 5;
  add("rhe_blocks", "blocks of four intervals, linked", random(rhe([](RheSpec& s) { s.block = 4; }))).problems = 5;
  add("rhe_blocks_unlinked", "blocks of five intervals without links", random(rhe([](RheSpec& s) {
        s.block = 5;
        s.linked = false;
      })))
      .applies = has_parameters;
  add("rhe_unblocked", "a value on every interval, linked", random(rhe([](RheSpec& s) { s.block = 1; })));
  add("rhe_ramps", "linked ramps between blocks", random(rhe([](RheSpec& s) {
        s.block = 4;
        s.transition = Transition::ramp;
      })))
      .applies = has_parameters;
  add("rhe_mixed_blocks", "each parameter with irregular blocks of its own",
      changed(RheSpec{},
              [](RheProblem& problem, RandomProblem& random) {
                set_blocks(problem, Transition::step, 0.01,
                           [&](int, int parameter) { return parameter > 0 && random.uniform(0.0, 1.0) < 0.3; });
              }))
      .applies = has_parameters;
  add("rhe_uneven_links", "links of variances from very tight to very loose",
      changed(rhe([](RheSpec& s) { s.block = 2; }),
              [](RheProblem& problem, RandomProblem& random) {
                for (int j = 0; j < problem.model().parameter_count(); ++j)
                  for (int i = 1; i < problem.intervals(); ++i)
                    if (problem.structure().starts_block(i, j))
                      problem.link(i, j, uneven_variance(random, problem.model().description().parameters[j]));
              }))
      .applies = has_parameters;

  // Estimation: measurements.
  add("rhe_robust", "pseudo-Huber loss, one fix in five far off",
      changed(rhe([](RheSpec& s) {
                s.block = 4;
                s.robust = true;
              }),
              [](RheProblem& problem, RandomProblem& random) {
                for (int i = 1; i <= problem.intervals(); ++i)
                  if (random.uniform(0.0, 1.0) < 0.2)
                    problem.output(i)[0] += 0.3 * random.normal() * problem.model().description().outputs[0].scale;
              }))
      .several_optima = true;
  add("rhe_missing_outputs", "three outputs in ten are missing", random(rhe([](RheSpec& s) {
        s.missing = 0.3;
        s.block = 4;
      })));
  add("rhe_no_outputs", "all outputs are missing", random(rhe([](RheSpec& s) { s.missing = 1.1; })));
  // Without bounds, an input that nobody measured may turn a vehicle round and round between two fixes.
  add("rhe_missing_inputs", "one measured input in five is missing, and none is far from what is usual",
      [](const ModelPointer& model, unsigned seed) {
        const RheSpec spec = rhe([&](RheSpec& s) {
          s.missing_inputs = 0.2;
          s.adjust = [&](RheProblem::Setup& setup, const Drive& d) {
            std::tie(setup.input_lower, setup.input_upper) = hull(d.inputs, model->description().inputs, 0.5);
          };
        });
        return random(spec)(model, seed);
      });
  add("rhe_exact_measurements", "measurements without noise: the objective is all but zero",
      changed(rhe([](RheSpec& s) { s.noise = 1e-6; }), [](RheProblem&, RandomProblem&) {}));
  add("rhe_standing_still", "no input determines any parameter",
      changed(rhe([](RheSpec& s) { s.block = 3; }), stand_still));
  add("rhe_uneven_weights", "weights that are twelve orders of magnitude apart", random(rhe([](RheSpec& s) {
        s.block = 4;
        s.adjust = [](RheProblem::Setup& setup, const Drive&) {
          setup.output_weights.front() *= 1e4;
          setup.output_weights.back() *= 1e-4;
          setup.input_weights.front() *= 1e-4;
        };
      })))
      .several_optima = true;  // an interior point may leave a guess that one coordinate alone pins down

  // Estimation: bounds.
  add("rhe_states_at_bounds", "the truth leaves the bounds of states", beyond_bounds(states, false)).several_optima =
      true;
  add("rhe_inputs_at_bounds", "the truth leaves the bounds of inputs", beyond_bounds(inputs, false));
  add("rhe_parameters_at_bounds", "the truth leaves the bounds of parameters", beyond_bounds(parameters, true))
      .applies = has_parameters;
  add("rhe_all_at_bounds", "the truth leaves bounds of every kind", beyond_bounds(states | inputs | parameters, true))
      .several_optima = true;
  add("rhe_fixed", "an input and the parameters are fixed: lower bound = upper bound", random(rhe([](RheSpec& s) {
        s.block = 4;
        s.adjust = [](RheProblem::Setup& setup, const Drive& d) {
          setup.input_lower.assign(setup.input_weights.size(), -infinity);
          setup.input_upper.assign(setup.input_weights.size(), infinity);
          setup.input_lower[0] = setup.input_upper[0] = d.inputs[0];
          const std::size_t np = d.parameters.size() / d.durations.size();
          setup.parameter_lower.assign(d.parameters.begin(), d.parameters.begin() + static_cast<std::ptrdiff_t>(np));
          setup.parameter_upper = setup.parameter_lower;
        };
      })));

  // Estimation: the past.
  add("rhe_dense_prior", "an information matrix full of correlations",
      changed(rhe([](RheSpec& s) { s.block = 4; }), [](RheProblem& p, RandomProblem& r) { correlate(p, r, 1000); }));
  add("rhe_singular_prior", "an information matrix of rank two",
      changed(RheSpec{}, [](RheProblem& p, RandomProblem& r) { correlate(p, r, 2); }));
  add("rhe_no_prior", "no arrival cost",
      changed(RheSpec{}, [](RheProblem& p, RandomProblem&) { p.arrival_information.setZero(); }));
  add("rhe_prior_far_off", "the arrival mean is ten standard deviations off",
      changed(rhe([](RheSpec& s) { s.block = 4; }),
              [](RheProblem& p, RandomProblem& random) {
                for (int j = 0; j < p.model().state_count(); ++j)
                  p.arrival_mean[j] +=
                      (random.uniform(0.0, 1.0) < 0.5 ? -10.0 : 10.0) / std::sqrt(p.arrival_information(j, j));
              }))
      .several_optima = true;

  // Estimation: horizons.
  add("rhe_no_interval", "a horizon of one node", random(rhe([](RheSpec& s) { s.intervals = 0; })));
  add("rhe_one_interval", "a horizon of one interval", random(rhe([](RheSpec& s) { s.intervals = 1; })));
  add("rhe_two_intervals", "a horizon of two intervals, each a block", random(rhe([](RheSpec& s) {
        s.intervals = 2;
        s.block = 1;
      })));
  add("rhe_part_of_the_room", "a horizon shorter than the capacity", random(rhe([](RheSpec& s) {
        s.intervals = 7;
        s.room = 23;
        s.block = 3;
      })));
  add("rhe_durations", "intervals from 0.01 s to 1 s", random(rhe([](RheSpec& s) {
        s.dt = 0.01;
        s.longest = 1.0;
        s.block = 4;
      })));
  add("rhe_200_intervals", "200 intervals, blocks of ten", random(rhe([](RheSpec& s) {
        s.intervals = 200;
        s.block = 10;
      })))
      .problems = 1;
  all.back().several_optima = true;  // a guess that has drifted for 40 s is far
  add("rhe_200_intervals_unblocked", "200 intervals, a value of each parameter on every one",
      random(rhe([](RheSpec& s) {
        s.intervals = 200;
        s.block = 1;
      })))
      .problems = 1;
  all.back().several_optima = true;  // a guess that has drifted for 40 s is far

  // Estimation: starts, models, and what cannot be.
  add("rhe_far_guess", "a guess that is no trajectory", scattered(rhe([](RheSpec& s) { s.block = 4; }), 0.5))
      .several_optima = true;
  add("rhe_without_second_derivatives", "a model without second derivatives",
      without_second_derivatives(random(rhe([](RheSpec& s) { s.block = 4; }))));
  add("rhe_infeasible", "the vehicle has to move and has no room", no_room_to_move).answer = Family::Answer::infeasible;

  // Control.
  add("rhc_near", "the vehicle starts near the path", random(rhc([](RhcSpec& s) { s.off = 0.05; }))).problems = 5;
  add("rhc_off", "the vehicle starts far from the path", random(rhc([](RhcSpec& s) { s.off = 0.3; }))).several_optima =
      true;
  all.back().problems = 5;
  add("rhc_one_interval", "a horizon of one interval", random(rhc([](RhcSpec& s) { s.intervals = 1; })));
  add("rhc_two_intervals", "a horizon of two intervals", random(rhc([](RhcSpec& s) { s.intervals = 2; })));
  add("rhc_part_of_the_room", "a horizon shorter than the capacity", random(rhc([](RhcSpec& s) {
        s.intervals = 7;
        s.room = 23;
      })));
  add("rhc_200_intervals", "200 intervals", random(rhc([](RhcSpec& s) {
        s.intervals = 200;
        s.off = 0.05;
      })))
      .problems = 1;
  all.back().several_optima = true;
  add("rhc_durations", "intervals from 0.05 s to 0.5 s", random(rhc([](RhcSpec& s) {
        s.dt = 0.05;
        s.longest = 0.5;
      })));
  add("rhc_blocked_input", "the first input in blocks of three",
      random(rhc([](RhcSpec& s) { s.blocked_inputs = {0}; })));
  add("rhc_all_inputs_blocked", "every input in blocks of three", [](const ModelPointer& model, unsigned seed) {
    RhcSpec spec;
    for (int j = 0; j < model->input_count(); ++j) spec.blocked_inputs.push_back(j);
    return random(spec)(model, seed);
  });
  add("rhc_rates", "inputs are states, and their rates have weights", with_rates(false));
  add("rhc_rates_at_bounds", "rates and inputs are bounded, and the path leaves both", with_rates(true))
      .several_optima = true;
  add("rhc_states_at_bounds", "the path leaves the bounds of states", [](const ModelPointer& model, unsigned seed) {
    RhcSpec spec;
    spec.off = 0.0;
    spec.adjust = [&](RhcProblem::Setup& setup, const Drive& d) {
      std::tie(setup.state_lower, setup.state_upper) =
          hull(gentler(*model, d, 0.8).states, model->description().states, 0.01);
    };
    RandomProblem problems(model, 4000 + seed);
    return cold(problems.rhc(spec));
  }).several_optima = true;
  add("rhc_inputs_at_bounds", "bounds of inputs that the path needs more than, other ones on each interval",
      changed(RhcSpec{}, [](RhcProblem& problem, RandomProblem& random) {
        for (int i = 0; i < problem.intervals(); ++i) {
          for (int j = 0; j < problem.model().input_count(); ++j) {
            const double wanted = problem.input_reference(i)[j];
            const double room = random.uniform(0.01, 0.2) * problem.model().description().inputs[j].scale;
            problem.input_lower(i, j) = 0.8 * wanted - room;
            problem.input_upper(i, j) = 0.8 * wanted + room;
          }
        }
      }));
  add("rhc_fixed_inputs", "inputs are fixed on the first intervals: lower bound = upper bound",
      changed(RhcSpec{}, [](RhcProblem& problem, RandomProblem&) {
        for (int i = 0; i < 5; ++i)
          for (int j = 0; j < problem.model().input_count(); ++j)
            problem.input_lower(i, j) = problem.input_upper(i, j) = 0.9 * problem.input_reference(i)[j];
      }));
  add("rhc_fixed_state", "the last state has to stay as it is at the start", fixed_state).applies = can_stand_still;
  add("rhc_far_guess", "a guess that is no trajectory", scattered(rhc([](RhcSpec& s) { s.off = 0.05; }), 0.5))
      .several_optima = true;
  add("rhc_without_second_derivatives", "a model without second derivatives",
      without_second_derivatives(random(rhc([](RhcSpec& s) { s.off = 0.05; }))))
      .several_optima = true;
  add("rhc_infeasible", "the lower bound of an input is above its upper bound",
      changed(RhcSpec{},
              [](RhcProblem& problem, RandomProblem&) {
                problem.input_lower(3, 0) = problem.input_reference(3)[0] + 0.2;
                problem.input_upper(3, 0) = problem.input_reference(3)[0] - 0.2;
              }))
      .answer = Family::Answer::infeasible;
  std::vector<Family> with_limits = limited_families();
  std::move(with_limits.begin(), with_limits.end(), std::back_inserter(all));
  return all;
}

}  // namespace

const std::vector<Family>& families() {
  static const std::vector<Family> all = make_families();
  return all;
}

int problem_count(const Family& family) {
  const char* wanted = std::getenv("RHEC_CONFORMANCE_PROBLEMS");
  return wanted ? std::max(family.problems, std::atoi(wanted)) : family.problems;
}

const Family& family(const std::string& name) {
  for (const Family& each : families())
    if (each.name == name) return each;
  throw std::out_of_range("no family of problems is called " + name);
}

const std::vector<std::string>& models_of_the_suite() {
  static const std::vector<std::string> names = {"integrator", "wide_chain"};
  return names;
}

std::vector<std::string> model_names() {
  std::vector<std::string> names = host().names(PluginKind::model);
  names.insert(names.end(), models_of_the_suite().begin(), models_of_the_suite().end());
  return names;
}

std::shared_ptr<const Model> make_model(const std::string& name) {
  if (name == "integrator") return std::make_shared<FormulaModel<Integrator>>(Integrator<double>{}, about_integrator());
  if (name == "wide_chain") return std::make_shared<FormulaModel<WideChain>>(WideChain<double>{}, about_wide_chain());
  return host().make_model(name);
}

bool applies(const Family& family, const std::string& model_name, const Model& model) {
  if (model_name == "wide_chain") return family.name == "rhe_blocks" || family.name == "rhc_near";
  return family.applies(model);
}

std::unique_ptr<HorizonProblem> integrator_in_a_box(double lower_input, double upper_input) {
  RheProblem::Setup setup;
  setup.max_intervals = 10;
  setup.output_weights = {1.0};
  setup.input_weights = {1.0};
  setup.state_lower = {0.0};
  setup.state_upper = {1.0};
  setup.input_lower = {lower_input};
  setup.input_upper = {upper_input};
  auto problem = std::make_unique<RheProblem>(make_model("integrator"), setup);
  problem->set_intervals(10);
  problem->finish();
  problem->arrival_information(0, 0) = 1.0;
  for (int i = 0; i <= 10; ++i) {
    problem->output(i)[0] = 0.5;
    if (i == 10) break;
    problem->measured_input(i)[0] = 1.0;
    problem->set_duration(i, 1.0);
  }
  return problem;
}

}  // namespace rhec::conformance
