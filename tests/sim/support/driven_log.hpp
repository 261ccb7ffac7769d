#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "rhec/logs/files/open_log.hpp"
#include "rhec/logs/mapping/drive.hpp"
#include "rhec/plugins/yaml/yaml.hpp"
#include "rhec/sim/loop/closed_loop.hpp"
#include "rhec/sim/replay/replay_scenario.hpp"
#include "rhec/sim/telemetry/measurement_log.hpp"
#include "support/temporary_folder.hpp"

namespace rhec::sim {

/// A test with a simulated drive and the log of its sensors.
class DrivenLogTest : public FolderTest {
 protected:
  /// A scenario, shortened.
  static Settings settings_of(const std::string& name) {
    Settings settings = load_yaml(std::string(SCENARIOS) + "/" + name + ".yaml");
    for (const char* assignment : {"path.laps=1", "path.legs=2", "path.radius=8", "path.leg_length=15"})
      apply_assignment(settings, assignment);
    return settings;
  }

  /// Drives, and keeps what the sensors measured in `file`.
  RunLog drive(const Settings& settings, const std::string& name) const {
    const Scenario scenario(Host(), settings);
    MeasurementLog log(file(name), scenario.robot().model()->description());
    LoopHooks hooks;
    log.listen(hooks);
    RunLog run = run_closed_loop(scenario, hooks);
    log.close();
    return run;
  }

  logs::Drive read(const ReplayVariant& variant, const std::string& name) const {
    return logs::read_drive(*logs::open_log(file(name)), variant.signals);
  }
};

}  // namespace rhec::sim
