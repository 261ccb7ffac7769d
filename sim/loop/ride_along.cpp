#include "rhec/sim/loop/ride_along.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>

#include <Eigen/Cholesky>

#include "rhec/core/base/angle.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/sim/loop/loop_world.hpp"

namespace rhec::sim {
namespace {

// A vehicle farther than this from its path is lost [m].
constexpr double off_the_path = 50.0;
constexpr double counted = 3.0;             // standard deviations
constexpr double counted_in_plane = 11.83;  // of e' P^-1 e of two Gaussian variables, with the same probability
constexpr double rounding = 1e-9;           // relative

/// How the position was measured wrongly.
struct Displacement {
  Eigen::Vector2d shift = Eigen::Vector2d::Zero();  ///< [m]
  bool is_common = false;                           ///< all outputs that depend on the position are off by it
};

/// The shortest x that makes |A x - b| the least, of two columns A that are not zero.
Eigen::Vector2d least_squares(const Eigen::MatrixXd& A, const Eigen::VectorXd& b) {
  const double xx = A.col(0).squaredNorm(), xy = A.col(0).dot(A.col(1)), yy = A.col(1).squaredNorm();
  const Eigen::Vector2d right(A.col(0).dot(b), A.col(1).dot(b));
  const double determinant = xx * yy - xy * xy, trace = xx + yy;
  // With columns of one direction, A'A has one eigenvalue besides zero: its trace.
  if (determinant <= rounding * trace * trace)
    return Eigen::Vector2d(xx * right[0] + xy * right[1], xy * right[0] + yy * right[1]) / (trace * trace);
  return Eigen::Vector2d(yy * right[0] - xy * right[1], xx * right[1] - xy * right[0]) / determinant;
}

/// Finds the shift of the vehicle's position that explains best what was added to its outputs.
class DisplacementOfOutputs {
 public:
  explicit DisplacementOfOutputs(const Model& model)
      : model_(model), outputs_(model.output_count()), jacobian_(model.output_count(), model.state_count()) {}

  /// `added`: by output; NaN of one that was not measured.
  Displacement of(const Eigen::VectorXd& state, const std::vector<double>& added) {
    const Roles& roles = model_.description().roles;
    model_.observe({.count = 1, .states = state.data(), .outputs = outputs_.data(), .jacobians = jacobian_.data()});
    Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(outputs_.size(), 2);
    Eigen::VectorXd values = Eigen::VectorXd::Zero(outputs_.size());
    bool is_complete = true;
    for (Eigen::Index j = 0; j < values.size(); ++j) {
      const bool is_measured = !std::isnan(added[static_cast<std::size_t>(j)]);
      const Eigen::Vector2d row(jacobian_(j, roles.position_x), jacobian_(j, roles.position_y));
      is_complete = is_complete && (is_measured || row.isZero(0.0));
      // An angle that is off as well displaces nothing.
      if (!is_measured || row.isZero(0.0)) continue;
      rows.row(j) = row;
      values[j] = added[static_cast<std::size_t>(j)];
    }
    Displacement found;
    if (rows.isZero(0.0) || values.isZero(0.0) || !values.allFinite()) return found;
    found.shift = least_squares(rows, values);
    found.is_common = is_complete && (rows * found.shift - values).norm() <= rounding * values.norm();
    return found;
  }

 private:
  const Model& model_;
  Eigen::VectorXd outputs_;
  Eigen::MatrixXd jacobian_;
};

/// Whether sensors may be off for good.
bool has_lasting_offset(const Scenario& scenario) {
  return std::any_of(scenario.faults().begin(), scenario.faults().end(), [](const FaultOptions& fault) {
    return fault.kind == FaultKind::offset && !fault.length && !fault.every;
  });
}

/// An estimator, and what it has said so far.
class Rider {
 public:
  Rider(const Scenario& scenario, const Eigen::VectorXd& initial_state)
      : estimator(scenario.robot().make_estimator(initial_state)), about_(scenario.robot().bounded_description()) {}
  std::unique_ptr<Estimator> estimator;
  Ride ride;

  void look(double time, const TruthVehicle& truth, const Eigen::Vector2d& frame, const Displacement& displacement) {
    const Estimate& estimate = estimator->estimate(time);
    RideSample sample;
    judge_numbers(estimate, sample);
    judge_position(estimate, truth, frame, displacement, sample);
    const Roles& roles = about_.roles;
    if (roles.heading >= 0) {
      sample.heading_error = std::abs(angle_difference(estimate.state[roles.heading], truth.state()[roles.heading]));
      sample.is_heading_inside =
          sample.heading_error <= counted * std::sqrt(estimate.covariance(roles.heading, roles.heading));
    }
    sample.parameter_errors = (estimate.parameters - truth.parameters()).cwiseAbs();
    sample.health = estimate.health.level;
    sample.reasons = estimate.health.reasons | estimate.health.inputs.reasons;
    for (const SensorHealth& sensor : estimate.health.sensors) sample.reasons |= sensor.reasons;
    ride.samples.push_back(std::move(sample));
    estimator->prepare();
  }

  void end() {
    ride.counts = estimator->counts();
    if (!estimator->watch()) return;
    ride.sensors = estimator->watch()->sensors();
    ride.verdicts.assign(estimator->watch()->sensor_states().begin(), estimator->watch()->sensor_states().end());
  }

 private:
  void judge_numbers(const Estimate& estimate, RideSample& sample) const {
    sample.is_finite = estimate.state.allFinite() && estimate.parameters.allFinite() && estimate.covariance.allFinite();
    const Eigen::LLT<Eigen::MatrixXd> root(estimate.covariance);
    sample.log_volume = root.info() == Eigen::Success ? root.matrixLLT().diagonal().array().log().sum()
                                                      : std::numeric_limits<double>::quiet_NaN();
    const auto is_bounded = [](const std::vector<Variable>& variables, const Eigen::VectorXd& values) {
      for (std::size_t j = 0; j < variables.size(); ++j) {
        const double room = rounding * variables[j].scale, value = values[static_cast<Eigen::Index>(j)];
        if (!(value >= variables[j].lower - room && value <= variables[j].upper + room)) return false;
      }
      return true;
    };
    sample.is_bounded = is_bounded(about_.states, estimate.state) && is_bounded(about_.parameters, estimate.parameters);
  }

  void judge_position(const Estimate& estimate, const TruthVehicle& truth, const Eigen::Vector2d& frame,
                      const Displacement& displacement, RideSample& sample) const {
    const int x = about_.roles.position_x, y = about_.roles.position_y;
    const Eigen::Vector2d off(estimate.state[x] - truth.state()[x], estimate.state[y] - truth.state()[y]);
    const Eigen::Vector2d error = off - frame;
    const double xx = estimate.covariance(x, x), xy = estimate.covariance(x, y), yy = estimate.covariance(y, y);
    sample.error = error.norm();
    const double squared = yy * error[0] * error[0] - 2.0 * xy * error[0] * error[1] + xx * error[1] * error[1];
    sample.is_inside = squared <= counted_in_plane * (xx * yy - xy * xy);
    sample.displaced = displacement.shift.norm();
    if (sample.displaced > 0.0) sample.followed = off.dot(displacement.shift) / displacement.shift.squaredNorm();
  }

  const ModelDescription& about_;
};

/// What a controller is told by one who knows.
Estimate truth_of(double time, const TruthVehicle& vehicle) {
  Estimate estimate;
  estimate.time = time;
  estimate.state = vehicle.state();
  estimate.parameters = vehicle.parameters();
  return estimate;
}

}  // namespace

std::vector<Ride> ride_along(const Scenario& scenario, std::span<const Scenario> riders, int samples) {
  const Robot& robot = scenario.robot();
  const Roles& roles = robot.model()->description().roles;
  LoopWorld world(scenario, {.outputs = robot.output_sigmas(), .inputs = robot.input_sigmas()});
  const auto controller = robot.make_controller(scenario.path());
  controller->locate(scenario.start());
  std::vector<Rider> all;
  all.reserve(riders.size());
  for (const Scenario& rider : riders) all.emplace_back(rider, scenario.initial_state());
  DisplacementOfOutputs displacements(*robot.model());
  const bool may_move_for_good = has_lasting_offset(scenario);
  Eigen::Vector2d frame = Eigen::Vector2d::Zero();
  for (int k = 0; k < samples && !controller->finished(); ++k) {
    const double time = k * robot.step();
    world.measure(time);
    world.deliver(time, [&](double stamp, const double* outputs) {
      for (Rider& rider : all) rider.estimator->push_measurement(stamp, outputs);
    });
    const Displacement displacement = displacements.of(world.truth().state(), world.added());
    if (may_move_for_good && displacement.is_common) frame = displacement.shift;
    const bool is_faulty = !world.take_faults().empty();
    for (Rider& rider : all) {
      rider.look(world.on_robots_clock(time), world.truth(), frame, displacement);
      rider.ride.samples.back().is_faulty = is_faulty;
    }
    const Controller::Command& command = controller->control(truth_of(time, world.truth()));
    const double off = std::hypot(world.truth().state()[roles.position_x] - command.reference.x,
                                  world.truth().state()[roles.position_y] - command.reference.y);
    if (!(off < off_the_path))
      throw Error(
          fmt::format("scenario '{}': the vehicle left its path after {} s, though it knew its state; choose "
                      "another path, speed or fault",
                      scenario.options().name, time));
    world.drive(command.inputs, time, robot.step());
    const std::vector<double>& measured = world.measured_inputs(command.inputs);
    controller->prepare();
    for (Rider& rider : all) rider.estimator->push_input(world.on_robots_clock(time), measured.data());
  }
  std::vector<Ride> rides;
  rides.reserve(all.size());
  for (Rider& rider : all) {
    rider.end();
    rides.push_back(std::move(rider.ride));
  }
  return rides;
}

}  // namespace rhec::sim
