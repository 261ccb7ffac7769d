#include "rhec/plugins/robot/scenario_file.hpp"

#include <fmt/format.h>

#include <string>

#include "rhec/core/base/error.hpp"
#include "rhec/plugins/yaml/yaml.hpp"

namespace rhec {
namespace {

constexpr const char* robot_key = "robot";

void put_over(Settings& base, const Settings& keys, const std::string& prefix) {
  for (const auto& [key, value] : keys.members()) {
    std::string path = prefix;
    if (!path.empty()) path += '.';
    path += key;
    if (value.kind() == Settings::Kind::map && !value.members().empty()) {
      put_over(base, value, path);
    } else {
      base.set(path, value);
    }
  }
}

Settings load_robot(const Settings& named, const std::filesystem::path& scenario) {
  const std::filesystem::path file = scenario.parent_path() / named.as_text();
  if (!std::filesystem::exists(file))
    throw named.error(
        fmt::format("found '{}', expected the file of a robot; there is no {}", named.as_text(), file.string()));
  Settings robot = load_yaml(file);
  if (robot.kind() != Settings::Kind::map) throw robot.mismatch("a robot, which is a map of keys and values");
  if (const Settings* another = robot.find(robot_key))
    throw another->error("a robot's file names no other one; write its keys here");
  return robot;
}

}  // namespace

void put_over(Settings& base, const Settings& keys) { put_over(base, keys, ""); }

void refuse_what_is_no_scenario(const Settings& settings) {
  struct {
    const char* key;
    const char* what;
  } constexpr others[] = {{"grid", "is that of a sweep: this file is for 'rhec sweep'"},
                          {"equations", "is that of a vehicle; a scenario names the file: 'model: {equations: FILE}'"}};
  if (settings.kind() != Settings::Kind::map) return;
  for (const auto& [key, what] : others)
    if (const Settings* found = settings.find(key)) throw found->error(what);
}

Settings load_scenario(const std::filesystem::path& file) {
  Settings scenario = load_yaml(file);
  refuse_what_is_no_scenario(scenario);
  const Settings* named = scenario.find(robot_key);
  if (!named) return scenario;
  Settings merged = load_robot(*named, file);
  Settings own = Settings::map(scenario.origin());
  for (const auto& [key, value] : scenario.members())
    if (key != robot_key) own.add(key, value);
  put_over(merged, own);
  return merged;
}

}  // namespace rhec
