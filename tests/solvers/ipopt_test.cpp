// What the solver ipopt promises beyond the conformance of every solver.

#include <gtest/gtest.h>

#include <unistd.h>

#include <atomic>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <thread>

#include "rhec/core/ocp/solver.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "solvers/ipopt/ocp_nlp.hpp"
#include "support/random_problem.hpp"

namespace rhec {
namespace {

using ipopt::Curvature;
using ipopt::OcpNlp;
using testing::RandomProblem;
using Vector = std::vector<double>;

const Host& host() {
  static const Host one;
  return one;
}
std::shared_ptr<Solver> ipopt_with(const std::string& options) {
  return host().make_solver("ipopt", parse_yaml(options, "options.yaml"));
}
std::shared_ptr<const Model> bicycle() { return host().make_model("bicycle_slip"); }

std::string error_of(const std::string& options) {
  try {
    ipopt_with(options);
  } catch (const Error& error) {
    return error.what();
  }
  return {};
}

RandomProblem::RheSpec blocks_of(int block, int intervals = 15) {
  RandomProblem::RheSpec spec;
  spec.intervals = intervals;
  spec.block = block;
  return spec;
}

/// A problem with its objective in other units; counts what is asked of it.
class Scaled final : public Ocp {
 public:
  Scaled(const Ocp& of, double factor) : of_(of), factor_(factor), weighted_(of.capacity()) {}
  mutable int evaluations = 0, linearisations = 0;

  Capacity capacity() const noexcept override { return of_.capacity(); }
  int intervals() const noexcept override { return of_.intervals(); }
  int state_count(int node) const noexcept override { return of_.state_count(node); }
  int control_count(int i) const noexcept override { return of_.control_count(i); }
  const double* initial_state() const noexcept override { return of_.initial_state(); }
  const double* state_lower(int node) const noexcept override { return of_.state_lower(node); }
  const double* state_upper(int node) const noexcept override { return of_.state_upper(node); }
  const double* control_lower(int i) const noexcept override { return of_.control_lower(i); }
  const double* control_upper(int i) const noexcept override { return of_.control_upper(i); }
  bool has_second_derivatives() const noexcept override { return of_.has_second_derivatives(); }
  bool has_small_residuals() const noexcept override { return of_.has_small_residuals(); }
  std::size_t scratch_size() const noexcept override { return of_.scratch_size(); }
  void mark_dynamics(int i, std::uint8_t* states, std::uint8_t* controls) const noexcept override {
    of_.mark_dynamics(i, states, controls);
  }
  double evaluate_stages(const Iterate& point, double* defects, double* stage_costs,
                         std::span<double> scratch) const noexcept override {
    ++evaluations;
    const double cost = of_.evaluate_stages(point, defects, stage_costs, scratch);
    if (stage_costs)
      for (int i = 0; i <= intervals(); ++i) stage_costs[i] *= factor_;
    return factor_ * cost;
  }
  void simulate_interval(int i, Iterate& point, std::span<double> scratch) const noexcept override {
    of_.simulate_interval(i, point, scratch);
  }
  double linearise(StageRange range, const Iterate& point, Hessian hessian, StageQp& qp,
                   std::span<double> scratch) const noexcept override {
    ++linearisations;
    weighted_ = point;
    for (int i = 0; i <= intervals(); ++i)
      for (int j = 0; j < state_count(i); ++j) weighted_.costate(i)[j] /= factor_;
    const double objective = of_.linearise(range, weighted_, hessian, qp, scratch);
    const int rows = capacity().states + capacity().controls;
    for (int i = range.first; i <= range.last; ++i)
      for (auto [values, count] : {std::pair{qp.H(i), rows * qp.stride()}, {qp.h(i), rows}})
        for (int k = 0; k < count; ++k) values[k] *= factor_;
    return factor_ * objective;
  }
  void refresh(const Iterate&, StageQp&, std::span<double>) const noexcept override {}

 private:
  const Ocp& of_;
  double factor_;
  mutable Iterate weighted_;
};

/// The program at a point near a problem's cold start, with multipliers of the size of its gradient.
struct Program {
  Program(const Ocp& ocp, const Iterate& start, RandomProblem& random, Curvature curvature)
      : nlp(new OcpNlp(ocp, curvature)) {
    nlp->take(ocp);
    nlp->get_nlp_info(n, m, jacobian_entries, hessian_entries, style);
    nlp->set_start(start, 0.0);
    z.resize(n);
    nlp->get_starting_point(n, true, z.data(), false, nullptr, nullptr, m, false, nullptr);
    for (double& value : z) value += 0.01 * random.normal();
    for (int row = 0; row < m; ++row) multipliers.push_back(20.0 * random.normal());
    for (auto* indices : {&rows, &columns}) indices->resize(hessian_entries);
    nlp->eval_h(n, nullptr, false, 0.0, m, nullptr, false, hessian_entries, rows.data(), columns.data(), nullptr);
    jacobian_rows.resize(jacobian_entries);
    jacobian_columns.resize(jacobian_entries);
    nlp->eval_jac_g(n, nullptr, false, m, jacobian_entries, jacobian_rows.data(), jacobian_columns.data(), nullptr);
  }
  double lagrangian(const Vector& at, double factor) {
    double objective = 0.0;
    Vector constraints(m);
    EXPECT_TRUE(nlp->eval_f(n, at.data(), true, objective));
    EXPECT_TRUE(nlp->eval_g(n, at.data(), false, m, constraints.data()));
    double sum = factor * objective;
    for (int row = 0; row < m; ++row) sum += multipliers[row] * constraints[row];
    return sum;
  }
  Vector gradient(const Vector& at, double factor) {
    Vector sum(n), jacobian(jacobian_entries);
    EXPECT_TRUE(nlp->eval_grad_f(n, at.data(), true, sum.data()));
    EXPECT_TRUE(nlp->eval_jac_g(n, at.data(), false, m, jacobian_entries, nullptr, nullptr, jacobian.data()));
    for (double& value : sum) value *= factor;
    for (int k = 0; k < jacobian_entries; ++k) sum[jacobian_columns[k]] += jacobian[k] * multipliers[jacobian_rows[k]];
    return sum;
  }
  /// Dense, column by column.
  std::vector<Vector> hessian(double factor) {
    Vector values(hessian_entries);
    EXPECT_TRUE(nlp->eval_h(n, z.data(), true, factor, m, multipliers.data(), true, hessian_entries, nullptr, nullptr,
                            values.data()));
    std::vector<Vector> dense(n, Vector(n, 0.0));
    for (int k = 0; k < hessian_entries; ++k) dense[columns[k]][rows[k]] = dense[rows[k]][columns[k]] = values[k];
    return dense;
  }
  Ipopt::SmartPtr<OcpNlp> nlp;
  int n = 0, m = 0, jacobian_entries = 0, hessian_entries = 0;
  OcpNlp::IndexStyleEnum style = OcpNlp::C_STYLE;
  Vector z, multipliers;
  std::vector<int> rows, columns, jacobian_rows, jacobian_columns;
};

void check_derivatives(const HorizonProblem& problem, RandomProblem& random) {
  Program program(problem, RandomProblem::cold_start(problem), random, Curvature::exact);
  constexpr double step = 1e-6;
  // 1e-4: where the weight is too small to be divided by.
  for (const double factor : {0.0, 1e-4, 1.0, 2.0}) {
    const Vector gradient = program.gradient(program.z, factor);
    const auto hessian = program.hessian(factor);
    double scale = 1.0, curvature = 1.0;
    for (int c = 0; c < program.n; ++c) {
      scale = std::max(scale, std::abs(gradient[c]));
      for (const double value : hessian[c]) curvature = std::max(curvature, std::abs(value));
    }
    for (int c = 0; c < program.n; ++c) {
      Vector before = program.z, after = program.z;
      before[c] -= step;
      after[c] += step;
      EXPECT_NEAR(gradient[c], (program.lagrangian(after, factor) - program.lagrangian(before, factor)) / (2.0 * step),
                  1e-5 * scale)
          << "weight " << factor << ", variable " << c;
      const Vector low = program.gradient(before, factor), high = program.gradient(after, factor);
      for (int r = 0; r < program.n; ++r)
        EXPECT_NEAR(hessian[c][r], (high[r] - low[r]) / (2.0 * step), 1e-6 * curvature)
            << "weight " << factor << ", " << r << ", " << c;
    }
  }
}

TEST(IpoptProgram, DerivativesAreThoseOfItsFunctionsWithAnyWeightOfTheObjective) {
  RandomProblem random(bicycle(), 1);
  check_derivatives(*random.rhe(blocks_of(3, 5)), random);
  check_derivatives(*random.rhe(blocks_of(0, 1)), random);
  RandomProblem::RhcSpec spec;
  spec.intervals = 5;
  spec.blocked_inputs = {0};
  check_derivatives(*random.rhc(spec), random);
}

TEST(IpoptProgram, GaussNewtonCurvatureIsOfTheObjectiveAlone) {
  RandomProblem random(bicycle(), 2);
  const auto problem = random.rhe(blocks_of(3, 5));
  Program program(*problem, RandomProblem::cold_start(*problem), random, Curvature::gauss_newton);
  const auto none = program.hessian(0.0), once = program.hessian(1.0), twice = program.hessian(2.0);
  double largest = 0.0;
  for (int c = 0; c < program.n; ++c) {
    for (int r = 0; r < program.n; ++r) {
      EXPECT_EQ(none[c][r], 0.0);
      EXPECT_EQ(twice[c][r], 2.0 * once[c][r]);
      largest = std::max(largest, once[c][r]);
    }
    EXPECT_GE(once[c][c], 0.0);
  }
  EXPECT_GT(largest, 1.0);
}

TEST(IpoptProgram, EvaluatesEveryPointOnce) {
  RandomProblem random(bicycle(), 3);
  const auto problem = random.rhe(blocks_of(3));
  const Scaled counted(*problem, 1.0);
  Program program(counted, RandomProblem::cold_start(*problem), random, Curvature::exact);
  counted.evaluations = counted.linearisations = 0;
  for (int repeat = 0; repeat < 2; ++repeat) {
    program.lagrangian(program.z, 1.0);
    program.gradient(program.z, 1.0);
  }
  EXPECT_EQ(counted.evaluations, 1);
  EXPECT_EQ(counted.linearisations, 1);
  program.z[0] += 0.1;
  program.gradient(program.z, 1.0);
  program.lagrangian(program.z, 1.0);
  EXPECT_EQ(counted.evaluations, 2);
  EXPECT_EQ(counted.linearisations, 2);
}

TEST(Ipopt, PassesNativeOptionsOn) {
  RandomProblem random(bicycle(), 4);
  RandomProblem::RhcSpec spec;
  spec.off = 0.3;
  const auto problem = random.rhc(spec);
  const auto report_with = [&](const std::string& options) {
    const auto solver = ipopt_with(options);
    solver->setup(*problem);
    Iterate point = RandomProblem::cold_start(*problem);
    return solver->solve(point);
  };
  const Report usual = report_with("{}");
  ASSERT_EQ(usual.status, Status::solved);
  // A number, an integer that wins over ours, and a choice written as a flag.
  // (None of them is a time: clocks of the processor may stand still for as long as a solve takes.)
  const Report diverged = report_with("{native: {diverging_iterates_tol: 1e-6}}");
  EXPECT_NE(diverged.status, Status::solved);
  EXPECT_EQ(diverged.iterations, 0);
  EXPECT_GT(report_with("{hessian: limited_memory, native: {limited_memory_max_history: 1}}").iterations,
            report_with("{hessian: limited_memory}").iterations);
  const Report restored = report_with("{native: {start_with_resto: true}}");
  EXPECT_EQ(restored.status, Status::solved);
  EXPECT_NE(restored.iterations, usual.iterations);
}

TEST(Ipopt, RefusesNativeOptionsWithTheirPlace) {
  EXPECT_EQ(error_of("native:\n  mu_strategy: adaptive\n  mu_stategy: adaptive"),
            "options.yaml:3: native.mu_stategy: solver 'ipopt': Ipopt has no option 'mu_stategy'; did you mean "
            "'mu_strategy'?");
  EXPECT_NE(error_of("native: {mu_strategy: often}").find("found 'often', expected monotone | adaptive"),
            std::string::npos);
  EXPECT_NE(error_of("native: {mu_init: -1}").find("found '-1', expected a number, above 0"), std::string::npos);
  EXPECT_NE(error_of("native: {max_soc: many}").find("found 'many', expected an integer, at least 0"),
            std::string::npos);
  EXPECT_NE(error_of("native: {mu_init: [1]}").find("options.yaml:1: native.mu_init"), std::string::npos);
  EXPECT_NE(error_of("native: adaptive").find("expected a map of options of Ipopt"), std::string::npos);
  // What would print, read files or contradict an option of ours.
  EXPECT_NE(error_of("native: {print_level: 5}").find("a solver prints nothing"), std::string::npos);
  EXPECT_NE(error_of("native: {option_file_name: mine.opt}").find("cannot be set here"), std::string::npos);
  EXPECT_NE(error_of("native: {tol: 1e-3}").find("option 'tolerance'"), std::string::npos);
  // Only Ipopt itself knows that this one is not there, and only when it starts.
  EXPECT_NE(error_of("native:\n  mu_init: 0.1\n  linear_solver: pardiso")
                .find("options.yaml:3: native.linear_solver: solver 'ipopt': Ipopt cannot start"),
            std::string::npos);
}

TEST(Ipopt, AWarmStartTakesFewerIterationsThanAColdOne) {
  int warm_iterations = 0, cold_iterations = 0;
  for (unsigned seed = 20; seed < 30; ++seed) {
    RandomProblem random(bicycle(), seed);
    RandomProblem::RhcSpec spec;
    spec.off = 0.2;
    const auto problem = random.rhc(spec);
    const auto warm = ipopt_with("{}"), cold = ipopt_with("{warm_start: false}");
    warm->setup(*problem);
    cold->setup(*problem);
    Iterate solution = RandomProblem::cold_start(*problem);
    ASSERT_EQ(warm->solve(solution).status, Status::solved);
    problem->given_state()[0] += 0.02;
    problem->given_state()[2] -= 0.01;
    std::vector<double> scratch(problem->scratch_size());
    problem->finish(scratch);
    Iterate from_warm = solution, from_cold = solution;
    const Report a = warm->solve(from_warm), b = cold->solve(from_cold);
    EXPECT_EQ(a.status, Status::solved);
    EXPECT_EQ(b.status, Status::solved);
    warm_iterations += a.iterations;
    cold_iterations += b.iterations;
  }
  EXPECT_LT(warm_iterations, 0.8 * cold_iterations);
}

TEST(Ipopt, TheUnitsOfTheObjectiveMatterToNothing) {
  RandomProblem random(bicycle(), 5);
  const auto rhe = random.rhe(blocks_of(4));
  RandomProblem::RhcSpec spec;
  spec.off = 0.3;
  const auto rhc = random.rhc(spec);
  for (const HorizonProblem* problem :
       {static_cast<HorizonProblem*>(rhe.get()), static_cast<HorizonProblem*>(rhc.get())}) {
    std::vector<double> scratch(problem->scratch_size());
    const Iterate start = RandomProblem::cold_start(*problem);
    const auto solver = ipopt_with("{}");
    solver->setup(*problem);
    Iterate expected = start;
    ASSERT_EQ(solver->solve(expected).status, Status::solved);
    const double optimum = problem->evaluate(expected, nullptr, scratch);
    for (const double factor : {1e-4, 1e-2, 1e2, 1e4}) {
      const Scaled scaled(*problem, factor);
      Iterate point = start;
      solver->setup(scaled);
      const Report report = solver->solve(point);
      EXPECT_EQ(report.status, Status::solved) << factor;
      EXPECT_LE(report.kkt.defect, 1e-8) << factor;
      EXPECT_NEAR(problem->evaluate(point, nullptr, scratch), optimum, 1e-7 * optimum) << factor;
    }
  }
}

TEST(Ipopt, TwoThreadsGetTheBitsThatEachGetsAlone) {
  RandomProblem random(bicycle(), 6);
  const auto rhe = random.rhe(blocks_of(2));
  const auto rhc = random.rhc({});
  const HorizonProblem* problems[] = {rhe.get(), rhc.get()};
  const auto solve = [](const HorizonProblem& problem) {
    const auto solver = ipopt_with("{}");
    solver->setup(problem);
    Iterate point = RandomProblem::cold_start(problem);
    EXPECT_EQ(solver->solve(point).status, Status::solved);
    return point;
  };
  const Iterate alone[] = {solve(*rhe), solve(*rhc)};
  std::atomic<int> wrong{0};
  const auto work = [&](int which) {
    const HorizonProblem& problem = *problems[which];
    for (int repeat = 0; repeat < 10; ++repeat) {
      const Iterate point = solve(problem);
      for (int i = 0; i <= problem.intervals(); ++i) {
        const std::size_t bytes = sizeof(double) * problem.state_count(i);
        wrong += std::memcmp(point.state(i), alone[which].state(i), bytes) != 0;
        wrong += std::memcmp(point.costate(i), alone[which].costate(i), bytes) != 0;
      }
    }
  };
  std::thread one(work, 0), other(work, 1);
  one.join();
  other.join();
  EXPECT_EQ(wrong, 0);
}

TEST(Ipopt, ADeadlineGivesTheBestIterateSoFar) {
  RandomProblem random(bicycle(), 7);
  const auto problem = random.rhe(blocks_of(10, 300));
  const auto solver = ipopt_with("{}");
  solver->setup(*problem);
  const Iterate start = RandomProblem::cold_start(*problem);
  std::vector<double> scratch(problem->scratch_size());
  StageQp qp(problem->capacity());
  const double before = kkt_residual(*problem, start, qp, scratch).largest();
  bool improved = false;
  for (const int milliseconds : {-1000, 1, 5, 10, 20, 40}) {
    Iterate point = start;
    const Report report = solver->solve(point, Clock::now() + std::chrono::milliseconds(milliseconds));
    EXPECT_TRUE(report.status == Status::deadline || (report.status == Status::solved && milliseconds > 0));
    EXPECT_TRUE(point.is_finite());
    EXPECT_EQ(report.kkt.largest(), kkt_residual(*problem, point, qp, scratch).largest());
    EXPECT_LE(report.kkt.largest(), before);
    improved |= report.kkt.largest() < before;
  }
  EXPECT_TRUE(improved) << "no deadline left time for an iteration";
}

TEST(Ipopt, WaitingForAnotherSolveCountsForTheDeadline) {
  RandomProblem random(bicycle(), 8);
  const auto longer = random.rhe(blocks_of(10, 300));
  std::atomic<bool> stop{false}, started{false};
  std::thread other([&] {
    const auto solver = ipopt_with("{}");
    solver->setup(*longer);
    while (!stop) {
      started = true;
      Iterate point = RandomProblem::cold_start(*longer);
      solver->solve(point);
    }
  });
  const auto solver = ipopt_with("{}");
  solver->setup(*longer);
  while (!started) std::this_thread::yield();
  for (int repeat = 0; repeat < 5; ++repeat) {
    Iterate point = RandomProblem::cold_start(*longer);
    EXPECT_EQ(solver->solve(point, Clock::now() + std::chrono::milliseconds(1)).status, Status::deadline);
    EXPECT_TRUE(point.is_finite());
  }
  stop = true;
  other.join();
}

TEST(Ipopt, PrintsNothingAndReadsNoFile) {
  const auto here = std::filesystem::current_path();
  const auto folder = std::filesystem::temp_directory_path() / ("rhec_ipopt_test_" + std::to_string(::getpid()));
  std::filesystem::create_directories(folder);
  std::filesystem::current_path(folder);
  std::ofstream("ipopt.opt") << "print_level 8\nmax_iter 1\noutput_file told.txt\n";
  ::testing::internal::CaptureStdout();
  ::testing::internal::CaptureStderr();
  RandomProblem random(bicycle(), 9);
  const auto possible = random.rhc({});
  RandomProblem::RhcSpec far;
  far.off = 3.0;
  const auto difficult = random.rhc(far);
  for (const char* options : {"{}", "{hessian: limited_memory}", "{max_iterations: 2}", "{native: {mu_init: 1.0}}"}) {
    for (const auto* problem : {possible.get(), difficult.get()}) {
      const auto solver = ipopt_with(options);
      solver->setup(*problem);
      Iterate point = RandomProblem::cold_start(*problem);
      const Report report = solver->solve(point);
      if (problem == possible.get() && std::string(options) == "{}") {
        EXPECT_EQ(report.status, Status::solved);
      }
    }
  }
  EXPECT_NE(error_of("{native: {mu_strategy: never}}"), "");
  std::fflush(nullptr);
  EXPECT_EQ(::testing::internal::GetCapturedStdout(), "");
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
  int files = 0;
  for ([[maybe_unused]] const auto& file : std::filesystem::directory_iterator(folder)) ++files;
  EXPECT_EQ(files, 1) << "besides ipopt.opt";
  std::filesystem::current_path(here);
  std::filesystem::remove_all(folder);
}

TEST(Ipopt, AnotherCapacityThanAtSetupIsBadInput) {
  RandomProblem random(bicycle(), 10);
  const auto small = random.rhe(blocks_of(3, 5)), large = random.rhe(blocks_of(3, 6));
  const auto solver = ipopt_with("{}");
  solver->setup(*small);
  Iterate point = RandomProblem::cold_start(*large);
  EXPECT_EQ(solver->solve(point).status, Status::bad_input);
}

}  // namespace
}  // namespace rhec
