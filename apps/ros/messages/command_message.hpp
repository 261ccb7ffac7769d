#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "../ros_options.hpp"
#include "rhec/core/model/model.hpp"
#include "rhec/logs/cdr/cdr_writer.hpp"

namespace rhec::apps::ros {

/// Motion of the vehicle's reference point, in its own frame.
struct BodyMotion {
  double speed = 0.0;     ///< along the heading [m/s]
  double yaw_rate = 0.0;  ///< [rad/s]
};

/// A model's inputs as a command that a robot's base understands, and back. A base knows nothing of slip: it moves its
/// wheels as they would have to turn for a motion if nothing slipped. So a command is the motion that the inputs would
/// make at the end of the interval that they are meant for, without slip.
class CommandMessage {
 public:
  /// `interval`: for which inputs are held [s]. Throws Error if the model cannot be commanded in this form.
  CommandMessage(std::shared_ptr<const Model> model, const CommandOptions& options, double interval);

  static const char* type_of(CommandForm form) noexcept;
  const char* type() const noexcept { return type_of(form_); }

  /// The message for inputs (n_u) in a state (n_x); for zeros alone: `stop`.
  std::span<const std::byte> write(logs::Stamp when, const std::string& frame, const double* state,
                                   const double* inputs);
  std::span<const std::byte> stop(logs::Stamp when, const std::string& frame);

  /// The inputs (n_u), within their bounds, that a base gives to its vehicle in a state (n_x) for a message. Throws
  /// RecordError for one that is broken, or that no vehicle carries out; then `inputs` stay as they were.
  void read(std::span<const std::byte> message, const double* state, double* inputs);

 private:
  BodyMotion motion_after(const double* state, const double* inputs);
  void read_inputs(std::span<const std::byte> message, const double* state, double* inputs);
  void inputs_for(const BodyMotion& wanted, const double* state, double* inputs);
  std::span<const std::byte> write_motion(logs::Stamp when, const std::string& frame, const BodyMotion& motion,
                                          double steering_angle, double steering_rate, const double* inputs);

  std::shared_ptr<const Model> model_;
  CommandForm form_;
  double interval_;
  int steering_ = -1;       ///< state: the steering angle
  int steering_rate_ = -1;  ///< input: what changes it
  std::vector<std::string> names_;
  std::vector<double> nominal_, next_, rates_, zeros_, trial_, read_;
  logs::CdrWriter message_;
};

}  // namespace rhec::apps::ros
