// Messages in CDR, as they come from the wire or out of a log.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "apps/ros/messages/command_message.hpp"
#include "apps/ros/messages/heard_messages.hpp"
#include "apps/ros/messages/obstacle_messages.hpp"
#include "apps/ros/node/intake.hpp"
#include "apps/ros/node/node_time.hpp"
#include "fuzz/targets.hpp"
#include "rhec/logs/cdr/message_definitions.hpp"
#include "rhec/logs/cdr/message_reader.hpp"
#include "rhec/plugins/equations/equations.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/yaml/yaml.hpp"

namespace rhec::fuzz {
namespace {

using apps::ros::CommandForm;
using Bytes = std::span<const std::byte>;

Bytes bytes_of(std::string_view text) { return std::as_bytes(std::span(text.data(), text.size())); }

/// What was taken must be usable: a fault of the reader, and no answer.
void require(bool truth, const char* text) {
  if (!truth) throw std::logic_error(text);
}

void require_places(const std::vector<apps::ros::Position>& places) {
  for (const apps::ros::Position& place : places)
    require(std::isfinite(place.x * place.x + place.y * place.y), "a place was taken that cannot be reckoned with");
}

void require_obstacles(const apps::ros::SeenObstacles& seen) {
  for (const Obstacle& each : seen.obstacles) {
    require(std::isfinite(each.x * each.x + each.y * each.y + each.velocity_x + each.velocity_y + each.heading),
            "an obstacle was taken that cannot be reckoned with");
    require(each.semi_axis_along > 0.0 && each.semi_axis_across > 0.0 &&
                std::isfinite(each.semi_axis_along * each.semi_axis_across),
            "an obstacle was taken that has no size");
  }
}

void read_command(CommandForm form, Bytes message) {
  static const std::shared_ptr<const Model> model = load_vehicle(RHEC_SOURCE "/examples/vehicles/bicycle.yaml");
  apps::ros::CommandOptions options;
  options.form = form;
  options.steering = "delta";
  apps::ros::CommandMessage command(model, options, 0.05);
  std::vector<double> state(static_cast<std::size_t>(model->state_count()), 0.1);
  std::vector<double> inputs(static_cast<std::size_t>(model->input_count()));
  command.read(message, state.data(), inputs.data());
  for (std::size_t j = 0; j < inputs.size(); ++j) {
    const Variable& about = model->description().inputs[j];
    require(std::isfinite(inputs[j]) && inputs[j] >= about.lower && inputs[j] <= about.upper,
            "a command was taken that is beyond its bounds");
  }
}

}  // namespace

void ros_messages(std::string_view input) {
  if (input.empty()) return;
  constexpr double radius = 0.5;
  const Bytes message = bytes_of(input.substr(1));
  answered([&] {
    switch (input.front()) {
      case 'h':
        return static_cast<void>(apps::ros::read_header(message));
      case 'p':
        return require_places(apps::ros::read_path(message).places);
      case 'a':
        return require_places(apps::ros::read_pose_array(message).places);
      case 't':
        for (const apps::ros::PlaceOfFrame& place : apps::ros::read_transforms(message))
          for (const double value : place.translation) require(std::isfinite(value), "a transform is not finite");
        return;
      case 'f':
        return static_cast<void>(apps::ros::read_flag(message));
      case 'c': {
        apps::ros::NodeTime time(true);
        time.take(1, Clock::time_point());
        time.take(apps::ros::read_clock(message), Clock::time_point());
        return require(time.now() >= 0, "a time before 1970 was taken");
      }
      case 'q':
        return require(!(apps::ros::read_fix_quality(message).sigma.value_or(0.0) < 0.0), "an error is negative");
      case 'o':
        return require_obstacles(apps::ros::read_obstacle_poses(message, radius));
      case 'O':
        return require_obstacles(apps::ros::read_obstacle_array(message, radius));
      case '0':
        return read_command(CommandForm::twist, message);
      case '1':
        return read_command(CommandForm::twist_stamped, message);
      case '2':
        return read_command(CommandForm::ackermann, message);
      case '3':
        return read_command(CommandForm::inputs, message);
      default:
        return;
    }
  });
}

void ros_intake(std::string_view input) {
  static const Settings signals = parse_yaml(R"(
outputs:
  x: {from: /fix, as: east}
  y: {from: /fix, as: north}
  heading: {from: "/imu:orientation", as: heading}
  place: "/odom:pose.pose.position.x"
  angle: "/joint_states:position[steer]"
inputs:
  speed: {from: ["/joint_states:velocity[left]", "/joint_states:velocity[right]"], as: mean}
  turning: "/imu:angular_velocity.z"
  rate: {from: "/joint_states:position[steer]", derivative: true}
)",
                                             "fuzz.yaml");
  static const ModelDescription about = [] {
    ModelDescription vehicle;
    vehicle.name = "vehicle";
    for (const char* name : {"x", "y", "heading", "place"}) vehicle.outputs.push_back({name, "m", ""});
    vehicle.outputs[2].unit = "rad";
    vehicle.outputs.push_back({.name = "angle", .unit = "rad", .meaning = "", .lower = -1.0, .upper = 1.0});
    vehicle.inputs = {{"speed", "m/s", ""}, {"turning", "rad/s", ""}, {"rate", "rad/s", ""}};
    return vehicle;
  }();
  const apps::ros::LiveTopics topics(signals, Settings(), {});
  apps::ros::Intake intake(topics, logs::SignalMap(signals, about), about, {});
  constexpr std::array names{"/fix", "/imu", "/odom", "/joint_states"};
  constexpr logs::Stamp now = 1'700'000'000'000'000'000;
  for (const Part& part : parts_of(input)) {
    const auto name = std::ranges::find(names, part.name);
    if (name == names.end()) continue;
    for (const logs::SignalRow& row : intake.take(topics.topic(*name), bytes_of(part.content), now)) {
      if (!row.is_output) continue;
      for (std::size_t j = 0; j < row.values.size(); ++j)
        require(std::isnan(row.values[j]) || (row.values[j] >= about.outputs[j].lower &&
                                              row.values[j] <= about.outputs[j].upper && std::isfinite(row.values[j])),
                "an output was taken that cannot be");
    }
  }
}

void cdr(std::string_view input) {
  const std::vector<Part> parts = parts_of(input);
  if (parts.size() != 2) return;
  const std::string type = "pkg/msg/A";
  const Bytes message = bytes_of(parts[1].content);
  answered([&] {
    logs::Definitions definitions = logs::builtin_definitions();
    logs::parse_ros2msg(type, parts[0].content, definitions);
    const auto linked = std::make_shared<const logs::MessageType>(logs::link_message(type, definitions));
    const std::vector<std::string> paths = logs::number_paths(*linked, message);
    std::vector<double> values(paths.size());
    logs::MessageReader reader(linked, {.fields = paths});
    reader.read({.bytes = message}, values.data());
    if (!paths.empty())
      answered([&] {  // the stamp is one of its numbers
        logs::MessageReader(linked, {.fields = {}, .clock = paths.front()}).read({.bytes = message}, nullptr);
      });
  });
}

}  // namespace rhec::fuzz
