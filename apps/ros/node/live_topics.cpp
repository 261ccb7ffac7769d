#include "live_topics.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string_view>
#include <utility>

#include "../messages/type_hash.hpp"
#include "rhec/core/base/error.hpp"

namespace rhec::apps::ros {
namespace {

/// Names that robots use by convention, and what is on them.
constexpr std::array<std::pair<std::string_view, const char*>, 12> usual{{
    {"/fix", "sensor_msgs/msg/NavSatFix"},
    {"/gps/fix", "sensor_msgs/msg/NavSatFix"},
    {"/navsat", "sensor_msgs/msg/NavSatFix"},
    {"/imu", "sensor_msgs/msg/Imu"},
    {"/imu/data", "sensor_msgs/msg/Imu"},
    {"/joint_states", "sensor_msgs/msg/JointState"},
    {"/odom", "nav_msgs/msg/Odometry"},
    {"/odometry", "nav_msgs/msg/Odometry"},
    {"/odometry/gps", "nav_msgs/msg/Odometry"},
    {"/wheel/odometry", "nav_msgs/msg/Odometry"},
    {logs::measured_topic, "sensor_msgs/msg/JointState"},
    {logs::inputs_topic, "sensor_msgs/msg/JointState"},
}};

void collect(const Settings& value, std::vector<std::pair<std::string, Settings>>& topics) {
  if (value.kind() == Settings::Kind::list) {
    for (const Settings& item : value.items()) collect(item, topics);
  } else if (value.kind() == Settings::Kind::scalar && value.text() != "none") {
    const std::string topic = logs::parse_signal_name(value.text()).topic;
    if (topic.empty())
      throw value.error(
          fmt::format("found '{}', a column; expected /topic:field, since a live node has no tables", value.text()));
    if (!is_topic_name(topic))
      throw value.error(
          fmt::format("found the topic '{}', expected a full name, such as /fix, of letters, digits, _ and /", topic));
    if (std::ranges::none_of(topics, [&](const auto& each) { return each.first == topic; }))
      topics.emplace_back(topic, value);
  }
}

}  // namespace

LiveTopics::LiveTopics(const Settings& signals, const Settings& types, std::vector<std::filesystem::path> msg_paths)
    : MessageLog("the robot", {std::move(msg_paths)}) {
  std::vector<std::pair<std::string, Settings>> topics;
  for (const char* kind : {"outputs", "inputs"})
    if (const Settings* section = signals.find(kind))
      for (const auto& [name, value] : section->members())
        collect(value.kind() == Settings::Kind::map && value.find("from") ? *value.find("from") : value, topics);
  for (const char* own : {logs::measured_topic, logs::inputs_topic})
    if (std::ranges::none_of(topics, [&](const auto& each) { return each.first == own; }))
      topics.emplace_back(own, signals);
  for (const auto& [topic, origin] : topics) {
    std::string type;
    if (const Settings* given = types.find(topic)) type = logs::full_type_name(given->as_text());
    for (const auto& [name, usual_type] : usual)
      if (type.empty() && name == topic) type = usual_type;
    if (type.empty())
      throw origin.error(
          fmt::format("nothing says what is on {}; expected its type in ros.types, such as {}: "
                      "sensor_msgs/msg/Imu",
                      topic, topic));
    add_topic(topic, type, {.serialization = "cdr", .schema_encoding = "", .schema = ""});
  }
}

std::string LiveTopics::hash(int topic) const {
  const std::string& type = topics()[static_cast<std::size_t>(topic)].type;
  const logs::Definitions& definitions = logs::builtin_definitions();
  return definitions.contains(type) ? type_hash(type, definitions) : "";
}

std::optional<logs::Damage> LiveTopics::read(const std::vector<bool>&, const Take&) const {
  throw Error("a live robot has no records to read at once");
}

logs::Damage LiveTopics::damage_at(const logs::Record& record, const logs::RecordError& error) const {
  return {fmt::format("{}: {}", topics()[static_cast<std::size_t>(record.topic)].name, error.what())};
}

}  // namespace rhec::apps::ros
