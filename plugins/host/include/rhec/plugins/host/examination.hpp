#pragma once

#include <chrono>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <string_view>

#include "rhec/core/base/export.hpp"

namespace rhec {

/// How a host looks at plugins before it lists or loads them.
///
/// Looking at a plugin runs its code: the constructors of its library and of what that needs, its functions, its
/// destructors. With `apart`, all of that happens first in a process of its own, the program `rhec/examine_plugin`
/// beside rhec's own library. A plugin that crashes there, does not return, ends the process, writes beyond what it has
/// allocated, asks for more memory than it may have, starts another process, or closes a standard stream, is refused
/// with what it did. The verdict is kept in a file, with the plugin's hash, and holds as long as the plugin, the
/// libraries it needs and rhec itself are the same files; looking it up takes some 10 us a plugin. A plugin is loaded
/// into this process only when an object of it, or its options, are asked for.
///
/// What it does not do: a plugin that is accepted runs as a part of this process, with its user's rights, and can still
/// fail with other options or data.
struct Examination {
  bool apart = false;
  bool anew = false;                                ///< do not use verdicts that were kept; keep the new ones
  std::chrono::milliseconds time_limit{10'000};     ///< for one plugin
  std::size_t memory_limit = std::size_t{1} << 30;  ///< for one plugin [bytes]
  /// Where verdicts are kept. Empty: `rhec/plugins` in XDG_CACHE_HOME, or in `.cache` of HOME; none if neither is set.
  /// A folder that cannot be written to, or that others may write to, is not used.
  std::filesystem::path verdicts{};
};

/// The exit code of an examination that could not tell what it found.
inline constexpr int kExaminationNotTold = 70;

/// Takes some lines of what an examination finds, with their ends.
using ExaminationReport = std::function<void(std::string_view lines)>;

/// Loads a plugin into this process, makes an object of it and deletes it, and tells what it finds. To be called by a
/// program that the plugin may take down, which passes the lines on: apps/examine_plugin.
RHEC_EXPORT void examine_in_this_process(const std::filesystem::path& plugin, const ExaminationReport& report);

}  // namespace rhec
