#pragma once

#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <vector>

#include "rhec/core/config/option_values.hpp"
#include "rhec/core/config/settings.hpp"

namespace rhec {

/// What a plugin makes.
enum class PluginKind : std::int32_t {
  model = 1,     ///< rhec::Model
  blocking = 2,  ///< rhec::Blocking
  solver = 3     ///< rhec::Solver
};

/// "RHECPLUG", as the bytes stand in memory.
inline constexpr std::uint64_t kManifestMagic = 0x47554C5043454852u;
/// Counts changes of the layout of Manifest.
inline constexpr std::uint32_t kManifestAbi = 1;
/// Counts changes of the interfaces that plugins implement or are handed: Model, Blocking, Solver, Settings, OptionRow.
inline constexpr std::uint32_t kInterfaceRevision = 2;
/// The name of the one symbol that a plugin exports.
inline constexpr const char* kManifestSymbol = "rhec_plugin_manifest";

/// The part of a manifest that keeps its place for ever. It decides if the rest may be read.
struct ManifestHead {
  std::uint64_t magic = kManifestMagic;
  std::uint32_t abi = kManifestAbi;
  std::uint32_t size = 0;  ///< of the whole Manifest [bytes]
};

/// What a plugin says of itself: constant data under the C symbol `rhec_plugin_manifest`, which the host reads from top
/// to bottom, and only as far as what it has read allows: the texts that name the plugin, for what is said of it, as
/// soon as ABI and size are right. No function of the plugin is called before all of it has been checked. Texts are
/// UTF-8, end with a zero, live as long as the plugin, and are never null (empty if there is nothing to say). Authors
/// do not write it by hand: see rhec/plugins/kit/sdk.hpp.
///
/// Exceptions do not cross: the functions answer by their result and put a text into `error` (`error_size` bytes, cut
/// there, ended with a zero).
struct Manifest {
  ManifestHead head{.size = sizeof(Manifest)};
  std::uint32_t interface_revision = kInterfaceRevision;
  PluginKind kind{};
  const char* fingerprint = nullptr;      ///< RHEC_BUILD_FINGERPRINT of the plugin
  const char* name = nullptr;             ///< how configuration calls it
  const char* version = nullptr;          ///< of the plugin
  const char* licence = nullptr;          ///< SPDX identifier of plugin and backend together
  const char* source = nullptr;           ///< publication or home of what it implements
  const char* backend = nullptr;          ///< the software that does the work, e.g. "Ipopt"; empty: its own code
  const char* backend_version = nullptr;  ///< empty where there is no backend
  const char* capabilities = nullptr;     ///< one phrase for people

  /// Appends the options to `rows`; false with a text if that failed.
  bool (*schema)(std::vector<OptionRow>* rows, char* error, std::size_t error_size) noexcept = nullptr;
  /// A new object, as pointer to the interface of its kind; null with a text if that failed.
  void* (*create)(const Settings* settings, char* error, std::size_t error_size) noexcept = nullptr;
  /// Ends an object that `create` made.
  void (*destroy)(void* object) noexcept = nullptr;
};

static_assert(std::is_standard_layout_v<Manifest> && std::is_trivially_copyable_v<Manifest>);
static_assert(offsetof(Manifest, head) == 0 && sizeof(ManifestHead) == 16);

}  // namespace rhec
