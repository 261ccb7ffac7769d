// METHOD's Kalman test: a linear Gaussian problem without bounds is a Kalman filter, whatever the horizon.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>

#include "rhec/core/estimation/estimator.hpp"
#include "support/linear_case.hpp"

namespace rhec {
namespace receding_horizon_estimation_test {

using namespace rhec::testing;

constexpr double neighbour_variance = 0.04;

/// How a parameter is blocked, and what the reference filter has to do for it.
struct Parameter {
  std::string name, options;
  Change change;
  int size = 1, overlap = 0;
};
std::string link(const std::string& more = "") { return "neighbour_sigma: 0.2" + more; }
Parameter unblocked() { return {"unblocked", "{" + link() + "}", {1, neighbour_variance}}; }
Parameter structured(int size, int overlap) {
  return {"structured",
          "{size: " + std::to_string(size) + ", overlap: " + std::to_string(overlap) + ", " + link() + "}",
          {size, neighbour_variance},
          size,
          overlap};
}
Parameter full_horizon() { return {"full_horizon", "", {0}}; }
Parameter ramped(Parameter parameter) {
  parameter.options.insert(parameter.options.size() - 1, ", transition: ramp");
  parameter.change.ramp = true;
  return parameter;
}

enum class Way { method, prepared, estimator, prepared_estimator };

struct Case {
  std::shared_ptr<const Model> model;
  std::vector<Parameter> parameters;
  ArrivalKind arrival = ArrivalKind::ekf;
  std::string solver = "{mode: rti}";
  bool equal_intervals = true;
  Way way = Way::method;
  int horizon = 5;
  int steps = 40;
  double vagueness = 1.0;  ///< factor on the initial standard deviations
  double tolerance = 1e-9;
};

/// True where step k has a block whose start does not exist yet.
bool has_suppressed_start(const Case& run, int k) {
  for (const Parameter& p : run.parameters)
    for (int s = std::max(1, k - p.overlap + 1); s < k; ++s)
      if (p.overlap >= 2 && s % p.size == 0) return true;
  return false;
}

/// The largest deviation from the reference filter over a run.
double worst_of(const Case& run) {
  const Model& model = *run.model;
  std::vector<std::shared_ptr<const Blocking>> blockings;
  std::vector<Change> changes;
  for (const Parameter& p : run.parameters) {
    blockings.push_back(blocking(p.name, p.options));
    changes.push_back(p.change);
  }
  const std::vector<Sample> samples = simulate(model, run.steps, run.equal_intervals, 7u + run.horizon);
  ReferenceFilter reference(model, noise_of(model), changes);
  RecedingHorizonEstimation::Setup setup = linear_setup(model, run.horizon, run.arrival, blockings);
  const double factor = run.vagueness * run.vagueness;
  reference.covariance *= factor;
  setup.initial_covariance *= factor;
  auto method = std::make_unique<RecedingHorizonEstimation>(run.model, gn_rti(run.solver), setup);
  RecedingHorizonEstimation& direct = *method;
  const bool through_estimator = run.way == Way::estimator || run.way == Way::prepared_estimator;
  const bool prepares = run.way == Way::prepared || run.way == Way::prepared_estimator;
  // Its nodes are those of the samples, since these are one step apart.
  Estimator estimator(std::move(method), {.longest_interval = samples[1].duration});
  Estimate own = empty_estimate(model);
  double worst = 0.0, time = 0.0;
  for (int k = 0; k <= run.steps; ++k) {
    const Sample& sample = samples[k];
    if (k > 0) reference.predict(k - 1, sample);
    reference.update(sample);
    const Estimate* estimate = &own;
    if (through_estimator) {
      if (k > 0) estimator.push_input(time, sample.inputs.data());
      time += sample.duration;
      estimator.push_measurement(time, sample.outputs.data());
      estimate = &estimator.estimate(time);
      if (prepares) estimator.prepare();
    } else {
      if (k == 0) direct.start(sample.outputs.data());
      if (k > 0) direct.add_node(sample.duration, sample.inputs.data(), sample.outputs.data());
      direct.estimate(own, Clock::time_point::max());
      if (prepares) direct.prepare();
    }
    if (has_suppressed_start(run, k)) continue;
    const double now = estimate->fallback ? HUGE_VAL : deviation(*estimate, reference);
    if (now > run.tolerance && worst <= run.tolerance)
      ADD_FAILURE() << "first at step " << k << ": " << now << ", horizon " << run.horizon;
    worst = std::max(worst, now);
  }
  return worst;
}

/// Over all horizons, arrival costs, modes and ways. Small horizons get all of them, large ones take turns.
void expect_kalman(Case run, int least_horizon = 1) {
  double worst = 0.0;
  int turn = 0;
  for (int horizon = least_horizon; horizon <= 30; ++horizon) {
    run.horizon = horizon;
    run.steps = horizon + 30;
    for (const ArrivalKind arrival : {ArrivalKind::ekf, ArrivalKind::smoothing}) {
      for (const bool equal : {true, false}) {
        for (const std::string solver : {"{mode: rti}", "{mode: converge}"}) {
          // Rounding then stops a converging solver above its tolerance, and it reports that.
          if (run.tolerance > 1e-9 && solver != "{mode: rti}") continue;
          for (const Way way : {Way::method, Way::prepared, Way::estimator, Way::prepared_estimator}) {
            if (horizon > 4 && turn++ % 7 != 0) continue;
            const bool through_estimator = way == Way::estimator || way == Way::prepared_estimator;
            if (through_estimator && !equal) continue;
            run.arrival = arrival;
            run.equal_intervals = equal;
            run.solver = solver;
            run.way = way;
            const double now = worst_of(run);
            worst = std::max(worst, now);
            ASSERT_LE(now, run.tolerance)
                << "horizon " << horizon << ", arrival " << static_cast<int>(arrival) << ", equal intervals " << equal
                << ", solver " << solver << ", way " << static_cast<int>(way);
          }
        }
      }
    }
  }
  std::printf("worst deviation %.1e standard deviations\n", worst);
}

TEST(Kalman, WithoutParameters) { expect_kalman({linear_model<Trolley>(), {}}); }

TEST(Kalman, Unblocked) {
  expect_kalman({linear_model<Boat>(), {unblocked()}});
  expect_kalman({linear_model<Hovercraft>(), {unblocked(), unblocked()}});
}

TEST(Kalman, BlocksOfThree) {
  expect_kalman({linear_model<Boat>(), {structured(3, 0)}});
  expect_kalman({linear_model<Boat>(), {structured(3, 1)}});
  expect_kalman({linear_model<Hovercraft>(), {structured(3, 0), structured(3, 1)}});
}

TEST(Kalman, VagueAndSharpPriors) {
  for (const double vagueness : {1e-4, 1e-2, 30.0, 1000.0}) {
    Case run{linear_model<Hovercraft>(), {structured(3, 1), full_horizon()}};
    run.vagueness = vagueness;
    // An information recursion loses the rounding error times the ratio of the prior's variance to the measurements'.
    if (vagueness > 100.0) run.tolerance = 1e-6;
    expect_kalman(run);
  }
}

TEST(Kalman, OneValueForTheWholeHorizon) {
  expect_kalman({linear_model<Boat>(), {full_horizon()}});
  expect_kalman({linear_model<Hovercraft>(), {full_horizon(), full_horizon()}});
}

TEST(Kalman, AnotherBlockingForEachParameter) {
  expect_kalman({linear_model<Hovercraft>(), {structured(3, 1), full_horizon()}});
  expect_kalman({linear_model<Hovercraft>(), {structured(2, 0), structured(5, 1)}});
  expect_kalman({linear_model<Hovercraft>(), {full_horizon(), unblocked()}});
}

TEST(Kalman, OverlapWhereNoStartIsSuppressed) {
  for (const int overlap : {2, 3}) expect_kalman({linear_model<Boat>(), {structured(3, overlap)}}, overlap);
  for (const int overlap : {2, 3, 4, 5}) expect_kalman({linear_model<Boat>(), {structured(5, overlap)}}, overlap);
  expect_kalman({linear_model<Hovercraft>(), {structured(4, 2), structured(4, 3)}}, 3);
}

TEST(Kalman, RampsThatTheWindowsEdgePasses) {
  expect_kalman({linear_model<Boat>(), {ramped(unblocked())}});
  expect_kalman({linear_model<Boat>(), {ramped(structured(3, 0))}});
  expect_kalman({linear_model<Hovercraft>(), {ramped(structured(3, 1)), structured(2, 0)}});
  expect_kalman({linear_model<Hovercraft>(), {full_horizon(), ramped(unblocked())}});
}

}  // namespace receding_horizon_estimation_test
}  // namespace rhec
