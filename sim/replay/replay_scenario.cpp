#include "rhec/sim/replay/replay_scenario.hpp"

#include "rhec/sim/logs/variants.hpp"
#include "rhec/sim/loop/scenario.hpp"
#include "rhec/sim/world/truth_estimator.hpp"

namespace rhec::sim {

const OptionTable<ReplayOptions>& ReplayOptions::table() {
  static const auto rows = [] {
    OptionTable<ReplayOptions> table;
    table.text("name", &ReplayOptions::name, "of the drive, for titles")
        .subtree("variants", &ReplayOptions::variants, "keys that differ, by a name of your own");
    for (const char* key : {"log", "speed", "seed", "path", "terrain", "vehicle", "sensors", "faults"})
      table.subtree(key, &ReplayOptions::world, "of a simulation, or of another kind of log");
    RobotOptions::add_to(table);
    return table;
  }();
  return rows;
}

ReplayScenario::ReplayScenario(const Host& host, const Settings& settings, const std::vector<std::string>& chosen) {
  name_ = ReplayOptions::table().parse(settings, "scenario").name;
  for (const auto& [name, with] : variant_settings(name_, settings, chosen, {"name", "variants"})) {
    const ReplayOptions options = ReplayOptions::table().parse(with, "scenario");
    Robot robot(host, options, scenario_estimators());
    logs::SignalMap signals(options.signals, robot.model()->description());
    robot.make_estimator();  // reports errors before anything runs
    variants_.push_back({name, std::move(robot), std::move(signals), with});
    if (!options.variants.is_null()) variants_.back().settings.set("variants", Settings::null());
  }
  if (settings.find("path") && !settings.find("variants")) start_ = Scenario(host, settings).initial_state();
}

}  // namespace rhec::sim
