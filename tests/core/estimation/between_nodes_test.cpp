// Measurements between nodes, and measurements that come in any order: what filters, banks and windows make of them.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <random>
#include <vector>

#include "rhec/core/estimation/bank_estimation.hpp"
#include "rhec/core/estimation/banked_covariance.hpp"
#include "rhec/core/estimation/estimator.hpp"
#include "rhec/core/estimation/filter_estimation.hpp"
#include "rhec/core/estimation/prior_horizon_estimation.hpp"
#include "support/bank_case.hpp"
#include "support/linear_case.hpp"

namespace rhec {
namespace between_nodes_test {

using namespace testing;

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr int room = 16;

/// What a stream of sensors says: rows with stamps.
struct Row {
  double stamp = 0.0, arrival = 0.0;
  bool is_input = false;
  std::vector<double> values;
};

/// A drive of a linear model with an encoder at 20 Hz (the last output), positions at 5 Hz beside the grid, and inputs
/// at 10 Hz.
std::vector<Row> stream(const Model& model, double seconds, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  const testing::Noise noise = noise_of(model);
  const int nx = model.state_count(), nu = model.input_count(), ny = model.output_count();
  std::vector<double> x(nx, 0.0), next(nx), u(nu), p(model.parameter_count(), 0.3), y(ny);
  std::vector<Row> rows;
  const int ticks = static_cast<int>(seconds / 0.01);
  for (int k = 0; k <= ticks; ++k) {
    const double time = 0.01 * k;
    if (k % 10 == 0) {
      for (double& value : u) value = normal(random);
      Row row{time, time, true, u};
      for (int j = 0; j < nu; ++j) row.values[j] += noise.inputs[j] * normal(random);
      rows.push_back(row);
    }
    const bool encoder = k % 5 == 0, fix = k > 0 && k % 20 == 7;
    if (encoder || fix) {
      model.observe({.count = 1, .states = x.data(), .outputs = y.data()});
      Row row{time, time, false, std::vector<double>(ny, nan)};
      for (int j = 0; j < ny; ++j)
        if ((j == ny - 1 && encoder) || (j < ny - 1 && fix)) row.values[j] = y[j] + noise.outputs[j] * normal(random);
      rows.push_back(row);
    }
    const double step = 0.01;
    model.integrate({.count = 1,
                     .states = x.data(),
                     .inputs = u.data(),
                     .parameters = p.data(),
                     .durations = &step,
                     .next_states = next.data()});
    x = next;
  }
  return rows;
}

constexpr int horizon = 8;

FilterEstimation::Setup filter_setup(const Model& model) {
  const testing::Noise noise = noise_of(model);
  FilterEstimation::Setup setup;
  for (const double sigma : noise.outputs) setup.noise.output_variances.push_back(sigma * sigma);
  for (const double sigma : noise.inputs) setup.noise.input_variances.push_back(sigma * sigma);
  setup.noise.parameter_lower.assign(model.parameter_count(), -infinity);
  setup.noise.parameter_upper.assign(model.parameter_count(), infinity);
  setup.walk.assign(model.parameter_count(), 0.1);
  setup.initial_mean = initial_mean(model);
  setup.initial_covariance = initial_covariance(model);
  setup.most_between = room;
  setup.remembered_nodes = horizon + 3;
  return setup;
}

BankEstimation::Setup bank_estimation_setup(const Model& model, std::vector<PriorCombination> members) {
  BankEstimation::Setup setup;
  setup.bank = bank_setup(model, std::move(members));
  setup.bank.memory = 3.0;
  setup.bank.most_between = room;
  setup.initial_state = initial_mean(model).head(model.state_count());
  setup.initial_covariance = initial_covariance(model).topLeftCorner(model.state_count(), model.state_count());
  setup.parameter_lower.assign(model.parameter_count(), -infinity);
  setup.parameter_upper.assign(model.parameter_count(), infinity);
  setup.remembered_nodes = horizon + 3;
  return setup;
}

RheProblem::Setup problem_setup(const Model& model, int intervals) {
  RheProblem::Setup setup = linear_setup(model, intervals, ArrivalKind::ekf, {}).problem;
  setup.most_between = room;
  return setup;
}

std::unique_ptr<EstimationMethod> window_of_blocks(const std::shared_ptr<const Model>& model, ArrivalKind arrival,
                                                   const std::string& name, const std::string& options) {
  RecedingHorizonEstimation::Setup setup =
      linear_setup(*model, horizon, arrival,
                   std::vector<std::shared_ptr<const Blocking>>(model->parameter_count(), blocking(name, options)));
  setup.problem.most_between = room;
  return std::make_unique<RecedingHorizonEstimation>(model, gn_rti(), setup);
}

std::unique_ptr<EstimationMethod> window_of_priors(const std::shared_ptr<const Model>& model, int intervals,
                                                   std::vector<PriorCombination> members) {
  return std::make_unique<PriorHorizonEstimation>(
      model, gn_rti(),
      PriorHorizonEstimation::Setup{.filters = bank_estimation_setup(*model, std::move(members)),
                                    .problem = problem_setup(*model, intervals)});
}

/// Pushes rows in the order of their arrival, and asks whenever a grid of 0.1 s has passed.
void drive(Estimator& estimator, std::vector<Row> rows, double until) {
  std::stable_sort(rows.begin(), rows.end(), [](const Row& a, const Row& b) { return a.arrival < b.arrival; });
  double asked = 0.1;
  for (const Row& row : rows) {
    while (row.arrival > asked + 1e-9) {
      estimator.estimate(asked);
      estimator.prepare();
      asked += 0.1;
    }
    if (row.is_input)
      estimator.push_input(row.stamp, row.values.data());
    else
      estimator.push_measurement(row.stamp, row.values.data());
  }
  estimator.estimate(until);
}

/// Largest difference, in standard deviations.
double difference(const Estimate& a, const Estimate& b) {
  Eigen::VectorXd means(a.state.size() + a.parameters.size());
  means << a.state - b.state, a.parameters - b.parameters;
  const Eigen::VectorXd sigma = b.covariance.diagonal().cwiseSqrt();
  const double largest = (means.array() / sigma.array()).abs().maxCoeff();
  const Eigen::MatrixXd scaled =
      ((a.covariance - b.covariance).array() / (sigma * sigma.transpose()).array()).abs().matrix();
  return std::max(largest, scaled.maxCoeff());
}

/// Conditions [x; p; u] of an interval on all measurements within it at once, by the textbook's matrices.
class DenseFilter {
 public:
  DenseFilter(const std::shared_ptr<const Model>& model, const FilterEstimation::Setup& setup)
      : model_(model), setup_(setup), mean(setup.initial_mean), covariance(setup.initial_covariance) {}

  void update(const std::vector<double>& y) {
    const Step here = at(mean.head(nx()), Eigen::VectorXd::Zero(nu()), mean.tail(np()), 0.0);
    std::vector<Eigen::VectorXd> rows;
    std::vector<double> innovations, variances;
    collect(here, y, Eigen::MatrixXd::Identity(nx(), nx() + np()), rows, innovations, variances);
    condition(mean, covariance, rows, innovations, variances);
  }
  void predict(double duration, const std::vector<double>& u, const BetweenNodes& between) {
    const Eigen::Index n = nx() + np(), a = n + nu();
    Eigen::VectorXd z = Eigen::VectorXd::Zero(a);
    Eigen::MatrixXd P = Eigen::MatrixXd::Zero(a, a);
    z.head(n) = mean;
    z.tail(nu()) = Eigen::Map<const Eigen::VectorXd>(u.data(), nu());
    P.topLeftCorner(n, n) = covariance;
    for (Eigen::Index j = 0; j < nu(); ++j) P(n + j, n + j) = setup_.noise.input_variances[j];
    std::vector<Eigen::VectorXd> rows;
    std::vector<double> innovations, variances;
    for (int k = 0; k < between.count(); ++k) {
      const Step there = at(z.head(nx()), z.tail(nu()), z.segment(nx(), np()), between.time(k));
      const std::vector<double> y(between.outputs(k), between.outputs(k) + model_->output_count());
      collect(there, y, there.jacobian, rows, innovations, variances);
    }
    condition(z, P, rows, innovations, variances);
    const Step end = at(z.head(nx()), z.tail(nu()), z.segment(nx(), np()), duration);
    Eigen::MatrixXd T = Eigen::MatrixXd::Zero(n, a);
    T.topRows(nx()) = end.jacobian;
    T.block(nx(), nx(), np(), np()).setIdentity();
    mean << end.state, z.segment(nx(), np());
    covariance = T * P * T.transpose();
    for (Eigen::Index j = 0; j < np(); ++j) covariance(nx() + j, nx() + j) += setup_.walk[j] * setup_.walk[j];
  }

 private:
  struct Step {
    Eigen::VectorXd state;
    Eigen::MatrixXd jacobian;  ///< by [x; p; u]
  };
  Eigen::Index nx() const { return model_->state_count(); }
  Eigen::Index nu() const { return model_->input_count(); }
  Eigen::Index np() const { return model_->parameter_count(); }
  Step at(const Eigen::VectorXd& x, const Eigen::VectorXd& u, const Eigen::VectorXd& p, double time) const {
    Step step{Eigen::VectorXd(nx()), Eigen::MatrixXd(nx(), nx() + np() + nu())};
    Eigen::MatrixXd J(nx(), nx() + nu() + np());
    model_->integrate({.count = 1,
                       .states = x.data(),
                       .inputs = u.data(),
                       .parameters = p.data(),
                       .durations = &time,
                       .next_states = step.state.data(),
                       .jacobians = J.data()});
    step.jacobian << J.leftCols(nx()), J.rightCols(np()), J.middleCols(nx(), nu());
    return step;
  }
  void collect(const Step& step, const std::vector<double>& y, const Eigen::MatrixXd& transition,
               std::vector<Eigen::VectorXd>& rows, std::vector<double>& innovations,
               std::vector<double>& variances) const {
    Eigen::VectorXd h(model_->output_count());
    Eigen::MatrixXd C(model_->output_count(), nx());
    model_->observe({.count = 1, .states = step.state.data(), .outputs = h.data(), .jacobians = C.data()});
    for (Eigen::Index j = 0; j < h.size(); ++j) {
      if (std::isnan(y[j])) continue;
      rows.emplace_back((C.row(j) * transition).transpose());
      innovations.push_back(y[j] - h[j]);
      variances.push_back(setup_.noise.output_variances[j]);
    }
  }
  static void condition(Eigen::VectorXd& z, Eigen::MatrixXd& P, const std::vector<Eigen::VectorXd>& rows,
                        const std::vector<double>& innovations, const std::vector<double>& variances) {
    const auto count = static_cast<Eigen::Index>(rows.size());
    if (count == 0) return;
    Eigen::MatrixXd H(count, z.size());
    for (Eigen::Index i = 0; i < count; ++i) H.row(i) = rows[i].transpose();
    Eigen::MatrixXd S = H * P * H.transpose();
    for (Eigen::Index i = 0; i < count; ++i) S(i, i) += variances[i];
    const Eigen::MatrixXd gain = S.ldlt().solve(H * P).transpose();
    z += gain * Eigen::Map<const Eigen::VectorXd>(innovations.data(), count);
    P -= gain * H * P;
  }
  std::shared_ptr<const Model> model_;
  FilterEstimation::Setup setup_;

 public:
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;
};

/// A run of intervals with measurements between their nodes.
struct Course {
  std::vector<double> outputs;
  struct Interval {
    double duration;
    std::vector<double> inputs, outputs;
    BetweenNodes between;
  };
  std::vector<Interval> intervals;
};

Course course_of(const Model& model, int count, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  const auto draw = [&](int size, double missing) {
    std::vector<double> values(size);
    for (double& value : values) value = std::abs(normal(random)) < missing ? nan : normal(random);
    return values;
  };
  Course run{draw(model.output_count(), 0.3), {}};
  for (int i = 0; i < count; ++i) {
    Course::Interval interval{0.2 + 0.05 * (i % 3), draw(model.input_count(), 0.0), draw(model.output_count(), 0.8),
                              BetweenNodes(model.output_count(), room)};
    const int between = static_cast<int>(random() % 6);
    for (int k = 0; k < between; ++k) {
      const std::vector<double> y = draw(model.output_count(), 0.6);
      std::copy(y.begin(), y.end(), interval.between.add(interval.duration * (k + 0.7) / (between + 0.7)));
    }
    run.intervals.push_back(interval);
  }
  return run;
}

TEST(BetweenNodes, AFilterConditionsTheWholeIntervalOnThem) {
  const auto model = linear_model<Hovercraft>();
  const FilterEstimation::Setup setup = filter_setup(*model);
  FilterEstimation filter(model, setup);
  DenseFilter dense(model, setup);
  const Course run = course_of(*model, 30, 3);
  filter.start(run.outputs.data());
  dense.update(run.outputs);
  Estimate own = empty_estimate(*model), expected = own;
  for (const Course::Interval& interval : run.intervals) {
    filter.add(interval.between.over(interval.duration, interval.inputs.data()), interval.outputs.data());
    dense.predict(interval.duration, interval.inputs, interval.between);
    dense.update(interval.outputs);
    filter.estimate(own, Clock::time_point::max());
    expected.state = dense.mean.head(4);
    expected.parameters = dense.mean.tail(2);
    expected.covariance = dense.covariance;
    ASSERT_LT(difference(own, expected), 1e-9);
  }
}

/// The window's problem, solved at once, against the filters' recursion: of any prior, ramped or held.
TEST(BetweenNodes, AWindowIsTheFilterOfItsPrior) {
  const auto model = linear_model<Hovercraft>();
  for (const PriorCombination& member : linear_priors()) {
    for (const int intervals : {1, 3, 9}) {
      const auto window = window_of_priors(model, intervals, {member});
      BankEstimation bank(model, bank_estimation_setup(*model, {member}));
      const Course run = course_of(*model, 25, 5);
      window->start(run.outputs.data());
      bank.start(run.outputs.data());
      Estimate own = empty_estimate(*model), expected = own;
      for (const Course::Interval& interval : run.intervals) {
        for (EstimationMethod* each : {window.get(), static_cast<EstimationMethod*>(&bank)})
          each->add(interval.between.over(interval.duration, interval.inputs.data()), interval.outputs.data());
        window->estimate(own, Clock::time_point::max());
        bank.estimate(expected, Clock::time_point::max());
        ASSERT_FALSE(own.fallback);
        ASSERT_LT(difference(own, expected), 1e-7) << intervals;
      }
    }
  }
}

/// With random walks on every interval, or one value and no walk, blocks are the filter: by either arrival cost.
TEST(BetweenNodes, AWindowOfBlocksIsTheFilter) {
  const auto model = linear_model<Hovercraft>();
  for (const bool walks : {true, false}) {
    for (const ArrivalKind arrival : {ArrivalKind::ekf, ArrivalKind::smoothing}) {
      FilterEstimation::Setup setup = filter_setup(*model);
      setup.walk.assign(2, walks ? 0.2 : 0.0);
      FilterEstimation filter(model, setup);
      const auto window = walks ? window_of_blocks(model, arrival, "unblocked", "{neighbour_sigma: 0.2}")
                                : window_of_blocks(model, arrival, "full_horizon", "{}");
      const Course run = course_of(*model, 25, 5);
      window->start(run.outputs.data());
      filter.start(run.outputs.data());
      Estimate own = empty_estimate(*model), expected = own;
      int k = 0;
      for (const Course::Interval& interval : run.intervals) {
        // A filter's walk comes behind an interval, that of blocks before it: the first interval has none.
        for (EstimationMethod* each : {window.get(), static_cast<EstimationMethod*>(&filter)})
          each->add(interval.between.over(interval.duration, interval.inputs.data()), interval.outputs.data());
        window->estimate(own, Clock::time_point::max());
        window->prepare();
        filter.estimate(expected, Clock::time_point::max());
        for (int j = 4; j < 6; ++j) expected.covariance(j, j) -= setup.walk[j - 4] * setup.walk[j - 4];
        ASSERT_FALSE(own.fallback);
        ASSERT_LT(difference(own, expected), 1e-7) << walks << ", at " << k++;
      }
    }
  }
}

/// However measurements and inputs come, up to the whole window late: from their arrival on, all is as if they had come
/// in time.
TEST(LateData, CountFromTheirStampOn) {
  const auto model = linear_model<Hovercraft>();
  struct Way {
    const char* name;
    std::function<std::unique_ptr<EstimationMethod>()> make;
  };
  const std::vector<Way> ways{
      {"ekf", [&] { return std::make_unique<FilterEstimation>(model, filter_setup(*model)); }},
      {"bank", [&] { return std::make_unique<BankEstimation>(model, bank_estimation_setup(*model, linear_priors())); }},
      {"rhe", [&] { return window_of_priors(model, horizon, linear_priors()); }},
      {"unblocked", [&] { return window_of_blocks(model, ArrivalKind::ekf, "unblocked", "{neighbour_sigma: 0.2}"); }},
      {"one block, smoothing", [&] { return window_of_blocks(model, ArrivalKind::smoothing, "full_horizon", "{}"); }},
      {"blocks", [&] {
         return window_of_blocks(model, ArrivalKind::ekf, "structured",
                                 "{size: 3, overlap: 2, transition: ramp, neighbour_sigma: 0.2}");
       }}};
  for (const Way& way : ways) {
    for (unsigned seed = 1; seed <= 4; ++seed) {
      const double until = 4.0;
      const std::vector<Row> in_time = stream(*model, until, seed);
      std::vector<Row> late = in_time;
      std::mt19937 random(100 + seed);
      std::uniform_real_distribution<double> delay(0.0, 0.2 * (horizon - 1));
      // All of the first window has come before it is full.
      for (Row& row : late)
        if (random() % 3 == 0) row.arrival = std::min(row.stamp + delay(random), until);
      Estimator one(way.make(), {.longest_interval = 0.2}), other(way.make(), {.longest_interval = 0.2});
      drive(one, in_time, until);
      drive(other, late, until);
      EXPECT_GT(other.counts().late, 20) << way.name;
      EXPECT_EQ(other.counts().dropped, 0) << way.name;
      EXPECT_EQ(other.counts().nodes, one.counts().nodes) << way.name;
      const Estimate a = one.estimate(until), b = other.estimate(until);
      EXPECT_FALSE(a.fallback || b.fallback);
      EXPECT_LT(difference(b, a), 1e-6) << way.name << ", seed " << seed;
      const auto* first = dynamic_cast<const WindowedEstimation*>(&one.method());
      const auto* second = dynamic_cast<const WindowedEstimation*>(&other.method());
      if (!first) continue;
      ASSERT_EQ(first->window().first, second->window().first) << way.name;
      ASSERT_EQ(first->window().intervals, second->window().intervals) << way.name;
      const double least = a.covariance.diagonal().cwiseSqrt().minCoeff();
      for (int i = 0; i <= first->window().intervals; ++i)
        for (int j = 0; j < 4; ++j)
          EXPECT_NEAR(first->solution().state(i)[j], second->solution().state(i)[j], 1e-6 * least)
              << way.name << ", node " << i;
    }
  }
}

}  // namespace between_nodes_test
}  // namespace rhec
