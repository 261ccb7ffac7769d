#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "file_stamp.hpp"
#include "rhec/plugins/host/host.hpp"

namespace rhec {

/// A library that a plugin was loaded with.
struct NeededLibrary {
  std::filesystem::path path;
  FileStamp stamp;
};

/// What the examination of a plugin has found.
struct Verdict {
  PluginRecord record;
  PluginTrial trial;  ///< of an accepted plugin
  /// All that the process had loaded; empty if the plugin could not be loaded.
  std::vector<NeededLibrary> libraries;
  bool harmful = false;  ///< refused for what it did, not for what it is
};

/// One line of a report of an examination: a key, a space, and a value without line breaks.
std::string report_line(std::string_view key, std::string_view value);
/// The lines of a report; a last line without its end is left out.
std::vector<std::pair<std::string, std::string>> report_lines(std::string_view text);

/// Takes what one line of a report says of the plugin; false if the key is none of a verdict, or its value is wrong.
bool take_line(std::string_view key, std::string_view value, Verdict& verdict);
/// All lines of a verdict but for the plugin's path.
std::string lines_of(const Verdict& verdict);

}  // namespace rhec
