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

/// Whether every user may write to what has these permissions: whoever can write to a plugin has their code run here.
inline bool all_may_write(std::filesystem::perms given) {
  return (given & std::filesystem::perms::others_write) != std::filesystem::perms::none;
}

/// Loads one file with RTLD_NOW and RTLD_LOCAL, and checks its whole manifest. Reports failures in the result, not by
/// exceptions.
Library load_library(const std::filesystem::path& file);

}  // namespace rhec
