// How every solver that is found goes from sample to sample: along a horizon that moves, with blocks that move in it.
#include "behaviour.hpp"

#include <fmt/format.h>

#include <utility>

#include "rhec/core/horizon/shift.hpp"
#include "support/random_problem.hpp"

namespace rhec::conformance {
namespace behaviour_sequence_test {

using testing::RandomProblem;

class BehaviourInSequence : public Behaviour {};

TEST_P(BehaviourInSequence, FollowsAHorizonThatMoves) {
  constexpr int samples = 6, length = 12, period = 5;
  RandomProblem random(model_, 77);
  RandomProblem::RheSpec spec;
  spec.intervals = length + samples;
  const auto whole = random.rhe(spec);
  spec.intervals = length;
  RandomProblem again(model_, 77);
  const auto window = again.rhe(spec);
  window->arrival_mean = whole->arrival_mean;
  const int np = model_->parameter_count();
  // Borders of blocks stand still in time, and so move through the window.
  const auto fill = [&](int first) {
    for (int i = 0; i <= length; ++i) {
      std::copy_n(whole->output(first + i), model_->output_count(), window->output(i));
      if (i == length) break;
      std::copy_n(whole->measured_input(first + i), model_->input_count(), window->measured_input(i));
      window->set_duration(i, whole->duration(first + i));
    }
    for (int j = 0; j < np; ++j) {
      std::array<std::uint8_t, length> begins{};
      for (int i = 0; i < length; ++i) begins[i] = i == 0 || (first + i) % period == 0;
      window->set_blocks(j, begins.data(), Transition::step);
      for (int i = 1; i < length; ++i)
        if (begins[i]) window->link(i, j, 0.01);
    }
    window->finish();
  };
  const auto solver = make();
  solver->setup(*window);
  GuessShifter shifter(*window);
  Iterate guess;
  for (int sample = 0; sample <= samples; ++sample) {
    SCOPED_TRACE("sample " + std::to_string(sample));
    fill(sample);
    // A weak prior that need not move along: what is tested is the solver.
    window->arrival_information.diagonal() *= 0.5;
    Iterate cold = RandomProblem::cold_start(*window);
    if (sample == 0) {
      guess = cold;
    } else {
      ASSERT_TRUE(shifter.apply(1, *window, guess));
    }
    const auto fresh = make();
    fresh->setup(*window);
    const Assessment expected = solve_and_assess(*fresh, *window, guess, tolerance_);
    const Assessment assessed = solve_and_assess(*solver, *window, guess, tolerance_);
    expect_solved(expected, "by a new instance");
    expect_solved(assessed, "by one that has a history");
    EXPECT_NEAR(assessed.objective, expected.objective, 1e-9 * (1e-3 + std::abs(expected.objective)));
    EXPECT_LT(distance(scaled_primal(*window, assessed.point), scaled_primal(*window, expected.point)), 1e-5);
    shifter.take(*window, assessed.point);
    guess = assessed.point;
  }
}

TEST_P(BehaviourInSequence, KeepsUpWithBlocksThatMoveFromSampleToSample) {
  if (model_->parameter_count() == 0) GTEST_SKIP() << "the model has no parameter";
  const auto solver = make();
  Problem of = problem("rhe_blocks");
  auto& rhe = dynamic_cast<RheProblem&>(*of.ocp);
  solver->setup(rhe);
  for (int sample = 0; sample < 12; ++sample) {
    SCOPED_TRACE("sample " + std::to_string(sample));
    for (int j = 0; j < model_->parameter_count(); ++j) {
      std::vector<std::uint8_t> begins(rhe.intervals(), 0);
      // One parameter's blocks move, the others' grow.
      for (int i = 0; i < rhe.intervals(); ++i)
        begins[i] = i == 0 || (j == 0 ? (i + sample) % 4 == 0 : i % (1 + sample % 6) == 0);
      rhe.set_blocks(j, begins.data(), sample % 5 == 4 ? Transition::ramp : Transition::step);
      for (int i = 0; i < rhe.intervals(); ++i)
        if (begins[i]) rhe.link(i, j, 0.01);
    }
    rhe.finish();
    of.guess = RandomProblem::cold_start(rhe);
    const Assessment assessed = solve(*solver, of), fresh = by_new_instance(of);
    expect_solved(assessed, "with a history");
    EXPECT_NEAR(assessed.objective, fresh.objective, 1e-8 * (1e-3 + std::abs(fresh.objective)));
    EXPECT_LT(distance(scaled_primal(rhe, assessed.point), scaled_primal(rhe, fresh.point)), 1e-5);
  }
}

INSTANTIATE_TEST_SUITE_P(Every, BehaviourInSequence, ::testing::ValuesIn(all_pairs()),
                         [](const auto& of) { return of.param.solver + "_on_" + of.param.model; });

}  // namespace behaviour_sequence_test
}  // namespace rhec::conformance
