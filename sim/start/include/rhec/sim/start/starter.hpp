#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/core/config/settings.hpp"
#include "rhec/core/model/model.hpp"
#include "rhec/plugins/host/host.hpp"

namespace rhec::sim {

/// What a new robot is.
struct StarterWishes {
  std::string name;                  ///< for titles
  std::string vehicle;               ///< a model plugin, or a file with a vehicle's equations
  std::vector<std::string> sensors;  ///< outputs of the model, or parts of their names (gps); none: the usual ones
  Settings options;                  ///< of the model; a map, or null
  std::filesystem::path folder;      ///< where the files will be: a vehicle's file is named relative to it
};

/// Commented files to go on from. Every number that the model knows stands in them.
struct StarterFiles {
  static constexpr const char* robot_name = "robot.yaml";
  static constexpr const char* scenario_name = "field.yaml";
  std::string robot;            ///< keys of RobotOptions
  std::string scenario;         ///< names the robot, and has a path and a ground for it; empty if it cannot drive
  std::string why_no_scenario;  ///< empty if it can
};

/// The model of the wishes with all outputs it offers. Throws Error if there is none of that name, or for its options.
RHEC_EXPORT ModelDescription starter_vehicle(const Host& host, const StarterWishes& wishes);

/// Throws Error for an unknown sensor, with the nearest one, and as above.
RHEC_EXPORT StarterFiles starter_files(const Host& host, const StarterWishes& wishes);

}  // namespace rhec::sim
