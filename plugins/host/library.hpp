#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string_view>

#include "refusal.hpp"
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

/// Told what is about to be done with a plugin.
using Stage = std::function<void(std::string_view)>;

/// The refusal of a file that every user may write to; empty if they may not.
Refusal writable_by_all(const std::filesystem::path& file);

/// Why a file is refused before it is passed to the loader; empty if it may be.
Refusal why_not_to_load(const std::filesystem::path& file);

/// Loads one file with RTLD_NOW and RTLD_LOCAL, and checks its whole manifest. Reports failures in the result, not by
/// exceptions. `stage` is called with "load" before the library's constructors run, and with "manifest" after them.
Library load_library(const std::filesystem::path& file, const Stage& stage);

}  // namespace rhec
