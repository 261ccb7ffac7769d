// `rhec ros`, which is in a library of its own, so that whoever does not use it needs no DDS.
#include "live.hpp"

#include <dlfcn.h>

#include <fmt/format.h>

#include <filesystem>
#include <string_view>
#include <utility>

#include "rhec/core/base/error.hpp"

namespace rhec::apps::ros {
namespace {

/// The library beside the plugins that are installed with this program; empty: none of them is.
std::filesystem::path library_of(const Host& host) {
  for (const PluginPlace& place : host.places())
    if (place.origin == "installed") return place.directory.parent_path() / live_library;
  return {};
}

/// A function of the library, which stays loaded.
template <class Function>
Function* find(const Host& host, const char* symbol) {
  const std::filesystem::path library = library_of(host);
  if (!std::filesystem::exists(library))
    throw Error(
        fmt::format("rhec ros: the node is not installed: there is no {}; install the package rhec-ros, or build rhec "
                    "with Cyclone DDS (Debian: apt-get install cyclonedds-dev)",
                    library.empty() ? live_library : library.string()));
  void* const loaded = dlopen(library.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (!loaded) {
    const char* const reason = dlerror();
    throw Error(fmt::format("{}: cannot be loaded ({}); install the package rhec-ros anew, which brings Cyclone DDS",
                            library.string(), reason ? reason : "no reason is known"));
  }
  const auto* const version = static_cast<const char*>(dlsym(loaded, version_symbol));
  void* const function = dlsym(loaded, symbol);
  if (!version || !function || std::string_view(version) != RHEC_PROJECT_VERSION)
    throw Error(fmt::format("{}: is of version {}, and this program of {}; install both of one build", library.string(),
                            version ? version : "unknown", RHEC_PROJECT_VERSION));
  return reinterpret_cast<Function*>(function);
}

}  // namespace

int run_node(const Host& host, Settings settings, const LiveArguments& arguments) {
  return find<RunLive>(host, run_node_symbol)(host, std::move(settings), arguments);
}

int run_robot(const Host& host, Settings settings, const LiveArguments& arguments) {
  return find<RunLive>(host, run_robot_symbol)(host, std::move(settings), arguments);
}

}  // namespace rhec::apps::ros
