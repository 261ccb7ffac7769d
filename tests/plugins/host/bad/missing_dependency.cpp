// Needs a library that the loader will not find.
#include "rhec/plugins/kit/manifest.hpp"

extern "C" int rhec_test_gone();

extern "C" {
extern RHEC_EXPORT const rhec::Manifest rhec_plugin_manifest;
const rhec::Manifest rhec_plugin_manifest = {};
RHEC_EXPORT int needs_it() { return rhec_test_gone(); }
}
