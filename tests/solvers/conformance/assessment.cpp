#include "assessment.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <random>

#include "rhec/core/base/infinity.hpp"
#include "rhec/core/ocp/iterate_checks.hpp"

namespace rhec::conformance {
namespace {

/// Visits every row that the problem uses, with its length.
template <class Function>
void for_each_row(const Ocp& problem, const Iterate& point, const Function& function) {
  for (int i = 0; i <= problem.intervals(); ++i) {
    function(point.state(i), problem.state_count(i));
    function(point.costate(i), problem.state_count(i));
    function(point.state_bound(i), problem.state_count(i));
    function(point.limit_bound(i), problem.limit_count(i));
    if (i == problem.intervals()) break;
    function(point.control(i), problem.control_count(i));
    function(point.control_bound(i), problem.control_count(i));
  }
}

/// The values of a problem's limits at a point, a row of the capacity for each stage.
std::vector<double> limit_values(const Ocp& problem, const Iterate& point, std::vector<double>& scratch) {
  std::vector<double> values((static_cast<std::size_t>(problem.intervals()) + 1) * problem.capacity().limit_row());
  if (!values.empty()) problem.evaluate_limits(point, values.data(), scratch);
  return values;
}

/// The objective with the costs of slacks.
double objective_at(const Ocp& problem, const Iterate& point, std::vector<double>& scratch) {
  double sum = problem.evaluate(point, nullptr, scratch);
  const std::vector<double> values = limit_values(problem, point, scratch);
  for (int i = 0; i <= problem.intervals() && !values.empty(); ++i)
    sum +=
        limit_costs(problem, i, values.data() + static_cast<std::ptrdiff_t>(i) * problem.capacity().limit_row()).slack;
  return sum;
}

/// The Lagrangian by its definition (iterate.hpp), one interval at a time.
double lagrangian(const Ocp& problem, const Iterate& point, const Iterate& multipliers, std::vector<double>& scratch) {
  double sum = problem.evaluate(point, nullptr, scratch);
  const auto dot = [](const double* a, const double* b, int n) {
    double total = 0.0;
    for (int j = 0; j < n; ++j) total += a[j] * b[j];
    return total;
  };
  const std::vector<double> limits = limit_values(problem, point, scratch);
  Iterate simulated = point;
  for (int i = 0; i <= problem.intervals(); ++i) {
    const int n = problem.state_count(i);
    sum += dot(multipliers.state_bound(i), point.state(i), n);
    sum += dot(multipliers.limit_bound(i),
               limits.data() + static_cast<std::ptrdiff_t>(i) * problem.capacity().limit_row(), problem.limit_count(i));
    if (i == 0 && problem.initial_state()) {
      for (int j = 0; j < n; ++j) sum += multipliers.costate(0)[j] * (problem.initial_state()[j] - point.state(0)[j]);
    }
    if (i == problem.intervals()) break;
    sum += dot(multipliers.control_bound(i), point.control(i), problem.control_count(i));
    problem.simulate_interval(i, simulated, scratch);
    for (int j = 0; j < problem.state_count(i + 1); ++j)
      sum += multipliers.costate(i + 1)[j] * (simulated.state(i + 1)[j] - point.state(i + 1)[j]);
    std::copy_n(point.state(i + 1), problem.state_count(i + 1), simulated.state(i + 1));
  }
  return sum;
}

/// The Lagrangian, with each bound's multiplier times the distance from its bound, that of a limit's from its side
/// beyond the slack, and the costs of slacks.
double corrected_objective(const Ocp& problem, const Iterate& point, std::vector<double>& scratch) {
  double sum = lagrangian(problem, point, point, scratch);
  const auto subtract = [&](const double* multiplier, const double* lower, const double* upper, int n) {
    for (int j = 0; j < n; ++j) {
      const double bound = multiplier[j] > 0.0 ? upper[j] : lower[j];
      if (multiplier[j] != 0.0 && std::isfinite(bound)) sum -= multiplier[j] * bound;
    }
  };
  const std::vector<double> limits = limit_values(problem, point, scratch);
  for (int i = 0; i <= problem.intervals(); ++i) {
    const double* values = limits.data() + static_cast<std::ptrdiff_t>(i) * problem.capacity().limit_row();
    if (problem.limit_count(i) > 0) sum += limit_costs(problem, i, values).slack;
    for (int r = 0; r < problem.limit_count(i); ++r) {
      const double multiplier = point.limit_bound(i)[r];
      const bool is_soft = problem.limit_linear(i)[r] < infinity;
      double side = multiplier > 0.0 ? problem.limit_upper(i)[r] : problem.limit_lower(i)[r];
      if (is_soft) side = multiplier > 0.0 ? std::max(side, values[r]) : std::min(side, values[r]);
      if (multiplier != 0.0 && std::isfinite(side)) sum -= multiplier * side;
    }
    subtract(point.state_bound(i), problem.state_lower(i), problem.state_upper(i), problem.state_count(i));
    if (i < problem.intervals())
      subtract(point.control_bound(i), problem.control_lower(i), problem.control_upper(i), problem.control_count(i));
  }
  return sum;
}

double largest_multiplier(const Ocp& problem, const Iterate& point) {
  double largest = largest_bound_multiplier(problem, point);
  for (int i = 0; i <= problem.intervals(); ++i)
    for (int j = 0; j < problem.state_count(i); ++j) largest = std::max(largest, std::abs(point.costate(i)[j]));
  return largest;
}

/// Derivatives of the Lagrangian along random directions, by central differences.
double slope_of_lagrangian(const Ocp& problem, const Iterate& point, std::vector<double>& scratch) {
  constexpr double step = 1e-6;  // with multipliers of 1e5, third derivatives show in those of ten times that
  std::mt19937 random(1);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  double largest = 0.0;
  for (int direction = 0; direction < 3; ++direction) {
    Iterate ahead = point, behind = point;
    const auto move = [&](double* a, double* b, int n) {
      for (int j = 0; j < n; ++j) {
        const double by = step * uniform(random);
        a[j] += by;
        b[j] -= by;
      }
    };
    for (int i = 0; i <= problem.intervals(); ++i) {
      move(ahead.state(i), behind.state(i), problem.state_count(i));
      if (i < problem.intervals()) move(ahead.control(i), behind.control(i), problem.control_count(i));
    }
    const double difference = lagrangian(problem, ahead, point, scratch) - lagrangian(problem, behind, point, scratch);
    largest = std::max(largest, std::abs(difference) / (2.0 * step));
  }
  return largest;
}

/// Defects, bounds and signs of multipliers, and the Lagrangian's slope, of a point that is said to be a solution.
void check_solution(const Ocp& problem, const Assessment& assessed, double tolerance,
                    std::vector<std::string>& complaints) {
  const Iterate& point = assessed.point;
  std::vector<double> scratch(problem.scratch_size());
  double defect = 0.0, violation = 0.0, at_no_bound = 0.0;
  Iterate simulated = point;
  for (int i = 0; i < problem.intervals(); ++i) {
    problem.simulate_interval(i, simulated, scratch);
    for (int j = 0; j < problem.state_count(i + 1); ++j)
      defect = std::max(defect, std::abs(simulated.state(i + 1)[j] - point.state(i + 1)[j]));
    std::copy_n(point.state(i + 1), problem.state_count(i + 1), simulated.state(i + 1));
  }
  if (problem.initial_state())
    for (int j = 0; j < problem.state_count(0); ++j)
      defect = std::max(defect, std::abs(point.state(0)[j] - problem.initial_state()[j]));
  const auto check = [&](const double* value, const double* multiplier, const double* lower, const double* upper,
                         int n) {
    for (int j = 0; j < n; ++j) {
      violation = std::max({violation, lower[j] - value[j], value[j] - upper[j]});
      const double gap = multiplier[j] > 0.0 ? upper[j] - value[j] : value[j] - lower[j];
      if (multiplier[j] != 0.0) at_no_bound = std::max(at_no_bound, std::abs(multiplier[j]) * std::min(gap, 1.0));
    }
  };
  for (int i = 0; i <= problem.intervals(); ++i) {
    check(point.state(i), point.state_bound(i), problem.state_lower(i), problem.state_upper(i), problem.state_count(i));
    if (i < problem.intervals())
      check(point.control(i), point.control_bound(i), problem.control_lower(i), problem.control_upper(i),
            problem.control_count(i));
  }
  // A soft limit's multiplier is at most what its slack costs at the margin, and that where there is one.
  double off_price = 0.0;
  const std::vector<double> limits = limit_values(problem, point, scratch);
  for (int i = 0; i <= problem.intervals(); ++i) {
    for (int r = 0; r < problem.limit_count(i); ++r) {
      const double value = limits[static_cast<std::size_t>(i) * problem.capacity().limit_row() + r];
      const double lower = problem.limit_lower(i)[r], upper = problem.limit_upper(i)[r];
      const double linear = problem.limit_linear(i)[r], multiplier = point.limit_bound(i)[r];
      const double excess = std::max(lower - value, value - upper), slack = std::max(0.0, excess);
      const double gap = multiplier > 0.0 ? upper - value : value - lower;
      if (linear == infinity) {
        violation = std::max(violation, excess);
        if (multiplier != 0.0) at_no_bound = std::max(at_no_bound, std::abs(multiplier) * std::min(gap, 1.0));
        continue;
      }
      const double price = linear + problem.limit_quadratic(i)[r] * slack;
      off_price = std::max(off_price, std::abs(multiplier) - price);
      if (slack > 0.0) off_price = std::max(off_price, (price - std::abs(multiplier)) * std::min(slack, 1.0));
      if (multiplier != 0.0 && gap > 0.0)
        at_no_bound = std::max(at_no_bound, std::abs(multiplier) * std::min(gap, 1.0));
    }
  }
  // The core integrates several intervals at once, on other instructions: results differ by rounding.
  const double slack = tolerance + 1e-11;
  if (!(defect <= slack)) complaints.push_back(fmt::format("its defect is {:.1e}", defect));
  if (!(violation <= slack)) complaints.push_back(fmt::format("it violates a bound by {:.1e}", violation));
  const double scale = 1.0 + largest_multiplier(problem, point) + std::abs(assessed.objective);
  if (!(at_no_bound <= 10.0 * slack * scale))
    complaints.push_back(fmt::format("a multiplier is not at its bound: {:.1e}", at_no_bound));
  if (!(off_price <= 10.0 * slack * scale))
    complaints.push_back(fmt::format("a soft limit's multiplier is not the price of its slack: {:.1e}", off_price));
  // What differences can tell: a wrong sign or a missing multiplier, not the last digits.
  const double slope = slope_of_lagrangian(problem, point, scratch);
  if (!(slope <= (1e-4 + 100.0 * tolerance) * scale))
    complaints.push_back(fmt::format("the Lagrangian is not stationary: {:.1e} at a scale of {:.1e}", slope, scale));
}

}  // namespace

KktResidual residual_at(const Ocp& problem, const Iterate& point) {
  std::vector<double> scratch(problem.scratch_size());
  StageQp qp(problem.capacity());
  return kkt_residual(problem, point, qp, scratch);
}

Assessment solve_and_assess(Solver& solver, const Ocp& problem, const Iterate& guess, double tolerance,
                            Clock::time_point deadline) {
  Assessment assessed;
  assessed.point = guess;
  const auto start = Clock::now();
  solver.prepare(assessed.point);
  assessed.report = solver.solve(assessed.point, deadline);
  assessed.milliseconds = 1e-3 * microseconds_since(start);
  const Report& report = assessed.report;
  std::vector<std::string>& complaints = assessed.complaints;
  std::vector<double> scratch(problem.scratch_size());
  if (!is_finite(problem, assessed.point)) {
    complaints.emplace_back("the point is not finite");
    return assessed;
  }
  assessed.kkt = residual_at(problem, assessed.point);
  assessed.objective = objective_at(problem, assessed.point, scratch);
  assessed.corrected_objective = corrected_objective(problem, assessed.point, scratch);
  const double residual = assessed.kkt.largest();
  const std::string status = name_of(report.status);
  const bool solved = report.status == Status::solved;
  if (solved && !(residual <= tolerance))
    complaints.push_back(fmt::format("it says {} with a KKT residual of {:.1e}", status, residual));
  const bool gave_up =
      report.status == Status::iteration_limit || report.status == Status::stalled || report.status == Status::deadline;
  if (gave_up && residual <= tolerance)
    complaints.push_back(fmt::format("it says {} of a point with a KKT residual of {:.1e}", status, residual));
  if (report.status == Status::infeasible && !same_bits(problem, assessed.point, guess))
    complaints.emplace_back("it says infeasible and has changed the point");
  if (is_usable(report.status)) {
    if (!(std::abs(report.objective - assessed.objective) <= 1e-11 * (1.0 + std::abs(assessed.objective))))
      complaints.push_back(fmt::format("it reports an objective of {:.12g}; the point's is {:.12g}", report.objective,
                                       assessed.objective));
    if (!(std::abs(report.kkt.largest() - residual) <= 1e-12 + 1e-3 * residual))
      complaints.push_back(
          fmt::format("it reports a KKT residual of {:.1e}; the point's is {:.1e}", report.kkt.largest(), residual));
  }
  if (solved) check_solution(problem, assessed, tolerance, complaints);
  return assessed;
}

bool same_bits(const Ocp& problem, const Iterate& a, const Iterate& b) {
  std::vector<double> of_a, of_b;
  for_each_row(problem, a, [&](const double* row, int n) { of_a.insert(of_a.end(), row, row + n); });
  for_each_row(problem, b, [&](const double* row, int n) { of_b.insert(of_b.end(), row, row + n); });
  return of_a.size() == of_b.size() && std::memcmp(of_a.data(), of_b.data(), of_a.size() * sizeof(double)) == 0;
}

std::vector<double> scaled_primal(const HorizonProblem& problem, const Iterate& point) {
  const auto& about = problem.model().description();
  const int nx = problem.model().state_count(), nu = problem.model().input_count(),
            np = problem.model().parameter_count();
  std::vector<double> all, u(nu), p(np);
  for (int i = 0; i <= problem.intervals(); ++i) {
    for (int j = 0; j < nx; ++j) all.push_back(point.state(i)[j] / about.states[j].scale);
    if (i == problem.intervals()) break;
    problem.structure().inputs_on(point, i, u.data());
    problem.structure().parameters_on(point, i, p.data());
    for (int j = 0; j < nu; ++j) all.push_back(u[j] / about.inputs[j].scale);
    for (int j = 0; j < np; ++j) all.push_back(p[j] / about.parameters[j].scale);
  }
  return all;
}

double distance(const std::vector<double>& a, const std::vector<double>& b) {
  double largest = 0.0;
  for (std::size_t k = 0; k < std::min(a.size(), b.size()); ++k) largest = std::max(largest, std::abs(a[k] - b[k]));
  return largest;
}

}  // namespace rhec::conformance
