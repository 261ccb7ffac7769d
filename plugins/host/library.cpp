#define BOOST_DLL_USE_STD_FS
#include "library.hpp"

#include <dlfcn.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <boost/core/demangle.hpp>
#include <boost/dll/shared_library.hpp>
#include <cstring>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "elf_file.hpp"
#include "rhec/plugins/kit/fingerprint.hpp"

namespace rhec {
namespace {

static_assert(std::string_view(RHEC_VERSION_TEXT) == RHEC_PROJECT_VERSION,
              "fingerprint.hpp and CMakeLists.txt disagree");

constexpr const char* kRebuild = "build it again with the headers of rhec " RHEC_VERSION_TEXT;
constexpr const char* kUseMacro = "make its manifest by RHEC_PLUGIN";

Refusal why_head_not_usable(const ManifestHead& head) {
  if (head.magic != kManifestMagic) {
    return {fmt::format("its manifest does not start like one of rhec: it starts with {:016x}, expected {:016x}",
                        head.magic, kManifestMagic),
            kUseMacro};
  }
  if (head.abi != kManifestAbi) {
    return {fmt::format("its manifest has ABI {}, this rhec reads {}: the plugin is {} than rhec", head.abi,
                        kManifestAbi, head.abi < kManifestAbi ? "older" : "newer"),
            kRebuild};
  }
  if (head.size != sizeof(Manifest)) {
    return {fmt::format("its manifest has {} bytes, expected {}", head.size, sizeof(Manifest)), kRebuild};
  }
  return {};
}

/// The texts that a manifest may have, with their names.
std::array<std::pair<const char*, const char*>, 8> texts_of(const Manifest& manifest) {
  return {{{"fingerprint", manifest.fingerprint},
           {"name", manifest.name},
           {"version", manifest.version},
           {"licence", manifest.licence},
           {"source", manifest.source},
           {"backend", manifest.backend},
           {"backend_version", manifest.backend_version},
           {"capabilities", manifest.capabilities}}};
}

/// A text that does not end, or is none, is told before anything is made of it; null texts are told later.
Refusal why_texts_not_usable(const Manifest& manifest) {
  constexpr std::size_t most = 4000;
  for (const auto& [name, text] : texts_of(manifest)) {
    if (text == nullptr) continue;
    const std::size_t length = strnlen(text, most + 1);
    if (length > most) return {fmt::format("its manifest's {} does not end within {} bytes", name, most), kUseMacro};
    const bool printable = std::none_of(text, text + length, [](unsigned char c) { return c < 0x20 || c == 0x7f; });
    if (!printable) return {fmt::format("its manifest's {} has control characters: it is no text", name), kUseMacro};
  }
  return {};
}

/// Copies the manifest's contents into the record; missing texts stay empty.
void tell(const Manifest& manifest, PluginRecord& record) {
  const auto text = [](const char* given) { return std::string(given != nullptr ? given : ""); };
  record.kind = manifest.kind;
  record.name = text(manifest.name);
  record.version = text(manifest.version);
  record.licence = text(manifest.licence);
  record.source = text(manifest.source);
  record.backend = text(manifest.backend);
  record.backend_version = text(manifest.backend_version);
  record.capabilities = text(manifest.capabilities);
}

/// The parts of a build fingerprint.
std::vector<std::string_view> parts_of(std::string_view fingerprint) {
  constexpr std::string_view separator = ", ";
  std::vector<std::string_view> parts;
  while (true) {
    const std::size_t end = fingerprint.find(separator);
    parts.push_back(fingerprint.substr(0, end));
    if (end == std::string_view::npos) return parts;
    fingerprint.remove_prefix(end + separator.size());
  }
}

Refusal built_differently(const std::string& title, std::string_view theirs) {
  const std::vector<std::string_view> own = parts_of(RHEC_BUILD_FINGERPRINT), other = parts_of(theirs);
  const std::array<std::string, 5> remedies{
      kRebuild, "build it with the compiler of rhec",
      "build it with the C++ library of rhec, and the same _GLIBCXX_USE_CXX11_ABI and _GLIBCXX_DEBUG",
      "build it with the Eigen of rhec",
      "build the file with its manifest with the flags of rhec: -march, -mavx, EIGEN_DONT_ALIGN and "
      "EIGEN_MAX_[STATIC_]ALIGN_BYTES move Eigen's alignment"};
  if (own.size() != remedies.size() || own.size() != other.size()) {
    return {fmt::format("{} was built with '{}', rhec with '{}'", title, theirs, RHEC_BUILD_FINGERPRINT),
            "build both alike"};
  }
  Refusal refusal;
  for (std::size_t i = 0; i < own.size(); ++i) {
    if (own[i] == other[i]) continue;
    const bool is_first = refusal.empty();
    refusal.reason += fmt::format("{} with {}, rhec with {}", is_first ? title + " was built" : ";", other[i], own[i]);
    refusal.remedy += (is_first ? "" : "; ") + remedies[i];
  }
  return refusal;
}

Refusal why_contents_not_usable(const Manifest& manifest, const std::string& title) {
  if (manifest.interface_revision != kInterfaceRevision) {
    return {fmt::format("{} implements revision {} of the interfaces, this rhec has {}", title,
                        manifest.interface_revision, kInterfaceRevision),
            kRebuild};
  }
  if (manifest.fingerprint == nullptr) return {fmt::format("{} has no build fingerprint", title), kUseMacro};
  if (std::string_view(manifest.fingerprint) != RHEC_BUILD_FINGERPRINT) {
    return built_differently(title, manifest.fingerprint);
  }
  switch (manifest.kind) {
    case PluginKind::model:
    case PluginKind::blocking:
    case PluginKind::solver:
    case PluginKind::prior:
    case PluginKind::term:
      break;
    default:
      return {fmt::format("its kind {} is unknown to this rhec", static_cast<int>(manifest.kind)), kRebuild};
  }
  for (const auto& [name, text] : texts_of(manifest)) {
    if (text == nullptr) return {fmt::format("the manifest of {} has a null text", title), kUseMacro};
  }
  if (manifest.name[0] == '\0') return {"its manifest has no name", "give it one in RHEC_PLUGIN"};
  if (manifest.schema == nullptr || manifest.create == nullptr || manifest.destroy == nullptr) {
    return {fmt::format("the manifest of {} lacks a function (schema, create or destroy is null)", title), kUseMacro};
  }
  return {};
}

/// The loader's own message, without the wrapper's text around it.
std::string loader_words(const std::string& message) {
  const std::string before = "(dlerror system message: ";
  const std::size_t start = message.find(before);
  if (start == std::string::npos) return message;
  const std::size_t end = message.rfind(')');
  return message.substr(start + before.size(), end - start - before.size());
}

/// The undefined symbol in the loader's message, demangled; empty if there is none.
std::string missing_symbol(const std::string& words) {
  const std::string before = "undefined symbol: ";
  const std::size_t start = words.find(before);
  if (start == std::string::npos) return {};
  const std::string symbol = words.substr(start + before.size());
  return boost::core::demangle(symbol.substr(0, symbol.find(',')).c_str());
}

/// The usual cause of the loader's message, and its remedy.
Refusal refused_by_loader(const std::string& words) {
  const auto says = [&](std::string_view part) { return words.find(part) != std::string::npos; };
  if (says("cannot open shared object file")) {
    const std::string lacking = words.substr(0, words.find(':'));
    return {fmt::format("it needs the library {}, which the loader cannot open ({})", lacking, words),
            fmt::format("install the package that provides {}, or name its directory in LD_LIBRARY_PATH", lacking)};
  }
  if (const std::string symbol = missing_symbol(words); !symbol.empty()) {
    return {fmt::format("undefined symbol: no library that it is linked to defines {}", symbol),
            symbol.find("rhec::") == std::string::npos
                ? "link it to the library that does"
                : fmt::format("{}, and as this one was built: {}", kRebuild, RHEC_BUILD_FINGERPRINT)};
  }
  const std::string reason = fmt::format("the loader refuses it: {}", words);
  if (says("version `"))
    return {reason, "build it on this machine: it was linked to a newer library than the one here"};
  if (says("failed to map segment")) {
    return {reason, "put it on a file system that may hold programs (one that is not mounted noexec)"};
  }
  return {reason, kRebuild};
}

/// Keeps the library loaded until the process ends, whoever closes it.
void pin(const std::filesystem::path& file) {
  if (void* handle = dlopen(file.c_str(), RTLD_NOW | RTLD_NOLOAD | RTLD_NODELETE)) dlclose(handle);
}

}  // namespace

Refusal writable_by_all(const std::filesystem::path& file) {
  std::error_code problem;
  const std::filesystem::perms permissions = std::filesystem::status(file, problem).permissions();
  if (problem || !all_may_write(permissions)) return {};
  return {"every user may write to it, and so have their code run here",
          fmt::format("run 'chmod o-w {}', and build it again if you do not know who wrote it", file.string())};
}

Refusal why_not_to_load(const std::filesystem::path& file) {
  Refusal refusal = writable_by_all(file);
  return refusal.empty() ? why_not_loadable(file, kManifestSymbol, sizeof(ManifestHead)) : refusal;
}

Library load_library(const std::filesystem::path& file, const Stage& stage) {
  Library result;
  result.record.path = file;
  const auto refused = [&](const Refusal& refusal) {
    result.record.refusal = refusal.reason;
    result.record.remedy = refusal.remedy;
    return !refusal.empty();
  };
  if (refused(why_not_to_load(file))) return result;
  auto library = std::make_shared<boost::dll::shared_library>();
  try {
    stage("load");
    library->load(file, boost::dll::load_mode::rtld_now | boost::dll::load_mode::rtld_local);
  } catch (const std::exception& failure) {
    refused(refused_by_loader(loader_words(failure.what())));
    return result;
  }
  stage("manifest");
  if (!library->has(kManifestSymbol)) {
    refused(no_manifest(kManifestSymbol));
    return result;
  }
  const auto& head = library->get<const ManifestHead>(kManifestSymbol);
  if (refused(why_head_not_usable(head))) return result;
  // The head has been checked: it starts a complete manifest of this layout.
  const auto& manifest = reinterpret_cast<const Manifest&>(head);
  if (refused(why_texts_not_usable(manifest))) return result;
  tell(manifest, result.record);
  const std::string title = result.record.title();
  if (refused(why_contents_not_usable(manifest, title))) return result;
  pin(file);
  result.manifest = &manifest;
  result.pinned = std::move(library);
  return result;
}

}  // namespace rhec
