// What the headers promise to programs with several threads: one host, model, path, blocking and problem serve all of
// them, and solvers, estimators and controllers of their own never disturb each other. The preset `tsan` runs this
// under ThreadSanitizer; here and there every thread must find the very bits that are found without the others.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <functional>
#include <latch>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "rhec/core/control/path.hpp"
#include "rhec/core/control/path_follower.hpp"
#include "rhec/plugins/robot/robot.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "support/random_problem.hpp"

namespace rhec {
namespace threads_test {

using testing::RandomProblem;
using Numbers = std::vector<double>;

constexpr int threads = 4;

const Host& host() {
  static const Host found;
  return found;
}

/// Calls a function on all threads at once.
void at_once(const std::function<void(int)>& function) {
  std::latch start(threads);
  std::vector<std::thread> running;
  for (int i = 0; i < threads; ++i)
    running.emplace_back([&, i] {
      start.arrive_and_wait();
      function(i);
    });
  for (std::thread& thread : running) thread.join();
}

bool same_bits(const Numbers& a, const Numbers& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(double)) == 0;
}

/// Each thread must find what was found alone.
void expect_the_same_on_all(const std::function<Numbers()>& work, const std::string& what) {
  const Numbers alone = work();
  EXPECT_FALSE(alone.empty()) << what;
  std::vector<Numbers> found(threads);
  at_once([&](int thread) { found[thread] = work(); });
  for (int i = 0; i < threads; ++i) EXPECT_TRUE(same_bits(found[i], alone)) << what << ", thread " << i;
}

TEST(Threads, ShareAHostFromItsFirstUseOn) {
  const Host fresh;
  std::vector<std::vector<std::string>> names(threads);
  std::vector<std::shared_ptr<Model>> models(threads);
  at_once([&](int thread) {
    names[thread] = fresh.names(PluginKind::solver);
    models[thread] = fresh.make_model("bicycle_slip");
    for (const std::string& blocking : {std::string("full_horizon"), std::string("unblocked")})
      fresh.make_blocking(blocking);
  });
  for (int i = 0; i < threads; ++i) {
    EXPECT_FALSE(names[i].empty());
    EXPECT_EQ(names[i], names[0]);
    ASSERT_NE(models[i], nullptr);
    EXPECT_EQ(models[i]->state_count(), 4);
  }
}

TEST(Threads, ShareEveryModel) {
  for (const std::string& name : host().names(PluginKind::model)) {
    const std::shared_ptr<const Model> model = host().make_model(name);
    const int nx = model->state_count(), nu = model->input_count(), np = model->parameter_count(),
              ny = model->output_count(), nz = nx + nu + np;
    const auto evaluate = [&] {
      constexpr int count = 24;
      Numbers x, u, p, durations(count, 0.1), multipliers(count * nx, 0.5), output_multipliers(count * ny, -0.5);
      for (int i = 0; i < count; ++i) {
        for (int j = 0; j < nx; ++j) x.push_back(0.3 * std::sin(i + j));
        for (int j = 0; j < nu; ++j) u.push_back(1.0 + 0.2 * std::cos(i - j));
        for (int j = 0; j < np; ++j) p.push_back(0.4 + 0.1 * std::sin(i * j));
      }
      Numbers next(count * nx), jacobians(count * nx * nz), hessians(count * nz * nz), outputs(count * ny),
          output_jacobians(count * ny * nx), output_hessians(count * nx * nx);
      for (int repeat = 0; repeat < 20; ++repeat) {
        model->integrate({.count = count,
                          .states = x.data(),
                          .inputs = u.data(),
                          .parameters = p.data(),
                          .durations = durations.data(),
                          .substeps = 2,
                          .next_states = next.data(),
                          .jacobians = jacobians.data(),
                          .multipliers = multipliers.data(),
                          .hessians = hessians.data()});
        model->observe({.count = count,
                        .states = x.data(),
                        .outputs = outputs.data(),
                        .jacobians = output_jacobians.data(),
                        .multipliers = output_multipliers.data(),
                        .hessians = output_hessians.data()});
      }
      Numbers all;
      for (const Numbers* part : {&next, &jacobians, &hessians, &outputs, &output_jacobians, &output_hessians})
        all.insert(all.end(), part->begin(), part->end());
      return all;
    };
    expect_the_same_on_all(evaluate, name);
  }
}

TEST(Threads, ShareAPathAndABlocking) {
  std::vector<Waypoint> waypoints;
  for (int i = 0; i <= 200; ++i) waypoints.push_back({0.5 * i, 2.0 * std::sin(0.1 * i), 1.0});
  const Path path(waypoints);
  const auto blocking = host().make_blocking("structured", parse_yaml("{size: 4, overlap: 2}", "blocking"));
  const auto look = [&] {
    Numbers found;
    std::vector<std::uint8_t> begins(12);
    PathFollower follower(path);
    for (int i = 0; i < 150; ++i) {
      const PathPoint point = path.point_at(0.6 * i);
      found.insert(found.end(),
                   {point.x, point.y, point.heading, point.speed, follower.advance(point.x, point.y + 0.3)});
      found.push_back(path.closest(point.x, point.y + 1.0, 0.0, path.length()).arc_length);
      found.push_back(static_cast<double>(blocking->starts({.first = i, .intervals = 12}, begins.data())));
      found.insert(found.end(), begins.begin(), begins.end());
    }
    return found;
  };
  expect_the_same_on_all(look, "path and blocking");
}

/// The numbers of a point that a problem uses.
Numbers numbers_of(const Ocp& ocp, const Iterate& point) {
  Numbers all;
  for (int i = 0; i <= ocp.intervals(); ++i) {
    all.insert(all.end(), point.state(i), point.state(i) + ocp.state_count(i));
    all.insert(all.end(), point.costate(i), point.costate(i) + ocp.state_count(i));
    if (i < ocp.intervals()) all.insert(all.end(), point.control(i), point.control(i) + ocp.control_count(i));
  }
  return all;
}

/// An estimator's problem and a controller's.
std::vector<std::unique_ptr<HorizonProblem>> problems() {
  RandomProblem random(host().make_model("bicycle_slip"), 11);
  RandomProblem::RheSpec rhe;
  rhe.block = 3;
  std::vector<std::unique_ptr<HorizonProblem>> both;
  both.push_back(random.rhe(rhe));
  both.push_back(random.rhc({}));
  return both;
}

TEST(Threads, EvaluateOneProblem) {
  for (const auto& problem : problems()) {
    const Iterate start = RandomProblem::cold_start(*problem);
    const auto evaluate = [&] {
      StageQp qp(problem->capacity());
      Numbers scratch(problem->scratch_size()),
          defects(static_cast<std::size_t>(problem->intervals()) * problem->capacity().states), all;
      Iterate point = start;
      for (int repeat = 0; repeat < 10; ++repeat) {
        all.push_back(problem->evaluate(point, defects.data(), scratch));
        for (const Hessian hessian : {Hessian::gauss_newton, Hessian::exact})
          all.push_back(problem->linearise({0, problem->intervals()}, point, hessian, qp, scratch));
        for (int i = 0; i < problem->intervals(); ++i)
          all.insert(all.end(), qp.b(i), qp.b(i) + problem->capacity().states);
        point.control(repeat)[0] += 0.01;
      }
      return all;
    };
    expect_the_same_on_all(evaluate, std::string(problem->kind()));
  }
}

TEST(Threads, SolveOneProblemWithASolverEach) {
  for (const auto& problem : problems()) {
    const Iterate start = RandomProblem::cold_start(*problem);
    for (const std::string& name : host().names(PluginKind::solver)) {
      if (!host().make_solver(name)->why_not(*problem).empty()) continue;
      const auto solve = [&] {
        const std::shared_ptr<Solver> solver = host().make_solver(name);
        solver->setup(*problem);
        Numbers all;
        for (int repeat = 0; repeat < 3; ++repeat) {
          Iterate point = start;
          solver->prepare(point);
          solver->solve(point);
          const Numbers found = numbers_of(*problem, point);
          all.insert(all.end(), found.begin(), found.end());
        }
        return all;
      };
      expect_the_same_on_all(solve, name + ", " + std::string(problem->kind()));
    }
  }
}

TEST(Threads, DriveVehiclesOfTheirOwnWithOneRobot) {
  const Robot robot(host(), RobotOptions::table().parse(
                                parse_yaml("{model: bicycle_slip, blocking: {kappa: {name: structured, size: 3}},"
                                           " estimator: {horizon: 8}, controller: {horizon: 8}}",
                                           "robot.yaml"),
                                "robot"));
  const Path path({{0.0, 0.0, 2.0}, {8.0, 0.0, 2.0}, {12.0, 4.0, 2.0}, {40.0, 4.0, 2.0}});
  const auto drive = [&] {
    const auto estimator = robot.make_estimator();
    const auto controller = robot.make_controller(path);
    const Model& model = *robot.model();
    Numbers state{0.0, 0.4, 0.1, 0.0}, next(4), outputs(model.output_count()), all;
    const Numbers slip{0.8, 0.7};
    const double step = robot.step();
    for (int k = 0; k < 40; ++k) {
      model.observe({.count = 1, .states = state.data(), .outputs = outputs.data()});
      estimator->push_measurement(k * step, outputs.data());
      const Controller::Command& command = controller->control(estimator->estimate(k * step));
      all.insert(all.end(), command.inputs.begin(), command.inputs.end());
      model.integrate({.count = 1,
                       .states = state.data(),
                       .inputs = command.inputs.data(),
                       .parameters = slip.data(),
                       .durations = &step,
                       .next_states = next.data()});
      state = next;
      estimator->push_input(k * step, command.inputs.data());
      estimator->prepare();
      controller->prepare();
    }
    return all;
  };
  expect_the_same_on_all(drive, "closed loop");
}

}  // namespace threads_test
}  // namespace rhec
