#include "rhec/logs/mapping/proposal.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rhec/logs/mapping/signal_map.hpp"
#include "rhec/logs/signals/units.hpp"

namespace rhec::logs {
namespace {

constexpr const char* fix_type = "sensor_msgs/msg/NavSatFix";

/// A signal that could be meant, and how likely that is.
struct Candidate {
  std::string entry;  ///< in YAML
  double points = 0.0;
};

std::string lower(std::string_view text) {
  std::string result(text);
  for (char& c : result) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return result;
}

bool has_any(const std::string& text, std::initializer_list<const char*> words) {
  return std::any_of(words.begin(), words.end(),
                     [&](const char* word) { return text.find(word) != std::string::npos; });
}

/// What a variable is, as far as its unit, name and meaning say.
enum class Quantity {
  x,
  y,
  height,
  heading,
  steering,
  articulation,
  steering_rate,
  yaw_rate,
  ground_speed,
  speed,
  left,
  right,
  other
};

Quantity quantity_of(const Variable& variable, bool is_output) {
  const std::string name = lower(variable.name), all = name + " " + lower(variable.meaning);
  if (variable.unit == "m") {
    if (name.starts_with('x') || all.ends_with(", x")) return Quantity::x;
    if (name.starts_with('y') || all.ends_with(", y")) return Quantity::y;
    return name.starts_with('z') ? Quantity::height : Quantity::other;
  }
  if (variable.unit == "rad") {
    if (has_any(all, {"heading", "yaw", "orientation"})) return Quantity::heading;
    if (has_any(all, {"articul", "hitch"})) return Quantity::articulation;
    return has_any(all, {"steer", "delta"}) ? Quantity::steering : Quantity::other;
  }
  if (variable.unit == "rad/s" || variable.unit == "m/s") {
    if (has_any(all, {"left"})) return Quantity::left;
    if (has_any(all, {"right"})) return Quantity::right;
    if (variable.unit == "m/s") return is_output ? Quantity::ground_speed : Quantity::speed;
    return has_any(all, {"steer", "delta"}) ? Quantity::steering_rate : Quantity::yaw_rate;
  }
  return Quantity::other;
}

/// A name in YAML's flow style, in quotes where it has to be.
std::string plain(const std::string& signal) {
  const bool is_word =
      !signal.empty() &&
      (std::isalpha(static_cast<unsigned char>(signal.front())) || signal.front() == '/' || signal.front() == '_') &&
      std::ranges::all_of(signal, [](char c) {
        return std::isalnum(static_cast<unsigned char>(c)) || c == '_' || c == '/' || c == '.' || c == '-';
      });
  const std::string word = lower(signal);
  const bool is_other = word == "null" || word == "true" || word == "false" || word == "none" || word == "yes" ||
                        word == "no" || word == "on" || word == "off";
  if (is_word && !is_other) return signal;
  std::string quoted;
  for (const char c : signal) {
    if (c == '"' || c == '\\') quoted += '\\';
    quoted += c;
  }
  return fmt::format("\"{}\"", quoted);
}

/// The words of a name: "gps_lat (deg)" as gps, lat, deg.
std::vector<std::string> words_of(const std::string& name) {
  std::vector<std::string> words(1);
  for (const char c : lower(name)) {
    if (std::isalnum(static_cast<unsigned char>(c))) {
      words.back() += c;
    } else if (!words.back().empty()) {
      words.emplace_back();
    }
  }
  return words;
}

bool has_word(const std::string& name, std::initializer_list<const char*> any) {
  return std::ranges::any_of(words_of(name),
                             [&](const std::string& word) { return std::ranges::find(any, word) != any.end(); });
}

/// What a number seems to be in; empty: the variable's unit, as far as is known.
std::string unit_guessed(const FieldSurvey& field, const std::string& wanted) {
  const std::string name = lower(field.name);
  if (has_word(name, {"kmh", "kph"}) || has_any(name, {"km_h", "kmph"})) return "km/h";
  if (has_word(name, {"mph"})) return "mph";
  if (has_word(name, {"rpm"})) return "rpm";
  if (has_word(name, {"dps"}) || has_any(name, {"deg_s", "deg_per_s", "deg/s"})) return "deg/s";
  constexpr double more_than_a_turn = 6.4;  // [rad]
  const bool is_large = std::max(std::abs(field.least), std::abs(field.most)) > more_than_a_turn;
  if (wanted == "rad" && (is_large || has_word(name, {"deg", "degrees"}))) return "deg";
  return "";
}

class Proposer {
 public:
  explicit Proposer(const Survey& survey) : survey_(survey) {}

  std::vector<Candidate> candidates(const Variable& variable, bool is_output) {
    found_.clear();
    const Quantity quantity = quantity_of(variable, is_output);
    for (const TopicSurvey& topic : survey_.topics) {
      const bool is_table = topic.topic.name.empty();
      for (const FieldSurvey& field : topic.fields) {
        if (field.count == 0) continue;
        by_name(topic, field, variable, quantity);
      }
      by_pairs(topic, variable, quantity);
      if (!is_table) by_type(topic, quantity);
      if (is_table) by_columns(topic, quantity);
    }
    std::stable_sort(found_.begin(), found_.end(),
                     [](const Candidate& a, const Candidate& b) { return a.points > b.points; });
    return found_;
  }

 private:
  void add(std::string entry, double points) { found_.push_back({std::move(entry), points}); }

  static std::string signal_of(const TopicSurvey& topic, const std::string& field) {
    return topic.topic.name.empty() ? field : topic.topic.name + ":" + field;
  }

  /// A field with the unit that it seems to have, so that it becomes the variable.
  void add_field(const TopicSurvey& topic, const FieldSurvey& field, const Variable& variable, double points) {
    const std::string signal = plain(signal_of(topic, field.name));
    const std::string guessed = field.unit.empty() ? unit_guessed(field, variable.unit) : "";
    const std::optional<Unit> unit = find_unit(field.unit.empty() ? guessed : field.unit);
    std::string keys = guessed.empty() ? "" : fmt::format(", unit: {}", guessed), note;
    const std::string found = unit ? unit->si : variable.unit;
    const auto rolls = [&](const char* from, const char* to) { return found == from && variable.unit == to; };
    if (rolls("rad/s", "m/s") || rolls("m/s", "rad/s")) {
      keys += ", radius: 0.3";
      note = "    # the wheel's radius [m]";
    } else if (found != variable.unit) {
      return;  // something else
    }
    add(keys.empty() ? signal : fmt::format("{{from: {}{}}}{}", signal, keys, note), points);
  }

  /// Counts of an encoder.
  void add_counts(const TopicSurvey& topic, const FieldSurvey& field, const Variable& variable, double points) {
    add(fmt::format("{{from: {}, counts: 1024{}, derivative: true}}    # counts in a turn of the wheel{}",
                    plain(signal_of(topic, field.name)), variable.unit == "m/s" ? ", radius: 0.3" : "",
                    variable.unit == "m/s" ? ", its radius [m]" : ""),
        points);
  }

  void by_name(const TopicSurvey& topic, const FieldSurvey& field, const Variable& variable, Quantity quantity) {
    const std::string item = fmt::format("[{}]", variable.name);
    const std::string signal = signal_of(topic, field.name);
    if (field.name == variable.name || (field.name.ends_with(item) && field.name.starts_with("position")))
      return add(plain(signal), 10.0);
    const std::string name = lower(signal);
    const bool is_table = topic.topic.name.empty();
    const bool is_velocity = has_any(name, {"velocity", "rate", "omega", "speed", "vel"});
    const bool is_angle_of_joint = field.name.starts_with("position[") || is_table;
    if (quantity == Quantity::steering && is_angle_of_joint && has_any(name, {"steer", "delta"}) && !is_velocity)
      add_field(topic, field, variable, 5.0);
    if (quantity == Quantity::steering && field.name.ends_with("steering_angle")) add(plain(signal), 5.0);
    if (quantity == Quantity::articulation && is_angle_of_joint && has_any(name, {"articul", "hitch"}))
      add_field(topic, field, variable, 5.0);
    if (quantity == Quantity::steering_rate && has_any(name, {"steer", "delta"})) {
      const std::string unit = unit_guessed(field, "rad");
      const std::string of_angle = unit.empty() || !field.unit.empty() ? "" : fmt::format(", unit: {}", unit);
      if (is_velocity && !field.name.starts_with("position")) add_field(topic, field, variable, 4.0);
      if (is_angle_of_joint && !is_velocity)
        add(fmt::format("{{from: {}{}, derivative: true}}", plain(signal), of_angle), 3.0);
    }
    by_side(topic, field, variable, quantity);
    if (quantity == Quantity::speed && field.name.starts_with("velocity[") && has_any(name, {"wheel", "rear"}))
      add(fmt::format("{{from: {}, unit: rad/s, radius: 0.3}}    # the wheel's radius [m]", plain(signal)), 2.5);
    if (is_table && (quantity == Quantity::speed || quantity == Quantity::ground_speed) &&
        has_any(name, {"speed", "velocity", "radar"}) && !has_any(name, {"left", "right", "ang", "steer"}))
      add_field(topic, field, variable,
                has_any(name, {"radar", "ground", "gps"}) == (quantity == Quantity::ground_speed) ? 4.0 : 2.0);
    if (is_table && quantity == Quantity::heading && has_any(name, {"heading", "yaw", "compass"}) && !is_velocity)
      add_heading(topic, field, variable);
    if (is_table && quantity == Quantity::yaw_rate &&
        (has_any(name, {"yaw_rate", "yawrate", "yaw rate", "gyro_z", "gyro z", "gyroz", "omega_z"}) ||
         has_word(name, {"wz"})))
      add_field(topic, field, variable, 4.0);
    if (is_table && quantity == Quantity::x && has_word(name, {"east", "easting", "x"}))
      add_field(topic, field, variable, 2.0);
    if (is_table && quantity == Quantity::y && has_word(name, {"north", "northing", "y"}))
      add_field(topic, field, variable, 2.0);
  }

  /// Wheels of the left and of the right side.
  void by_side(const TopicSurvey& topic, const FieldSurvey& field, const Variable& variable, Quantity quantity) {
    const std::string name = lower(signal_of(topic, field.name));
    if (!(quantity == Quantity::left && has_any(name, {"left"})) &&
        !(quantity == Quantity::right && has_any(name, {"right"})))
      return;
    if (field.name.starts_with("velocity[")) return add(plain(signal_of(topic, field.name)), 5.0);
    if (field.name.starts_with("position[") || field.name.starts_with("effort[")) return;
    if (has_any(name, {"tick", "count", "encoder"})) return add_counts(topic, field, variable, 3.5);
    if (topic.topic.name.empty() && has_any(name, {"wheel", "omega", "speed", "vel", "rpm"}))
      return add_field(topic, field, variable, 5.0);
    if (has_any(name, {"omega", "speed", "vel", "rpm"})) add_field(topic, field, variable, 3.0);
  }

  /// An angle from 0 to 360 that is called heading is a compass's more often than not.
  void add_heading(const TopicSurvey& topic, const FieldSurvey& field, const Variable& variable) {
    constexpr double beyond_half_a_turn = 181.0;
    if (field.least >= 0.0 && field.most > beyond_half_a_turn)
      add(fmt::format("{{from: {}, unit: deg, sign: -1, offset: 1.5708}}    # if it is clockwise from north",
                      plain(signal_of(topic, field.name))),
          4.5);
    add_field(topic, field, variable, 4.0);
  }

  void by_type(const TopicSurvey& topic, Quantity quantity) {
    const std::string& type = topic.topic.type;
    const std::string& name = topic.topic.name;
    const bool is_gnss = type == fix_type;
    const bool is_odometry = type == "nav_msgs/msg/Odometry";
    const bool is_of_gps = has_any(lower(name), {"gps", "gnss", "rtk"});
    if (is_gnss && quantity == Quantity::x) add(fmt::format("{{from: {}, as: east}}", plain(name)), 4.0);
    if (is_gnss && quantity == Quantity::y) add(fmt::format("{{from: {}, as: north}}", plain(name)), 4.0);
    if (is_gnss && quantity == Quantity::height) add(fmt::format("{{from: {}, as: up}}", plain(name)), 4.0);
    if (is_gnss && quantity == Quantity::heading)
      for (const TopicSurvey& other : survey_.topics)
        if (&other < &topic && other.topic.type == type)
          add(fmt::format("{{from: [{}, {}], as: direction}}    # from the rear antenna to the front one",
                          plain(other.topic.name), plain(name)),
              3.5);
    const std::string pose = is_odometry || type == "geometry_msgs/msg/PoseWithCovarianceStamped" ? "pose.pose"
                             : type == "geometry_msgs/msg/PoseStamped"                            ? "pose"
                                                                                                  : "";
    if (!pose.empty() && (quantity == Quantity::x || quantity == Quantity::y))
      add(plain(fmt::format("{}:{}.position.{}", name, pose, quantity == Quantity::x ? "x" : "y")),
          is_of_gps ? 4.5 : 2.0);
    if (!pose.empty() && quantity == Quantity::heading)
      add(fmt::format("{{from: {}, as: heading}}", plain(fmt::format("{}:{}.orientation", name, pose))), 2.0);
    if (type == "sensor_msgs/msg/Imu") {
      if (quantity == Quantity::heading)
        add(fmt::format("{{from: {}, as: heading}}", plain(name + ":orientation")), 3.0);
      if (quantity == Quantity::yaw_rate) add(plain(name + ":angular_velocity.z"), 4.0);
    }
    const std::string twist = is_odometry                                ? "twist.twist"
                              : type == "geometry_msgs/msg/TwistStamped" ? "twist"
                              : type == "geometry_msgs/msg/Twist"        ? ""
                                                                         : "-";
    if (twist != "-") {
      const std::string prefix = name + ":" + (twist.empty() ? "" : twist + ".");
      if (quantity == Quantity::speed) add(plain(prefix + "linear.x"), is_odometry ? 3.5 : 1.5);
      if (quantity == Quantity::yaw_rate) add(plain(prefix + "angular.z"), is_odometry ? 2.5 : 1.0);
    }
    if (type == "ackermann_msgs/msg/AckermannDriveStamped" && quantity == Quantity::speed)
      add(plain(name + ":drive.speed"), 2.0);
  }

  /// The speed of a vehicle from the wheels of both sides.
  void by_pairs(const TopicSurvey& topic, const Variable& variable, Quantity quantity) {
    if (quantity != Quantity::speed || variable.unit != "m/s") return;
    for (const FieldSurvey& left : topic.fields) {
      const std::size_t at = lower(left.name).find("left");
      if (at == std::string::npos || left.name.starts_with("position[") || left.name.starts_with("effort[")) continue;
      for (const FieldSurvey& right : topic.fields) {
        std::string other = lower(left.name);
        if (lower(right.name) != other.replace(at, 4, "right")) continue;
        const std::string both = fmt::format("{{from: [{}, {}], as: mean", plain(signal_of(topic, left.name)),
                                             plain(signal_of(topic, right.name)));
        const std::string name = lower(left.name), guessed = left.unit.empty() ? unit_guessed(left, variable.unit) : "";
        const std::optional<Unit> unit = find_unit(left.unit.empty() ? guessed : left.unit);
        const std::string told = guessed.empty() ? "" : ", unit: " + guessed;
        const bool is_joint = left.name.starts_with("velocity[");
        if (is_joint || (unit && unit->si == "rad/s"))
          add(fmt::format("{}{}, radius: 0.3}}    # the wheel's radius [m]", both, is_joint ? ", unit: rad/s" : told),
              is_joint ? 3.4 : 3.7);
        else if (has_any(name, {"tick", "count", "encoder"}))
          add(both +
                  ", counts: 1024, radius: 0.3, derivative: true}    # counts in a turn of the wheel, its radius [m]",
              3.2);
        else if (has_any(name, {"speed", "vel"}) && (!unit || unit->si == "m/s"))
          add(fmt::format("{}{}}}", both, told), 3.7);
      }
    }
  }

  void by_columns(const TopicSurvey& topic, Quantity quantity) {
    std::vector<std::string> latitudes, longitudes;
    std::string height;
    for (const FieldSurvey& field : topic.fields) {
      const std::string name = lower(field.name);
      if (has_any(name, {"latitude"}) || has_word(name, {"lat", "lat1", "lat2"})) latitudes.push_back(field.name);
      if (has_any(name, {"longitude"}) || has_word(name, {"lon", "lon1", "lon2", "lng", "long"}))
        longitudes.push_back(field.name);
      if (height.empty() && (has_any(name, {"altitude", "height"}) || has_word(name, {"alt"}))) height = field.name;
    }
    if (latitudes.empty() || longitudes.empty()) return;
    const std::string &latitude = latitudes.front(), &longitude = longitudes.front();
    if (quantity == Quantity::heading && latitudes.size() > 1 && longitudes.size() > 1)
      add(fmt::format("{{from: [{}, {}, {}, {}], as: direction}}    # from the rear antenna to the front one",
                      plain(latitude), plain(longitude), plain(latitudes[1]), plain(longitudes[1])),
          3.5);
    if (quantity != Quantity::x && quantity != Quantity::y) return;
    add(fmt::format("{{from: [{}, {}{}], as: {}}}", plain(latitude), plain(longitude),
                    height.empty() ? "" : ", " + plain(height), quantity == Quantity::x ? "east" : "north"),
        4.0);
  }

  const Survey& survey_;
  std::vector<Candidate> found_;
};

void append_section(const char* name, const std::vector<Variable>& variables, bool is_output, Proposer& proposer,
                    std::string& text) {
  text += fmt::format("  {}:\n", name);
  for (const Variable& variable : variables) {
    const std::vector<Candidate> found = proposer.candidates(variable, is_output);
    text += fmt::format("    {}: {}", variable.name, found.empty() ? "none" : found.front().entry);
    text += fmt::format("{}{} [{}]",
                        found.empty() || found.front().entry.find("    # ") == std::string::npos ? "    # " : "; ",
                        variable.meaning.empty() ? variable.name : variable.meaning, variable.unit);
    if (found.empty()) text += "; nothing was found that could be it";
    text += "\n";
    constexpr std::size_t most_others = 3;
    for (std::size_t i = 1; i < std::min(found.size(), most_others + 1); ++i)
      text += fmt::format("    #   or {}\n", found[i].entry);
  }
}

/// Of a table of which nobody knows when its lines were measured.
void append_clock(const TopicSurvey& topic, std::string& text) {
  if (!topic.topic.name.empty() || topic.unreadable.empty()) return;
  const auto clock = std::ranges::find_if(
      topic.fields, [&](const FieldSurvey& field) { return field.is_rising && field.count == topic.count; });
  if (clock != topic.fields.end())
    text += fmt::format(
        "  clock: {}    # the first column that rises: does it count seconds? Else `{} [ms]`, or the like\n",
        plain(clock->name), clock->name);
}

/// What to do where a receiver's fixes are now better, now worse.
void append_grades(const TopicSurvey& fixes, std::string& text) {
  constexpr double by_much = 4.0;
  const auto variance = std::ranges::find(fixes.fields, "position_covariance[0]", &FieldSurvey::name);
  if (variance != fixes.fields.end() && variance->least >= 0.0 && variance->most > by_much * variance->least)
    text += fmt::format(
        "    # {0} says how accurate its fixes are: {1:.2g} to {2:.2g} m to the east. They count by that with\n"
        "    #   variance: \"{0}:position_covariance[0]\", and [4] to the north\n",
        fixes.topic.name, std::sqrt(variance->least), std::sqrt(variance->most));
  const auto status = std::ranges::find(fixes.fields, "status.status", &FieldSurvey::name);
  if (status == fixes.fields.end() || status->count == 0 || std::max(status->least, 0.0) >= status->most) return;
  text += fmt::format(
      "    # The status of {0} is {1:g} to {2:g}. Worse fixes can be left out, by\n"
      "    #   when: {{of: \"{0}:status.status\", at_least: {2:g}}}\n"
      "    # or be another sensor with noise of its own: docs/sensors.md\n",
      fixes.topic.name, status->least, status->most);
}

}  // namespace

std::string propose_signals(const Survey& survey, const ModelDescription& about) {
  Proposer proposer(survey);
  std::string text = "signals:\n";
  for (const TopicSurvey& topic : survey.topics) append_clock(topic, text);
  append_section("outputs", about.outputs, true, proposer, text);
  for (const TopicSurvey& topic : survey.topics)
    if (topic.topic.type == fix_type) append_grades(topic, text);
  append_section("inputs", about.inputs, false, proposer, text);
  return text;
}

}  // namespace rhec::logs
