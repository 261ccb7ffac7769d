// Manifests that are wrong in one field, chosen by a macro. None of its functions may be called.
#include <array>
#include <cstdlib>

#include "rhec/plugins/kit/fingerprint.hpp"
#include "rhec/plugins/kit/manifest.hpp"

namespace {

bool never_schema(std::vector<rhec::OptionRow>*, char*, std::size_t) noexcept { std::abort(); }
void* never_create(const rhec::Settings*, char*, std::size_t) noexcept { std::abort(); }
void never_destroy(void*) noexcept { std::abort(); }

#if defined(ENDLESS_TEXT)
constexpr auto endless = [] {
  std::array<char, 8000> text{};
  text.fill('x');
  return text;
}();
#endif

constexpr rhec::Manifest wrong() {
  rhec::Manifest manifest;
  manifest.kind = rhec::PluginKind::blocking;
  manifest.fingerprint = RHEC_BUILD_FINGERPRINT;
  manifest.name = "wrong";
  manifest.version = manifest.licence = manifest.source = "";
  manifest.backend = manifest.backend_version = manifest.capabilities = "";
  manifest.schema = never_schema;
  manifest.create = never_create;
  manifest.destroy = never_destroy;
#if defined(WRONG_MAGIC)
  manifest.head.magic = 42;
#elif defined(OLD_ABI)
  manifest.head.abi = 0;
#elif defined(NEW_ABI)
  manifest.head.abi = 99;
#elif defined(OTHER_REVISION)
  manifest.interface_revision = 77;
  manifest.fingerprint = nullptr;  // must not be read
#elif defined(OTHER_FINGERPRINT)
  manifest.fingerprint = "rhec 0.0.1, gcc 4, somewhere else";
#elif defined(UNKNOWN_KIND)
  manifest.kind = static_cast<rhec::PluginKind>(9);
#elif defined(NULL_TEXT)
  manifest.licence = nullptr;
#elif defined(NULL_FACTORY)
  manifest.create = nullptr;
#elif defined(ENDLESS_TEXT)
  manifest.licence = endless.data();
#elif defined(NO_TEXT)
  manifest.source = "\x1b[2J\x01";
#endif
  return manifest;
}

}  // namespace

extern "C" {
extern RHEC_EXPORT const rhec::Manifest rhec_plugin_manifest;
constinit const rhec::Manifest rhec_plugin_manifest = wrong();
}
