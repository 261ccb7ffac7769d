#include "command_message.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>

#include "rhec/core/base/error.hpp"
#include "rhec/core/config/option_values.hpp"
#include "rhec/logs/cdr/cdr_cursor.hpp"

namespace rhec::apps::ros {
namespace {

using logs::CdrCursor;
using logs::Kind;

void write_twist(const BodyMotion& motion, logs::CdrWriter& message) {
  message.numbers(std::array{motion.speed, 0.0, 0.0, 0.0, 0.0, motion.yaw_rate});
}

void skip_header(CdrCursor& cursor) {
  cursor.number(Kind::i32);
  cursor.number(Kind::u32);
  cursor.skip_text();
}

/// No vehicle moves or turns as fast as that [m/s], [rad/s]; far beyond, there are no inputs to be found.
constexpr double fastest = 1e3;

double possible(double value) {
  if (!(std::abs(value) <= fastest))
    throw logs::RecordError(
        fmt::format("found a command of {}, expected numbers from {} to {}", value, -fastest, fastest));
  return value;
}

/// The input that changes a state most directly: of a steering angle, its rate.
int rate_of(const Model& model, int state) {
  std::vector<double> x(static_cast<std::size_t>(model.state_count())), rates(x.size());
  const std::vector<double> p = nominal_values(model.description().parameters);
  for (int j = 0; j < model.input_count(); ++j) {
    std::vector<double> u(static_cast<std::size_t>(model.input_count()));
    u[static_cast<std::size_t>(j)] = 1.0;
    model.rates(x.data(), u.data(), p.data(), rates.data());
    if (rates[static_cast<std::size_t>(state)] == 1.0) return j;
  }
  return -1;
}

}  // namespace

CommandMessage::CommandMessage(std::shared_ptr<const Model> model, const CommandOptions& options, double interval)
    : model_(std::move(model)), form_(options.form), interval_(interval) {
  const ModelDescription& about = model_->description();
  names_ = names_of(about.inputs);
  nominal_ = nominal_values(about.parameters);
  next_.resize(about.states.size());
  rates_.resize(about.states.size());
  zeros_.resize(about.inputs.size());
  trial_.resize(about.inputs.size());
  read_.resize(about.inputs.size());
  if (form_ != CommandForm::inputs && about.roles.heading < 0)
    throw Error(
        fmt::format("the model {} has no heading, so that its motion is no twist; expected ros.command.form: "
                    "inputs",
                    about.name));
  if (form_ != CommandForm::ackermann) return;
  const std::vector<std::string> states = names_of(about.states);
  const auto found = std::find(states.begin(), states.end(), options.steering);
  if (found == states.end())
    throw Error(fmt::format("ros.command.steering: found '{}', expected a state of {}: {}", options.steering,
                            about.name, one_of(states)));
  steering_ = static_cast<int>(found - states.begin());
  steering_rate_ = rate_of(*model_, steering_);
  if (steering_rate_ < 0 || about.roles.speed < 0)
    throw Error(
        fmt::format("the model {} is not steered by a speed and by the rate of {}; expected another "
                    "ros.command.form",
                    about.name, options.steering));
}

const char* CommandMessage::type_of(CommandForm form) noexcept {
  switch (form) {
    case CommandForm::twist_stamped:
      return "geometry_msgs/msg/TwistStamped";
    case CommandForm::twist:
      return "geometry_msgs/msg/Twist";
    case CommandForm::ackermann:
      return "ackermann_msgs/msg/AckermannDriveStamped";
    case CommandForm::inputs:
      break;
  }
  return "sensor_msgs/msg/JointState";
}

BodyMotion CommandMessage::motion_after(const double* state, const double* inputs) {
  Model::Intervals interval;
  interval.count = 1;
  interval.states = state;
  interval.inputs = inputs;
  interval.parameters = nominal_.data();
  interval.durations = &interval_;
  interval.next_states = next_.data();
  model_->integrate(interval);
  model_->rates(next_.data(), inputs, nominal_.data(), rates_.data());
  const Roles& roles = model_->description().roles;
  const auto at = [](int role) { return static_cast<std::size_t>(role); };
  const double heading = next_[at(roles.heading)];
  return {rates_[at(roles.position_x)] * std::cos(heading) + rates_[at(roles.position_y)] * std::sin(heading),
          rates_[at(roles.heading)]};
}

std::span<const std::byte> CommandMessage::write_motion(logs::Stamp when, const std::string& frame,
                                                        const BodyMotion& motion, double steering_angle,
                                                        double steering_rate, const double* inputs) {
  message_.clear();
  if (form_ != CommandForm::twist) message_.header(when, frame);
  switch (form_) {
    case CommandForm::twist_stamped:
    case CommandForm::twist:
      write_twist(motion, message_);
      break;
    case CommandForm::ackermann:
      message_.f32(static_cast<float>(steering_angle));
      message_.f32(static_cast<float>(steering_rate));
      message_.f32(static_cast<float>(motion.speed));
      message_.f32(0.0F);  // as quickly as the base can
      message_.f32(0.0F);
      break;
    case CommandForm::inputs:
      message_.length(names_.size());
      for (const std::string& name : names_) message_.text(name);
      message_.length(names_.size());
      message_.numbers({inputs, names_.size()});
      message_.length(0);  // velocities
      message_.length(0);  // efforts
      break;
  }
  return message_.bytes();
}

std::span<const std::byte> CommandMessage::write(logs::Stamp when, const std::string& frame, const double* state,
                                                 const double* inputs) {
  BodyMotion motion;
  double angle = 0.0, rate = 0.0;
  if (form_ != CommandForm::inputs) motion = motion_after(state, inputs);
  if (steering_ >= 0) angle = next_[static_cast<std::size_t>(steering_)];
  if (steering_rate_ >= 0) rate = inputs[steering_rate_];
  return write_motion(when, frame, motion, angle, rate, inputs);
}

std::span<const std::byte> CommandMessage::stop(logs::Stamp when, const std::string& frame) {
  return write_motion(when, frame, {}, 0.0, 0.0, zeros_.data());
}

/// Gauss-Newton on the two numbers of a motion, with as many inputs as the model has, beginning at rest: so a steering
/// that has no effect at the moment stays where it is.
void CommandMessage::inputs_for(const BodyMotion& wanted, const double* state, double* inputs) {
  constexpr int most_iterations = 20;
  constexpr double tolerance = 1e-9, difference = 1e-6, damping = 1e-9;
  const std::vector<Variable>& variables = model_->description().inputs;
  const auto count = static_cast<Eigen::Index>(variables.size());
  std::fill_n(inputs, variables.size(), 0.0);
  for (int iteration = 0; iteration < most_iterations; ++iteration) {
    const BodyMotion at = motion_after(state, inputs);
    const Eigen::Vector2d error(wanted.speed - at.speed, wanted.yaw_rate - at.yaw_rate);
    if (error.norm() < tolerance) break;
    Eigen::MatrixXd slopes(2, count);
    for (Eigen::Index j = 0; j < count; ++j) {
      std::copy_n(inputs, count, trial_.begin());
      trial_[static_cast<std::size_t>(j)] += difference;
      const BodyMotion beside = motion_after(state, trial_.data());
      slopes.col(j) << (beside.speed - at.speed) / difference, (beside.yaw_rate - at.yaw_rate) / difference;
    }
    const Eigen::Matrix2d normal = slopes * slopes.transpose() + damping * Eigen::Matrix2d::Identity();
    const Eigen::VectorXd change = slopes.transpose() * normal.ldlt().solve(error);
    for (Eigen::Index j = 0; j < count; ++j) {
      const Variable& variable = variables[static_cast<std::size_t>(j)];
      inputs[j] = std::clamp(inputs[j] + change[j], variable.lower, variable.upper);
    }
  }
}

void CommandMessage::read(std::span<const std::byte> message, const double* state, double* inputs) {
  read_inputs(message, state, read_.data());
  const std::vector<Variable>& variables = model_->description().inputs;
  for (std::size_t j = 0; j < read_.size(); ++j) {
    if (!std::isfinite(read_[j])) throw logs::RecordError("found a command that no inputs of the vehicle carry out");
    read_[j] = std::clamp(read_[j], variables[j].lower, variables[j].upper);
  }
  std::ranges::copy(read_, inputs);
}

void CommandMessage::read_inputs(std::span<const std::byte> message, const double* state, double* inputs) {
  CdrCursor cursor(message);
  if (form_ != CommandForm::twist) skip_header(cursor);
  if (form_ == CommandForm::inputs) {
    std::vector<std::string> names;
    for (std::uint64_t left = cursor.length(4); left > 0; --left) names.emplace_back(cursor.text());
    const std::uint64_t count = cursor.length(sizeof(double));
    if (names != names_ || count != names_.size())
      throw logs::RecordError(fmt::format("found a command with other inputs, expected {}", one_of(names_)));
    for (std::size_t j = 0; j < names_.size(); ++j) inputs[j] = cursor.number(Kind::f64);
  } else if (form_ == CommandForm::ackermann) {
    const double angle = possible(cursor.number(Kind::f32));
    cursor.number(Kind::f32);  // a base that has an angle to go to chooses the rate
    const double wanted = possible(cursor.number(Kind::f32));
    // The speed is that of the vehicle as it steers now; the steering goes where it is wanted within the interval.
    std::fill_n(inputs, names_.size(), 0.0);
    const int speed = model_->description().roles.speed;
    inputs[speed] = 1.0;
    inputs[speed] = wanted / motion_after(state, inputs).speed;
    inputs[steering_rate_] = (angle - state[steering_]) / interval_;
  } else {
    std::array<double, 6> twist{};
    for (double& value : twist) value = possible(cursor.number(Kind::f64));
    inputs_for({twist[0], twist[5]}, state, inputs);
  }
}

}  // namespace rhec::apps::ros
