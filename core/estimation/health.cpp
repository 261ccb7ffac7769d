#include "rhec/core/estimation/health.hpp"

#include <fmt/format.h>

namespace rhec {

const char* name_of(HealthLevel level) noexcept {
  switch (level) {
    case HealthLevel::ok:
      return "ok";
    case HealthLevel::degraded:
      return "degraded";
    case HealthLevel::lost:
      return "lost";
  }
  return "";
}

const char* name_of_reason(std::uint32_t reason) noexcept {
  switch (reason) {
    case reason::rejected:
      return "rejected";
    case reason::stuck:
      return "stuck";
    case reason::silent:
      return "silent";
    case reason::implausible:
      return "implausible";
    case reason::moved:
      return "moved";
    case reason::clock:
      return "wrong clock";
    case reason::uncertain:
      return "uncertain";
    case reason::starting:
      return "starting";
    case reason::off:
      return "off";
    case reason::heading:
      return "heading unknown";
    default:
      return "";
  }
}

std::string in_words(const Health& health, const std::vector<Sensor>& sensors, const std::vector<Sensor>& inputs) {
  std::string text = name_of(health.level);
  const char* separator = ": ";
  const auto add = [&](const std::string& who, std::uint32_t reasons, const std::string& offset = "") {
    std::string words;
    for (const std::uint32_t each : reason::all)
      if (reasons & each)
        words += fmt::format("{}{}", words.empty() ? "" : " and ", each == reason::off ? offset : name_of_reason(each));
    if (words.empty()) return;
    text += fmt::format("{}{}{}{}", separator, who, who.empty() ? "" : " ", words);
    separator = "; ";
  };
  add("", health.reasons);
  for (std::size_t s = 0; s < health.sensors.size(); ++s) {
    const SensorHealth& sensor = health.sensors[s];
    std::string offset =
        sensor.offset == 0.0 ? "was off" : fmt::format("off by about {:.2g} {}", sensor.offset, sensors[s].unit);
    if (sensor.rival >= 0) offset += " from " + sensors[static_cast<std::size_t>(sensor.rival)].name;
    add(sensors[s].name, sensor.reasons, offset);
  }
  const bool is_named = health.off_input >= 0 && health.off_input < std::ssize(inputs);
  const bool is_one_doubted = health.doubted_input >= 0 && health.doubted_input < std::ssize(inputs);
  const std::uint32_t told = (is_named ? reason::off : 0u) | (is_one_doubted ? reason::rejected : 0u);
  add("inputs", health.inputs.reasons & ~told, health.inputs.offset == 0.0 ? "were off" : "off");
  if (is_one_doubted)
    add("input " + inputs[static_cast<std::size_t>(health.doubted_input)].name,
        health.inputs.reasons & reason::rejected, "off");
  if (is_named) {
    const Sensor& input = inputs[static_cast<std::size_t>(health.off_input)];
    add("input " + input.name, health.inputs.reasons & reason::off,
        fmt::format("off by about {:.2g} {}", health.inputs.offset, input.unit));
  }
  return text;
}

}  // namespace rhec
