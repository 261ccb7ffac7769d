#include "rhec/sim/replay/drive_replay.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <utility>

#include <Eigen/Cholesky>

#include "rhec/core/base/angle.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/core/base/infinity.hpp"
#include "rhec/core/estimation/measurement.hpp"
#include "rhec/core/model/motion_outputs.hpp"

namespace rhec::sim {
namespace {

constexpr double missing = std::numeric_limits<double>::quiet_NaN();
// Times closer than this are one [s].
constexpr double same_time = 1e-6;
// Longer than this without anything is the end of a drive, or a broken stamp [s].
constexpr double longest_silence = 3600.0;
// In a longer silence nothing is estimated: each estimate goes on from the last measurement, and takes longer than the
// one before it.
constexpr double longest_blind = 60.0;
constexpr double most_estimates = 2e7;

std::vector<Sensor> sensors_of(const Robot& robot) {
  std::vector<double> variances;
  for (const double sigma : robot.output_sigmas()) variances.push_back(sigma * sigma);
  return rhec::sensors_of(robot.model()->description(), variances);
}

/// The first value of each output in a drive, NaN of one that is never measured, and how long that is after the first
/// of all [s].
struct FirstOutputs {
  std::vector<double> values, ages;
  explicit FirstOutputs(const logs::Drive& drive)
      : values(static_cast<std::size_t>(drive.outputs), missing), ages(values.size()) {
    double start = missing;
    for (const logs::DriveEvent& event : drive.events) {
      if (!event.is_output) continue;
      if (std::isnan(start)) start = event.time;
      for (std::size_t j = 0; j < values.size(); ++j) {
        if (!std::isnan(values[j])) continue;
        values[j] = drive.values_of(event)[j];
        ages[j] = std::abs(event.time - start);
      }
    }
  }
};

/// Outputs of the state alone, and their derivatives (column-major), at a state.
struct Seen {
  std::vector<double> outputs, jacobian;
  Seen(const Model& model, const Eigen::VectorXd& state)
      : outputs(static_cast<std::size_t>(model.output_count())),
        jacobian(outputs.size() * static_cast<std::size_t>(model.state_count())) {
    Model::Nodes request;
    request.count = 1;
    request.states = state.data();
    request.outputs = outputs.data();
    request.jacobians = jacobian.data();
    model.observe(request);
  }
  double slope(std::size_t output, std::size_t state) const { return jacobian[state * outputs.size() + output]; }
};

/// Outputs of motion have no value at a state.
std::vector<bool> outputs_of_state(const Model& model) {
  std::vector<bool> of_state(static_cast<std::size_t>(model.output_count()), true);
  for (const int output : outputs_of_motion(model)) of_state[static_cast<std::size_t>(output)] = false;
  return of_state;
}

/// Whether a drive can have begun in a state: an output that was measured later may have changed as quickly as typical
/// inputs change it.
bool agrees(const Robot& robot, const FirstOutputs& first, const Eigen::VectorXd& state) {
  constexpr double most = 5.0;  // standard deviations
  const std::vector<double>& measured = first.values;
  const Model& model = *robot.model();
  double quickest = 0.0;
  for (const Variable& input : model.description().inputs) quickest = std::max(quickest, input.scale);
  const Seen seen(model, state);
  const std::vector<bool> of_state = outputs_of_state(model);
  for (std::size_t j = 0; j < measured.size(); ++j) {
    if (std::isnan(measured[j]) || !of_state[j]) continue;
    const double bias = robot.output_biases().empty() ? 0.0 : robot.output_biases()[j].sigma;
    const Variable& output = model.description().outputs[j];
    const double off = output.is_angle ? angle_difference(measured[j], seen.outputs[j]) : measured[j] - seen.outputs[j];
    const double spread = most * std::hypot(robot.output_sigmas()[j], bias);
    if (!(std::abs(off) <= spread + 2.0 * quickest * first.ages[j])) return false;
  }
  return true;
}

double log_determinant(const Innovation& innovation) {
  const Eigen::MatrixXd factor = innovation.covariance.llt().matrixL();
  return 2.0 * factor.diagonal().array().log().sum();
}

/// Pushes a drive into an estimator.
class Driver {
 public:
  Driver(const Robot& robot, const logs::Drive& drive, const HoldOut& hold_out, const Eigen::VectorXd& start,
         const LoopHooks& hooks)
      : robot_(robot),
        drive_(drive),
        hooks_(hooks),
        estimator_(with_hooks(robot, hooks, [this] { return estimator_->counts().nodes - 1; }).make_estimator(start)),
        outputs_(static_cast<std::size_t>(drive.outputs)) {
    result_.sensors = sensors_of(robot);
    if (hold_out.every > 0) withhold(hold_out);
  }
  Driver(const Driver&) = delete;  // the estimator's solver queries this object for the step
  Driver& operator=(const Driver&) = delete;

  DriveReplay run() {
    const auto begin = Clock::now();
    const auto first = std::find_if(drive_.events.begin(), drive_.events.end(),
                                    [](const logs::DriveEvent& event) { return event.is_output; });
    if (first == drive_.events.end()) throw Error("the log has no measurement of an output: nothing can be estimated");
    const double step = robot_.step(), start = first->time, end = drive_.events.back().arrival;
    check_length(start, end, step);
    for (std::int64_t k = 0;; ++k) {
      const double time = start + static_cast<double>(k) * step;
      advance_to(time);
      note(time);
      if (hooks_.progress) hooks_.progress(std::min(1.0, (time - start) / std::max(step, end - start)));
      if (next_ == drive_.events.size() && time > end - step + same_time) break;
      k = behind_silence(k, start, step);
      estimator_->prepare();
    }
    predict_until(infinity);
    estimator_->end_drive();
    result_.counts = estimator_->counts();
    result_.start = estimator_->start_time();
    result_.seconds = std::chrono::duration<double>(Clock::now() - begin).count();
    return std::move(result_);
  }

 private:
  /// The last of the times that a long silence leaves out; `k`, where there is none.
  std::int64_t behind_silence(std::int64_t k, double start, double step) const {
    if (next_ == 0 || next_ == drive_.events.size()) return k;
    const double last = drive_.events[next_ - 1].arrival, next = drive_.events[next_].arrival;
    const double time = start + static_cast<double>(k) * step;
    if (next - last < longest_blind || time - last < longest_blind) return k;
    return std::max(k, static_cast<std::int64_t>(std::ceil((next - start) / step)) - 1);
  }

  void check_length(double start, double end, double step) const {
    double last = start;
    for (const logs::DriveEvent& event : drive_.events) {
      if (event.arrival - last > longest_silence)
        throw Error(
            fmt::format("the log leaps from {} s to {} s; expected nothing to be silent for more than {} s; cut it "
                        "there, or name another clock: `signals.clock`",
                        last, event.arrival, longest_silence));
      last = event.arrival;
    }
    if ((end - start) / step > most_estimates)
      throw Error(
          fmt::format("the log has {:.4g} s, of which a step of {} s makes more than {:g} estimates; expected a "
                      "longer step, or a shorter log",
                      end - start, step, most_estimates));
  }

  /// Marks the measurements that are withheld.
  void withhold(const HoldOut& hold_out) {
    result_.withheld_sensor = sensor_to_withhold(robot_, result_.sensors);
    const std::vector<int>& outputs = sensor().outputs;
    std::size_t count = 0;
    for (std::size_t i = 0; i < drive_.events.size(); ++i) {
      const logs::DriveEvent& event = drive_.events[i];
      const double* values = drive_.values_of(event);
      if (!event.is_output || std::ranges::all_of(outputs, [&](int j) { return std::isnan(values[j]); })) continue;
      if (hold_out.holds(count++)) withheld_.push_back(i);
    }
    by_time_ = withheld_;
    std::stable_sort(by_time_.begin(), by_time_.end(),
                     [&](std::size_t a, std::size_t b) { return drive_.events[a].time < drive_.events[b].time; });
    // What is stamped late was measured before.
    const Settings& delays = robot_.estimator_options().delays;
    const Settings* const given =
        delays.find(robot_.model()->description().outputs[static_cast<std::size_t>(outputs.front())].name);
    if (given) delay_ = given->as_number();
  }

  const Sensor& sensor() const { return result_.sensors[static_cast<std::size_t>(result_.withheld_sensor)]; }

  void advance_to(double time) {
    for (; next_ < drive_.events.size() && drive_.events[next_].arrival <= time + same_time; ++next_) {
      predict_until(drive_.events[next_].arrival);
      push(next_);
    }
    predict_until(time);
  }

  void push(std::size_t index) {
    const logs::DriveEvent& event = drive_.events[index];
    const double* values = drive_.values_of(event);
    if (!event.is_output) return estimator_->push_input(event.time, values);
    std::copy_n(values, outputs_.size(), outputs_.begin());
    if (std::binary_search(withheld_.begin(), withheld_.end(), index))
      for (const int j : sensor().outputs) outputs_[static_cast<std::size_t>(j)] = missing;
    if (std::ranges::any_of(outputs_, [](double value) { return !std::isnan(value); }))
      estimator_->push_measurement(event.time, outputs_.data(), drive_.sigmas_of(event));
  }

  /// Predicts what is due before a time.
  void predict_until(double time) {
    for (; predicted_ < by_time_.size(); ++predicted_) {
      if (!(measured_at(by_time_[predicted_]) < time - same_time)) return;
      if (!estimator_->has_started()) {
        ++result_.unpredicted;
        continue;
      }
      predict(by_time_[predicted_]);
    }
  }

  /// When what is withheld was measured [s].
  double measured_at(std::size_t index) const { return drive_.events[index].time - delay_; }

  void predict(std::size_t index) {
    const logs::DriveEvent& event = drive_.events[index];
    const Estimate& estimate = estimator_->estimate(measured_at(index));
    const Model& model = estimator_->model();
    Model::Nodes request;
    request.count = 1;
    request.states = estimate.state.data();
    request.outputs = outputs_.data();
    model.observe(request);
    DrivePrediction prediction{.event = index, .time = measured_at(index), .residuals = {}, .distance = 0.0};
    double squares = 0.0;
    for (const int j : sensor().outputs) {
      const auto i = static_cast<std::size_t>(j);
      const double measured = drive_.values_of(event)[j];
      const double residual = model.description().outputs[i].is_angle && !std::isnan(measured)
                                  ? angle_difference(measured, outputs_[i])
                                  : measured - outputs_[i];
      prediction.residuals.push_back(residual);
      if (!std::isnan(residual)) squares += residual * residual;
    }
    prediction.distance = std::sqrt(squares);
    result_.predictions.push_back(std::move(prediction));
  }

  void note(double time) {
    const Estimate& estimate = estimator_->estimate(time);
    if (!estimator_->has_started()) return;
    const Eigen::Index nx = std::ssize(robot_.estimated_description().states), np = estimate.parameters.size();
    DriveEstimate entry;
    entry.time = time;
    // Behind the biases and scale errors there are values of motion, which are no result.
    entry.values.resize(nx + np);
    entry.values << estimate.state.head(nx), estimate.parameters;
    entry.sigmas.setConstant(nx + np, missing);
    if (estimate.covariance.size() > 0) {
      const auto sigmas = estimate.covariance.diagonal().cwiseMax(0.0).cwiseSqrt();
      entry.sigmas << sigmas.head(nx), sigmas.tail(np);
    }
    entry.health = estimate.health.level;
    entry.fallback = estimate.fallback;
    if (entry.health != HealthLevel::ok && estimator_->watch())
      entry.findings = estimator_->watch()->in_words(estimate.health);
    for (const Innovation& innovation : estimate.innovations) note(innovation);
    result_.solve_us.push_back(estimate.report.preparation_us + estimate.report.feedback_us);
    if (hooks_.sampled)
      hooks_.sampled({estimator_->counts().nodes - 1, time, estimator_.get(), &estimate, nullptr, nullptr});
    result_.estimates.push_back(std::move(entry));
  }

  void note(const Innovation& innovation) {
    DriveInnovation entry{.time = innovation.time,
                          .sensor = innovation.sensor,
                          .accepted = innovation.accepted,
                          .nis = innovation.nis,
                          .log_determinant = log_determinant(innovation),
                          .values = {},
                          .sigmas = {}};
    for (Eigen::Index j = 0; j < innovation.value.size(); ++j) {
      entry.values.push_back(innovation.value[j]);
      entry.sigmas.push_back(std::sqrt(std::max(0.0, innovation.covariance(j, j))));
    }
    result_.innovations.push_back(std::move(entry));
  }

  const Robot& robot_;
  const logs::Drive& drive_;
  const LoopHooks& hooks_;
  std::unique_ptr<Estimator> estimator_;
  std::vector<double> outputs_;
  std::vector<std::size_t> withheld_, by_time_;  ///< events, in the order of arrival and of time
  std::size_t next_ = 0, predicted_ = 0;
  double delay_ = 0.0;  ///< of the sensor that is withheld [s]
  DriveReplay result_;
};

}  // namespace

int sensor_to_withhold(const Robot& robot, const std::vector<Sensor>& sensors) {
  const std::vector<Variable>& outputs = robot.model()->description().outputs;
  for (std::size_t s = 0; s < sensors.size(); ++s)
    if (sensors[s].outputs.size() > 1 && outputs[static_cast<std::size_t>(sensors[s].outputs.front())].unit == "m")
      return static_cast<int>(s);
  return 0;
}

Eigen::VectorXd start_of(const Robot& robot, const logs::Drive& drive,
                         const std::optional<Eigen::VectorXd>& simulated_start) {
  const Model& model = *robot.model();
  const FirstOutputs first(drive);
  if (simulated_start && agrees(robot, first, *simulated_start)) return *simulated_start;
  const std::vector<double>& measured = first.values;
  Eigen::VectorXd start = Eigen::VectorXd::Zero(model.state_count());
  const std::vector<bool> of_state = outputs_of_state(model);
  std::vector<bool> is_told(static_cast<std::size_t>(model.state_count()), false);
  // Angles first: what they turn, such as a lever arm, is then right for positions.
  for (const bool angles : {true, false}) {
    const Seen seen(model, start);
    Eigen::VectorXd found = start;
    for (std::size_t i = 0; i < static_cast<std::size_t>(model.state_count()); ++i) {
      const Variable& state = model.description().states[i];
      if ((state.unit == "rad") != angles) continue;
      for (std::size_t j = 0; j < measured.size(); ++j) {
        if (std::isnan(measured[j]) || !of_state[j] || model.description().outputs[j].unit != state.unit) continue;
        if (std::abs(seen.slope(j, i) - 1.0) > 1e-9) continue;
        found[static_cast<Eigen::Index>(i)] += measured[j] - seen.outputs[j];
        is_told[i] = true;
        break;
      }
    }
    start = found;
  }
  const auto forget = [&](int heading) {
    if (heading >= 0 && !is_told[static_cast<std::size_t>(heading)]) start[heading] = missing_value;
  };
  forget(model.description().roles.heading);
  std::ranges::for_each(model.description().roles.other_headings, forget);
  return start;
}

DriveReplay replay_drive(const Robot& robot, const logs::Drive& drive, const HoldOut& hold_out,
                         const std::optional<Eigen::VectorXd>& simulated_start, const LoopHooks& hooks) {
  return Driver(robot, drive, hold_out, start_of(robot, drive, simulated_start), hooks).run();
}

}  // namespace rhec::sim
