#define BOOST_DLL_USE_STD_FS
#include "library.hpp"

#include <dlfcn.h>
#include <fmt/format.h>

#include <boost/dll/shared_library.hpp>
#include <cstring>

#include "elf_file.hpp"
#include "rhec/plugins/fingerprint.hpp"

namespace rhec {
namespace {

static_assert(std::string_view(RHEC_VERSION_TEXT) == RHEC_PROJECT_VERSION,
              "fingerprint.hpp and CMakeLists.txt disagree");

constexpr const char* kRebuild = "build it again with the headers of rhec " RHEC_VERSION_TEXT;

std::string why_head_not_usable(const ManifestHead& head) {
  if (head.magic != kManifestMagic) return "its manifest does not start like one of rhec; make it by RHEC_PLUGIN";
  if (head.abi != kManifestAbi) {
    return fmt::format("its manifest has ABI {}, this rhec reads {}: the plugin is {} than rhec; {}", head.abi,
                       kManifestAbi, head.abi < kManifestAbi ? "older" : "newer", kRebuild);
  }
  if (head.size != sizeof(Manifest)) {
    return fmt::format("its manifest has {} bytes, expected {}; {}", head.size, sizeof(Manifest), kRebuild);
  }
  return {};
}

std::string why_contents_not_usable(const Manifest& manifest) {
  if (manifest.interface_revision != kInterfaceRevision) {
    return fmt::format("it implements revision {} of the interfaces, this rhec has {}; {}", manifest.interface_revision,
                       kInterfaceRevision, kRebuild);
  }
  if (manifest.fingerprint == nullptr) return fmt::format("its manifest has no build fingerprint; {}", kRebuild);
  if (std::strcmp(manifest.fingerprint, RHEC_BUILD_FINGERPRINT) != 0) {
    return fmt::format("it was built differently from rhec; build both alike\n  plugin: {}\n  rhec:   {}",
                       manifest.fingerprint, RHEC_BUILD_FINGERPRINT);
  }
  switch (manifest.kind) {
    case PluginKind::model:
    case PluginKind::blocking:
    case PluginKind::solver:
      break;
    default:
      return fmt::format("its kind {} is unknown to this rhec; {}", static_cast<int>(manifest.kind), kRebuild);
  }
  for (const char* text : {manifest.name, manifest.version, manifest.licence, manifest.source, manifest.backend,
                           manifest.backend_version, manifest.capabilities}) {
    if (text == nullptr) return "its manifest has a null text; make it by RHEC_PLUGIN";
  }
  if (manifest.name[0] == '\0') return "its manifest has no name; give it one in RHEC_PLUGIN";
  if (manifest.schema == nullptr || manifest.create == nullptr || manifest.destroy == nullptr) {
    return "its manifest lacks a function (schema, create or destroy is null); make it by RHEC_PLUGIN";
  }
  return {};
}

/// The loader's own words without what is put around them.
std::string loader_words(const std::string& message) {
  const std::string before = "(dlerror system message: ";
  const std::size_t start = message.find(before);
  if (start == std::string::npos) return message;
  const std::size_t end = message.rfind(')');
  return message.substr(start + before.size(), end - start - before.size());
}

std::string refused_by_loader(const std::string& words) {
  const bool lacks_library = words.find("cannot open shared object file") != std::string::npos;
  return fmt::format("the loader refuses it: {}{}", words,
                     lacks_library ? "; install that library, or name its directory in LD_LIBRARY_PATH" : "");
}

/// From here on the library stays until the process ends, whoever closes it.
void pin(const std::filesystem::path& file) {
  if (void* handle = dlopen(file.c_str(), RTLD_NOW | RTLD_NOLOAD | RTLD_NODELETE)) dlclose(handle);
}

}  // namespace

std::string why_not_usable(const ManifestHead& head) {
  const std::string refusal = why_head_not_usable(head);
  // The head has said that it is the start of a whole manifest of this layout.
  return refusal.empty() ? why_contents_not_usable(reinterpret_cast<const Manifest&>(head)) : refusal;
}

Library load_library(const std::filesystem::path& file) {
  Library result;
  result.refusal = why_not_loadable(file, kManifestSymbol, sizeof(ManifestHead));
  if (!result.refusal.empty()) return result;
  auto library = std::make_shared<boost::dll::shared_library>();
  try {
    library->load(file, boost::dll::load_mode::rtld_now | boost::dll::load_mode::rtld_local);
  } catch (const std::exception& failure) {
    result.refusal = refused_by_loader(loader_words(failure.what()));
    return result;
  }
  if (!library->has(kManifestSymbol)) {
    result.refusal = fmt::format("not a plugin of rhec: it exports no data symbol {}", kManifestSymbol);
    return result;
  }
  const auto& head = library->get<const ManifestHead>(kManifestSymbol);
  result.refusal = why_not_usable(head);
  if (!result.refusal.empty()) return result;
  pin(file);
  result.manifest = reinterpret_cast<const Manifest*>(&head);
  result.pinned = std::move(library);
  return result;
}

}  // namespace rhec
