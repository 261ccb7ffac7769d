#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "rhec/core/base/export.hpp"

namespace rhec {

/// The sources of a model plugin.
struct VehicleSources {
  struct File {
    std::string name, content;
  };
  std::string plugin;              ///< its name, a word of small letters
  std::vector<File> files;         ///< the formula's header, the plugin, CMakeLists.txt, README.md
  std::vector<std::string> notes;  ///< what is not as in the file
};

/// The vehicle of a file with equations (docs/equations.md) as C++: definitions keep their names, variables their units
/// and meanings. Traced, the formula is the file's graph, so that values agree bit by bit; evaluated with double, as
/// the compiler does it, they may differ in the last places. The same file gives the same text. Throws Error as
/// `load_vehicle` does.
RHEC_EXPORT VehicleSources vehicle_as_cpp(const std::filesystem::path& file);

}  // namespace rhec
