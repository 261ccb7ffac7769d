// Smoothing a whole log: on a linear model with Gaussian noise it is the Rauch-Tung-Striebel smoother.
#include "rhec/core/estimation/full_information.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/LU>

#include <algorithm>
#include <cstdio>
#include <functional>
#include <memory>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "rhec/core/base/error.hpp"
#include "rhec/core/model/formula_model.hpp"
#include "support/error_of.hpp"
#include "support/linear_case.hpp"

namespace rhec {
namespace full_information_test {

using namespace rhec::testing;
using namespace std::string_literals;
using ::testing::HasSubstr;
using Matrix = ReferenceFilter::Matrix;
using Vector = ReferenceFilter::Vector;

struct Moments {
  Vector mean;
  Matrix covariance;
};

/// The textbook smoother (Rauch, Tung and Striebel 1965) on z = [x; p]: the filter forwards, then a backward pass with
/// the cross-covariance of each state and the next, which the filter's linear prediction gives column by column.
std::vector<Moments> rauch_tung_striebel(const Model& model, const std::vector<Change>& changes,
                                         const std::vector<Sample>& samples) {
  ReferenceFilter filter(model, noise_of(model), changes);
  std::vector<Moments> filtered, predicted;
  std::vector<Matrix> transitions;
  for (std::size_t k = 0; k < samples.size(); ++k) {
    if (k > 0) {
      const auto n = filter.mean.size();
      Matrix transition(n, n);
      ReferenceFilter at_zero(model, noise_of(model), changes);
      at_zero.mean = Vector::Zero(n);
      at_zero.predict(static_cast<int>(k) - 1, samples[k]);
      for (Eigen::Index c = 0; c < n; ++c) {
        ReferenceFilter at_unit(model, noise_of(model), changes);
        at_unit.mean = Vector::Unit(n, c);
        at_unit.predict(static_cast<int>(k) - 1, samples[k]);
        transition.col(c) = at_unit.mean - at_zero.mean;
      }
      transitions.push_back(transition);
      filter.predict(static_cast<int>(k) - 1, samples[k]);
      predicted.push_back({filter.mean, filter.covariance});
    }
    filter.update(samples[k]);
    filtered.push_back({filter.mean, filter.covariance});
  }
  std::vector<Moments> smoothed = filtered;
  for (std::size_t k = samples.size() - 1; k-- > 0;) {
    const Matrix gain =
        filtered[k].covariance * transitions[k].transpose() * predicted[k].covariance.fullPivLu().inverse();
    smoothed[k].mean += gain * (smoothed[k + 1].mean - predicted[k].mean);
    smoothed[k].covariance += gain * (smoothed[k + 1].covariance - predicted[k].covariance) * gain.transpose();
  }
  return smoothed;
}

std::shared_ptr<Solver> solver_of(const std::string& name, const std::string& options = "{}") {
  return host().make_solver(name, parse_yaml(options, "test"));
}
FullInformationEstimation::Setup setup_of(const Model& model, std::vector<std::shared_ptr<const Blocking>> blockings) {
  RecedingHorizonEstimation::Setup from = linear_setup(model, 1, ArrivalKind::constant, std::move(blockings));
  return {from.problem, from.blockings, from.walks, from.initial_mean, from.initial_covariance};
}

/// The largest deviation of means and covariances from the textbook smoother's, relative to its standard deviations.
/// Node 0's parameters belong to the first interval in both.
double deviation(const SmoothedRun& run, const Model& model, const std::vector<Moments>& reference) {
  const int nx = model.state_count(), np = model.parameter_count(), n = nx + np;
  double worst = 0.0;
  for (std::ptrdiff_t k = 0; k <= run.intervals(); ++k) {
    const Moments& expected = reference[k];
    const auto sigma = [&](int i) { return std::sqrt(static_cast<double>(expected.covariance(i, i))); };
    for (int r = 0; r < n; ++r) {
      const double value =
          r < nx ? run.states[k * nx + r] : run.parameters[std::max<std::ptrdiff_t>(k - 1, 0) * np + r - nx];
      worst = std::max(worst, std::abs(value - static_cast<double>(expected.mean[r])) / sigma(r));
      if (run.covariances.empty()) continue;
      for (int c = 0; c < n; ++c)
        worst = std::max(
            worst, std::abs(run.covariances[(k * n + c) * n + r] - static_cast<double>(expected.covariance(r, c))) /
                       (sigma(r) * sigma(c)));
    }
  }
  return worst;
}

struct Blocks {
  std::string name, options;
  Change change;
};
const Blocks unblocked{"unblocked", "{neighbour_sigma: 0.2}", {1, 0.04}};
const Blocks threes{"structured", "{size: 3, neighbour_sigma: 0.2}", {3, 0.04}};
const Blocks one_value{"full_horizon", "{}", {0}};

double worst_of(const std::shared_ptr<const Model>& model, const std::vector<Blocks>& blocks,
                const std::string& solver) {
  double worst = 0.0;
  for (unsigned seed = 0; seed < 6; ++seed) {
    const auto samples = simulate(*model, 12 + 9 * static_cast<int>(seed), seed % 2 == 0, 40 + seed);
    std::vector<std::shared_ptr<const Blocking>> blockings;
    std::vector<Change> changes;
    for (const Blocks& each : blocks) {
      blockings.push_back(blocking(each.name, each.options));
      changes.push_back(each.change);
    }
    const FullInformationEstimation smoother(model, solver_of(solver, solver == "gn_rti" ? "{mode: converge}" : "{}"),
                                             setup_of(*model, blockings));
    const SmoothedRun run = smoother.estimate(log_of(*model, samples));
    EXPECT_EQ(run.report.status, Status::solved) << seed;
    EXPECT_FALSE(run.covariances.empty());
    worst = std::max(worst, deviation(run, *model, rauch_tung_striebel(*model, changes, samples)));
  }
  std::printf("%s: worst deviation %.1e standard deviations\n", solver.c_str(), worst);
  return worst;
}

TEST(FullInformation, IsTheTextbooksSmoother) {
  for (const std::string solver : {"sparse_sqp", "gn_rti"}) {
    EXPECT_LT(worst_of(linear_model<Trolley>(), {}, solver), 1e-8);
    EXPECT_LT(worst_of(linear_model<Boat>(), {unblocked}, solver), 1e-8);
    EXPECT_LT(worst_of(linear_model<Boat>(), {threes}, solver), 1e-8);
    EXPECT_LT(worst_of(linear_model<Boat>(), {one_value}, solver), 1e-8);
    EXPECT_LT(worst_of(linear_model<Hovercraft>(), {threes, one_value}, solver), 1e-8);
  }
}

/// The boat with its input as a parameter, which is unblocked and walks.
template <class Scalar>
struct DriftingBoat {
  static constexpr int state_count = 3, input_count = 1, parameter_count = 2, output_count = 2;
  void dynamics(const Scalar* x, const Scalar* u, const Scalar* p, Scalar* dxdt) const {
    const Scalar acting[] = {u[0] + p[1]};
    Boat<Scalar>{}.dynamics(x, acting, p, dxdt);
  }
  void outputs(const Scalar* x, Scalar* y) const { Boat<Scalar>{}.outputs(x, y); }
};

TEST(FullInformation, TakesAnInputThatIsMissingForAParameterThatWalks) {
  const auto boat = linear_model<Boat>();
  ModelDescription about = boat->description();
  about.inputs[0].scale = 0.7;
  const auto model = std::make_shared<FormulaModel<Boat>>(Boat<double>{}, about);
  about.parameters.push_back(about.parameters[0]);
  const auto drifting = std::make_shared<FormulaModel<DriftingBoat>>(DriftingBoat<double>{}, about);
  auto samples = simulate(*boat, 30, true, 7);
  const double duration = samples[1].duration, scale = 0.7;
  for (std::size_t k = 1; k < samples.size(); ++k) samples[k].inputs[0] = nan;
  for (const char* solver : {"sparse_sqp", "gn_rti"}) {
    const auto made = [&] { return solver_of(solver, solver == "gn_rti"s ? "{mode: converge}" : "{}"); };
    const auto of_kappa = blocking("structured", "{size: 3, neighbour_sigma: 0.2}");
    const SmoothedRun run =
        FullInformationEstimation(model, made(), setup_of(*model, {of_kappa})).estimate(log_of(*model, samples));
    ASSERT_EQ(run.report.status, Status::solved);
    FullInformationEstimation::Setup setup = setup_of(
        *drifting,
        {of_kappa, blocking("unblocked", fmt::format("{{neighbour_sigma: {}}}", scale * std::sqrt(duration)))});
    setup.problem.input_weights = {1e16};
    setup.initial_mean.setZero();
    setup.initial_mean.head(4) = initial_mean(*model);
    setup.initial_covariance.setZero();
    setup.initial_covariance.topLeftCorner(4, 4) = initial_covariance(*model);
    setup.initial_covariance(4, 4) = scale * scale * (9.0 + duration);
    auto known = samples;
    for (std::size_t k = 1; k < samples.size(); ++k) known[k].inputs[0] = 0.0;
    const SmoothedRun expected = FullInformationEstimation(drifting, made(), setup).estimate(log_of(*drifting, known));
    ASSERT_EQ(expected.report.status, Status::solved);
    ASSERT_FALSE(run.covariances.empty());
    for (std::size_t i = 0; i < 30; ++i)
      EXPECT_NEAR(run.inputs[i], expected.parameters[2 * i + 1], 1e-6) << solver << ' ' << i;
    for (std::size_t i = 0; i <= 30; ++i) {
      for (std::size_t r = 0; r < 4; ++r) {
        const double value = r < 3 ? run.states[3 * i + r] : run.node_parameters[i],
                     wanted = r < 3 ? expected.states[3 * i + r] : expected.node_parameters[2 * i];
        EXPECT_NEAR(value, wanted, 1e-6) << solver << ' ' << i << ' ' << r;
        for (std::size_t c = 0; c < 4; ++c) {
          const double covariance = expected.covariances[i * 25 + c * 5 + r];
          EXPECT_NEAR(run.covariances[i * 16 + c * 4 + r], covariance, 1e-6) << solver << ' ' << i;
        }
      }
    }
  }
}

TEST(FullInformation, SaysWhatIsWrong) {
  const auto model = linear_model<Boat>();
  const auto good = setup_of(*model, {blocking("unblocked")});
  const auto with = [&](const std::function<void(FullInformationEstimation::Setup&)>& change, const NodeLog& log) {
    return error_of([&] {
      auto setup = good;
      change(setup);
      FullInformationEstimation(model, solver_of("sparse_sqp"), setup).estimate(log);
    });
  };
  const auto samples = simulate(*model, 5, true, 1);
  const NodeLog log = log_of(*model, samples);
  EXPECT_EQ(with([](auto&) {}, log), "");
  EXPECT_THAT(with([](auto&) {}, log_of(*model, {samples[0]})), HasSubstr("fewer than two nodes"));
  EXPECT_THAT(with([](auto& setup) { setup.blockings.clear(); }, log), HasSubstr("0 blockings"));
  EXPECT_THAT(with([](auto& setup) { setup.walks.push_back({}); }, log), HasSubstr("2 parameter walks"));
  EXPECT_THAT(with([](auto& setup) { setup.initial_mean.conservativeResize(3); }, log), HasSubstr("size 4"));
}

}  // namespace full_information_test
}  // namespace rhec
