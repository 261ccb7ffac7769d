#include "bench.hpp"

#include <utility>

#include "rhec/core/ocp/iterate_checks.hpp"
#include "rhec/sim/problems/problem_format.hpp"

namespace rhec::sim {

Bench::Bench(const Host& host, const Backend& backend, Settings options)
    : host_(&host), backend_(&backend), options_(std::move(options)) {
  make();
}

std::string Bench::why_not(const Recorded& record) {
  if (solver_->why_not(*record.problem).empty() && (!ready_ || seed_ != record.place.seed)) {
    if (ready_) make();
    problem_ = problem_format(record.problem->kind()).copy(*record.problem);
    solver_->setup(*problem_);
    ready_ = true;
    seed_ = record.place.seed;
  }
  return solver_->why_not(*record.problem);
}

Answer Bench::solve(const Recorded& record, Iterate& point) {
  point = record.guess;
  problem_format(problem_->kind()).take_data(*record.problem, *problem_);
  const auto start = Clock::now();
  solver_->prepare(point);
  const Report report = solver_->solve(point);
  const double time = microseconds_since(start);
  Answer answer;
  answer.status = report.status;
  answer.usable = rhec::is_usable(report.status) && is_finite(*record.problem, point);
  answer.iterations = report.iterations;
  answer.time_us = time;
  return answer;
}

}  // namespace rhec::sim
