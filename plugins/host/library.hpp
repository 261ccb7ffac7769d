#pragma once

#include <filesystem>
#include <memory>

#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/kit/manifest.hpp"

namespace rhec {

/// A plugin's library, loaded and with its manifest checked, or the reason why not.
struct Library {
  PluginRecord record;                 ///< names the plugin once the layout of its manifest is known to match ours
  const Manifest* manifest = nullptr;  ///< null if refused
  std::shared_ptr<const void> pinned;  ///< keeps the library loaded
};

/// Loads one file with RTLD_NOW and RTLD_LOCAL, and checks its whole manifest. Reports failures in the result, not by
/// exceptions.
Library load_library(const std::filesystem::path& file);

}  // namespace rhec
