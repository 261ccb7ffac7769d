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
  solver = 3,    ///< rhec::Solver
  prior = 4,     ///< rhec::Prior
  term = 5       ///< rhec::Term
};

/// "RHECPLUG", in memory order.
inline constexpr std::uint64_t kManifestMagic = 0x47554C5043454852u;
/// Incremented when the layout of Manifest changes.
inline constexpr std::uint32_t kManifestAbi = 1;
/// Incremented when an interface that plugins implement or receive changes: Model, Blocking, Solver, Prior,
/// Term, Settings, OptionRow.
inline constexpr std::uint32_t kInterfaceRevision = 5;
/// The name of the one symbol that a plugin exports.
inline constexpr const char* kManifestSymbol = "rhec_plugin_manifest";

/// The part of a manifest whose layout never changes. It decides whether the rest may be read.
struct ManifestHead {
  std::uint64_t magic = kManifestMagic;
  std::uint32_t abi = kManifestAbi;
  std::uint32_t size = 0;  ///< of the whole Manifest [bytes]
};

/// A plugin's description of itself: constant data under the C symbol `rhec_plugin_manifest`. The host reads it from
/// top to bottom, and only as far as the fields read so far allow; once ABI and size match, it reads the texts that
/// name the plugin, for its messages. No function of the plugin is called before the whole manifest has been checked.
/// Texts are UTF-8, zero-terminated, live as long as the plugin, and are never null (empty if there is nothing to say).
/// Authors do not write it by hand: see rhec/plugins/kit/sdk.hpp.
///
/// No exception crosses this interface: the functions report failure by their result, and write a message to `error`
/// (truncated to `error_size` bytes, zero-terminated).
struct Manifest {
  ManifestHead head{.size = sizeof(Manifest)};
  std::uint32_t interface_revision = kInterfaceRevision;
  PluginKind kind{};
  const char* fingerprint = nullptr;      ///< RHEC_BUILD_FINGERPRINT of the plugin
  const char* name = nullptr;             ///< its name in configurations
  const char* version = nullptr;          ///< of the plugin
  const char* licence = nullptr;          ///< SPDX identifier of plugin and backend together
  const char* source = nullptr;           ///< publication or home page of what it implements
  const char* backend = nullptr;          ///< the software that does the work, e.g. "Ipopt"; empty for code of its own
  const char* backend_version = nullptr;  ///< empty if there is no backend
  const char* capabilities = nullptr;     ///< one human-readable phrase

  /// Appends the options to `rows`; false with a message on failure.
  bool (*schema)(std::vector<OptionRow>* rows, char* error, std::size_t error_size) noexcept = nullptr;
  /// A new object, as a pointer to the interface of its kind; null with a message on failure.
  void* (*create)(const Settings* settings, char* error, std::size_t error_size) noexcept = nullptr;
  /// Deletes an object that `create` made.
  void (*destroy)(void* object) noexcept = nullptr;
};

static_assert(std::is_standard_layout_v<Manifest> && std::is_trivially_copyable_v<Manifest>);
static_assert(offsetof(Manifest, head) == 0 && sizeof(ManifestHead) == 16);

}  // namespace rhec
