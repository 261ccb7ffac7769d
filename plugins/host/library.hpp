#pragma once

#include <filesystem>
#include <memory>

#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/kit/manifest.hpp"

namespace rhec {

/// A plugin's library that has been loaded and whose manifest has been checked, or the reason why not.
struct Library {
  PluginRecord record;                 ///< names the plugin as soon as the layout of its manifest is known to be ours
  const Manifest* manifest = nullptr;  ///< null if refused
  std::shared_ptr<const void> pinned;  ///< keeps the library
};

/// Loads one file, now-bound and local, and checks everything that its manifest says. Throws nothing of its own.
Library load_library(const std::filesystem::path& file);

}  // namespace rhec
