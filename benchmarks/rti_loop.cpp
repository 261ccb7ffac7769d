#include "rti_loop.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "rhec/core/base/error.hpp"
#include "rhec/core/horizon/rhc_problem.hpp"

namespace rhec::bench {

RtiLoop::RtiLoop(const Sequence& sequence, std::shared_ptr<Solver> solver)
    : sequence_(&sequence),
      solver_(std::move(solver)),
      problem_(sequence.workspace.get()),
      shifter_(*problem_),
      point_(problem_->capacity()),
      guess_(problem_->capacity()),
      scratch_(problem_->scratch_size()) {
  if (const std::string reason = solver_->why_not(*problem_); !reason.empty())
    throw Error(sequence.name + ": the solver cannot take this problem: " + reason);
  if (problem_->capacity().intervals > longest_horizon)
    throw Error(sequence.name + ": the horizon is longer than a benchmark can set");
  solver_->setup(*problem_);
}

void RtiLoop::restart() noexcept {
  solver_->reset();
  next_ = 0;
}

const Report& RtiLoop::step() noexcept {
  const Sequence::Sample& sample = sequence_->samples[next_];
  times_.begin = Ticks::now();
  if (next_ == 0) {
    set_known(sample, *problem_);
    point_ = sequence_->start;
    if (looks_inside) times_.prepared = Ticks::now();
  } else {
    shifter_.take(*problem_, std::move(point_));
    set_known(sample, *problem_);
    shifter_.apply(sample.steps, *problem_, point_);
    solver_->prepare(point_);
    if (looks_inside) times_.prepared = Ticks::now();
    if (keep_guess) guess_ = point_;
  }
  set_newest(*sample.problem, *problem_, scratch_);
  report_ = solver_->feedback(point_, Clock::time_point::max());
  if (looks_inside) times_.answered = Ticks::now();
  solver_->finish(point_, report_);
  times_.end = Ticks::now();
  ++next_;
  return report_;
}

std::vector<double> excess_objectives(const Sequence& sequence, const std::shared_ptr<Solver>& solver,
                                      const std::shared_ptr<Solver>& converging) {
  RtiLoop loop(sequence, solver);
  loop.restart();
  converging->setup(*sequence.workspace);
  std::vector<double> scratch(sequence.workspace->scratch_size()), excess;
  for (std::size_t k = 0; k < sequence.samples.size(); ++k) {
    loop.step();
    Iterate stepped = loop.point(), optimum = loop.point();
    if (sequence.kind == "rhc") roll_out(loop.problem(), stepped, scratch);
    const Report report = converging->solve(optimum);
    if (report.status != Status::solved)
      throw Error(sequence.name + ": sample " + std::to_string(k) + " does not converge: " + name_of(report.status));
    const double objective = loop.problem().evaluate(stepped, nullptr, scratch);
    excess.push_back((objective - report.objective) / std::abs(report.objective));
  }
  return excess;
}

}  // namespace rhec::bench
