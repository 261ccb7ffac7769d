#include "assessment.hpp"

#include <algorithm>
#include <cmath>

#include "rhec/core/base/angle.hpp"
#include "rhec/core/ocp/iterate_checks.hpp"
#include "rhec/core/qp/kkt.hpp"

namespace rhec::sim {
namespace {

// A point may be the best one if its defects and violations are at most this.
constexpr double feasible = 1e-6;

double violation_of(double value, double lower, double upper) { return std::max({0.0, lower - value, value - upper}); }

}  // namespace

void Assessor::begin(const HorizonProblem& problem) {
  problem_ = &problem;
  if (qp_.capacity() != problem.capacity()) qp_ = StageQp(problem.capacity());
  scratch_.resize(problem.scratch_size());
  defects_.resize(static_cast<std::size_t>(problem.capacity().intervals) * problem.capacity().states);
}

double Assessor::kkt_of(const Iterate& point, Answer& answer) {
  const KktResidual kkt = kkt_residual(*problem_, point, qp_, scratch_);
  answer.defect = kkt.defect;
  return kkt.largest();
}

void Assessor::make_assessed(Iterate& point) {
  if (problem_->can_roll_out()) roll_out(*problem_, point, scratch_);
}

bool Assessor::Verdict::is_feasible() const { return defect <= feasible && violation <= feasible; }

Assessor::Verdict Assessor::verdict_on(const Iterate& assessed, const Iterate& prices) {
  Verdict verdict;
  verdict.objective = problem_->evaluate(assessed, defects_.data(), scratch_);
  double charge = 0.0;
  const int N = problem_->intervals(), width = problem_->capacity().states;
  const auto charge_bounds = [&](const double* values, const double* lower, const double* upper, const double* price,
                                 int count) {
    for (int j = 0; j < count; ++j) {
      const double violation = violation_of(values[j], lower[j], upper[j]);
      verdict.violation = std::max(verdict.violation, violation);
      charge += std::abs(price[j]) * violation;
    }
  };
  for (int i = 0; i <= N; ++i) {
    const bool is_given = i == 0 && problem_->initial_state();
    if (!is_given)
      charge_bounds(assessed.state(i), problem_->state_lower(i), problem_->state_upper(i), prices.state_bound(i),
                    problem_->state_count(i));
    if (i == N) break;
    charge_bounds(assessed.control(i), problem_->control_lower(i), problem_->control_upper(i), prices.control_bound(i),
                  problem_->control_count(i));
    const double* defect = defects_.data() + static_cast<std::ptrdiff_t>(i) * width;
    for (int j = 0; j < problem_->state_count(i + 1); ++j) {
      verdict.defect = std::max(verdict.defect, std::abs(defect[j]));
      charge += std::abs(prices.costate(i + 1)[j] * defect[j]);
    }
  }
  verdict.charged = verdict.objective + charge;
  return verdict;
}

double Assessor::distance(const Iterate& a, const Iterate& b) {
  const ModelDescription& about = problem_->model().description();
  double largest = 0.0;
  const auto compare = [&](const std::vector<Variable>& variables, const double* one, const double* other) {
    for (std::size_t j = 0; j < variables.size(); ++j) {
      const double difference = variables[j].is_angle ? angle_difference(one[j], other[j]) : one[j] - other[j];
      largest = std::max(largest, std::abs(difference) / variables[j].scale);
    }
  };
  const std::size_t nx = about.states.size();
  row_.resize(std::max({nx, about.inputs.size(), about.parameters.size()}));
  other_row_.resize(row_.size());
  for (int i = 0; i <= problem_->intervals(); ++i) {
    compare(about.states, a.state(i), b.state(i));
    if (i == problem_->intervals()) break;
    problem_->structure().inputs_on(a, i, row_.data());
    problem_->structure().inputs_on(b, i, other_row_.data());
    compare(about.inputs, row_.data(), other_row_.data());
    problem_->structure().parameters_on(a, i, row_.data());
    problem_->structure().parameters_on(b, i, other_row_.data());
    compare(about.parameters, row_.data(), other_row_.data());
  }
  // An estimator's window may have no interval yet; its parameters then stand in the first stage state.
  if (problem_->intervals() == 0) compare(about.parameters, a.state(0) + nx, b.state(0) + nx);
  return largest;
}

}  // namespace rhec::sim
