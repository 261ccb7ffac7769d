#include "ros_options.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>

namespace rhec::apps::ros {
namespace {

void check_topic(const Settings& section, std::string_view key, const std::string& name) {
  if (name.empty() || is_topic_name(name)) return;
  const Settings* const at = section.find(key);
  throw(at ? *at : section)
      .error(fmt::format("found '{}', expected a full name, such as /fix, of letters, digits, _ and /", name));
}

}  // namespace

const OptionTable<CommandOptions>& CommandOptions::table() {
  static const auto rows =
      OptionTable<CommandOptions>()
          .flag("steer", &CommandOptions::steer,
                "whether commands are sent at all; without it, the node only estimates")
          .choice("form", &CommandOptions::form,
                  {{"twist_stamped", CommandForm::twist_stamped},
                   {"twist", CommandForm::twist},
                   {"ackermann", CommandForm::ackermann},
                   {"inputs", CommandForm::inputs}},
                  "the message: TwistStamped, Twist, AckermannDriveStamped, or a JointState with the model's inputs by "
                  "name")
          .text("steering", &CommandOptions::steering, "of ackermann: the model's state that is the steering angle")
          .number("timeout", &CommandOptions::timeout, "after this time without a measurement the robot is stopped [s]",
                  between(0.01, 60.0))
          .number("heading_sigma", &CommandOptions::heading_sigma,
                  "the robot is not moved while its heading is less certain than this standard deviation [rad]",
                  greater_than(0.0));
  return rows;
}

const char* type_of(ObstacleForm form) noexcept {
  return form == ObstacleForm::poses ? "geometry_msgs/msg/PoseArray" : "costmap_converter_msgs/msg/ObstacleArrayMsg";
}

const OptionTable<ObstacleOptions>& ObstacleOptions::table() {
  static const auto rows =
      OptionTable<ObstacleOptions>()
          .choice("form", &ObstacleOptions::form,
                  {{"poses", ObstacleForm::poses}, {"obstacle_array", ObstacleForm::obstacle_array}},
                  "the message of `ros.names.obstacles`: PoseArray, centres at rest; or ObstacleArrayMsg of "
                  "costmap_converter_msgs, outlines with velocities")
          .number("radius", &ObstacleOptions::radius, "of obstacles whose message states no size [m]",
                  greater_than(0.0));
  return rows;
}

const OptionTable<NameOptions>& NameOptions::table() {
  static const auto rows =
      OptionTable<NameOptions>()
          .text("odometry", &NameOptions::odometry, "sent: the estimate, as Odometry")
          .text("plan", &NameOptions::plan, "sent: what the controller plans, as Path")
          .text("path", &NameOptions::path, "sent: the path that is followed, as Path")
          .text("slip", &NameOptions::slip, "sent: slip by name, as JointState; effort is its standard deviation")
          .text("state", &NameOptions::state, "sent: all that is estimated, by name, as JointState")
          .text("inputs", &NameOptions::inputs, "sent: the inputs that are commanded, by name, as JointState")
          .text("transforms", &NameOptions::transforms, "sent: the transform from the fixed frame to the vehicle")
          .text("diagnostics", &NameOptions::diagnostics, "sent: health, once a second and when it changes")
          .text("command", &NameOptions::command, "sent, if `ros.command.steer`: the one topic that steers")
          .text("wanted_path", &NameOptions::wanted_path, "heard: a path to follow from now on, as Path")
          .text("obstacles", &NameOptions::obstacles, "heard: obstacles, as `ros.obstacles.form` says")
          .text("stop", &NameOptions::stop, "heard: true stops the robot until false comes, as std_msgs/Bool")
          .text("clock", &NameOptions::clock, "heard with `ros.use_sim_time`: the time")
          .text("static_transforms", &NameOptions::static_transforms, "heard: places of sensors, for `ros.lever_arms`")
          .text("truth", &NameOptions::truth, "sent by a simulated robot: where it is");
  return rows;
}

const OptionTable<FrameOptions>& FrameOptions::table() {
  static const auto rows =
      OptionTable<FrameOptions>()
          .text("fixed", &FrameOptions::fixed, "in which estimates are given: odom or map (REP 105)")
          .text("vehicle", &FrameOptions::vehicle, "the frame whose place is estimated")
          .flag("publish", &FrameOptions::publish,
                "whether this node owns the transform between both; false where another node sends it");
  return rows;
}

const OptionTable<CheckOptions>& CheckOptions::table() {
  static const auto rows =
      OptionTable<CheckOptions>()
          .number("behind", &CheckOptions::behind, "a message whose stamp is older than this is refused [s]",
                  or_infinite(greater_than(0.0)))
          .number("ahead", &CheckOptions::ahead, "a message from further in the future is refused [s]",
                  or_infinite(at_least(0.0)))
          .number("fix_sigma", &CheckOptions::fix_sigma,
                  "a fix that states a larger standard deviation is refused; one that states none is used [m]",
                  or_infinite(greater_than(0.0)));
  return rows;
}

const OptionTable<RosOptions>& RosOptions::table() {
  static const auto rows =
      OptionTable<RosOptions>()
          .text("node", &RosOptions::node, "its name, as `ros2 node list` shows it")
          .text("interface", &RosOptions::interface,
                "the network interface, by name or address; lo: nobody from outside is heard")
          .text("trigger", &RosOptions::trigger,
                "the topic whose messages begin a step of the loop; empty: each measurement that comes when a step is "
                "due")
          .flag("use_sim_time", &RosOptions::use_sim_time, "the time is that of /clock")
          .number("path_speed", &RosOptions::path_speed, "along a path that comes as a message [m/s]",
                  greater_than(0.0))
          .number("patience", &RosOptions::patience, "how long to wait for the transforms of `lever_arms` [s]",
                  greater_than(0.0))
          .group("obstacles", &RosOptions::obstacles, ObstacleOptions::table())
          .group("command", &RosOptions::command, CommandOptions::table())
          .group("names", &RosOptions::names, NameOptions::table())
          .group("frames", &RosOptions::frames, FrameOptions::table())
          .group("checks", &RosOptions::checks, CheckOptions::table())
          .map("types", &RosOptions::types,
               {{"TOPIC", "text", "", "",
                 "the type of a topic of `signals`, such as sensor_msgs/msg/Imu; usual names "
                 "are known"}})
          .map("lever_arms", &RosOptions::lever_arms,
               {{"OPTION", "text", "", "",
                 "an option of the model that is a coordinate of a sensor's frame on the "
                 "vehicle, from /tf_static: `gps_link.x`, `-gps_link.x`"}});
  return rows;
}

std::vector<OptionSection> ros_sections() {
  return {{"ros", "For `rhec ros`: how a live node takes part in ROS 2. Topics of measurements are named in `signals`.",
           RosOptions::table().schema()}};
}

bool is_topic_name(std::string_view name) noexcept {
  for (char before = '\0'; const char c : name) {
    const bool is_letter = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_',
               is_digit = c >= '0' && c <= '9';
    const bool begins = before == '\0' || before == '/';
    if (before == '\0' ? c != '/' : !(is_letter || (is_digit && !begins) || (c == '/' && !begins))) return false;
    before = c;
  }
  return name.size() > 1 && !name.ends_with('/');
}

RosOptions read_ros_options(const Settings& section) {
  RosOptions options = RosOptions::table().parse(section, "ros");
  const Settings empty = Settings::map(section.origin());
  const Settings& names = section.find("names") ? *section.find("names") : empty;
  for (const auto& [key, name] : {std::pair{"odometry", options.names.odometry},
                                  {"plan", options.names.plan},
                                  {"path", options.names.path},
                                  {"slip", options.names.slip},
                                  {"state", options.names.state},
                                  {"inputs", options.names.inputs},
                                  {"transforms", options.names.transforms},
                                  {"diagnostics", options.names.diagnostics},
                                  {"command", options.names.command},
                                  {"wanted_path", options.names.wanted_path},
                                  {"obstacles", options.names.obstacles},
                                  {"stop", options.names.stop},
                                  {"clock", options.names.clock},
                                  {"static_transforms", options.names.static_transforms},
                                  {"truth", options.names.truth}})
    check_topic(names, key, name);
  if (options.command.steer && options.names.command.empty())
    throw names.error("command: expected a topic, since `ros.command.steer` is true");
  if (options.command.steer && options.command.form == CommandForm::ackermann && options.command.steering.empty())
    throw section.error("command.steering: expected the state that is the steering angle, for AckermannDriveStamped");
  read_lever_arms(options.lever_arms);
  return options;
}

std::vector<LeverArm> read_lever_arms(const Settings& section) {
  std::vector<LeverArm> arms;
  for (const auto& [option, value] : section.members()) {
    LeverArm arm{.option = option, .frame = "", .key = value};
    std::string_view text = value.as_text();
    if (text.starts_with('-')) {
      arm.sign = -1;
      text.remove_prefix(1);
    }
    const std::size_t dot = text.rfind('.');
    const std::string_view axis = dot == std::string_view::npos ? "" : text.substr(dot + 1);
    if (dot == 0 || axis.size() != 1 || axis.front() < 'x' || axis.front() > 'z')
      throw value.mismatch("a coordinate of a frame on the vehicle, such as gps_link.x or -gps_link.x");
    arm.frame = text.substr(0, dot);
    arm.axis = axis.front() - 'x';
    arms.push_back(std::move(arm));
  }
  return arms;
}

}  // namespace rhec::apps::ros
