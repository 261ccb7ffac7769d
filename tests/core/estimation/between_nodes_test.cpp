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
  std::vector<double> values, sigmas = {};  ///< of outputs; none: as usual
};

/// A drive of a linear model with an encoder at 20 Hz (the last output), positions at 5 Hz beside the grid, each as
/// accurate as it says, and inputs at 10 Hz.
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
      Row row{time, time, false, std::vector<double>(ny, nan), std::vector<double>(ny, nan)};
      for (int j = 0; j < ny; ++j) {
        if (!((j == ny - 1 && encoder) || (j < ny - 1 && fix))) continue;
        row.sigmas[j] = noise.outputs[j] * (random() % 3 == 0 ? 1.0 : std::exp(normal(random)));
        row.values[j] = y[j] + row.sigmas[j] * normal(random);
      }
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
      estimator.push_measurement(row.stamp, row.values.data(), row.sigmas.empty() ? nullptr : row.sigmas.data());
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

  void update(Measured y) {
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
      collect(there, between.measured(k), there.jacobian, rows, innovations, variances);
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
  void collect(const Step& step, Measured y, const Eigen::MatrixXd& transition, std::vector<Eigen::VectorXd>& rows,
               std::vector<double>& innovations, std::vector<double>& variances) const {
    Eigen::VectorXd h(model_->output_count());
    Eigen::MatrixXd C(model_->output_count(), nx());
    model_->observe({.count = 1, .states = step.state.data(), .outputs = h.data(), .jacobians = C.data()});
    for (Eigen::Index j = 0; j < h.size(); ++j) {
      if (std::isnan(y[j])) continue;
      rows.emplace_back((C.row(j) * transition).transpose());
      innovations.push_back(y[j] - h[j]);
      variances.push_back(setup_.noise.output_variances[j] / y.weight(j));
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
  MeasuredOutputs outputs;
  struct Interval {
    double duration;
    std::vector<double> inputs;
    MeasuredOutputs outputs;
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
  // Some say how accurate they are.
  const auto measure = [&](double missing) {
    const std::vector<double> y = draw(model.output_count(), missing);
    std::vector<double> weights(y.size(), 1.0);
    for (double& weight : weights)
      if (random() % 2 == 0) weight = std::exp(normal(random));
    MeasuredOutputs measured(model.output_count());
    measured.assign({y.data(), random() % 2 == 0 ? weights.data() : nullptr});
    return measured;
  };
  Course run{measure(0.3), {}};
  for (int i = 0; i < count; ++i) {
    Course::Interval interval{0.2 + 0.05 * (i % 3), draw(model.input_count(), 0.0), measure(0.8),
                              BetweenNodes(model.output_count(), room)};
    const int between = static_cast<int>(random() % 6);
    for (int k = 0; k < between; ++k) {
      interval.between.add(interval.duration * (k + 0.7) / (between + 0.7));
      interval.between.add_outputs(k, measure(0.6).measured());
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
  filter.start(run.outputs.measured());
  dense.update(run.outputs.measured());
  Estimate own = empty_estimate(*model), expected = own;
  for (const Course::Interval& interval : run.intervals) {
    filter.add(interval.between.over(interval.duration, interval.inputs.data()), interval.outputs.measured());
    dense.predict(interval.duration, interval.inputs, interval.between);
    dense.update(interval.outputs.measured());
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
      window->start(run.outputs.measured());
      bank.start(run.outputs.measured());
      Estimate own = empty_estimate(*model), expected = own;
      for (const Course::Interval& interval : run.intervals) {
        for (EstimationMethod* each : {window.get(), static_cast<EstimationMethod*>(&bank)})
          each->add(interval.between.over(interval.duration, interval.inputs.data()), interval.outputs.measured());
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
      window->start(run.outputs.measured());
      filter.start(run.outputs.measured());
      Estimate own = empty_estimate(*model), expected = own;
      int k = 0;
      for (const Course::Interval& interval : run.intervals) {
        // A filter's walk comes behind an interval, that of blocks before it: the first interval has none.
        for (EstimationMethod* each : {window.get(), static_cast<EstimationMethod*>(&filter)})
          each->add(interval.between.over(interval.duration, interval.inputs.data()), interval.outputs.measured());
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

/// Estimators of one model, by name.
struct Way {
  const char* name;
  std::function<std::unique_ptr<EstimationMethod>()> make;
};

/// Two estimators of each kind get the same rows, one of them in time. From the arrival on, all is the same, to a
/// tolerance in standard deviations.
void expect_same(const std::vector<Way>& ways, const std::vector<Row>& in_time, unsigned seed, double until,
                 double tolerance) {
  std::vector<Row> late = in_time;
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> delay(0.0, 0.2 * (horizon - 1));
  for (Row& row : late)
    if (random() % 3 == 0) row.arrival = std::min(row.stamp + delay(random), until);
  for (const Way& way : ways) {
    SCOPED_TRACE(way.name);
    std::unique_ptr<EstimationMethod> method = way.make();
    const Estimator::Timeline timeline{.longest_interval = 0.2, .output_sigmas = noise_of(method->model()).outputs};
    Estimator one(std::move(method), timeline), other(way.make(), timeline);
    drive(one, in_time, until);
    drive(other, late, until);
    EXPECT_GT(other.counts().late, 20);
    EXPECT_EQ(other.counts().dropped, 0);
    EXPECT_EQ(other.counts().nodes, one.counts().nodes);
    const Estimate a = one.estimate(until), b = other.estimate(until);
    EXPECT_FALSE(a.fallback || b.fallback);
    EXPECT_LT(difference(b, a), tolerance);
    const auto* first = dynamic_cast<const WindowedEstimation*>(&one.method());
    const auto* second = dynamic_cast<const WindowedEstimation*>(&other.method());
    if (!first) continue;
    ASSERT_EQ(first->window().first, second->window().first);
    ASSERT_EQ(first->window().intervals, second->window().intervals);
    const double least = a.covariance.diagonal().cwiseSqrt().minCoeff();
    for (int i = 0; i <= first->window().intervals; ++i)
      for (int j = 0; j < 4; ++j)
        EXPECT_NEAR(first->solution().state(i)[j], second->solution().state(i)[j], tolerance * least) << "node " << i;
  }
}

/// However measurements and inputs come, up to the whole window late.
TEST(LateData, CountFromTheirStampOn) {
  const auto model = linear_model<Hovercraft>();
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
  for (unsigned seed = 1; seed <= 4; ++seed) expect_same(ways, stream(*model, 4.0, seed), 100 + seed, 4.0, 1e-6);
}

/// A bicycle weaves over ground whose slip varies; GPS at 5 Hz, an encoder of the steering at some rate, both inputs at
/// 10 Hz.
struct Weave {
  double seconds, encoder;  ///< duration, and period of the encoder [s]
  std::shared_ptr<const Model> model = host().make_model("bicycle_slip");
  std::vector<Row> rows = {};
  std::vector<double> kappas = {};  ///< every 0.2 s

  Weave(double length, double period, unsigned seed) : seconds(length), encoder(period) {
    std::mt19937 random(seed), of_encoder(seed + 1000);
    std::normal_distribution<double> normal;
    std::vector<double> x(4, 0.0), next(4), y(3);
    const double step = 0.01;
    const int between_readings = static_cast<int>(std::lround(encoder / step));
    double way = 0.0;
    for (int k = 0; k <= static_cast<int>(seconds / step); ++k) {
      const double time = step * k, u[] = {2.0, 0.25 * std::cos(0.9 * time)};
      const double p[] = {0.75 + 0.12 * std::sin(0.3 * way), 0.9};
      if (k % 10 == 0) rows.push_back({time, time, true, {u[0] + 0.05 * normal(random), u[1] + 0.02 * normal(random)}});
      model->observe({.count = 1, .states = x.data(), .outputs = y.data()});
      const double reading = y[2] + 0.01 * normal(of_encoder);
      if (k % 20 == 0) {
        rows.push_back({time, time, false, {y[0] + 0.03 * normal(random), y[1] + 0.03 * normal(random), nan}});
        kappas.push_back(p[0]);
      }
      if (k % between_readings == 0) rows.push_back({time, time, false, {nan, nan, reading}});
      model->integrate({.count = 1,
                        .states = x.data(),
                        .inputs = u,
                        .parameters = p,
                        .durations = &step,
                        .next_states = next.data()});
      way += std::hypot(next[0] - x[0], next[1] - x[1]);
      x = next;
    }
  }
};

/// Windows and filters for the weaving bicycle.
struct Bicycle {
  std::shared_ptr<const Model> model = host().make_model("bicycle_slip");
  std::string solver;
  int intervals;

  BankEstimation::Setup filters() const {
    ModelDescription about = model->description();
    BankEstimation::Setup setup;
    setup.bank.members = standard_bank(about);
    setup.bank.output_variances = {9e-4, 9e-4, 1e-4};
    setup.bank.input_variances = {2.5e-3, 4e-4};
    setup.bank.most_between = 32;
    setup.parameter_lower = {0.1, 0.1};
    setup.parameter_upper = {1.0, 1.0};
    setup.initial_state = Eigen::Vector4d::Zero();
    setup.initial_covariance = 0.01 * Eigen::Matrix4d::Identity();
    setup.remembered_nodes = intervals + 3;
    return setup;
  }
  RheProblem::Setup problem() const {
    RheProblem::Setup setup;
    setup.max_intervals = intervals;
    setup.most_between = 32;
    for (const double variance : filters().bank.output_variances) setup.output_weights.push_back(1.0 / variance);
    for (const double variance : filters().bank.input_variances) setup.input_weights.push_back(1.0 / variance);
    setup.parameter_lower = filters().parameter_lower;
    setup.parameter_upper = filters().parameter_upper;
    return setup;
  }
  std::unique_ptr<EstimationMethod> bank() const { return std::make_unique<BankEstimation>(model, filters()); }
  std::unique_ptr<EstimationMethod> priors() const {
    return std::make_unique<PriorHorizonEstimation>(
        model, gn_rti(solver), PriorHorizonEstimation::Setup{.filters = filters(), .problem = problem()});
  }
  std::unique_ptr<EstimationMethod> blocks() const {
    RecedingHorizonEstimation::Setup setup;
    setup.problem = problem();
    setup.blockings = {blocking("structured", "{size: 2, overlap: 4}"), blocking("full_horizon")};
    setup.walks.assign(2, {});
    setup.initial_mean = Eigen::VectorXd::Zero(6);
    setup.initial_mean.tail(2).setConstant(0.8);
    setup.initial_covariance = 0.01 * Eigen::MatrixXd::Identity(6, 6);
    return std::make_unique<RecedingHorizonEstimation>(model, gn_rti(solver), setup);
  }
  std::unique_ptr<EstimationMethod> ekf() const {
    FilterEstimation::Setup setup;
    setup.noise = {filters().bank.output_variances, filters().bank.input_variances, filters().parameter_lower,
                   filters().parameter_upper};
    setup.walk.assign(2, 0.03);
    setup.initial_mean = Eigen::VectorXd::Zero(6);
    setup.initial_mean.tail(2).setConstant(0.8);
    setup.initial_covariance = 0.01 * Eigen::MatrixXd::Identity(6, 6);
    setup.most_between = 32;
    setup.remembered_nodes = intervals + 3;
    return std::make_unique<FilterEstimation>(model, setup);
  }
};

/// Of converged solves, where the model is not linear.
TEST(LateData, OfABicycleCountFromTheirStampOn) {
  const Bicycle bicycle{.solver = "{mode: converge, max_iterations: 60, tolerance: 1.0e-11}", .intervals = horizon};
  const std::vector<Way> ways{{"ekf", [&] { return bicycle.ekf(); }},
                              {"bank", [&] { return bicycle.bank(); }},
                              {"rhe", [&] { return bicycle.priors(); }},
                              {"blocks", [&] { return bicycle.blocks(); }}};
  for (unsigned seed = 1; seed <= 2; ++seed) expect_same(ways, Weave(6.0, 0.05, seed).rows, seed, 6.0, 1e-4);
}

/// Mean error of the speed factor once the window is full.
double kappa_error(const Weave& weave, std::unique_ptr<EstimationMethod> method, int from) {
  Estimator estimator(std::move(method), {.longest_interval = 0.2});
  double sum = 0.0;
  int count = 0;
  std::size_t next = 0;
  for (int k = 0; k < static_cast<int>(weave.kappas.size()); ++k) {
    for (; next < weave.rows.size() && weave.rows[next].stamp <= 0.2 * k + 1e-9; ++next) {
      const Row& row = weave.rows[next];
      if (row.is_input)
        estimator.push_input(row.stamp, row.values.data());
      else
        estimator.push_measurement(row.stamp, row.values.data());
    }
    const Estimate& estimate = estimator.estimate(0.2 * k);
    EXPECT_FALSE(estimate.fallback);
    if (k < from) continue;
    sum += std::abs(estimate.parameters[0] - weave.kappas[static_cast<std::size_t>(k)]);
    ++count;
  }
  return sum / count;
}

/// A quick sensor beside a slow one neither shortens the horizon nor adds to its nodes: slip is known as well as with
/// both at 5 Hz.
TEST(Rates, AnEncoderAt100HzDoesNotSpoilSlip) {
  const Bicycle bicycle{.solver = "{mode: rti}", .intervals = 15};
  for (const bool blocks : {false, true}) {
    double slow = 0.0, quick = 0.0;
    for (unsigned seed = 1; seed <= 4; ++seed) {
      const auto make = [&] { return blocks ? bicycle.blocks() : bicycle.priors(); };
      slow += 0.25 * kappa_error(Weave(40.0, 0.2, seed), make(), 25);
      quick += 0.25 * kappa_error(Weave(40.0, 0.01, seed), make(), 25);
    }
    RecordProperty(blocks ? "blocks_5Hz" : "priors_5Hz", std::to_string(slow));
    RecordProperty(blocks ? "blocks_100Hz" : "priors_100Hz", std::to_string(quick));
    EXPECT_LT(quick, 1.02 * slow) << "blocks " << blocks;
    EXPECT_LT(quick, 0.05);
  }
}

}  // namespace between_nodes_test
}  // namespace rhec
