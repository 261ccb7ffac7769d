// A manifest of another time that ends after its head, or even before: what comes behind it may not be read.
#include "rhec/plugins/kit/manifest.hpp"

extern "C" {
#if defined(ENDS_AFTER_HEAD)
extern RHEC_EXPORT const rhec::ManifestHead rhec_plugin_manifest;
constinit const rhec::ManifestHead rhec_plugin_manifest{.size = sizeof(rhec::ManifestHead)};
#else
extern RHEC_EXPORT const int rhec_plugin_manifest;
const int rhec_plugin_manifest = 1;
#endif
}
