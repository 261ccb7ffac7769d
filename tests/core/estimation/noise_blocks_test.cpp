// Noise-blocked estimation on linear problems: blocks of one interval are a Kalman filter, and any blocks the dense
// least squares over all that was measured, whatever the horizon.
#include "core/estimation/noise_blocks.hpp"

#include <gtest/gtest.h>

#include <Eigen/QR>
#include <cmath>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "rhec/core/base/error.hpp"
#include "rhec/core/model/state_noise_model.hpp"
#include "support/error_of.hpp"
#include "support/linear_case.hpp"

namespace rhec {
namespace noise_blocks_test {

using namespace rhec::testing;
using Blocked = RecedingHorizonEstimation::Setup::BlockedNoise;

/// Hovercraft with process noise of its states 1 and 2, of which nothing is measured: 0 stands for it.
struct Drive {
  std::shared_ptr<const Model> model = std::make_shared<StateNoiseModel>(linear_model<Hovercraft>(), std::vector{1, 2});
  std::vector<Sample> samples;
  Drive(int steps, bool equal) : samples(simulate(*model, steps, equal, 11)) {
    for (Sample& sample : samples)
      for (std::size_t j = 2; j < sample.inputs.size(); ++j) sample.inputs[j] = 0.0;
  }
};

/// For the noise of a state: the absolute start of the block that an interval belongs to.
using Starts = int (*)(int interval);
int each(int interval) { return interval; }
int threes(int interval) { return interval - interval % 3; }
int whole(int) { return 0; }

/// Least squares over all that was measured up to a node, by one QR factorisation: every state is a linear function of
/// the first one, the parameters, and the inputs of intervals and of blocks of them.
void solve_densely(const Drive& drive, int last, const std::map<int, Starts>& blocks, ReferenceFilter& result) {
  const Model& model = *drive.model;
  const int nx = model.state_count(), nu = model.input_count(), np = model.parameter_count(), ny = model.output_count();
  const Noise noise = noise_of(model);
  const int unknowns = nx + np + last * nu;
  // An input that shares its value with those of a block has the column of the block's first interval.
  const auto column = [&](int interval, int j) {
    const auto found = blocks.find(j);
    return nx + np + (found == blocks.end() ? interval : found->second(interval)) * nu + j;
  };
  std::vector<Eigen::VectorXd> rows;
  std::vector<double> right;
  const auto add = [&](const Eigen::VectorXd& row, double value) {
    rows.push_back(row);
    right.push_back(value);
  };
  Eigen::MatrixXd state = Eigen::MatrixXd::Identity(nx, unknowns);
  Eigen::VectorXd offset = Eigen::VectorXd::Zero(nx);
  const Eigen::MatrixXd root = initial_covariance(model).inverse().llt().matrixU();
  const Eigen::VectorXd mean = root * initial_mean(model);
  for (int r = 0; r < nx + np; ++r) {
    Eigen::VectorXd row = Eigen::VectorXd::Zero(unknowns);
    row.head(nx + np) = root.row(r).transpose();
    add(row, mean[r]);
  }
  const std::vector<double> zero(nx + nu + np, 0.0);
  for (int k = 0; k <= last; ++k) {
    const Sample& sample = drive.samples[k];
    if (k > 0) {
      std::vector<double> drift(nx), jacobian(nx * (nx + nu + np));
      model.integrate({.count = 1,
                       .states = zero.data(),
                       .inputs = zero.data(),
                       .parameters = zero.data(),
                       .durations = &sample.duration,
                       .next_states = drift.data(),
                       .jacobians = jacobian.data()});
      const Eigen::Map<const Eigen::MatrixXd> J(jacobian.data(), nx, nx + nu + np);
      state = (J.leftCols(nx) * state).eval();
      offset = (J.leftCols(nx) * offset + Eigen::Map<const Eigen::VectorXd>(drift.data(), nx)).eval();
      state.middleCols(nx, np) += J.rightCols(np);
      for (int j = 0; j < nu; ++j) {
        state.col(column(k - 1, j)) += J.col(nx + j);
        Eigen::VectorXd row = Eigen::VectorXd::Zero(unknowns);
        row[column(k - 1, j)] = 1.0 / noise.inputs[j];
        add(row, sample.inputs[j] / noise.inputs[j]);
      }
    }
    std::vector<double> outputs(ny), jacobian(ny * nx);
    model.observe({.count = 1, .states = zero.data(), .outputs = outputs.data(), .jacobians = jacobian.data()});
    const Eigen::Map<const Eigen::MatrixXd> H(jacobian.data(), ny, nx);
    for (int j = 0; j < ny; ++j)
      if (!std::isnan(sample.outputs[j]))
        add((H.row(j) * state).transpose() / noise.outputs[j],
            (sample.outputs[j] - outputs[j] - H.row(j).dot(offset)) / noise.outputs[j]);
  }
  // Columns of intervals that share another one's value are empty: their own value does not matter.
  for (int c = 0; c < unknowns; ++c) {
    bool used = false;
    for (const Eigen::VectorXd& row : rows) used |= row[c] != 0.0;
    if (used) continue;
    Eigen::VectorXd row = Eigen::VectorXd::Zero(unknowns);
    row[c] = 1.0;
    add(row, 0.0);
  }
  Eigen::MatrixXd A(rows.size(), unknowns);
  for (std::size_t r = 0; r < rows.size(); ++r) A.row(static_cast<Eigen::Index>(r)) = rows[r].transpose();
  const Eigen::HouseholderQR<Eigen::MatrixXd> qr(A);
  const Eigen::VectorXd solution =
      qr.solve(Eigen::Map<const Eigen::VectorXd>(right.data(), static_cast<Eigen::Index>(right.size())));
  Eigen::MatrixXd wanted = Eigen::MatrixXd::Zero(nx + np, unknowns);
  wanted.topRows(nx) = state;
  wanted.block(nx, nx, np, np).setIdentity();
  Eigen::VectorXd found = wanted * solution;
  found.head(nx) += offset;
  const Eigen::MatrixXd R = qr.matrixQR().topRows(unknowns).triangularView<Eigen::Upper>();
  const Eigen::MatrixXd spread = R.transpose().triangularView<Eigen::Lower>().solve(wanted.transpose());
  result.mean = found.cast<long double>();
  result.covariance = (spread.transpose() * spread).cast<long double>();
}

RecedingHorizonEstimation estimation_of(const Drive& drive, int horizon, ArrivalKind arrival,
                                        std::vector<Blocked> noises, const std::string& solver = "{mode: rti}") {
  RecedingHorizonEstimation::Setup setup =
      linear_setup(*drive.model, horizon, arrival, {blocking("full_horizon"), blocking("full_horizon")});
  setup.noises = std::move(noises);
  return {drive.model, gn_rti(solver), std::move(setup)};
}

/// The largest deviation of a run from what `reference` gives at each step.
template <class Reference>
double worst_of(RecedingHorizonEstimation method, const Drive& drive, bool prepares, const Reference& reference) {
  Estimate estimate = empty_estimate(*drive.model);
  double worst = 0.0;
  for (int k = 0; k < std::ssize(drive.samples); ++k) {
    const Sample& sample = drive.samples[k];
    if (k == 0) method.start(sample.outputs.data());
    if (k > 0) method.add_node(sample.duration, sample.inputs.data(), sample.outputs.data());
    method.estimate(estimate, Clock::time_point::max());
    if (prepares) method.prepare();
    EXPECT_EQ(estimate.parameters.size(), 2) << "noise is no parameter of the vehicle";
    worst = std::max(worst, estimate.fallback ? HUGE_VAL : deviation(estimate, reference(k)));
  }
  return worst;
}

template <class Check>
void for_each_way(const Check& check) {
  for (const int horizon : {1, 2, 5, 9, 40})
    for (const ArrivalKind arrival : {ArrivalKind::ekf, ArrivalKind::smoothing})
      for (const bool equal : {true, false})
        for (const bool prepares : {false, true}) {
          SCOPED_TRACE("horizon " + std::to_string(horizon) + ", arrival " + std::to_string(static_cast<int>(arrival)) +
                       ", equal intervals " + std::to_string(equal) + ", prepares " + std::to_string(prepares));
          check(horizon, arrival, equal, prepares);
        }
}

TEST(NoiseBlocks, OfOneIntervalAreAKalmanFilter) {
  for_each_way([](int horizon, ArrivalKind arrival, bool equal, bool prepares) {
    const Drive drive(30, equal);
    ReferenceFilter filter(*drive.model, noise_of(*drive.model), {{.size = 0}, {.size = 0}});
    const auto reference = [&](int k) -> const ReferenceFilter& {
      if (k > 0) filter.predict(k - 1, drive.samples[k]);
      filter.update(drive.samples[k]);
      return filter;
    };
    std::vector<Blocked> noises{{1, blocking("unblocked")}, {2, blocking("structured", "{size: 1}")}};
    if (horizon == 9) noises.erase(noises.begin());  // one is an input still
    EXPECT_LE(worst_of(estimation_of(drive, horizon, arrival, noises), drive, prepares, reference), 1e-9);
  });
}

TEST(NoiseBlocks, AreTheDenseLeastSquaresOfAllBlocksWhateverTheHorizon) {
  const Drive drives[] = {Drive(30, false), Drive(30, true)};
  for (const bool is_whole : {false, true}) {
    std::vector<std::vector<ReferenceFilter>> solutions(2);
    for (const bool equal : {false, true})
      for (int k = 0; k < std::ssize(drives[equal].samples); ++k) {
        ReferenceFilter& now =
            solutions[equal].emplace_back(*drives[equal].model, noise_of(*drives[equal].model), std::vector<Change>(2));
        solve_densely(drives[equal], k, {{2, is_whole ? whole : threes}, {3, whole}}, now);
      }
    for_each_way([&](int horizon, ArrivalKind arrival, bool equal, bool prepares) {
      const auto reference = [&](int k) -> const ReferenceFilter& { return solutions[equal][k]; };
      const std::vector<Blocked> noises{{1, is_whole ? blocking("full_horizon") : blocking("structured", "{size: 3}")},
                                        {2, blocking("full_horizon")}};
      EXPECT_LE(worst_of(estimation_of(drives[equal], horizon, arrival, noises), drives[equal], prepares, reference),
                1e-8);
    });
  }
}

// A window as long as the run holds all blocks: suppressed starts at its end do not matter once they exist.
TEST(NoiseBlocks, OverlapJoinsTheNewestBlockToTheOneBefore) {
  const Drive drive(12, true);
  ReferenceFilter dense(*drive.model, noise_of(*drive.model), std::vector<Change>(2));
  const auto joined = [](int interval) { return interval < 9 ? threes(interval) : 6; };
  solve_densely(drive, 11, {{2, joined}}, dense);
  RecedingHorizonEstimation method =
      estimation_of(drive, 12, ArrivalKind::ekf, {{1, blocking("structured", "{size: 3, overlap: 3}")}});
  Estimate estimate = empty_estimate(*drive.model);
  for (int k = 0; k <= 11; ++k) {
    if (k == 0) method.start(drive.samples[k].outputs.data());
    if (k > 0) method.add_node(0.2, drive.samples[k].inputs.data(), drive.samples[k].outputs.data());
    method.estimate(estimate, Clock::time_point::max());
  }
  EXPECT_LE(deviation(estimate, dense), 1e-8);
}

TEST(NoiseBlocks, RefuseWhatTheyAreNot) {
  const Drive drive(3, true);
  const auto told = [&](Blocked noise) {
    return error_of([&] { estimation_of(drive, 3, ArrivalKind::ekf, {std::move(noise)}); });
  };
  EXPECT_NE(told({0, blocking("unblocked")}).find("'x0' has no process noise"), std::string::npos);
  EXPECT_NE(told({1, blocking("structured", "{transition: ramp}")}).find("'x1_noise': blocks of process noise jump"),
            std::string::npos);
  EXPECT_NE(told({1, blocking("unblocked", "{neighbour_sigma: 0.1}")}).find("neighbour_sigma"), std::string::npos);
  EXPECT_NE(told({1, blocking("structured", "{size: 2, anchor: horizon}")}).find("anchor: time"), std::string::npos);
  EXPECT_NE(told({1, blocking("structured", "{size: 2, overlap: 4}")}).find("overlap"), std::string::npos);
}

}  // namespace noise_blocks_test
}  // namespace rhec
