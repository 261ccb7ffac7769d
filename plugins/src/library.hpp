#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "rhec/plugins/manifest.hpp"

namespace rhec {

/// A plugin's library that has been loaded and whose manifest has been checked, or the reason why not.
struct Library {
  const Manifest* manifest = nullptr;  ///< null if refused
  std::string refusal;                 ///< empty if accepted
  std::shared_ptr<const void> pinned;  ///< keeps the library
};

/// Loads one file, now-bound and local, and checks everything that its manifest says. Throws nothing of its own.
Library load_library(const std::filesystem::path& file);

/// Why a manifest cannot be used here; empty if it can. Reads no further than what it has read allows.
std::string why_not_usable(const ManifestHead& head);

}  // namespace rhec
