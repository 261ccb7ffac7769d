#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "rhec/core/config/options.hpp"
#include "rhec/core/config/settings.hpp"
#include "rhec/plugins/robot/option_section.hpp"

namespace rhec::apps::ros {

/// What commands are sent as.
enum class CommandForm {
  twist_stamped,  ///< geometry_msgs/TwistStamped
  twist,          ///< geometry_msgs/Twist
  ackermann,      ///< ackermann_msgs/AckermannDriveStamped
  inputs          ///< sensor_msgs/JointState with the model's inputs by their names
};

/// What obstacles come as.
enum class ObstacleForm {
  poses,          ///< geometry_msgs/PoseArray: centres, at rest
  obstacle_array  ///< costmap_converter_msgs/ObstacleArrayMsg: outlines that may move
};
/// "geometry_msgs/msg/PoseArray"
const char* type_of(ObstacleForm form) noexcept;

/// The section `ros.obstacles`.
struct ObstacleOptions {
  ObstacleForm form = ObstacleForm::poses;
  double radius = 0.5;  ///< [m]
  static const OptionTable<ObstacleOptions>& table();
};

/// The section `ros.command`: who steers, and when not.
struct CommandOptions {
  bool steer = false;
  CommandForm form = CommandForm::twist_stamped;
  std::string steering;        ///< a state: the steering angle
  double timeout = 0.5;        ///< without a measurement [s]
  double heading_sigma = 0.5;  ///< largest standard deviation of the heading [rad]
  static const OptionTable<CommandOptions>& table();
};

/// The section `ros.names`: topics that have a meaning of their own; an empty name: none.
struct NameOptions {
  std::string odometry = "/rhec/odometry", plan = "/rhec/plan", slip = "/rhec/slip", state = "/rhec/state",
              inputs = "/rhec/commanded", path = "/rhec/path", transforms = "/tf", diagnostics = "/diagnostics";
  std::string command = "/cmd_vel";
  std::string wanted_path = "/plan", obstacles = "", stop = "/rhec/stop", clock = "/clock",
              static_transforms = "/tf_static";
  std::string truth = "/ground_truth/odometry";
  static const OptionTable<NameOptions>& table();
};

/// The section `ros.frames`.
struct FrameOptions {
  std::string fixed = "odom", vehicle = "base_link";
  bool publish = true;
  static const OptionTable<FrameOptions>& table();
};

/// The section `ros.checks`: which messages are used.
struct CheckOptions {
  double behind = 2.0, ahead = 0.2;  ///< of a stamp, against the node's clock [s]
  double fix_sigma = 5.0;            ///< the largest standard deviation that a fix may state [m]
  static const OptionTable<CheckOptions>& table();
};

/// The section `ros`.
struct RosOptions {
  std::string node = "rhec", interface = "lo", trigger;
  bool use_sim_time = false;
  double path_speed = 1.0;  ///< along a path that comes as a message [m/s]
  double patience = 10.0;   ///< for transforms that lever arms come from [s]
  ObstacleOptions obstacles;
  CommandOptions command;
  NameOptions names;
  FrameOptions frames;
  CheckOptions checks;
  Settings types, lever_arms;
  static const OptionTable<RosOptions>& table();
};

std::vector<OptionSection> ros_sections();

/// Whether ROS 2 takes it for the full name of a topic: "/robot1/fix".
bool is_topic_name(std::string_view name) noexcept;

/// The options of a section `ros`, checked as a whole. Throws Error with file, line and key.
RosOptions read_ros_options(const Settings& section);

/// A coordinate of a sensor's place on the vehicle that an option of the model is: sign * frame.axis.
struct LeverArm {
  std::string option;  ///< "antenna_x"
  std::string frame;   ///< "gps_link"
  int axis = 0;        ///< 0: x, 1: y, 2: z
  int sign = 1;
  Settings key;  ///< as written, for errors
};
/// Throws Error for what is no coordinate, such as "-gps_link.x".
std::vector<LeverArm> read_lever_arms(const Settings& section);

}  // namespace rhec::apps::ros
