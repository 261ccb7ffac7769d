#include "drive_innovations.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include <Eigen/Cholesky>

#include "rhec/core/base/angle.hpp"
#include "rhec/core/estimation/measurement.hpp"

namespace rhec::sim {
namespace {

// Beyond so many standard deviations a measurement is not used, this often in a row at most.
constexpr double farthest = 5.0;
constexpr int most_refused = 10;
// Times closer than this are one [s].
constexpr double same_time = 1e-7;

/// An estimation method that is asked, before each measurement, what it expects.
class AskedMethod final : public EstimationMethod {
 public:
  AskedMethod(std::unique_ptr<EstimationMethod> method, std::vector<Sensor> sensors, std::vector<double> variances,
              std::vector<AskedInnovation>& innovations)
      : method_(std::move(method)),
        sensors_(std::move(sensors)),
        variances_(std::move(variances)),
        innovations_(innovations),
        refused_(sensors_.size(), 0),
        told_(sensors_.size(), -1.0),
        predicted_(variances_.size()),
        jacobian_(predicted_.size() * static_cast<std::size_t>(method_->model().state_count())),
        nothing_(predicted_.size(), missing_value),
        no_input_(static_cast<std::size_t>(method_->model().input_count()), missing_value) {}

  const Model& model() const noexcept override { return method_->model(); }
  int substeps() const noexcept override { return method_->substeps(); }
  int most_between() const noexcept override { return method_->most_between(); }
  int reach() const noexcept override { return method_->reach(); }
  int most_reach() const noexcept override { return method_->most_reach(); }
  void start(Measured outputs) noexcept override {
    times_.assign(1, 0.0);
    method_->start(outputs);
  }
  void rewind(int nodes) noexcept override {
    method_->rewind(nodes);
    times_.resize(times_.size() - std::min(times_.size(), static_cast<std::size_t>(nodes)));
  }
  void add(const MeasuredInterval& interval, Measured outputs) noexcept override {
    const double start = times_.back();
    if (interval.duration > 0.0) {
      between_.assign(interval.outputs,
                      interval.outputs + static_cast<std::size_t>(interval.between) * nothing_.size());
      for (int j = 0; j < interval.between; ++j) {
        double* const row = between_.data() + static_cast<std::size_t>(j) * nothing_.size();
        method_->add({interval.times[j], interval.inputs, j, interval.times, between_.data(), interval.weights},
                     nothing_.data());
        ask(start + interval.times[j], row, interval.measured(j, std::ssize(nothing_)).weights);
        method_->rewind(1);
      }
      method_->add(
          {interval.duration, interval.inputs, interval.between, interval.times, between_.data(), interval.weights},
          nothing_.data());
      times_.push_back(start + interval.duration);
    }
    node_.assign(outputs.values, outputs.values + nothing_.size());
    if (std::ranges::all_of(node_, [](double value) { return std::isnan(value); })) return;
    ask(times_.back(), node_.data(), outputs.weights);
    method_->add_node(0.0, no_input_.data(), {node_.data(), outputs.weights});
  }
  void estimate(Estimate& result, Clock::time_point deadline) noexcept override { method_->estimate(result, deadline); }
  void reset() noexcept override {
    method_->reset();
    times_.clear();
  }

 private:
  /// Notes what the newest node expects of outputs at its time, and takes those away that are not to be used.
  void ask(double time, double* outputs, const double* weights) {
    method_->estimate(expected_, Clock::time_point::max());
    const Model& m = model();
    const Eigen::Index ny = m.output_count(), nx = m.state_count();
    m.observe(
        {.count = 1, .states = expected_.state.data(), .outputs = predicted_.data(), .jacobians = jacobian_.data()});
    const Eigen::Map<const Eigen::MatrixXd> H(jacobian_.data(), ny, nx);
    const auto P = expected_.covariance.topLeftCorner(nx, nx);
    for (std::size_t s = 0; s < sensors_.size(); ++s) {
      std::vector<int> measured;
      for (const int j : sensors_[s].outputs)
        if (!std::isnan(outputs[j])) measured.push_back(j);
      if (measured.empty()) continue;
      const auto n = std::ssize(measured);
      Eigen::VectorXd error(n);
      Eigen::MatrixXd S(n, n);
      for (Eigen::Index a = 0; a < n; ++a) {
        const auto j = static_cast<std::size_t>(measured[static_cast<std::size_t>(a)]);
        error[a] = m.description().outputs[j].is_angle ? angle_difference(outputs[j], predicted_[j])
                                                       : outputs[j] - predicted_[j];
        for (Eigen::Index b = 0; b < n; ++b)
          S(a, b) = H.row(measured[static_cast<std::size_t>(a)]) * P *
                    H.row(measured[static_cast<std::size_t>(b)]).transpose();
        S(a, a) += variances_[j] / (weights ? weights[j] : 1.0);
      }
      const Eigen::LLT<Eigen::MatrixXd> factor(S);
      Innovation innovation{.size = static_cast<int>(n), .squared = squared_of_lost, .log_determinant = 0.0};
      // A filter that has lost its way expected nothing of the kind.
      if (factor.info() == Eigen::Success && S.allFinite() && error.allFinite()) {
        innovation.squared = factor.matrixL().solve(error).squaredNorm();
        innovation.log_determinant = 2.0 * factor.matrixLLT().diagonal().array().log().sum();
      }
      note(time, static_cast<int>(s), innovation);
      if (is_refused(time, static_cast<int>(s), innovation))
        for (const int j : measured) outputs[j] = missing_value;
    }
  }

  /// A node that gave way to a later one is made again: what was said first counts.
  void note(double time, int sensor, const Innovation& innovation) {
    double& told = told_[static_cast<std::size_t>(sensor)];
    if (time < told + same_time) return;
    told = time;
    innovations_.push_back({.time = time, .sensor = sensor, .innovation = innovation});
    int& refused = refused_[static_cast<std::size_t>(sensor)];
    const bool is_far = innovation.squared > farthest * farthest * innovation.size && refused < most_refused;
    refused = is_far ? refused + 1 : 0;
    if (is_far) refusals_.emplace_back(time, sensor);
  }

  bool is_refused(double time, int sensor, const Innovation& innovation) const {
    if (innovation.squared >= squared_of_lost) return true;
    return std::any_of(refusals_.rbegin(), refusals_.rend(), [&](const std::pair<double, int>& each) {
      return each.second == sensor && std::abs(each.first - time) < same_time;
    });
  }

  std::unique_ptr<EstimationMethod> method_;
  std::vector<Sensor> sensors_;
  std::vector<double> variances_;
  std::vector<AskedInnovation>& innovations_;
  std::vector<double> times_;                     ///< of the nodes, from the first one on [s]
  std::vector<int> refused_;                      ///< by sensor, in a row
  std::vector<double> told_;                      ///< by sensor, up to when
  std::vector<std::pair<double, int>> refusals_;  ///< times and sensors
  std::vector<double> predicted_, jacobian_, nothing_, no_input_, between_, node_;
  Estimate expected_;
};

class AskingHooks final : public RobotHooks {
 public:
  AskingHooks(const Robot& robot, std::vector<AskedInnovation>& innovations) : innovations_(innovations) {
    for (const double sigma : robot.output_sigmas()) variances_.push_back(sigma * sigma);
    sensors_ = sensors_of(robot.model()->description(), variances_);
  }
  std::unique_ptr<EstimationMethod> wrap_method(std::unique_ptr<EstimationMethod> method) const override {
    return std::make_unique<AskedMethod>(std::move(method), sensors_, variances_, innovations_);
  }

 private:
  std::vector<AskedInnovation>& innovations_;
  std::vector<double> variances_;
  std::vector<Sensor> sensors_;
};

}  // namespace

std::vector<AskedInnovation> asked_innovations(const Robot& robot, const logs::Drive& drive, const HoldOut& withheld,
                                               const std::optional<Eigen::VectorXd>& simulated_start) {
  std::vector<AskedInnovation> innovations;
  LoopHooks hooks;
  hooks.robot = std::make_shared<AskingHooks>(robot, innovations);
  const DriveReplay replay = replay_drive(robot, drive, withheld, simulated_start, hooks);
  for (AskedInnovation& each : innovations) each.time += replay.start;
  return innovations;
}

}  // namespace rhec::sim
