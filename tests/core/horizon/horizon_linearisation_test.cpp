// A cached linearisation must equal one computed from scratch, with fewer evaluations of the model.
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <optional>

#include "rhec/core/horizon/shift.hpp"
#include "rhec/core/ocp/linearisation.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "support/other_model.hpp"
#include "support/random_problem.hpp"

namespace rhec {
namespace horizon_linearisation_test {

using testing::RandomProblem;

/// Counts the intervals and nodes that it evaluates.
class CountingModel final : public OtherModel {
 public:
  using OtherModel::OtherModel;
  void integrate_rows(const IntervalRows& request) const noexcept override {
    intervals += request.count;
    OtherModel::integrate_rows(request);
  }
  void observe_rows(const NodeRows& request) const noexcept override {
    nodes += request.count;
    OtherModel::observe_rows(request);
  }
  mutable std::atomic<int> intervals{0}, nodes{0};
};

/// Everything in a stage of a QP.
void expect_same(const StageQp& found, const StageQp& expected, const std::string& where) {
  ASSERT_EQ(found.intervals(), expected.intervals()) << where;
  ASSERT_EQ(found.initial_state_is_given, expected.initial_state_is_given) << where;
  const int stride = expected.stride(), ns = expected.capacity().states;
  const auto compare = [&](const double* a, const double* b, int count, const char* what, int stage) {
    for (int k = 0; k < count; ++k) {
      if (a[k] == b[k]) continue;
      ASSERT_NEAR(a[k], b[k], 1e-12 * (1.0 + std::abs(b[k]))) << where << ": " << what << ' ' << stage << ", " << k;
    }
  };
  for (int i = 0; i <= expected.intervals(); ++i) {
    ASSERT_EQ(found.states(i), expected.states(i)) << where << ' ' << i;
    ASSERT_EQ(found.controls(i), expected.controls(i)) << where << ' ' << i;
    compare(found.H(i), expected.H(i), (ns + expected.controls(i)) * stride, "H", i);
    compare(found.h(i), expected.h(i), stride, "h", i);
    compare(found.lower(i), expected.lower(i), stride, "lower", i);
    compare(found.upper(i), expected.upper(i), stride, "upper", i);
    if (i == expected.intervals()) break;
    compare(found.AB(i), expected.AB(i), ns * stride, "F", i);
    compare(found.b(i), expected.b(i), stride, "b", i);
  }
  if (expected.initial_state_is_given) compare(found.initial_step(), expected.initial_step(), ns, "initial", 0);
}

/// A horizon that moves along a longer drive; every sample takes a step from its guess.
class Journey {
 public:
  Journey(std::shared_ptr<const Model> inner, unsigned seed)
      : model_(std::make_shared<CountingModel>(std::move(inner))), random_(model_, seed) {}

  RandomProblem& random() { return random_; }
  const std::shared_ptr<CountingModel>& model() const { return model_; }

  void begin(HorizonProblem& problem, Hessian hessian) {
    problem_ = &problem;
    hessian_ = hessian;
    remembering_ = problem.make_linearisation();
    plain_ = std::make_unique<Linearisation>(problem);
    shifter_.emplace(problem);
    point_ = RandomProblem::cold_start(problem);
    assess();
  }
  /// Starts with another window of the same problem and QP, which meanwhile held the exact Hessian.
  void begin_again(const std::function<void()>& set_window) {
    if (problem_->has_second_derivatives()) remembering_->linearise(point_, Hessian::exact);
    set_window();
    point_ = RandomProblem::cold_start(*problem_);
    assess();
  }
  /// Linearises at a new point near the guess, as a solver does after a step.
  void assess() {
    const HorizonProblem& problem = *problem_;
    for (int i = 0; i <= problem.intervals(); ++i) {
      for (int j = 0; j < problem.model().state_count(); ++j) {
        point_.state(i)[j] += 1e-3 * random_.normal();
        point_.costate(i)[j] = random_.normal();
      }
      for (int j = 0; i < problem.intervals() && j < problem.model().input_count(); ++j)
        point_.control(i)[j] += 1e-3 * random_.normal();
    }
    remembering_->linearise_for_residual(point_, hessian_);
    shifter_->take(problem, point_);
  }
  bool move(int steps) { return shifter_->apply(steps, *problem_, point_); }
  /// Prepares both linearisations at the guess; the cached one may evaluate only so many intervals and nodes.
  void compare(const std::string& where, int most_intervals, int most_nodes) {
    model_->intervals = model_->nodes = 0;
    remembering_->prepare(point_, hessian_);
    EXPECT_LE(model_->intervals, most_intervals) << where;
    EXPECT_LE(model_->nodes, most_nodes) << where;
    EXPECT_TRUE(remembering_->is_at(point_)) << where;
    plain_->prepare(point_, hessian_);
    if (newest) newest();
    model_->nodes = 0;
    remembering_->refresh(point_);
    EXPECT_EQ(model_->nodes, 0) << where << ": of the outputs nothing can have changed";
    plain_->refresh(point_);
    expect_same(remembering_->qp(), plain_->qp(), where);
  }
  Iterate& point() { return point_; }
  Linearisation& remembering() { return *remembering_; }
  std::function<void()> newest;  ///< sets the newest data, between preparation and refresh

 private:
  std::shared_ptr<CountingModel> model_;
  RandomProblem random_;
  HorizonProblem* problem_ = nullptr;
  Hessian hessian_ = Hessian::gauss_newton;
  std::unique_ptr<Linearisation> remembering_, plain_;
  std::optional<GuessShifter> shifter_;
  Iterate point_;
};

class LinearisationCacheTest : public ::testing::TestWithParam<std::string> {
 protected:
  std::shared_ptr<const Model> model_ = host().make_model(GetParam());

 private:
  static const Host& host() {
    static const Host one;
    return one;
  }
};

struct Blocks {
  int length;  ///< 0: one for the horizon
  bool ends_early;
};

/// Blocks that stay fixed in time while the window moves over them, the last one twice as long.
void set_window(RheProblem& to, const RheProblem& from, int first, int count, const Blocks& blocks) {
  const int ny = to.model().output_count(), nu = to.model().input_count(), np = to.model().parameter_count();
  to.set_intervals(count);
  std::vector<std::uint8_t> begins(count, 0);
  for (int i = 0; i < count; ++i) {
    to.set_duration(i, from.duration(first + i));
    std::copy_n(from.measured_input(first + i), nu, to.measured_input(i));
    begins[i] = blocks.length > 0 && (first + i) % blocks.length == 0 && !(blocks.ends_early && i + 2 > count);
  }
  for (int i = 0; i <= count; ++i) std::copy_n(from.output(first + i), ny, to.output(i));
  for (int j = 0; j < np; ++j) {
    to.set_blocks(j, begins.data(), Transition::step);
    for (int i = 0; i < count; ++i)
      if (begins[i]) to.link(i, j, 0.1);
  }
  to.arrival_mean = from.arrival_mean;
  to.arrival_information = from.arrival_information;
  to.finish();
}

TEST_P(LinearisationCacheTest, AnEstimatorsQpMovesWithItsWindow) {
  constexpr int drive = 30, window = 9;
  unsigned seed = 1;
  for (const Blocks blocks : {Blocks{0, false}, Blocks{1, false}, Blocks{3, false}, Blocks{4, true}}) {
    for (const bool robust : {false, true}) {
      Journey journey(model_, seed++);
      RandomProblem::RheSpec spec;
      spec.intervals = drive;
      spec.longest = 0.3;
      spec.missing = 0.1;
      spec.robust = robust;
      const auto all = journey.random().rhe(spec);
      RheProblem::Setup setup = all->setup();
      setup.max_intervals = window;
      RheProblem problem(journey.model(), setup);
      set_window(problem, *all, 0, 4, blocks);
      journey.begin(problem, Hessian::gauss_newton);
      int first = 0, count = 4;
      for (int sample = 0; first + count < drive - 2; ++sample) {
        if (sample == 10) {
          journey.begin_again([&] { set_window(problem, *all, first, count = 4, blocks); });
        }
        // The window grows, then moves on, and once by two intervals.
        const int steps = count < window ? 0 : sample == 12 ? 2 : 1;
        first += steps;
        count = std::min(window, count + 1);
        set_window(problem, *all, first, count, blocks);
        journey.newest = [&] {
          for (int j = 0; j < problem.model().output_count(); ++j) problem.output(count)[j] += 0.1;
        };
        ASSERT_TRUE(journey.move(steps));
        // One more than planned, and those where the start or end of blocks has changed.
        const int most = blocks.length == 0 ? (steps == 2 ? 2 : 0) : 4;
        journey.compare("sample " + std::to_string(sample) + ", blocks of " + std::to_string(blocks.length), most,
                        steps == 2 ? 2 : 1);
        if (HasFatalFailure()) return;
        journey.assess();
      }
    }
  }
}

TEST_P(LinearisationCacheTest, AControllersQpMovesWithItsPlan) {
  for (const Hessian hessian : {Hessian::gauss_newton, Hessian::exact}) {
    Journey journey(model_, 77);
    RandomProblem::RhcSpec spec;
    const auto problem = journey.random().rhc(spec);
    const int nx = model_->state_count(), np = model_->parameter_count();
    std::vector<double> scratch(problem->scratch_size());
    journey.newest = [&] {
      for (int j = 0; j < nx + np; ++j) problem->given_state()[j] *= 1.0 + 1e-3 * journey.random().normal();
      problem->state_reference(2)[0] += 0.1;
      problem->finish(scratch);
    };
    journey.begin(*problem, hessian);
    for (int sample = 0; sample < 8; ++sample) {
      const int steps = sample == 5 ? 2 : 1;
      ASSERT_TRUE(journey.move(steps));
      // With the exact Hessian, the next interval is already known.
      const int unknown = hessian == Hessian::exact ? steps - 1 : steps;
      journey.compare("sample " + std::to_string(sample), unknown, 0);
      if (HasFatalFailure()) return;
      journey.assess();
    }
  }
}

TEST_P(LinearisationCacheTest, WhatHasChangedIsEvaluatedAgain) {
  Journey journey(model_, 5);
  RandomProblem::RheSpec spec;
  spec.intervals = 12;
  const auto problem = journey.random().rhe(spec);
  journey.begin(*problem, Hessian::gauss_newton);
  ASSERT_TRUE(journey.move(0));
  journey.compare("as it was", 0, 0);
  journey.point().state(4)[0] += 1e-9;  // what interval 4 starts from, and 3 leads to
  journey.compare("a state", 2, 1);
  journey.point().control(7)[0] += 1e-9;
  journey.compare("an input", 1, 0);
  problem->set_duration(9, 1.5 * problem->duration(9));
  journey.compare("a duration", 1, 0);
  journey.remembering().forget();
  journey.compare("all, after it has forgotten", 12, 13);
}

std::vector<std::string> all_models() { return Host().names(PluginKind::model); }
INSTANTIATE_TEST_SUITE_P(Models, LinearisationCacheTest, ::testing::ValuesIn(all_models()));

TEST(LinearisationCache, OfAHorizonWithoutIntervals) {
  const Host host;
  RandomProblem random(host.make_model("bicycle_slip"), 7);
  const auto problem = random.rhc({});
  Iterate point = RandomProblem::cold_start(*problem);
  problem->set_intervals(0);
  std::vector<double> scratch(problem->scratch_size());
  problem->finish(scratch);
  const auto remembering = problem->make_linearisation();
  Linearisation plain(*problem);
  for (int repeat = 0; repeat < 3; ++repeat) {
    for (Linearisation* each : {remembering.get(), &plain}) {
      each->prepare(point, Hessian::exact);
      each->refresh(point);
    }
    expect_same(remembering->qp(), plain.qp(), "repeat " + std::to_string(repeat));
    remembering->linearise_for_residual(point, Hessian::exact);
  }
}

}  // namespace horizon_linearisation_test
}  // namespace rhec
