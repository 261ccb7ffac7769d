// A library that is no plugin. It would tell of its loading by the environment: nothing of it may run.
#include <cstdlib>

namespace {
const int ran = setenv("RHEC_TEST_NO_MANIFEST_RAN", "1", 1);
}

extern "C" __attribute__((visibility("default"))) int some_function() { return ran; }
